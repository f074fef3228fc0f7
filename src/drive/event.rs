//! What a port thread reports, for the log.

use std::fmt;

use crate::units::{Counts, Nanos};

use super::AxisPhase;
use super::cia402::State;
use super::error::{AxisFault, LinkError};
use super::family::Fault;
use super::object::Address;
use super::request::AbortCode;

/// Something that happened on a port. Repeats of the same are reported once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PortEvent {
    /// The motor that it concerns.
    pub motor: usize,
    /// What happened.
    pub kind: PortEventKind,
}

/// What happened on a port.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PortEventKind {
    /// The drive was found, checked and limited, and the port thread takes over.
    Ready {
        /// Node id.
        node_id: u8,
        /// Product code.
        product_code: u32,
        /// Firmware version.
        firmware: u16,
        /// Serial number.
        serial_number: u32,
    },
    /// The axis moved on.
    Phase {
        /// Before.
        from: AxisPhase,
        /// After.
        to: AxisPhase,
        /// Statusword as last read.
        statusword: u16,
    },
    /// The drive reports a fault.
    Fault(Fault),
    /// A fault reset was carried out.
    FaultReset {
        /// The fault is gone.
        cleared: bool,
    },
    /// A request was not answered in time; it may have been answered when it was repeated.
    TimedOut {
        /// What was read or written.
        object: Address,
    },
    /// The drive refused a request.
    Refused {
        /// What was read or written.
        object: Address,
        /// Why.
        code: AbortCode,
    },
    /// A set-point outside the position limits was not written. Reported once until one is written
    /// again.
    TargetRefused {
        /// The set-point.
        target: Counts,
        /// Lowest allowed.
        min: Counts,
        /// Highest allowed.
        max: Counts,
    },
    /// The axis was not enabled.
    EnableFailed(Failure),
    /// The drive did not enter quick stop; it is switched off instead.
    QuickStopFailed(Failure),
    /// Homing was asked for in a phase that has none, and will not be done.
    HomingRefused,
    /// Homing ended.
    HomingEnded {
        /// Why it failed, if it did.
        failure: Option<Failure>,
    },
    /// The drive left its state by itself: its enable or quick-stop input, its supply, or another
    /// program.
    StateLost {
        /// Where it is now.
        state: State,
    },
    /// The power stage does not go off in order; its power is cut.
    StillOn {
        /// Where the drive stays.
        state: Option<State>,
    },
    /// The axis does not answer any more.
    Lost(LinkError),
    /// The axis answers, but may not be used as it is.
    NotUsable(AxisFault),
    /// The position is not where it was left while no one looked: the axis counts as not homed.
    Displaced {
        /// Where it was left; `None`: no one noted it.
        before: Option<Counts>,
        /// Where it stands.
        after: Counts,
    },
    /// The control loop wrote no request for too long; the axis is stopped.
    Deserted {
        /// For how long.
        silence: Nanos,
    },
    /// Exchanges take long: something holds replies back.
    SlowLine {
        /// What half of the exchanges take at least.
        median: Nanos,
    },
    /// The axis answers again, was checked and limited, and is not enabled.
    Readmitted,
    /// The port thread ends.
    Ended {
        /// The power stage is known to be off.
        off: bool,
    },
}

