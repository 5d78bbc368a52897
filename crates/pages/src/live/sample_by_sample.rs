//! A network beside a stream: the window, the forecast and the error.

use scrnn::error_regression::Regression;
use scrnn_run::following::{Following, View};

use super::motion::{Frame, Look, Sample};
use super::paced::Paced;

/// A page about a stream, if somebody wants one.
#[derive(Debug, Default)]
pub struct SampleBySample {
    watching: Option<Paced>,
    /// What the next sample was predicted as.
    mean: Vec<f64>,
    variance: Vec<f64>,
    /// Samples of the sequences before this one.
    before: usize,
    taken: usize,
    /// Said with the next sample.
    event: Option<String>,
}

impl SampleBySample {
    /// On this page, or nowhere.
    #[must_use]
    pub fn on(watching: Option<Paced>) -> Self {
        Self { watching, ..Self::default() }
    }

    /// A sequence begins.
    pub fn begin(&mut self, name: &str) {
        self.before += std::mem::take(&mut self.taken);
        self.mean.clear();
        self.variance.clear();
        self.event = Some(format!("{name} begins"));
    }

    /// A sample came, and this became of it.
    pub fn sample(&mut self, session: &Following, sample: &[f64], done: &Regression) {
        let Some(watching) = &mut self.watching else { return };
        self.taken = session.taken();
        let time = (self.before + self.taken) as f64;
        if watching.wants_look() {
            let View { from, smoothed, predicted, variance, .. } = session.view();
            let told = session.told(done, false);
            let found = match told.locked {
                Some(true) => "Found among what was learned. ",
                Some(false) => "Not found among what was learned: the forecast is not to be relied on. ",
                None => "",
            };
            let note = format!("{found}{:.3} ms for a sample.", told.milliseconds);
            watching.look(Look { from: (self.before + from) as f64, smoothed, forecast: predicted, variance }, note);
        }
        let event = self.event.take();
        let sample = Sample { sensed: sample, mean: &self.mean, variance: &self.variance };
        watching.frame(&Frame { time, scene: None, sample: Some(sample), event: event.as_deref() });
        self.mean = session.next_mean().unwrap_or_default();
        self.variance = session.next_variance().unwrap_or_default();
    }

    /// Nothing more will come.
    pub fn finish(self) {
        if let Some(watching) = self.watching {
            watching.finish();
        }
    }
}
