//! What a trained network does with recorded interactions: on its own (5.3.1), and following them (5.3.3, 5.3.5, D.2).

use std::time::Instant;

use scrnn::analysis::cycle::CycleProfile;
use scrnn::analysis::excursions::{Levels, order};
use scrnn::analysis::reaction::{ReactionRule, arm_error};
use scrnn::dataset::Dataset;
use scrnn::error_regression::{ErrorRegression, ErrorRegressionOptions};
use scrnn::evaluation::mean_and_deviation;
use scrnn::generation::{Feedback, Generated, GenerationOptions, Start, generate};
use scrnn::initial_states::InitialStates;
use scrnn::network::Network;
use scrnn::scaling::Scaling;
use scrnn_sim::interact::{ARM, arm_postures, branchings, primitive_len};
use scrnn_tasks::interact::BRANCHES;
use serde::{Deserialize, Serialize};

use crate::framework::{Desk, Result, closed_loop};

/// The order whose state stands for one that does not correspond (5.3.3).
pub const OTHER: &str = "LLRRL";
/// Kinds of closed loops.
const OWN_STATES: u64 = 0;
const ONE_STATE: u64 = 1;
/// The loop that figures show,
pub const SHOWN_LOOP: u64 = 2;
/// and predictions that are fed back, whose noise is off.
const FED: u64 = 3;
/// A channel that tells the arm's side: the shoulder's roll.
const TELLTALE: usize = 5;
/// How much longer than the data a closed loop may take for its order.
const PATIENCE: f64 = 1.3;

/// A network with all that its trials need.
pub struct Subject<'a> {
    /// The network.
    pub network: &'a Network,
    /// Its initial states.
    pub states: &'a InitialStates,
    /// Between the sensors' units and the network's.
    pub scaling: &'a Scaling,
    /// The recordings, in the network's units.
    pub data: &'a Dataset,
    /// Seed of noise.
    pub seed: u64,
    /// Where to compute, and whether to go on.
    pub desk: &'a Desk<'a>,
}

/// The network on its own.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct ClosedLoop {
    /// How many orders come from their own initial state.
    pub regenerated: usize,
    /// The order that came from each sequence's initial state.
    pub orders: Vec<String>,
    /// Different orders from one initial state, in as many runs as there are sequences.
    pub distinct_from_one: usize,
    /// The orders that came from it.
    pub orders_from_one: Vec<String>,
    /// Mean predicted variance over the cycle while it is fed with recordings: steps after the branching, and the peak over
    /// the median.
    pub variance_open: Peak,
    /// The same on its own, cycles aligned by what it does.
    pub variance_closed: Peak,
}

/// Where a profile is largest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Peak {
    /// Steps after the branching.
    pub steps: usize,
    /// Over the median.
    pub over_median: f64,
}

/// Reaction times to all branchings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reactions {
    /// Over all branchings.
    pub mean: f64,
    /// The printed reading: steps to the first small error.
    pub literal: f64,
    /// Mean over branchings to the left, and to the right.
    pub by_side: [f64; 2],
    /// Each sequence's branchings, in order.
    pub times: Vec<usize>,
}

/// Error regression over all recordings.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Regressed {
    /// y_t as it stood one step before, after the regression on targets up to t - 1.
    pub reactions: Reactions,
    /// y_t as it stood when its input came, xi steps before: the stricter reading.
    pub causal: Reactions,
    /// Milliseconds of a control step: median, 99 %, longest.
    pub milliseconds: [f64; 3],
}

