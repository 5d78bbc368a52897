//! What can be wrong with a robot or a world: found, where, and needed.

/// A request that cannot be served.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A robot's description that is no URDF at all.
    #[error("the robot's description cannot be read: {0}")]
    Unreadable(String),

    /// Something is wrong with one link.
    #[error("link `{link}`: {what}")]
    Link {
        /// Its name.
        link: String,
        /// What was found, and what was needed.
        what: String,
    },

    /// Something is wrong with one joint.
    #[error("joint `{joint}`: {what}")]
    Joint {
        /// Its name.
        joint: String,
        /// What was found, and what was needed.
        what: String,
    },

    /// A name that is not there.
    #[error("there is no {what} `{name}`; there is: {present}")]
    Missing {
        /// Link, joint, body or robot.
        what: &'static str,
        /// The name asked for.
        name: String,
        /// All names.
        present: String,
    },

    /// A number that stands for nothing here.
    #[error("there is no {what} {index}; there are {count}, counted from 0")]
    NoSuch {
        /// Joint or link.
        what: &'static str,
        /// The number asked for.
        index: usize,
        /// How many there are.
        count: usize,
    },

    /// A robot or a body of another world.
    #[error("the {what} is of another world; those of this one are: {present}")]
    Elsewhere {
        /// Robot or body.
        what: &'static str,
        /// All names.
        present: String,
    },

    /// A name that is already taken.
    #[error("the name `{0}` is already taken")]
    Taken(String),

    /// A list of another length than the robot has joints.
    #[error("{what} holds {found} values; needed: {needed}")]
    Length {
        /// The list.
        what: &'static str,
        /// Its length.
        found: usize,
        /// The length asked for.
        needed: usize,
    },

    /// A setting lies outside of its range.
    #[error("{what} is {found}; needed: {needed}")]
    Setting {
        /// The setting.
        what: &'static str,
        /// Its value.
        found: String,
        /// What would do.
        needed: &'static str,
    },

    /// A place that a robot's hand does not reach.
    #[error("{link} comes no closer than {distance:.4} m to ({x:.3}, {y:.3}, {z:.3})")]
    OutOfReach {
        /// The link to bring there.
        link: String,
        /// The distance that is left, in metres.
        distance: f64,
        /// The place.
        x: f64,
        /// The place.
        y: f64,
        /// The place.
        z: f64,
    },

    /// The network refused.
    #[error(transparent)]
    Network(#[from] scrnn::error::Error),
}

/// The result of a request.
pub type Result<T> = std::result::Result<T, Error>;
