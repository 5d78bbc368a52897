//! Means and spreads over seeds, tests between settings, and which setting is best for all seeds.

use scrnn::analysis::comparison::{TTest, holm};
use scrnn::evaluation::mean_and_deviation;
use serde::Serialize;

use super::collected::Collected;
use crate::measures::{Better, Measure};

/// So many settings are compared each with each; of more, the best with each of the others.
const EACH_WITH_EACH: usize = 7;

/// One measure over the seeds of one setting.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Summary {
    /// Networks.
    pub count: usize,
    /// Their mean.
    pub mean: f64,
    /// Their standard deviation; not a number for one alone.
    pub deviation: f64,
    /// The least.
    pub least: f64,
    /// The greatest.
    pub greatest: f64,
}

impl Summary {
    /// None without a value.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        if values.is_empty() {
            return None;
        }
        let (mean, deviation) = mean_and_deviation(values);
        let deviation = if values.len() > 1 { deviation } else { f64::NAN };
        let (least, greatest) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, greatest), &value| {
            (least.min(value), greatest.max(value))
        });
        Some(Self { count: values.len(), mean, deviation, least, greatest })
    }
}

/// The setting that is best over all its seeds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Best {
    /// By which measure.
    pub measure: &'static str,
    /// Its name.
    pub setting: String,
    /// Its place.
    #[serde(skip)]
    pub place: usize,
    /// Over its seeds.
    pub summary: Summary,
    /// The setting of the single best network, if that is another one: its name, the seed, and its value.
    pub luckiest: Option<(String, u64, f64)>,
    /// Settings that cannot be told from it at 5 %: their names.
    pub as_good: Vec<String>,
    /// Settings that are left out, since not all of their networks are finished.
    pub left_out: Vec<String>,
}

/// A test between two settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// The places of the settings.
    pub settings: (usize, usize),
    /// Welch's.
    pub test: TTest,
    /// Its p, corrected for all that are made of the measure.
    pub corrected: f64,
}

/// Which way is better, as a sign: less of `value * sign` is better.
pub fn sign(measure: &Measure) -> f64 {
    if measure.better == Better::Higher { -1.0 } else { 1.0 }
}

/// The places of settings that have values, the best mean first; where neither way is better, in their order.
#[must_use]
pub fn ranked(collected: &Collected, measure: &Measure) -> Vec<(usize, Summary)> {
    let of = |setting| Some((setting, Summary::of(&collected.values(setting, measure))?));
    let mut all: Vec<(usize, Summary)> = (0..collected.settings.len()).filter_map(of).collect();
    if measure.better != Better::Neither {
        all.sort_by(|a, b| (sign(measure) * a.1.mean).total_cmp(&(sign(measure) * b.1.mean)));
    }
    all
}

/// Welch's tests of one measure, corrected by Holm.
#[must_use]
pub fn tests(collected: &Collected, measure: &Measure) -> Vec<Pair> {
    let several: Vec<usize> =
        ranked(collected, measure).into_iter().filter(|(_, one)| one.count > 1).map(|(setting, _)| setting).collect();
    let pairs: Vec<(usize, usize)> = match several.as_slice() {
        [] => Vec::new(),
        few if few.len() <= EACH_WITH_EACH => (0..few.len())
            .flat_map(|a| (a + 1..few.len()).map(move |b| (a, b)))
            .map(|(a, b)| (few[a], few[b]))
            .collect(),
        [best, others @ ..] => others.iter().map(|&other| (*best, other)).collect(),
    };
    let values = |setting| collected.values(setting, measure);
    let tested: Vec<((usize, usize), TTest)> =
        pairs.into_iter().filter_map(|(a, b)| Some(((a, b), TTest::welch(&values(a), &values(b))?))).collect();
    let corrected = holm(&tested.iter().map(|(_, test)| test.p).collect::<Vec<_>>());
    tested.into_iter().zip(corrected).map(|((settings, test), corrected)| Pair { settings, test, corrected }).collect()
}

