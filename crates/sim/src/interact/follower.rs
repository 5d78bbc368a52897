//! A network that follows the other robot (thesis 5.2.3, 5.3.2): it senses object and head, predicts, and moves the arm to
//! where it predicts it, one sample from now. Its own arm it does not sense: the prediction is fed back instead.
//!
//! With iterations of error regression it revises its slow state while it acts (5.3.4), without it runs as it is.

use nalgebra::{Isometry3, Point3};
use scrnn::analysis::excursions::{Levels, Side};
use scrnn::analysis::reaction::{ReactionRule, arm_error};
use scrnn::engine::Engine;
use scrnn::error_regression::{ErrorRegression, ErrorRegressionOptions, Regression};
use scrnn::network::Network;
use scrnn::scaling::Scaling;
use serde::{Deserialize, Serialize};

use super::interaction::{ARM, CHANNELS, Collision, Interaction, arm_postures};
use super::order::{branchings, primitive_len};
use crate::error::{Error, Result};
use crate::robot::nao;

/// A trained network as an interaction needs it.
#[derive(Debug, Clone, Copy)]
pub struct Controller<'a> {
    /// The network.
    pub network: &'a Network,
    /// Leads from the sensors' units to the network's.
    pub scaling: &'a Scaling,
    /// u_0.
    pub initial_state: &'a [f64],
    /// What to compute with.
    pub engine: &'a Engine,
}

/// The feedback of an interaction: the arm runs on its own predictions, and its errors, which are none, are not regressed
/// on. Everything else is left as it is in `options`.
#[must_use]
pub fn with_own_arm(mut options: ErrorRegressionOptions) -> ErrorRegressionOptions {
    for channel in ARM {
        options.sensed[channel] = 0.0;
        options.mask[channel] = 0.0;
    }
    options
}

/// What was sensed, predicted and done at one sample of an interaction.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlStep {
    /// What was sensed, in pixels and radians.
    pub sensed: [f64; 8],
    /// Whether the object was in view; if not, its channels hold what was sensed of it last.
    pub object_in_view: bool,
    /// What the sample was predicted as, in the network's units; none before the first prediction.
    pub predicted: Option<[f64; 8]>,
    /// The variance that was predicted for it, in the network's units; empty without variance units.
    pub variance: Vec<f64>,
    /// The context that predicts the next sample.
    pub context: Vec<f64>,
    /// What the regression did.
    pub regression: Regression,
    /// E_t (D.3): where the arm is sent, against where a tutor would lead it.
    pub error: f64,
    /// How far out the hand is: 1 to the left, -1 to the right.
    pub hand: f64,
    /// What the robot ran into until the next sample.
    pub collision: Option<Collision>,
}

/// How a branching went.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The hand went to the object's side.
    Success,
    /// The hand went to the other side.
    Opposite,
    /// The robot ran into the other one or the object.
    Collision,
    /// The hand went nowhere.
    Stayed,
}

/// One branching.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Branch {
    /// Where the object went.
    pub side: Side,
    /// How it went.
    pub outcome: Outcome,
    /// What the robot ran into first.
    pub collision: Option<Collision>,
    /// In samples.
    pub reaction_time: usize,
}

/// A whole interaction.
#[derive(Debug, Clone, PartialEq)]
pub struct Followed {
    /// Sample by sample.
    pub steps: Vec<ControlStep>,
    /// All branchings.
    pub branches: Vec<Branch>,
}

