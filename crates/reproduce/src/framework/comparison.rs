//! Measures of conditions compared with each other by t-tests.

use scrnn::analysis::comparison::TTest;
use serde::Serialize;

use super::measure::Summary;
use super::verdict::Verdict;

/// Below this a difference of means is significant.
const LEVEL: f64 = 0.001;
/// Below this a difference as large as the margin is ruled out.
const LEVEL_OF_EQUALITY: f64 = 0.05;

/// How two lists belong together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Test {
    /// Value by value: both are of the same networks.
    #[serde(rename = "paired")]
    Paired,
    /// Not at all, and their variances may differ.
    Welch,
}

impl Test {
    /// As it is written.
    pub fn word(self) -> &'static str {
        match self {
            Self::Paired => "paired",
            Self::Welch => "Welch",
        }
    }
}

/// Two measures to compare.
#[derive(Debug, Clone, Copy)]
pub struct Comparison {
    /// What is compared.
    pub what: &'static str,
    /// What the thesis found.
    pub thesis: &'static str,
    /// Keys of the two measures: the first one should be larger, unless they should be equal.
    pub measures: [&'static str; 2],
    /// How they belong together.
    pub test: Test,
    /// The two should be less than this apart.
    pub within: Option<f64>,
}

/// What a comparison found.
#[derive(Debug, Clone, Serialize)]
pub struct Compared {
    /// What is compared.
    pub what: &'static str,
    /// What the thesis found.
    pub thesis: &'static str,
    /// paired, or Welch.
    pub test: Test,
    /// What was found.
    #[serde(flatten)]
    pub found: TTest,
    /// Of what should be equal: the p-value of a difference of the margin or more.
    pub p_of_equivalence: Option<f64>,
    #[serde(skip)]
    within: Option<f64>,
}

impl Comparison {
    /// None where there are not enough values.
    pub fn made(&self, summary: &[Summary]) -> Option<Compared> {
        let &Self { what, thesis, measures, test, within } = self;
        let values = |key: &str| summary.iter().find(|one| one.key == key).map(Summary::known);
        let (a, b) = (values(measures[0])?, values(measures[1])?);
        let found = match test {
            Test::Paired => TTest::paired(&a, &b),
            Test::Welch => TTest::welch(&a, &b),
        }?;
        let p_of_equivalence = within.map(|margin| found.p_of_equivalence(margin));
        Some(Compared { what, thesis, test, found, p_of_equivalence, within })
    }
}

impl Compared {
    /// As a goal: equal, or significantly more.
    pub fn verdict(&self) -> Verdict {
        let TTest { difference, t, degrees, p, .. } = self.found;
        let found = format!("{difference:.2}, t({degrees:.1}) = {t:.2}, p = {p:.1e}");
        match self.within.zip(self.p_of_equivalence) {
            Some((margin, p)) => Verdict::overall(
                self.what,
                &format!("less than {margin} apart, p < {LEVEL_OF_EQUALITY}"),
                format!("{found}; of {margin} or more p = {p:.1e}"),
                p < LEVEL_OF_EQUALITY,
            ),
            None => {
                let met = difference > 0.0 && p < LEVEL;
                Verdict::overall(self.what, &format!("more, p < {LEVEL}"), found, met)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::measure::Measure;
    use super::*;

    fn summary(key: &'static str, values: &[f64]) -> Summary {
        let measure = Measure::<()>::new(key, "", "", "", 1, |()| None);
        Summary::over(&measure, values.iter().copied().map(Some).collect())
    }

    #[test]
    fn what_is_more_by_no_accident_and_what_is_equal_meets_its_goal() {
        let lists = [summary("a", &[30.0, 31.0, 32.0, 30.5]), summary("b", &[1.0, 1.2, 0.9, 1.1])];
        let judge = |a, b, test, within| {
            let comparison = Comparison { what: "w", thesis: "", measures: [a, b], test, within };
            comparison.made(&lists).map(|one| one.verdict().met)
        };
        assert_eq!(judge("a", "b", Test::Welch, None), Some(true));
        assert_eq!(judge("b", "a", Test::Paired, None), Some(false));
        assert_eq!(judge("a", "b", Test::Paired, Some(0.5)), Some(false));
        assert_eq!(judge("b", "b", Test::Welch, Some(0.5)), Some(true));
        assert_eq!(judge("a", "none", Test::Welch, None), None);
    }
}
