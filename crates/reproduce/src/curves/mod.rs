//! Curves with noise of constant variance, each its own: the twelve of 3.2, and the 144 patterns of 6.2.3.

mod findings;
mod goals;
mod page;
mod recognition;

use scrnn::analysis::clustering;
use scrnn::analysis::principal_components::PrincipalComponents;
use scrnn::dataset::Dataset;
use scrnn::evaluation::{half_mean_squared_error, mean_and_deviation, success_bound};
use scrnn::generation::{Feedback, Generated, GenerationOptions};
use scrnn::recognition::RecognitionOptions;
use scrnn_report::Section;
use scrnn_run::assessment::{self, Assessment, Predictions};
use scrnn_tasks::lissajous::PERIOD;
use scrnn_tasks::{TaskName, make};

use crate::framework::preset::asset;
use crate::framework::{
    Condition, Desk, Job, Kind, Learned, Measure, Result, Results, Study, Verdict, closed_loop, held_out,
};
use findings::{Ctrnn, Findings, Material, Pattern, Recognised};
use recognition::{STEPS, recognition};

/// Random orders of the labels that clustering is compared with.
const SHUFFLES: usize = 9999;

/// The S-CTRNN of the Lissajous curves.
const TWELVE: Kind =
    Kind { name: "S-CTRNN", suffix: "", presets: [asset!("lissajous.toml"), asset!("lissajous_fast.toml")] };
/// The CTRNN that it is compared with.
const TWELVE_CTRNN: Kind = Kind {
    name: "CTRNN",
    suffix: "-ctrnn",
    presets: [asset!("lissajous_ctrnn.toml"), asset!("lissajous_ctrnn_fast.toml")],
};
/// The S-CTRNN of 144 patterns; in the fast preset it has two time constants.
const MANY: Kind =
    Kind { name: "S-CTRNN", suffix: "", presets: [asset!("patterns.toml"), asset!("patterns_fast.toml")] };

/// A set of curves.
#[derive(Debug)]
pub struct Curves {
    title: &'static str,
    networks: &'static [Kind],
    task: TaskName,
    /// Whether the network is also asked to recognise them. With 144 patterns this would take longer than to learn them.
    recognition: bool,
}

/// The twelve Lissajous curves, which the thesis has S-CTRNN and CTRNN learn.
pub const LISSAJOUS: Curves = Curves {
    title: "Twelve fluctuating Lissajous curves",
    networks: &[TWELVE, TWELVE_CTRNN],
    task: TaskName::Lissajous,
    recognition: true,
};
/// The 144 patterns.
pub const PATTERNS: Curves =
    Curves { title: "144 fluctuating patterns", networks: &[MANY], task: TaskName::Patterns, recognition: false };

impl Study for Curves {
    type Findings = Findings;
    type Material = Material;

