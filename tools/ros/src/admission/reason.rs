//! Why a command is not passed on to the controller.

use i2ris::units::Nanos;

/// Why a command is not passed on to the controller. The sentence continues "refused".
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Reason {
    /// The number of positions differs from the number of joints.
    #[error("{given} positions for {joints} joints")]
    Length {
        /// Positions in the message.
        given: usize,
        /// Joints of the robot.
        joints: usize,
    },
    /// A position is not a number, or infinite.
    #[error("a position is not finite")]
    NotFinite,
    /// The message could not be decoded.
    #[error("the message does not have the type of the topic")]
    Undecodable,
    /// More messages than a client has use for.
    #[error("more than {per_second} messages a second: send less often")]
    Flood {
        /// The most that are taken.
        per_second: u32,
    },
    /// The first message of a stream may have been kept for those who come late.
    #[error("the first message of a stream is not followed; the next one is")]
    FirstOfStream,
    /// The stream broke off while it moved the snake, or its sender was gone.
    #[error("the stream broke off; it goes on after `hold`, `move_jp` or a state command")]
    BrokenOff,
    /// A command that is sent once was sent long ago, or its sender's clock is wrong.
    #[error(
        "it was sent {:.1} s {}: kept for late joiners, or the clocks of the computers differ",
        apart.as_seconds(),
        if *future { "in the future" } else { "ago" }
    )]
    Old {
        /// Between its stamp and now.
        apart: Nanos,
        /// It is to come.
        future: bool,
    },
    /// A writer that says nothing of time cannot be distinguished from one that repeats.
    #[error("its writer gives no time of sending")]
    NoStamp,
    /// A participant with more writers of one topic than are distinguished.
    #[error("its process has too many publishers of this topic")]
    TooManyWriters,
    /// A word that is no command.
    #[error(
        "it is none of enable, disable, pause, resume, home, unhome, condition, acknowledge, \
         release, hold"
    )]
    UnknownCommand,
    /// No present setpoint to add to.
    #[error("there is no setpoint to start from")]
    NoSetpoint,
    /// The robot's model gives positions of the tip and no angles.
    #[error("the model in use has no angles")]
    NoAngles,
    /// Nobody to pass it on to.
    #[error("no controller is there")]
    NoController,
    /// Too much waits for the controller.
    #[error("the controller has not answered earlier requests yet")]
    Waiting,
}

impl Reason {
    /// A number per kind: repeats are counted by it.
    #[must_use]
    pub const fn kind(&self) -> u8 {
        match self {
            Self::Length { .. } => 0,
            Self::NotFinite => 1,
            Self::Undecodable => 2,
            Self::Flood { .. } => 3,
            Self::FirstOfStream => 4,
            Self::BrokenOff => 5,
            Self::Old { .. } => 6,
            Self::NoStamp => 7,
            Self::TooManyWriters => 8,
            Self::NoSetpoint => 9,
            Self::NoAngles => 10,
            Self::NoController => 11,
            Self::Waiting => 12,
            Self::UnknownCommand => 13,
        }
    }
}
