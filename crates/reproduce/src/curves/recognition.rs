//! Recognition of new sequences of the learned patterns: which states are found, and what comes of them (3.2.5).

use scrnn::dataset::Dataset;
use scrnn::evaluation::half_mean_squared_error;
use scrnn::generation::{Feedback, GenerationOptions, Start, generate};
use scrnn::recognition::{RecognitionOptions, WarmStart, recognize};
use scrnn_tasks::lissajous::PERIOD;

use crate::framework::{Desk, Learned, Result, closed_loop};

/// Steps of each closed loop (3.2.3).
pub const STEPS: usize = 1000;
/// Samples of a pattern that recognition looks at: five periods. In the open loop u_0 is forgotten after some tens of
/// steps, so that later samples say nothing about it, and only make the ascent slower.
const OBSERVED: usize = 5 * PERIOD;
/// The largest rate of recognition. A step leads into another curve's attractor where it is long: with ten periods, 147 and 174
/// trials of 240 succeeded at 0.1 on two networks, 159 and 187 at 0.05, 202 and 194 at this, and with five periods 200 and 205
/// (docs/decisions.md has the table).
const RATE: f64 = 0.0125;
/// Spread of the random starts, as a share of that of the learned states. The thesis does not say how its random values
/// were drawn; those of 2.7 lie close to a neutral state, as these do. Far away the network begins in a wrong attractor.
const SPREAD: f64 = 0.2;
/// Decay of the second moment in recognition: with ten periods, 202 and 194 trials succeeded on these networks, 147 and 178 with
/// 0.99.
const BETA_2: f64 = 0.9;
/// For each pattern, the trials from whose state the closed loop regenerates it, and those that are as near while the
/// network listens.
pub fn recognition<'a>(
    learned: &Learned,
    new: &Dataset,
    (target, bounds): (&impl Fn(usize) -> &'a [f64], &[f64]),
    seed: u64,
    desk: &Desk<'_>,
) -> Result<Vec<(usize, usize)>> {
    desk.say("recognition, which takes a while");
    let engine = desk.engine();
    let options = RecognitionOptions::with(|it| {
        it.seed = seed;
        it.initial_state_variance = learned.experiment.network.initial_state_variance;
        it.warm_starts = vec![WarmStart::Random];
        it.random_spread = SPREAD;
        it.rate = RATE;
        it.beta2 = BETA_2;
        it.observed = Some(OBSERVED);
        // A training that was cut short for a trial does not deserve more.
        it.epochs = RecognitionOptions::default().epochs.min(learned.experiment.training.epochs);
    });
    let (n, delay) = (new.channels().len(), learned.network.topology().delay());
    let found = recognize(&learned.network, &learned.initial_states, new, &options, engine)?;
    desk.at(|| "recognition: running from what was found".to_owned())?;
    let starts: Vec<Start<'_>> = found
        .iter()
        .zip(new.sequences())
        .flat_map(|(found, sequence)| {
            found.trials.iter().map(|trial| Start { initial_state: &trial.initial_state, sensed: sequence.values() })
        })
        .collect();
    let (steps, per) = (STEPS - delay, options.starts);
    let within = |feedback| -> Result<Vec<bool>> {
        let options = GenerationOptions::new(steps, feedback).seed(closed_loop(seed, 1));
        let generated = generate(&learned.network, &starts, &options, engine)?;
        let judged = generated.iter().enumerate().map(|(k, one)| {
            let s = k / per;
            half_mean_squared_error(&target(s)[..steps * n], &one.mean) <= bounds[s]
        });
        Ok(judged.collect())
    };
    let (open, closed) = (within(Feedback::open(n))?, within(Feedback::closed(n, true))?);
    Ok((0..found.len())
        .map(|s| {
            let own = s * per..(s + 1) * per;
            let count = |within: &[bool]| within[own.clone()].iter().filter(|&&within| within).count();
            (count(&closed), count(&open))
        })
        .collect())
}