/// Lets the network follow an order to its end. `observe` hands each sample to the regression, and may keep a deadline;
/// `watch` sees the world at each sample, before time passes, and ends the interaction by an error of its own.
///
/// While the object is out of view, its channels hold what was sensed of it last, see [`Interaction::sense`]. The network
/// gets no sign of that, and goes on; [`ControlStep::object_in_view`] shows it to the caller.
///
/// # Errors
/// [`Error::Length`] for a network of other channels, [`Error::Network`] for options out of their range, and what `observe`
/// and `watch` refuse.
pub fn follow<E: From<Error>>(
    controller: &Controller<'_>,
    options: &ErrorRegressionOptions,
    interaction: &mut Interaction,
    mut observe: impl FnMut(&mut ErrorRegression, &[f64]) -> scrnn::error::Result<Regression>,
    mut watch: impl FnMut(&Interaction, &ControlStep, &ErrorRegression) -> std::result::Result<(), E>,
) -> std::result::Result<Followed, E> {
    let channels = controller.network.topology().channels();
    if channels != CHANNELS.len() {
        let what = "the network's list of channels";
        return Err(Error::Length { what, found: channels, needed: CHANNELS.len() }.into());
    }
    let Controller { network, scaling, initial_state, engine } = *controller;
    let mut regression = ErrorRegression::new(network, initial_state, options.clone(), engine).map_err(Error::from)?;
    let levels = hand_levels()?;
    let [centre, ..] = arm_postures();
    let mut arm = centre;
    let mut steps: Vec<ControlStep> = Vec::with_capacity(interaction.samples());
    for k in 0..interaction.samples() {
        let sensed = interaction.sense();
        let predicted = (k >= network.topology().delay()).then(|| array(regression.mean()));
        let variance = if predicted.is_some() { regression.variance().to_vec() } else { Vec::new() };
        let scaled: [f64; 8] = std::array::from_fn(|channel| scaling.to_scaled(channel, sensed[channel]));
        let done = observe(&mut regression, &scaled).map_err(Error::from)?;
        if k + 1 >= network.topology().delay() {
            let mean = regression.mean();
            arm = std::array::from_fn(|joint| scaling.to_raw(ARM.start + joint, mean[ARM.start + joint]));
        }
        let tutor = interaction.tutor();
        let to_scaled = |angles: [f64; 4]| -> [f64; 4] {
            std::array::from_fn(|joint| scaling.to_scaled(ARM.start + joint, angles[joint]))
        };
        let mut step = ControlStep {
            sensed,
            object_in_view: interaction.object_in_view(),
            predicted,
            variance,
            context: regression.context(regression.window()).unwrap_or_default().to_vec(),
            regression: done,
            error: arm_error(&to_scaled(arm), &to_scaled(tutor)),
            hand: levels.out(interaction.hand_place().y),
            collision: None,
        };
        watch(interaction, &step, &regression)?;
        interaction.step(arm);
        step.collision = interaction.collision();
        steps.push(step);
    }
    let branches = judge(&steps, interaction.order());
    Ok(Followed { steps, branches })
}

fn array(values: &[f64]) -> [f64; 8] {
    std::array::from_fn(|channel| values[channel])
}

/// Where the hand is in the centre, to the left and to the right.
fn hand_levels() -> Result<Levels> {
    let robot = nao::load_one_armed()?;
    let effector = robot.link("r_effector")?;
    let place = |arm: [f64; 4]| {
        let root_from_hand: Isometry3<f64> = robot.forward(&[&[0.0, 0.0][..], &arm].concat())?[effector];
        Ok::<_, Error>(Point3::from(root_from_hand.translation.vector).y)
    };
    let [centre, left, right] = arm_postures();
    Ok(Levels { centre: place(centre)?, left: place(left)?, right: place(right)? })
}

/// What became of each branching: a collision counts first, then a move to the wrong side that begins in its primitive.
#[must_use]
fn judge(steps: &[ControlStep], order: &[Side]) -> Vec<Branch> {
    let levels = Levels { centre: 0.0, left: 1.0, right: -1.0 };
    let excursions = levels.excursions(steps.iter().map(|step| step.hand));
    // The error of a sample is that of the next one's arm.
    let errors: Vec<f64> = std::iter::once(0.0).chain(steps.iter().map(|step| step.error)).collect();
    let rule = ReactionRule::default();
    let one = |(&side, begin): (&Side, usize)| {
        let end = (begin + primitive_len()).min(steps.len());
        let went = |to: Side| excursions.iter().any(|one| one.side == to && (begin..end).contains(&one.begins));
        let collision = steps[begin..end].iter().find_map(|step| step.collision);
        let outcome = match collision {
            Some(_) => Outcome::Collision,
            None if went(side.other()) => Outcome::Opposite,
            None if went(side) => Outcome::Success,
            None => Outcome::Stayed,
        };
        Branch { side, outcome, collision, reaction_time: rule.time(&errors, begin) }
    };
    order.iter().zip(branchings(order.len())).map(one).collect()
}

#[cfg(test)]
#[path = "follower_tests.rs"]
mod tests;