/// Why a change of state was not completed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Failure {
    /// The drive does not hold the limits that it was given.
    #[error("the drive was restarted and has lost its limits; it is configured again")]
    Restarted,
    /// The motor stands where no target may be written.
    #[error(
        "position {position} is outside {min} to {max}; home the axis, or correct the position limits"
    )]
    OutsideLimits {
        /// Where it stands.
        position: Counts,
        /// Lowest allowed.
        min: Counts,
        /// Highest allowed.
        max: Counts,
    },
    /// The drive holds another target than the one written.
    #[error("the target reads back as {found} after {written} was written")]
    Preload {
        /// As written.
        written: Counts,
        /// As read.
        found: Counts,
    },
    /// The homing method reads back differently.
    #[error("the drive did not take the homing method")]
    HomingMethod,
    /// What homing needs reads back differently.
    #[error("{object} reads back as 0x{found:08X} after 0x{written:08X} was written")]
    ReadBack {
        /// What was written.
        object: Address,
        /// As written.
        written: u32,
        /// As read.
        found: u32,
    },
    /// The drive refused a step.
    #[error("{object} refused: {code}")]
    Refused {
        /// What was read or written.
        object: Address,
        /// Why.
        code: AbortCode,
    },
    /// It took too long.
    #[error("the drive did not get there in time, statusword 0x{statusword:04X}")]
    Deadline {
        /// As last read.
        statusword: u16,
    },
    /// The drive reports a homing error.
    #[error("the drive reports a homing error")]
    HomingError,
    /// The start of homing was not acknowledged, and may not be sent twice.
    #[error("the start was not acknowledged")]
    Unanswered,
    /// Asked to stop, or the drive left its state, or the line was lost.
    #[error("interrupted")]
    Interrupted,
}

impl fmt::Display for PortEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "motor {}: {}", self.motor, self.kind)
    }
}

impl fmt::Display for PortEventKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ready {
                node_id,
                product_code,
                firmware,
                serial_number,
            } => write!(
                f,
                "drive ready, node {node_id}, product 0x{product_code:08X}, firmware 0x{firmware:04X}, serial number \
                 0x{serial_number:08X}"
            ),
            Self::Phase {
                from,
                to,
                statusword,
            } => write!(f, "{from:?} -> {to:?}, statusword 0x{statusword:04X}"),
            Self::Fault(fault) => write!(f, "fault {fault}"),
            Self::FaultReset { cleared: true } => f.write_str("fault reset"),
            Self::FaultReset { cleared: false } => {
                f.write_str("fault reset had no effect; remove the cause first")
            }
            Self::TimedOut { object } => write!(f, "{object} not answered in time"),
            Self::Refused { object, code } => write!(f, "{object} refused: {code}"),
            Self::TargetRefused { target, min, max } => {
                write!(f, "set-point {target} outside {min} to {max} not written")
            }
            Self::EnableFailed(failure) => write!(f, "not enabled: {failure}"),
            Self::QuickStopFailed(failure) => write!(f, "no quick stop, switching off: {failure}"),
            Self::HomingRefused => f.write_str("homing refused: the axis must be disabled"),
            Self::HomingEnded { failure: None } => f.write_str("homed"),
            Self::HomingEnded {
                failure: Some(failure),
            } => write!(f, "homing failed: {failure}"),
            Self::StateLost { state } => write!(f, "the drive went to {state:?} by itself"),
            Self::StillOn { state } => write!(
                f,
                "power stage does not go off in order ({state:?}), cutting its power"
            ),
            Self::Lost(error) => write!(f, "lost: {error}"),
            Self::NotUsable(fault) => write!(f, "not usable: {fault}"),
            Self::Displaced {
                before: Some(before),
                after,
            } => {
                write!(
                    f,
                    "stands at {after} and was left at {before}; it counts as not homed: home the axis"
                )
            }
            Self::Displaced {
                before: None,
                after,
            } => {
                write!(
                    f,
                    "stands at {after}, and no one noted where it was left; it counts as not homed: home the axis"
                )
            }
            Self::Deserted { silence } => {
                write!(
                    f,
                    "the control loop has been silent for {:.0} ms; quick stop",
                    silence.as_seconds() * 1e3
                )
            }
            Self::SlowLine { median } => write!(
                f,
                "an exchange takes {:.1} ms; with an FTDI adapter set its latency timer to 1 ms, and use no hub",
                median.as_seconds() * 1e3
            ),
            Self::Readmitted => f.write_str("answers again; disabled"),
            Self::Ended { off: true } => f.write_str("ended, power stage off"),
            Self::Ended { off: false } => f.write_str("ended, power stage NOT known to be off"),
        }
    }
}
