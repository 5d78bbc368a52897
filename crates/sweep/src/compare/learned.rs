//! The sequences that networks learned, each list of them made or read once.

use std::collections::HashMap;

use scrnn::dataset::Dataset;
use scrnn_run::trained::Trained;

/// What was made or read so far, by the fingerprint of its data.
#[derive(Debug, Default)]
pub struct LearnedData {
    found: HashMap<String, Option<Dataset>>,
}

impl LearnedData {
    /// What a network learned; none where that cannot be made or read again.
    pub fn of(&mut self, trained: &Trained) -> Option<&Dataset> {
        let digest = Self::digest(trained);
        self.found.entry(digest).or_insert_with(|| trained.learned_data(0).ok()).as_ref()
    }

    /// Whether [`LearnedData::of`] takes no time, or little: only simulated robots take long.
    pub fn is_near(&self, trained: &Trained) -> bool {
        let experiment = trained.notes.as_ref().and_then(|notes| notes.experiment().ok());
        let has_robot = experiment.and_then(|experiment| experiment.data.task).is_some_and(|task| task.has_robot());
        !has_robot || self.found.contains_key(&Self::digest(trained))
    }

    fn digest(trained: &Trained) -> String {
        trained.notes.as_ref().map(|notes| notes.data.digest.clone()).unwrap_or_default()
    }
}
