//! Events of an axis, for the log.

use super::family::Mode;
use super::state::State;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EventKind {
    /// A setpoint (object 0x607A) was received, in counts.
    Setpoint(i32),
    State {
        /// State before.
        from: State,
        /// State after.
        to: State,
    },
    Mode(Mode),
    /// A fault with this code was raised.
    Fault(u16),
    /// Homing ended; true if it succeeded.
    Homing(bool),
    /// The drive started, after power-up or by command.
    Boot,
    /// The line carried something that the drive could not use.
    Line(LineTrouble),
    /// A test or a scenario has injected this fault into the axis, its line or its wire.
    Injected(&'static str),
    /// The host broke a rule that a real drive would punish.
    HostBug(HostBug),
}

/// Something on the line that the drive could not use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineTrouble {
    /// A frame with a wrong CRC.
    Crc,
    /// A frame that was not complete within the frame timeout. It is dropped without a reply.
    FrameTimeout,
    /// The gateway got no answer from this drive.
    NoAnswer,
}

/// A rule that the host broke.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HostBug {
    /// Bytes arrived before the reply to the previous request had been sent. They are lost.
    Pipelined,
    /// An opcode that the drive does not know.
    Opcode(u8),
    /// A new setpoint in profile position mode without clearing bit 4 first. The drive ignores it
    /// without an error.
    SetpointIgnored,
}

impl EventKind {
    /// Name, number and text in the log file.
    pub(crate) fn columns(&self) -> (&'static str, i64, &'static str) {
        match *self {
            Self::Setpoint(counts) => ("setpoint", counts.into(), ""),
            Self::State { to, .. } => ("state", to.bits().into(), to.name()),
            Self::Mode(mode) => ("mode", mode.number().into(), mode.name()),
            Self::Fault(code) => ("fault", code.into(), ""),
            Self::Homing(true) => ("homing", 1, "attained"),
            Self::Homing(false) => ("homing", 0, "failed"),
            Self::Boot => ("boot", 0, ""),
            Self::Line(LineTrouble::Crc) => ("line", 0, "wrong CRC"),
            Self::Line(LineTrouble::FrameTimeout) => ("line", 0, "frame timeout"),
            Self::Line(LineTrouble::NoAnswer) => ("line", 0, "no answer to the gateway"),
            Self::Injected(name) => ("injected", 0, name),
            Self::HostBug(HostBug::Pipelined) => ("host-bug", 0, "bytes before the reply"),
            Self::HostBug(HostBug::Opcode(opcode)) => ("host-bug", opcode.into(), "unknown opcode"),
            Self::HostBug(HostBug::SetpointIgnored) => {
                ("host-bug", 0, "setpoint ignored: bit 4 was not cleared")
            }
        }
    }
}