    fn title(&self) -> &'static str {
        self.title
    }

    fn edition(&self) -> u32 {
        2
    }

    fn conditions(&self, _beyond: bool) -> Vec<Condition> {
        vec![Condition::only(self.networks)]
    }

    fn evaluate(&self, job: &Job<'_>, desk: &Desk<'_>) -> Result<(Findings, Material)> {
        let &Job { networks, seed, .. } = job;
        let (learned, engine) = (&networks[0], desk.engine());
        let (network, data) = (&learned.network, &learned.source.data);
        let (n, delay, count) = (data.channels().len(), network.topology().delay(), data.sequences().len());
        let ideal = make(self.task, (count, STEPS + delay), seed, 1)?;
        let new = make(self.task, (count, STEPS), held_out(seed, 0), 1)?.data;
        let true_variances: Vec<f64> =
            ideal.variances.sequences().iter().map(|sequence| sequence.sample(0)[0]).collect();
        let bounds: Vec<f64> = true_variances.iter().map(|v| success_bound(v.sqrt())).collect();
        let target = |s: usize| &ideal.means.sequences()[s].values()[delay * n..];
        let error = |s: usize, generated: &Generated| half_mean_squared_error(target(s), &generated.mean);

        let run = |network: &Learned, noise: bool, contexts: bool| {
            let feedback = Feedback::closed(n, noise);
            let options = GenerationOptions::new(STEPS, feedback).seed(closed_loop(seed, 0)).contexts(contexts);
            assessment::run(&network.network, &network.states(), data, &options, engine)
        };
        let closed = run(learned, true, count <= 12)?;
        desk.at(|| "the CTRNN on its own".to_owned())?;
        let ctrnn = networks.get(1).map(|network| run(network, false, false)).transpose()?;
        let counts = match self.recognition {
            true => Some(desk.part("recognition", || recognition(learned, &new, (&target, &bounds), seed, desk))?),
            false => None,
        };
        let patterns: Vec<Pattern> = (0..count)
            .map(|s| {
                let channel = |i: usize| closed[s].variance.iter().skip(i).step_by(n).copied().collect::<Vec<f64>>();
                let (mean_variance, variance_deviation) = (0..n).map(|i| mean_and_deviation(&channel(i))).unzip();
                let found = error(s, &closed[s]);
                Pattern {
                    number: s + 1,
                    true_variance: true_variances[s],
                    mean_variance,
                    variance_deviation,
                    error: found,
                    bound: bounds[s],
                    regenerated: found <= bounds[s],
                    error_at_best_phase: at_best_phase(target(s), &closed[s].mean, n),
                    recognised: counts.as_ref().map(|counts| counts[s].0),
                    recognised_listening: counts.as_ref().map(|counts| counts[s].1),
                }
            })
            .collect();
        let off = |pattern: &Pattern| {
            let truth = pattern.true_variance;
            pattern.mean_variance.iter().map(|v| (v - truth).abs() / truth).collect::<Vec<_>>()
        };
        let variance_errors: Vec<f64> = patterns.iter().flat_map(off).collect();

        let mut levels: Vec<f64> = true_variances.clone();
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        let levels: Vec<usize> =
            true_variances.iter().map(|v| levels.iter().position(|level| level == v).unwrap_or(0)).collect();
        let states = learned.initial_states.values();
        let units = network.topology().context_units();
        let components = PrincipalComponents::of(states, units);
        let plane = components.as_ref().map(|components| components.first(2)).unwrap_or_default();
        let chance = |points: &[f64], width: usize| clustering::against_chance(points, width, &levels, SHUFFLES, seed);

        desk.at(|| "one step ahead".to_owned())?;
        let predicted = |data: &Dataset| -> Result<Predictions> {
            Ok(Predictions::of(&assessment::open_loop(network, &learned.states(), data, engine)?, data, delay))
        };
        let mut assessment = Assessment::new(data, &predicted(data)?, Some(&predicted(&new)?), delay);
        if let Some(truth) = &learned.source.truth {
            assessment = assessment.with_truth(&truth.variances, delay);
        }
        let findings = Findings {
            regenerated: patterns.iter().filter(|pattern| pattern.regenerated).count(),
            variance_error_mean: variance_errors.iter().sum::<f64>() / variance_errors.len() as f64,
            variance_error_max: variance_errors
                .iter()
                .copied()
                .fold(0.0, |most, e| if e > most || e.is_nan() { e } else { most }),
            ctrnn: ctrnn.as_ref().map(|generated| {
                let errors: Vec<f64> = generated.iter().enumerate().map(|(s, one)| error(s, one)).collect();
                let failed: Vec<usize> =
                    (0..count).filter(|&s| errors[s].is_nan() || errors[s] > bounds[s]).map(|s| s + 1).collect();
                Ctrnn { regenerated: count - failed.len(), failed, errors }
            }),
            recognition: counts.as_ref().map(|counts| Recognised {
                trials: count * RecognitionOptions::default().starts,
                succeeded: counts.iter().map(|(closed, _)| closed).sum(),
                succeeded_listening: counts.iter().map(|(_, open)| open).sum(),
            }),
            clustering_plane: chance(&plane, plane.len() / count),
            clustering_all: chance(states, units),
            plane_share: components.map_or(0.0, |components| components.share(2)),
            assessment,
            patterns,
        };
        Ok((findings, Material { data: data.clone(), closed, ctrnn, units, plane, levels }))
    }

    fn measures(&self) -> Vec<Measure<Findings>> {
        goals::measures(self.recognition)
    }

    fn verdicts(&self, results: &Results<Findings>) -> Vec<Verdict> {
        goals::verdicts(&results.jobs, self.recognition)
    }

    fn sections(&self, results: &Results<Findings>, materials: &[Material]) -> Vec<Section> {
        page::sections(&results.jobs, materials)
    }
}

