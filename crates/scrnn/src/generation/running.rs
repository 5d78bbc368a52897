//! One network beside a world that moves on: it takes in a sample and predicts, step by step.

use pulp::{Simd, WithSimd};
use rand::rngs::ChaCha8Rng;

use super::{Feedback, check, draw, input};
use crate::engine::{Engine, InstructionSet, Run};
use crate::error::{Error, Result};
use crate::features::{Features, Past};
use crate::network::Network;
use crate::packed::Packed;
use crate::stepper::Stepper;
use crate::streams::{Purpose, stream};

/// A network that generates while its samples are still to come. Stepped through recorded samples it gives the bits of
/// [`generate`](super::generate) with one start.
#[derive(Debug)]
pub struct Running {
    packed: Packed,
    stepper: Stepper,
    set: InstructionSet,
    feedback: Feedback,
    random: ChaCha8Rng,
    delay: usize,
    features: Features,
    has_variance: bool,
    steps: usize,
    /// The inputs so far, as far back as the features need them.
    past: Past,
    x: Vec<f64>,
    guess: Vec<f64>,
    /// v of the last step, with the floor.
    variance: Vec<f64>,
    /// The samples of the last xi steps, and their means; that of step k is at k modulo xi.
    fed_back: Vec<f64>,
    means: Vec<f64>,
}

impl Running {
    /// A network at its initial state, before the first sample.
    ///
    /// # Errors
    /// [`Error::Length`] for an initial state or a feedback of another size than the network's, and [`Error::Setting`] for
    /// a share outside of [0, 1].
    pub fn new(
        network: &Network,
        initial_state: &[f64],
        feedback: Feedback,
        seed: u64,
        engine: &Engine,
    ) -> Result<Self> {
        let topology = &network.topology;
        let (n_y, n_c, delay) = (topology.channels(), topology.context_units(), topology.delay());
        check(&feedback, n_y)?;
        if initial_state.len() != n_c {
            let what = "the initial state".to_owned();
            return Err(Error::Length { what, found: initial_state.len(), needed: n_c });
        }
        let set = engine.instruction_set();
        let mut packed = Packed::new(topology, set);
        packed.fill(&network.parameters);
        let mut stepper = Stepper::new(&packed, 1);
        stepper.start(&packed, 0, initial_state);
        set.run(Enter { stepper: &mut stepper, packed: &packed });
        let has_variance = topology.has_variance();
        let features = Features::new(topology);
        Ok(Self {
            packed,
            stepper,
            set,
            feedback,
            random: stream(seed, Purpose::Generation, 0),
            delay,
            past: Past::new(&features),
            features,
            has_variance,
            steps: 0,
            x: vec![0.0; n_y],
            guess: vec![0.0; n_y],
            variance: vec![0.0; if has_variance { n_y } else { 0 }],
            fed_back: vec![0.0; delay * n_y],
            means: vec![0.0; delay * n_y],
        })
    }

    /// Takes in the sample of this step, as far as the feedback senses it, and predicts the sample xi steps ahead. The
    /// first xi steps take it in whole, since nothing was predicted for them. A value that is missing (NaN) is stood in for by the mean
    /// that was predicted for it, before that by the channel's last input, or 0.
    ///
    /// # Errors
    /// [`Error::Length`] for a sample of another size; it is not taken in.
    pub fn step(&mut self, sensed: &[f64]) -> Result<()> {
        let n_y = self.packed.n_y;
        if sensed.len() != n_y {
            return Err(Error::Length { what: "the sample".to_owned(), found: sensed.len(), needed: n_y });
        }
        let slot = (self.steps % self.delay) * n_y;
        let slot = slot..slot + n_y;
        let predicted = (&self.fed_back[slot.clone()], &self.means[slot.clone()]);
        self.x.copy_from_slice(self.past.at(0));
        input(&mut self.x, &self.feedback, Some(sensed), (self.steps >= self.delay).then_some(predicted));
        self.past.push(&self.x);
        self.features.inputs(|back| self.past.at(back), self.stepper.input(&self.packed, 0));
        self.set.run(Step { stepper: &mut self.stepper, packed: &self.packed });

        let (rho, exp_u) = (self.stepper.mean(&self.packed, 0), self.stepper.variance(&self.packed, 0));
        self.features.guess(|back| self.past.at(back), &mut self.guess);
        let (fed_back, means) = (&mut self.fed_back[slot.clone()], &mut self.means[slot]);
        for (i, (&rho, rule)) in rho.iter().zip(&self.feedback.0).enumerate() {
            let y = self.features.mean(i, self.guess[i], rho);
            means[i] = y;
            fed_back[i] = match self.has_variance {
                false => y,
                true => {
                    self.variance[i] = self.features.variance(i, exp_u[i]);
                    draw(&mut self.random, y, self.variance[i], rule.noise)
                }
            };
        }
        self.steps += 1;
        Ok(())
    }