impl Subject<'_> {
    /// How far out the arm's telltale is, in the network's units.
    fn levels(&self) -> Levels {
        let joint = TELLTALE - ARM.start;
        let [centre, left, right] = arm_postures().map(|arm| self.scaling.to_scaled(TELLTALE, arm[joint]));
        Levels { centre, left, right }
    }

    /// The learned sequence whose state does not correspond.
    pub fn other(&self) -> usize {
        self.data.sequences().iter().position(|sequence| sequence.name == OTHER).unwrap_or(0)
    }

    /// Runs with the network's own noise (2.25b), a bit longer than the data.
    pub fn on_its_own(&self, state: impl Fn(usize) -> usize, kind: u64, contexts: bool) -> Result<Vec<Generated>> {
        let n = self.data.channels().len();
        let known = self.network.topology().delay() * n;
        let starts: Vec<Start<'_>> = (0..self.data.sequences().len())
            .map(|s| Start {
                initial_state: self.states.sequence(state(s)),
                sensed: &self.data.sequences()[s].values()[..known],
            })
            .collect();
        let longest = self.data.sequences().iter().map(|sequence| sequence.len()).max().unwrap_or(0);
        let steps = (PATIENCE * longest as f64) as usize;
        let options = GenerationOptions::new(steps, Feedback::closed(n, true))
            .seed(closed_loop(self.seed, kind))
            .contexts(contexts);
        Ok(generate(self.network, &starts, &options, self.desk.engine())?)
    }

    /// The first five sides that the arm goes to.
    pub fn order_of(&self, generated: &Generated) -> String {
        let n = self.data.channels().len();
        let mut excursions = self.levels().excursions(generated.sample.chunks_exact(n).map(|row| row[TELLTALE]));
        excursions.truncate(BRANCHES);
        order(&excursions)
    }

    /// 5.3.1.
    pub fn closed_loop(&self) -> Result<ClosedLoop> {
        let own = self.on_its_own(|s| s, OWN_STATES, false)?;
        self.desk.go_on()?;
        let other = self.other();
        let from_one = self.on_its_own(|_| other, ONE_STATE, false)?;
        let read = |list: &[Generated]| list.iter().map(|one| self.order_of(one)).collect::<Vec<_>>();
        let (orders, orders_from_one) = (read(&own), read(&from_one));
        let names = self.data.sequences().iter().map(|sequence| &sequence.name);
        let mut distinct = orders_from_one.clone();
        distinct.sort();
        distinct.dedup();
        Ok(ClosedLoop {
            regenerated: orders
                .iter()
                .zip(names)
                .filter(|(found, name)| found.len() == BRANCHES && name.starts_with(*found))
                .count(),
            distinct_from_one: distinct.len(),
            variance_open: self.variance_open()?,
            variance_closed: self.variance_closed(&own),
            orders,
            orders_from_one,
        })
    }

    /// Mean predicted variance of all channels for each sample; 0 for those before the first prediction.
    fn variances(&self, generated: &Generated) -> Vec<f64> {
        let n = self.data.channels().len();
        let mut means = vec![0.0; self.network.topology().delay()];
        means.extend(generated.variance.chunks_exact(n).map(|row| row.iter().sum::<f64>() / n as f64));
        means
    }

    fn variance_open(&self) -> Result<Peak> {
        let feedback = Feedback::open(self.data.channels().len());
        let generated = self.fed(|s| self.states.sequence(s), feedback)?;
        let variances: Vec<Vec<f64>> = generated.iter().map(|one| self.variances(one)).collect();
        let starts = branchings(BRANCHES);
        Ok(peak(CycleProfile::of(variances.iter().map(Vec::as_slice), &starts, primitive_len())))
    }

    fn variance_closed(&self, generated: &[Generated]) -> Peak {
        // The arm is 0.6 of its way out 17 steps after a branching.
        const BEGUN: usize = 17;
        let (n, delay) = (self.data.channels().len(), self.network.topology().delay());
        let levels = self.levels();
        let mut cycles = Vec::new();
        for one in generated {
            let variances = self.variances(one);
            for excursion in levels.excursions(one.sample.chunks_exact(n).map(|row| row[TELLTALE])) {
                let Some(start) = (excursion.begins + delay).checked_sub(BEGUN) else { continue };
                cycles.extend(variances.get(start..start + primitive_len()).map(<[f64]>::to_vec));
            }
        }
        peak(CycleProfile::of(cycles.iter().map(Vec::as_slice), &[0], primitive_len()))
    }

    /// Fed with recordings, from a state for each; predictions that are fed back have no noise.
    fn fed<'a>(&'a self, state: impl Fn(usize) -> &'a [f64], feedback: Feedback) -> Result<Vec<Generated>> {
        let starts: Vec<Start<'_>> = self
            .data
            .sequences()
            .iter()
            .enumerate()
            .map(|(s, sequence)| Start { initial_state: state(s), sensed: sequence.values() })
            .collect();
        let longest = self.data.sequences().iter().map(|sequence| sequence.len()).max().unwrap_or(0);
        let steps = longest - self.network.topology().delay();
        let options = GenerationOptions::new(steps, feedback).seed(closed_loop(self.seed, FED));
        Ok(generate(self.network, &starts, &options, self.desk.engine())?)
    }

    /// D.2 without error regression: object and head from the recording, the arm from the own prediction.
    pub fn reactions<'a>(&'a self, state: impl Fn(usize) -> &'a [f64]) -> Result<Reactions> {
        let mut feedback = Feedback::mixed(self.data.channels().len(), 1.0, false);
        feedback.0[ARM].iter_mut().for_each(|channel| channel.sensed = 0.0);
        let generated = self.fed(state, feedback)?;
        Ok(self.timed(&generated.into_iter().map(|one| one.mean).collect::<Vec<_>>(), 1))
    }

    /// Every `every`-th recording's reaction times, from the means predicted for its samples after the first xi.
    fn timed(&self, means: &[Vec<f64>], every: usize) -> Reactions {
        let (n, delay) = (self.data.channels().len(), self.network.topology().delay());
        let rule = ReactionRule::default();
        let (mut times, mut literal, mut sides) = (Vec::new(), 0.0, [Vec::new(), Vec::new()]);
        for (sequence, means) in self.data.sequences().iter().step_by(every).zip(means) {
            let mut errors = vec![0.0; delay];
            errors.extend(
                means
                    .chunks_exact(n)
                    .zip(sequence.values()[delay * n..].chunks_exact(n))
                    .map(|(predicted, recorded)| arm_error(&predicted[ARM], &recorded[ARM])),
            );
            for (branch, letter) in branchings(BRANCHES).into_iter().zip(sequence.name.chars()) {
                let time = rule.time(&errors, branch);
                sides[usize::from(letter == 'R')].push(time as f64);
                literal += rule.literal_time(&errors, branch) as f64;
                times.push(time);
            }
        }
        let mean = |list: &[f64]| mean_and_deviation(list).0;
        let all: Vec<f64> = times.iter().map(|&time| time as f64).collect();
        Reactions {
            mean: mean(&all),
            literal: literal / times.len() as f64,
            by_side: [mean(&sides[0]), mean(&sides[1])],
            times,
        }
    }

    /// The feedback of D.2 in error regression: the arm's input is the own prediction.
    pub fn regression(&self, mut options: ErrorRegressionOptions) -> ErrorRegressionOptions {
        options.sensed[ARM].fill(0.0);
        options.ahead = self.network.topology().delay() - 1;
        options
    }

    /// D.2 with error regression over every `every`-th recording, all from one state.
    pub fn regressed(
        &self,
        what: &str,
        state: &[f64],
        options: &ErrorRegressionOptions,
        every: usize,
    ) -> Result<Regressed> {
        let delay = self.network.topology().delay();
        let (mut means, mut early, mut taken) = (Vec::new(), Vec::new(), Vec::new());
        let sequences = self.data.sequences();
        for (at, sequence) in sequences.iter().enumerate().step_by(every) {
            self.desk.at(|| format!("{what}, recording {} of {}", at + 1, sequences.len()))?;
            let mut regression = ErrorRegression::new(self.network, state, options.clone(), self.desk.engine())?;
            let (mut next, mut ahead) = (Vec::new(), Vec::new());
            for k in 0..sequence.len() {
                self.desk.go_on()?;
                let begun = Instant::now();
                regression.observe(sequence.sample(k), &mut || true)?;
                taken.push(begun.elapsed());
                // The next sample is k + 1, the farthest of those whose input has come k + xi.
                if k + 1 >= delay && k + 1 < sequence.len() {
                    next.extend_from_slice(regression.mean());
                }
                if k + 1 == delay {
                    ahead.extend((0..delay - 1).filter_map(|steps| regression.forecast_mean(steps)).flatten());
                }
                if k + 1 >= delay && k + delay < sequence.len() {
                    ahead.extend(regression.forecast_mean(delay - 1).into_iter().flatten());
                }
            }
            means.push(next);
            early.push(ahead);
        }
        taken.sort();
        let at = |share: f64| 1e3 * taken[((taken.len() - 1) as f64 * share).round() as usize].as_secs_f64();
        Ok(Regressed {
            reactions: self.timed(&means, every),
            causal: self.timed(&early, every),
            milliseconds: [at(0.5), at(0.99), at(1.0)],
        })
    }
}

fn peak(profile: Option<CycleProfile>) -> Peak {
    profile.map_or(Peak { steps: 0, over_median: f64::NAN }, |profile| Peak {
        steps: profile.peak_at,
        over_median: profile.peak_over_median,
    })
}