/// (3.5) at the shift within a period that makes it least.
fn at_best_phase(target: &[f64], mean: &[f64], n: usize) -> f64 {
    let steps = target.len() / n;
    let shifted = |shift: usize| {
        let of = |k: usize| &target[(k + shift) % PERIOD * n..((k + shift) % PERIOD + 1) * n];
        let target: Vec<f64> = (0..steps).flat_map(of).copied().collect();
        half_mean_squared_error(&target, mean)
    };
    (0..PERIOD).map(shifted).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::framework::preset::Preset;

    #[test]
    fn a_curve_that_is_only_out_of_phase_has_no_error_at_its_best_phase() {
        let wave = |shift: usize| -> Vec<f64> {
            let angle = |k: usize| std::f64::consts::TAU * ((k + shift) % PERIOD) as f64 / PERIOD as f64;
            (0..100).flat_map(|k| [angle(k).sin(), angle(k).cos()]).collect()
        };
        assert!(half_mean_squared_error(&wave(0), &wave(7)) > 0.1);
        assert_eq!(at_best_phase(&wave(0), &wave(7), 2), 0.0);
    }

    #[test]
    fn the_presets_are_those_of_chapter_3_on_unscaled_data() {
        for (kind, epochs, rate) in [(TWELVE, 500_000, 1e-4), (TWELVE_CTRNN, 500_000, 1e-2), (MANY, 500_000, 1e-4)] {
            for preset in [Preset::Thesis, Preset::Fast] {
                let experiment = kind.experiment(preset, 3, Some(7), &[]).unwrap();
                assert_eq!((experiment.seed, experiment.data.seed, experiment.training.epochs), (3, Some(3), 7));
                assert!(experiment.data.task.is_some(), "{}", experiment.name);
                assert_eq!(serde_json::to_value(&experiment.data.scaling).unwrap(), "none", "{}", experiment.name);
                assert_eq!(experiment.network.variance, kind.name == "S-CTRNN");
            }
            let thesis = kind.experiment(Preset::Thesis, 1, None, &[]).unwrap();
            assert_eq!((thesis.network.groups[0].time_constant, thesis.training.epochs), (2.0, epochs));
            let momentum = thesis.training.momentum.unwrap();
            assert_eq!((momentum.rate, momentum.momentum), (rate, 0.9));
        }
        let twelve = TWELVE.experiment(Preset::Thesis, 1, None, &[]).unwrap().network;
        assert_eq!((twelve.groups[0].units, twelve.initial_state_variance), (60, 100.0));
    }

    #[test]
    fn a_network_of_several_time_constants_is_called_an_mtrnn() {
        let called = |kind: Kind, preset| kind.called(&kind.experiment(preset, 1, None, &[]).unwrap());
        assert_eq!(called(MANY, Preset::Thesis), "S-CTRNN");
        assert_eq!(called(MANY, Preset::Fast), "S-MTRNN");
        assert_eq!(called(TWELVE_CTRNN, Preset::Fast), "CTRNN");
    }
}