    /// Changes where inputs come from, from the next step on.
    ///
    /// # Errors
    /// As [`Running::new`].
    pub fn set_feedback(&mut self, feedback: Feedback) -> Result<()> {
        check(&feedback, self.packed.n_y)?;
        self.feedback = feedback;
        Ok(())
    }

    /// Steps taken.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// y of the last step, N_O values; 0 before the first.
    #[must_use]
    pub fn mean(&self) -> &[f64] {
        let slot = (self.steps.saturating_sub(1) % self.delay) * self.packed.n_y;
        &self.means[slot..slot + self.packed.n_y]
    }

    /// v of the last step, N_O values; empty without variance units.
    #[must_use]
    pub fn variance(&self) -> &[f64] {
        &self.variance
    }

    /// y of the last step, plus noise where the channel asks for it, N_O values. After xi - 1 further steps it is what is
    /// fed back.
    #[must_use]
    pub fn sample(&self) -> &[f64] {
        let slot = (self.steps.saturating_sub(1) % self.delay) * self.packed.n_y;
        &self.fed_back[slot..slot + self.packed.n_y]
    }

    /// The oldest sample that is still to be fed back, N_O values: the prediction of the next step's input. It is 0 as
    /// long as fewer than xi steps are taken.
    #[must_use]
    pub fn due(&self) -> &[f64] {
        let slot = (self.steps % self.delay) * self.packed.n_y;
        &self.fed_back[slot..slot + self.packed.n_y]
    }

    /// c after the last step, N_C values.
    #[must_use]
    pub fn context(&self) -> &[f64] {
        self.stepper.context(&self.packed, 0)
    }
}

struct Enter<'a> {
    stepper: &'a mut Stepper,
    packed: &'a Packed,
}

impl WithSimd for Enter<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.stepper.enter(simd, self.packed);
    }
}

struct Step<'a> {
    stepper: &'a mut Stepper,
    packed: &'a Packed,
}

impl WithSimd for Step<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.stepper.step(simd, self.packed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::Engine;
    use crate::generation::tests::{U0, network, samples};
    use crate::generation::{ChannelFeedback, GenerationOptions, Start, generate};

    #[test]
    fn stepping_gives_the_bits_of_generation() {
        for (delay, set) in
            [(1, InstructionSet::best()), (3, InstructionSet::best()), (2, InstructionSet::available()[0])]
        {
            let (network, sensed) = (network(delay, 0.01), samples(40));
            let rules = [ChannelFeedback { sensed: 1.0, noise: true }, ChannelFeedback { sensed: 0.0, noise: true }];
            let feedback = Feedback(rules.to_vec());
            let start = Start { initial_state: &U0, sensed: &sensed };
            let options = GenerationOptions { steps: 40, feedback: feedback.clone(), seed: 9, contexts: true };
            let whole = generate(&network, &[start], &options, &Engine::new(1, set).unwrap()).unwrap();
            let mut running = Running::new(&network, &U0, feedback, 9, &Engine::new(1, set).unwrap()).unwrap();
            for (k, sample) in sensed.chunks_exact(2).enumerate() {
                if k >= delay {
                    assert_eq!(
                        running.due(),
                        &whole[0].sample[2 * (k - delay)..2 * (k - delay) + 2],
                        "due at step {k}"
                    );
                }
                running.step(sample).unwrap();
                assert_eq!(running.mean(), &whole[0].mean[2 * k..2 * k + 2], "mean of step {k}");
                assert_eq!(running.variance(), &whole[0].variance[2 * k..2 * k + 2], "variance of step {k}");
                assert_eq!(running.sample(), &whole[0].sample[2 * k..2 * k + 2], "sample of step {k}");
                assert_eq!(running.context(), &whole[0].contexts[13 * k..13 * (k + 1)], "context of step {k}");
            }
            assert_eq!(running.steps(), 40);
        }
    }

    #[test]
    fn wrong_sizes_are_refused_and_change_nothing() {
        let network = network(1, 0.0);
        let new = |state: &[f64], feedback| Running::new(&network, state, feedback, 1, &Engine::serial());
        assert!(new(&U0[1..], Feedback::open(2)).unwrap_err().to_string().contains("12 values; needed: 13"));
        assert!(new(&U0, Feedback::open(3)).unwrap_err().to_string().contains("3 values; needed: 2"));
        let mut running = new(&U0, Feedback::open(2)).unwrap();
        assert!(running.step(&[0.1]).is_err() && running.set_feedback(Feedback::mixed(2, -1.0, true)).is_err());
        running.step(&[0.1, 0.2]).unwrap();
        let mut fresh = new(&U0, Feedback::open(2)).unwrap();
        fresh.step(&[0.1, 0.2]).unwrap();
        assert_eq!(running.mean(), fresh.mean());
    }
}
