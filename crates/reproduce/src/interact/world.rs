//! The network in the world (5.3.2, 5.3.4): random orders, success and failure at each branching, and the moments that
//! figures are drawn from.

use scrnn::error_regression::{ErrorRegression, ErrorRegressionOptions};
use scrnn::streams::Purpose;
use scrnn_sim::interact::Film as Recording;
use scrnn_sim::interact::{Branch, Controller, Followed, Outcome, follow, with_own_arm};
use scrnn_sim::interact::{Interaction, InteractionOptions, parse_order, random_order};
use scrnn_tasks::interact::BRANCHES;
use serde::Serialize;

use super::trials::{OTHER, Subject};
use crate::framework::{Film, Result};

/// The order of the figures (5.3.2).
pub const SHOWN: &str = "RLLLR";
/// The seed of the interactions that all networks meet: the same orders, with the same noise of the sensors.
const SAME: u64 = 0;
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

    /// The order of the figures with error regression from a state that does not correspond, as a recording.
    pub fn film(&self, key: &str, label: &str) -> Result<Film> {
        let options = with_own_arm(ErrorRegressionOptions::adam(self.data.channels().len()));
        let state = self.states.sequence(self.other());
        let mut interaction = Interaction::new(&parse_order(SHOWN)?, &InteractionOptions::default(), self.seed, 0)?;
        let mut film = Recording::new(&[("task", "interact")])?;
        film.begin(SHOWN)?;
        let observe = |regression: &mut ErrorRegression, sample: &[f64]| regression.observe(sample, &mut || true);
        let raw = |y: [f64; 8]| (0..8).map(|i| self.scaling.to_raw(i, y[i])).collect::<Vec<_>>();
        follow(&self.controller(state), &options, &mut interaction, observe, |interaction, step, _| {
            let mean = step.predicted.map(raw);
            let variance = step.variance.iter().enumerate().map(|(i, &v)| self.scaling.variance_to_raw(i, v));
            let variance: Vec<f64> = variance.collect();
            let variance = Some(variance.as_slice()).filter(|variance| !variance.is_empty());
            film.frame(interaction, &step.sensed, mean.as_deref().map(|mean| (mean, variance)))?;
            self.desk.go_on()
        })?;
        let about = format!("{label}: order {SHOWN} from the state of {OTHER}, with error regression");
        Ok(Film { name: format!("interact-{key}"), about, bytes: film.finish()? })
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
                let order = random_order(BRANCHES, 0.5, SAME, Purpose::TrialOrders, trial);
                let mut interaction = Interaction::new(&order, &InteractionOptions::default(), SAME, trial)?;
                Ok(self.follow(state, &options, &mut interaction, |_| {})?.branches)
            })?);
        }
        Ok(InWorld::of(branches))
    }

    /// The order of the figures, with what each sample's regression made of the window.
    pub fn shown(&self, state: &[f64], options: &ErrorRegressionOptions) -> Result<(Followed, Vec<Snapshot>)> {
        let mut options = with_own_arm(options.clone());
        options.ahead = AHEAD;
        let mut interaction = Interaction::new(&parse_order(SHOWN)?, &InteractionOptions::default(), self.seed, 0)?;
        let mut snapshots = Vec::new();
        let followed = self.follow(state, &options, &mut interaction, |regression| {
            let window = regression.window();
            let past = 0..window;
            let rows = |k: usize| Some((regression.smoothed_mean(k)?.to_vec(), regression.context(k)?.to_vec()));
            let to_come =
                |k: usize| Some((regression.forecast_mean(k)?.to_vec(), regression.forecast_context(k)?.to_vec()));
            let (means, contexts) = past.filter_map(rows).chain((0..=AHEAD).filter_map(to_come)).unzip();
            snapshots.push(Snapshot { window, means, contexts, tail: regression.tail().to_vec() });
        })?;
        Ok((followed, snapshots))
    }
}