/// The setting with the best mean of the deciding measure, of those whose networks are all finished. None where no measure decides.
#[must_use]
pub fn best(collected: &Collected) -> Option<Best> {
    let measure = *collected.measures.first()?;
    if measure.better == Better::Neither {
        return None;
    }
    let is_complete =
        |setting: usize| collected.of(setting).all(|run| run.is_whole && run.measures.contains_key(measure.key));
    let all = ranked(collected, measure);
    let left_out = (0..collected.settings.len()).filter(|&setting| !is_complete(setting));
    let left_out: Vec<String> = left_out.map(|setting| collected.called(setting).to_owned()).collect();
    let &(place, summary) = all.iter().find(|(setting, _)| is_complete(*setting))?;
    let single = collected.runs.iter().filter(|run| run.is_whole);
    let single = single.filter_map(|run| Some((run, *run.measures.get(measure.key)?)));
    let single = single.min_by(|a, b| (sign(measure) * a.1).total_cmp(&(sign(measure) * b.1)));
    let luckiest = single.filter(|(run, _)| run.setting != place);
    let luckiest = luckiest.map(|(run, value)| (collected.called(run.setting).to_owned(), run.seed, value));
    let as_good = (tests(collected, measure).into_iter())
        .filter(|pair| (pair.settings.0 == place || pair.settings.1 == place) && pair.corrected >= 0.05)
        .map(|pair| if pair.settings.0 == place { pair.settings.1 } else { pair.settings.0 })
        .map(|setting| collected.called(setting).to_owned())
        .collect();
    let setting = collected.called(place).to_owned();
    Some(Best { measure: measure.key, setting, place, summary, luckiest, as_good, left_out })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::PathBuf;

    use super::super::collected::Row;
    use super::*;
    use crate::measures;

    fn collected(key: &str, settings: &[(&str, &[Option<f64>])]) -> Collected {
        let mut runs = Vec::new();
        for (setting, (name, values)) in settings.iter().enumerate() {
            for (seed, value) in (1..).zip(*values) {
                runs.push(Row {
                    name: format!("{name}/seed-{seed}"),
                    path: PathBuf::new(),
                    link: None,
                    setting,
                    seed,
                    state: if value.is_some() { "finished" } else { "diverged" },
                    message: None,
                    is_whole: value.is_some(),
                    measures: value.iter().map(|value| (key.to_owned(), *value)).collect::<BTreeMap<_, _>>(),
                });
            }
        }
        Collected {
            name: "s".into(),
            knobs: Vec::new(),
            settings: settings.iter().map(|(name, _)| ((*name).to_owned(), Vec::new())).collect(),
            has_conditions: true,
            runs,
            measures: vec![measures::of(key).unwrap()],
        }
    }

    #[test]
    fn the_best_setting_is_the_best_over_all_seeds_not_for_one() {
        let lucky = [Some(-9.0), Some(2.0), Some(3.0)];
        let steady = [Some(-2.0), Some(-2.1), Some(-1.9)];
        let lost = [Some(-8.0), Some(-8.0), None];
        let found = best(&collected("nll", &[("lucky", &lucky), ("steady", &steady), ("lost", &lost)])).unwrap();
        assert_eq!((found.setting.as_str(), found.summary.count), ("steady", 3));
        assert_eq!(found.luckiest, Some(("lucky".into(), 1, -9.0)));
        assert_eq!((found.left_out, found.as_good), (vec!["lost".to_owned()], vec!["lucky".to_owned()]));
        // Where more is better.
        let found = best(&collected("recognise.correct", &[("a", &[Some(0.5)]), ("b", &[Some(0.9)])])).unwrap();
        assert_eq!((found.setting.as_str(), found.luckiest), ("b", None));
        assert!(best(&collected("epoch", &[("a", &[Some(0.5)])])).is_none());
    }

    #[test]
    fn tests_are_made_of_all_pairs_or_of_the_best_with_each() {
        let values: Vec<Vec<Option<f64>>> = (0..9)
            .map(|k| (0..4).map(|seed| Some(f64::from(k) + 0.01 * f64::from(seed * seed % 3))).collect())
            .collect();
        let names: Vec<String> = (0..9).map(|k| format!("s{k}")).collect();
        let of = |count: usize| {
            let settings: Vec<(&str, &[Option<f64>])> =
                (0..count).map(|k| (names[k].as_str(), values[k].as_slice())).collect();
            let collected = collected("nll", &settings);
            super::tests(&collected, collected.measures[0])
        };
        assert_eq!((of(7).len(), of(9).len()), (21, 8));
        assert!(
            of(9).iter().all(|pair| pair.settings.0 == 0 && pair.corrected < 0.05 && pair.corrected >= pair.test.p)
        );
        assert!(of(1).is_empty());
    }
}
