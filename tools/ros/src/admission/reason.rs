//! Why something is not passed on to the controller.

use i2ris::units::Nanos;

/// Why something is not passed on to the controller. The sentence follows the name of the client.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Reason {
    #[error("its process has too many publishers of this topic")]
    TooManyWriters,
    #[error("more than {per_second} messages a second: send less often")]
    Flood { per_second: u32 },
    // What a message says.
    #[error("{given} positions for {joints} joints")]
    Length { given: usize, joints: usize },
    #[error("a position is not finite")]
    NotFinite,
    #[error("it is in frame {frame:?}; places of the tip are given in {own:?}, or without a name")]
    Frame { frame: String, own: String },
    #[error("the message does not have the type of the topic")]
    Undecodable,
    #[error("it names {name:?}; those of this robot are {own}, each once")]
    JointName { name: String, own: String },
    #[error(
        "{0:?} is none of enable, disable, pause, resume, home, unhome, condition, acknowledge, \
         release, hold"
    )]
    UnknownCommand(String),
    // When it was sent.
    /// It may have been kept for those who come late.
    #[error("the first message of a stream is not followed; the next one is")]
    FirstOfStream,
    #[error(
        "it was sent {:.1} s {}: kept for late joiners, or the clock was set",
        apart.as_seconds(),
        if *future { "in the future" } else { "ago" }
    )]
    Old { apart: Nanos, future: bool },
    #[error(
        "it comes {:.1} s later than the quickest one: its program or the middleware became \
         slow, or the clock was set; `hold` begins anew, or start its program again",
        .0.as_seconds()
    )]
    Late(Nanos),
    /// A writer that says nothing of time cannot be distinguished from one that repeats.
    #[error("its writer gives no time of sending")]
    NoStamp,
    // The controller.
    #[error("there is no setpoint to start from")]
    NoSetpoint,
    #[error("the model in use has no angles")]
    NoAngles,
    #[error("no controller is there")]
    NoController,
    #[error("the controller has not answered earlier requests yet")]
    Waiting,
    #[error("a stop came after it")]
    Overtaken,
    #[error(
        "homing makes the present pose the zero; start `i2ris start ros` with --home to allow it"
    )]
    NoHoming,
    #[error("{0}")]
    Failed(String),
}
