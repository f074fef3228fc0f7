//! Fault codes with the reactions to them; events of an axis, for the log.

use super::family::{Family, Mode};
use super::state::State;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reaction {
    /// Disables the power stage at once, without a controlled stop.
    Disable,
    /// Reacts according to object 0x605E.
    FaultOption,
    /// Reacts according to object 0x6007.
    AbortOption,
    /// Sets the warning bit only.
    Warning,
}

/// A fault code (object 0x603F).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fault(pub u16);

impl Fault {
    /// The motor is too far from its demand.
    pub const FOLLOWING_ERROR: Self = Self(0x8611);
    /// The demand is outside the software position limits.
    pub const POSITION_LIMIT: Self = Self(0x8A82);
    /// No setpoint in time although interpolation is on.
    pub const RPDO_TIMEOUT: Self = Self(0x8250);

    /// The reaction of the drive (EPOS4 Firmware Specification, table of errors; EPOS2: the same,
    /// if it has the error). An unknown code disables the power stage.
    pub fn reaction(self, family: Family) -> Reaction {
        match (family, self.0) {
            (Family::Epos2, 0xFF06 | 0xFF07 | 0xFF09) => Reaction::FaultOption,
            (Family::Epos2, 0xFF00..) => Reaction::Disable,
            (_, 0x8611 | 0x8A80..=0x8A82 | 0xFF10) => Reaction::FaultOption,
            (_, 0x6081 | 0x8110..=0x8180 | 0x8182..=0x8184 | 0x81FD..=0x81FF)
            | (_, 0x8210 | 0x8250 | 0x8280 | 0x8281) => Reaction::AbortOption,
            (_, 0xFF01) => Reaction::Warning,
            _ => Reaction::Disable,
        }
    }

    /// Whether the position is lost when the fault is reset.
    pub fn clears_position(self, family: Family) -> bool {
        match family {
            Family::Epos2 => matches!(self.0, 0xFF01..=0xFF04 | 0xFF08 | 0xFF0A | 0xFF11),
            Family::Epos4 => matches!(self.0, 0x7380..=0x7382 | 0x7388..=0x738A | 0x7392 | 0xFF02),
        }
    }

    /// The bits that it sets in the error register (object 0x1001).
    pub fn register(self) -> u8 {
        let class = match self.0 >> 8 {
            0x23 => 1 << 1,
            0x32 => 1 << 2,
            0x42 | 0x43 => 1 << 3,
            0x81 | 0x82 => 1 << 4,
            0x86 | 0x8A => 1 << 7,
            _ => 0,
        };
        class | 1
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EventKind {
    /// A setpoint (object 0x607A) was received, in counts.
    Setpoint(i32),
    State {
        from: State,
        to: State,
    },
    Mode(Mode),
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
    /// A new profile setpoint without clearing bit 4 first: ignored without an error.
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
