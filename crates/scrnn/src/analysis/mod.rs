//! Looking at what was learned: pure functions on lists of numbers.
//!
//! | module | question |
//! |---|---|
//! | [`principal_components`] | along which directions do points differ most? |
//! | [`clustering`] | do points lie together by their labels, more than by chance? |
//! | [`calibration`] | are predicted standard deviations as large as the errors that come? |
//! | [`baselines`] | how well would a simple model do? |
//! | [`mixture`] | how well would a Gaussian mixture do, with regression on it? |
//! | [`oscillation`] | how large and how long are the swings of a signal, and how regular? |

pub mod baselines;
pub mod calibration;
pub mod clustering;
pub mod mixture;
pub mod oscillation;
pub mod principal_components;
