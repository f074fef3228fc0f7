//! Reasons why a message is not passed on to the controller.

use i2ris::units::Nanos;

/// Reason why a message is not passed on to the controller. The text follows the client's name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Reason {
    #[error("its process has too many publishers of this topic")]
    TooManyWriters,
    #[error("more than {per_second} messages a second: send less often")]
    Flood { per_second: u32 },
    // Content of the message.
    #[error("{given} positions for {joints} joints")]
    Length { given: usize, joints: usize },
    #[error("a position is not finite")]
    NotFinite,
    #[error("it is in frame {frame:?}; tip positions must be in {own:?}, or without a frame")]
    Frame { frame: String, own: String },
    #[error("the message does not have the type of the topic")]
    Undecodable,
    #[error("it names {name:?}; the joints of this robot are {own}, each once")]
    JointName { name: String, own: String },
    #[error(
        "{0:?} is not one of enable, disable, pause, resume, home, unhome, condition, acknowledge, \
         release, hold"
    )]
    UnknownCommand(String),
    // Time of sending.
    /// It may have been stored for late joiners.
    #[error("the first message of a stream is not followed; the next one is")]
    FirstOfStream,
    #[error(
        "it was sent {:.1} s {}: stored for late joiners, or the clock was set",
        apart.as_seconds(),
        if *future { "in the future" } else { "ago" }
    )]
    Old { apart: Nanos, future: bool },
    #[error(
        "it arrived {:.1} s later than the quickest one: its program or the middleware became \
         slow, or the clock was set; send `hold` to start over, or restart its program",
        .0.as_seconds()
    )]
    Late(Nanos),
    /// A writer without times cannot be distinguished from one that repeats.
    #[error("its writer does not send the time of sending")]
    NoStamp,
    // The controller.
    #[error("no setpoint to start from")]
    NoSetpoint,
    #[error("the model in use has no angles")]
    NoAngles,
    #[error("no controller is running")]
    NoController,
    #[error("earlier requests to the controller are still pending")]
    Waiting,
    #[error("a stop arrived after it")]
    Overtaken,
    #[error(
        "homing makes the present pose the zero; start `i2ris start ros` with --home to allow it"
    )]
    NoHoming,
    #[error("{0}")]
    Failed(String),
}
