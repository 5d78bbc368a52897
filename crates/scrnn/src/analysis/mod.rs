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
//! | [`cycle`] | what does a quantity do over a cycle that repeats? |
//! | [`excursions`] | which of two sides does a signal go to, and in which order? |
//! | [`reaction`] | how long does a robot take to follow another one? |
//! | [`comparison`] | do two lists of numbers differ, or are they equal? |

pub mod baselines;
pub mod calibration;
pub mod clustering;
pub mod comparison;
pub mod cycle;
pub mod excursions;
pub mod mixture;
pub mod oscillation;
pub mod principal_components;
pub mod reaction;
