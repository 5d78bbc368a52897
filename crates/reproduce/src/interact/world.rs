//! The network in the world (5.3.2, 5.3.4): random orders, success and failure at each branching, and the moments that
//! figures are drawn from.

use scrnn::error_regression::{ErrorRegression, ErrorRegressionOptions};
use scrnn_sim::follower::{Branch, Controller, Followed, Outcome, follow, with_own_arm};
use scrnn_sim::interaction::{Interaction, InteractionOptions, parse_order, random_order};
use scrnn_tasks::interact::BRANCHES;
use serde::Serialize;

use super::trials::Subject;
use crate::framework::Result;

/// The order of the figures (5.3.2).
pub const SHOWN: &str = "RLLLR";
/// Samples to look ahead in Fig. 5.10.
const AHEAD: usize = 40;

/// Branchings in the world.
#[derive(Debug, Clone, Serialize)]
pub struct InWorld {
    /// Share that succeeded.
    pub success: f64,
    /// How many were collisions, moves to the other side, and no moves.
    pub failures: [usize; 3],
    /// Mean reaction time, in samples.
    pub reaction_time: f64,
    /// All branchings.
    pub branches: Vec<Branch>,
}

impl InWorld {
    fn of(branches: Vec<Branch>) -> Self {
        let count = |outcome| branches.iter().filter(|branch| branch.outcome == outcome).count();
        let n = branches.len().max(1) as f64;
        Self {
            success: count(Outcome::Success) as f64 / n,
            failures: [count(Outcome::Collision), count(Outcome::Opposite), count(Outcome::Stayed)],
            reaction_time: branches.iter().map(|branch| branch.reaction_time as f64).sum::<f64>() / n,
            branches,
        }
    }
}

/// What error regression made of past and future at one sample, in the network's units.
#[derive(Debug, Clone)]
pub struct Snapshot {
    /// Steps in the window.
    pub window: usize,
    /// Means of the window's samples, then of those to come.
    pub means: Vec<Vec<f64>>,
    /// The contexts that go with them.
    pub contexts: Vec<Vec<f64>>,
    /// u at the window's tail.
    pub tail: Vec<f64>,
}

impl Subject<'_> {
    fn controller<'a>(&'a self, state: &'a [f64]) -> Controller<'a> {
        Controller { network: self.network, scaling: self.scaling, initial_state: state, engine: self.desk.engine() }
    }

    /// Follows an interaction to its end, unless somebody asks to stop.
    fn follow(
        &self,
        state: &[f64],
        options: &ErrorRegressionOptions,
        interaction: &mut Interaction,
        mut watch: impl FnMut(&ErrorRegression),
    ) -> Result<Followed> {
        let observe = |regression: &mut ErrorRegression, sample: &[f64]| regression.observe(sample, &mut || true);
        follow(&self.controller(state), options, interaction, observe, |_, _, regression| {
            watch(regression);
            self.desk.go_on()
        })
    }

    /// So many random orders from one state. Every network meets the same orders.
    pub fn in_world(
        &self,
        what: &str,
        state: &[f64],
        options: &ErrorRegressionOptions,
        trials: u64,
    ) -> Result<InWorld> {
        let options = with_own_arm(options.clone());
        let mut branches = Vec::new();
        for trial in 0..trials {
            branches.extend(self.desk.part(&format!("{what}, interaction {}", trial + 1), || {
                let order = random_order(BRANCHES, 0.5, trial);
                let mut interaction = Interaction::new(&order, &InteractionOptions::default(), trial)?;
                Ok(self.follow(state, &options, &mut interaction, |_| {})?.branches)
            })?);
        }
        Ok(InWorld::of(branches))
    }

    /// The order of the figures, with what each sample's regression made of the window.
    pub fn shown(&self, state: &[f64], options: &ErrorRegressionOptions) -> Result<(Followed, Vec<Snapshot>)> {
        let mut options = with_own_arm(options.clone());
        options.ahead = AHEAD;
        let mut interaction = Interaction::new(&parse_order(SHOWN)?, &InteractionOptions::default(), self.seed)?;
        let mut snapshots = Vec::new();
        let followed = self.follow(state, &options, &mut interaction, |regression| {
            let window = regression.window();
            let past = 0..window;
            let mut means: Vec<Vec<f64>> = past.clone().map(|k| regression.smoothed_mean(k).to_vec()).collect();
            let mut contexts: Vec<Vec<f64>> = past.map(|k| regression.context(k).to_vec()).collect();
            means.extend((0..=AHEAD).map(|k| regression.forecast_mean(k).to_vec()));
            contexts.extend((0..=AHEAD).map(|k| regression.forecast_context(k).to_vec()));
            snapshots.push(Snapshot { window, means, contexts, tail: regression.tail().to_vec() });
        })?;
        Ok((followed, snapshots))
    }
}
