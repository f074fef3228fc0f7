//! Events of port threads.

use std::fmt;

use super::cia402::DriveState;
use super::drive_fault::DriveFault;
use super::error::{AxisError, LinkError};
use super::object::{AbortCode, Address};
use super::objects::{self, Access, Entry};
use crate::robot::{AxisPhase, DrivePower};
use crate::units::{Counts, Nanos};

/// An event on a port. A repeated event is reported once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PortEvent {
    pub motor: usize,
    pub kind: PortEventKind,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PortEventKind {
    /// The drive was identified and limited, and the port thread starts.
    Ready {
        node_id: u8,
        product_code: u32,
        firmware: u16,
        serial_number: u32,
    },
    /// The drive does not have an object that it can do without.
    LeftOut(Address),
    Phase {
        from: AxisPhase,
        to: AxisPhase,
        statusword: u16,
    },
    Fault(DriveFault),
    /// A fault reset was carried out: whether the fault is gone.
    FaultReset(bool),
    /// A request was not answered in time; a retry may have been answered.
    TimedOut(Address),
    Refused {
        object: Address,
        code: AbortCode,
    },
    /// A setpoint outside the limits was not written. Reported once until one is written.
    TargetRefused {
        target: Counts,
        min: Counts,
        max: Counts,
    },
    EnableFailed(TransitionError),
    /// The drive did not enter quick stop; it is switched off instead.
    QuickStopFailed(TransitionError),
    /// Homing was requested in a phase without homing, and is not carried out.
    HomingRefused,
    /// Homing ended; why it failed, if it did.
    HomingEnded(Option<TransitionError>),
    /// A change of state without a command: by an input, the supply, or another program.
    UnexpectedState(DriveState),
    /// The power stage does not switch off by the ramp, and stays in this state; its power is cut.
    StillPowered(Option<DriveState>),
    Lost(LinkError),
    /// The lost axis is the gateway of the port, so the drives behind it are also unreachable.
    GatewayLost,
    Unusable(AxisError),
    /// The position changed while it was not read: the axis counts as not homed.
    PositionMismatch {
        /// The last known position; `None`: it was not saved.
        before: Option<Counts>,
        after: Counts,
    },
    /// The watchdog of the control loop expired: no request for this long. The axis is stopped.
    WatchdogExpired(Nanos),
    /// Exchanges take this long (median): something delays the replies.
    SlowLine(Nanos),
    /// The axis answers again and was identified. True: it kept its power, and holds by quick stop;
    /// false: it was limited and is disabled.
    Reconnected(bool),
    /// The port thread ends, with this known power of the drive.
    Ended(DrivePower),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum TransitionError {
    #[error("the drive was restarted and has lost its limits; it is configured again")]
    Restarted,
    #[error(
        "position {position} is outside {min} to {max}; home the axis, or correct the position \
         limits"
    )]
    OutsideLimits { position: Counts, min: Counts, max: Counts },
    #[error("the target reads back as {found} after {written} was written")]
    Preload { written: Counts, found: Counts },
    #[error("the drive did not accept the homing method")]
    HomingMethod,
    #[error("{object} reads back as 0x{found:08X} after 0x{written:08X} was written")]
    ReadBack { object: Address, written: u32, found: u32 },
    #[error("{object} refused: {code}")]
    Refused { object: Address, code: AbortCode },
    #[error("the drive did not reach the state in time, statusword 0x{0:04X}")]
    Timeout(u16),
    #[error("the drive reports a homing error")]
    HomingError,
    /// The start of homing was not acknowledged, and must not be sent twice.
    #[error("the start was not acknowledged")]
    Unanswered,
    #[error("interrupted")]
    Interrupted,
    #[error("the watchdog has stopped the drives")]
    Stopped,
}

impl fmt::Display for PortEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "motor {}: {}", self.motor, self.kind)
    }
}

impl fmt::Display for PortEventKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ready { node_id, product_code, firmware, serial_number } => write!(
                f,
                "drive ready, node {node_id}, product 0x{product_code:08X}, firmware \
                 0x{firmware:04X}, serial number {serial_number}"
            ),
            Self::LeftOut(object) => {
                write!(f, "the drive has no {object}: left out")?;
                match objects::first(object.index, object.subindex) {
                    // The motor current is read for the sake of one limit.
                    Entry { access: Access::Ro, key, .. } if !key.is_empty() => {
                        write!(f, ", so `{key}` has no effect")
                    }
                    _ => Ok(()),
                }
            }
            Self::Phase { from, to, statusword } => {
                write!(f, "{from:?} -> {to:?}, statusword 0x{statusword:04X}")
            }
            Self::Fault(fault) => write!(f, "fault {fault}"),
            Self::FaultReset(true) => f.write_str("fault reset"),
            Self::FaultReset(false) => {
                f.write_str("fault reset had no effect; remove the cause first")
            }
            Self::TimedOut(object) => write!(f, "{object} not answered in time"),
            Self::Refused { object, code } => write!(f, "{object} refused: {code}"),
            Self::TargetRefused { target, min, max } => {
                write!(f, "setpoint {target} outside {min} to {max} not written")
            }
            Self::EnableFailed(error) => write!(f, "not enabled: {error}"),
            Self::QuickStopFailed(error) => write!(f, "no quick stop, switching off: {error}"),
            Self::HomingRefused => f.write_str("homing refused: the axis must be disabled"),
            Self::HomingEnded(None) => f.write_str("homed"),
            Self::HomingEnded(Some(error)) => write!(f, "homing failed: {error}"),
            Self::UnexpectedState(state) => {
                write!(f, "the drive went to {state:?} without a command")
            }
            Self::StillPowered(state) => {
                write!(f, "power stage does not switch off ({state:?}); cutting its power")
            }
            Self::Lost(error) => write!(f, "lost: {error}"),
            Self::GatewayLost => f.write_str(
                "the drives behind it cannot be stopped: each holds its last setpoint, with power, \
                 and none follows a new one; the emergency stop, or their supply, stops them",
            ),
            Self::Unusable(error) => write!(f, "not usable: {error}"),
            Self::PositionMismatch { before, after } => {
                match before {
                    Some(before) => write!(f, "position {after} differs from the last {before}")?,
                    None => write!(f, "position {after} cannot be compared: none was saved")?,
                }
                f.write_str("; the axis counts as not homed: home it")
            }
            Self::WatchdogExpired(silence) => write!(
                f,
                "no request from the control loop for {:.0} ms; quick stop",
                silence.as_seconds() * 1e3
            ),
            Self::SlowLine(median) => write!(
                f,
                "an exchange takes {:.1} ms; with an FTDI adapter set its latency timer to 1 ms, \
                 and connect without a hub",
                median.as_seconds() * 1e3
            ),
            Self::Reconnected(true) => f.write_str("answers again; holds by quick stop"),
            Self::Reconnected(false) => f.write_str("answers again; disabled"),
            Self::Ended(power) => f.write_str(match power {
                DrivePower::Off => "ended, power stage off",
                DrivePower::On => "ended, power stage ON: it holds; cut its power",
                DrivePower::NotKnown => {
                    "ended, power stage NOT known to be off: it may hold; cut its power"
                }
            }),
        }
    }
}
