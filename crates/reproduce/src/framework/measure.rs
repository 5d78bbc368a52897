//! Numbers of jobs, and over them.

use scrnn::evaluation::mean_and_deviation;
use serde::Serialize;

use super::job_result::JobResult;

/// A number that is compared.
pub struct Measure<F> {
    /// Its name in metrics.json.
    pub key: &'static str,
    /// Its name on the page.
    pub label: &'static str,
    /// What it means, in one line; may be empty.
    pub explanation: &'static str,
    /// What the thesis has; may be empty.
    pub thesis: &'static str,
    /// Digits behind the point.
    pub digits: usize,
    /// The condition that it is of; none for all.
    pub condition: Option<&'static str>,
    /// Where it stands; none where it does not exist.
    pub of: fn(&F) -> Option<f64>,
}

impl<F> Measure<F> {
    /// Of all conditions.
    pub fn new(
        key: &'static str,
        label: &'static str,
        explanation: &'static str,
        thesis: &'static str,
        digits: usize,
        of: fn(&F) -> Option<f64>,
    ) -> Self {
        Self { key, label, explanation, thesis, digits, condition: None, of }
    }
}

/// A measure over seeds.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// Its name.
    pub key: &'static str,
    /// Its name on the page.
    pub label: &'static str,
    /// What it means.
    pub explanation: &'static str,
    /// What the thesis has.
    pub thesis: &'static str,
    /// The condition that it is of; none for all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub condition: Option<&'static str>,
    /// Over the seeds that have it.
    pub mean: Option<f64>,
    /// Standard deviation over seeds; none for a single one.
    pub deviation: Option<f64>,
    /// Each seed's.
    pub values: Vec<Option<f64>>,
    #[serde(skip)]
    digits: usize,
}

impl Summary {
    /// Of a measure.
    pub fn of<F>(measure: &Measure<F>, jobs: &[JobResult<F>]) -> Self {
        let own = jobs.iter().filter(|job| measure.condition.is_none() || measure.condition == job.condition);
        Self::over(measure, own.map(|job| (measure.of)(&job.findings)).collect())
    }

    /// Of a measure's values.
    pub fn over<F>(measure: &Measure<F>, values: Vec<Option<f64>>) -> Self {
        let known: Vec<f64> = values.iter().flatten().copied().collect();
        let (mean, deviation) = mean_and_deviation(&known);
        let &Measure { key, label, explanation, thesis, digits, condition, .. } = measure;
        let (mean, deviation) = (Some(mean).filter(|x| x.is_finite()), Some(deviation).filter(|_| known.len() > 1));
        Self { key, label, explanation, thesis, condition, mean, deviation, values, digits }
    }

    /// The values of the seeds that have it.
    pub fn known(&self) -> Vec<f64> {
        self.values.iter().flatten().copied().collect()
    }

    /// The smallest value, and the largest.
    pub fn extent(&self) -> (f64, f64) {
        let values = || self.values.iter().flatten().copied();
        (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max))
    }

    /// What it is, with its meaning.
    pub fn explained(&self) -> String {
        match self.explanation {
            "" => self.label.to_owned(),
            explanation => format!("{}: {explanation}", self.label),
        }
    }

    /// A value as it is shown.
    pub fn shown(&self, value: Option<f64>) -> String {
        value.map_or("\u{2013}".to_owned(), |value| format!("{value:.*}", self.digits))
    }

    /// Mean and spread as they are shown.
    pub fn shown_mean(&self) -> String {
        match self.deviation {
            Some(deviation) => {
                format!("{} \u{b1} {deviation:.*}", self.shown(self.mean), self.digits.max(1))
            }
            None => self.shown(self.mean),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn summary(values: &[Option<f64>]) -> Summary {
        Summary::over(&Measure::<()>::new("k", "l", "", "", 2, |()| None), values.to_vec())
    }

    #[test]
    fn a_summary_shows_mean_and_spread_of_the_seeds_that_have_it() {
        let three = summary(&[Some(1.0), None, Some(3.0)]);
        assert_eq!((three.shown_mean().as_str(), three.shown(None).as_str()), ("2.00 \u{b1} 1.41", "\u{2013}"));
        assert_eq!((three.known(), three.extent()), (vec![1.0, 3.0], (1.0, 3.0)));
        assert_eq!(summary(&[Some(1.0)]).shown_mean(), "1.00");
        assert_eq!(summary(&[None]).shown_mean(), "\u{2013}");
    }
}
