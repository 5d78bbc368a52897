//! What is found for each network.

use scrnn::error_regression::{Ascent, ErrorRegressionOptions};
use scrnn_sim::interact::ARM;
use serde::Serialize;

use super::Interact;
use super::conditions::Setting;
use super::scan;
use super::trials::{ClosedLoop, Reactions, Regressed, Subject};
use super::world::InWorld;
use crate::framework::Result;

/// Of one network.
#[derive(Debug, Clone, Serialize)]
pub struct Findings {
    /// 5.3.1.
    pub closed_loop: ClosedLoop,
    /// From the state of each recording's own order.
    pub corresponding: Reactions,
    /// From the state of LLRRL, whatever the order.
    pub other: Reactions,
    /// From that state with error regression.
    pub regression: Option<Regression>,
    /// In the world, from that state, without error regression.
    pub world: Option<InWorld>,
}

/// Error regression of one network.
#[derive(Debug, Clone, Serialize)]
pub struct Regression {
    /// At the default setting.
    pub default: Regressed,
    /// With momentum at the thesis' rate.
    pub thesis: Regressed,
    /// At the default setting, the arm's errors left out: what a robot can know.
    pub without_arm: Regressed,
    /// In the world at the default setting.
    pub world: InWorld,
    /// Mean reaction time and median milliseconds for each setting of the scan.
    #[serde(skip)]
    pub scan: Vec<(f64, f64)>,
}

impl Findings {
    /// Puts a network through everything. Only the thesis' conditions meet the world, only the wide one regresses.
    pub fn of(setting: &Setting, subject: &Subject<'_>, study: &Interact) -> Result<Self> {
        let state = subject.states.sequence(subject.other());
        let default = ErrorRegressionOptions::adam(subject.data.channels().len());
        let quiet = {
            let mut it = default.clone();
            it.iterations = 0;
            it
        };
        let desk = subject.desk;
        Ok(Self {
            closed_loop: desk.part("the network on its own", || subject.closed_loop())?,
            corresponding: desk.part("reactions, own state", || subject.reactions(|s| subject.states.sequence(s)))?,
            other: desk.part("reactions, other state", || subject.reactions(|_| state))?,
            world: match setting.of_thesis {
                true => Some(subject.in_world("in the world", state, &quiet, study.trials)?),
                false => None,
            },
            regression: match setting.condition.key {
                "wide" => Some(Regression::of(subject, state, &default, study)?),
                _ => None,
            },
        })
    }
}

impl Regression {
    fn of(subject: &Subject<'_>, state: &[f64], default: &ErrorRegressionOptions, study: &Interact) -> Result<Self> {
        let regress = |what: &str, options: ErrorRegressionOptions| {
            subject.desk.part(what, || subject.regressed(what, state, &subject.regression(options), 1))
        };
        let mut without_arm = default.clone();
        without_arm.mask[ARM].fill(0.0);
        Ok(Self {
            default: regress("error regression", default.clone())?,
            thesis: regress("error regression at the thesis' rate", thesis(subject.data.channels().len()))?,
            without_arm: regress("error regression without the arm's errors", without_arm)?,
            world: subject.in_world("in the world with error regression", state, default, study.trials)?,
            scan: scan::one(subject, state, study.scanned)?,
        })
    }
}

/// The thesis' ascent: momentum at alpha_init of the training (5.3.4).
pub fn thesis(channels: usize) -> ErrorRegressionOptions {
    let ascent = Ascent::Momentum { rate: 1e-4 / channels as f64, momentum: 0.9 };
    let mut options = ErrorRegressionOptions::adam(channels);
    (options.ascent, options.max_norm) = (ascent, None);
    options
}
