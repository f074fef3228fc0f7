//! Events of the watchdog, as lines of its log.

use std::fmt;
use std::path::PathBuf;

use super::heartbeat_monitor::ControllerStatus;
use crate::drive::bring_up::QuickStopError;
use crate::drive::cia402::DriveState;
use crate::units::Nanos;

/// An event of the watchdog.
#[derive(Debug, Clone, PartialEq)]
pub enum WatchdogEvent {
    /// A port is open.
    PortOpened(PathBuf),
    /// A port cannot be opened now, and the reason.
    PortRefused(PathBuf, String),
    /// The controller is present, and monitored from now on.
    Monitoring,
    /// The controller died or hangs; age of the last heartbeat.
    ControllerLost(ControllerStatus, Nanos),
    /// Outcome of the quick stop on a port.
    Stopped(PathBuf, Vec<AxisStop>),
    /// The controller ended with its drives off.
    ControllerEnded,
}

/// Outcome of the quick stop of one axis.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AxisStop {
    /// The motor.
    pub motor: usize,
    /// State of the drive, or why it is not known.
    pub outcome: Result<DriveState, QuickStopError>,
}

/// One line; for [`WatchdogEvent::Stopped`] one line per axis.
impl fmt::Display for WatchdogEvent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PortOpened(device) => write!(f, "holding {}", device.display()),
            Self::PortRefused(device, why) => {
                write!(f, "cannot hold {}: {why}", device.display())
            }
            Self::Monitoring => f.write_str("watching the controller"),
            Self::ControllerEnded => f.write_str("the controller ended with its drives off"),
            Self::ControllerLost(status, age) => {
                let died = *status == ControllerStatus::Died;
                let what = if died { "is gone" } else { "hangs" };
                let ms = age.as_seconds() * 1e3;
                write!(
                    f,
                    "the controller {what}; its last heartbeat was {ms:.1} ms ago"
                )
            }
            Self::Stopped(device, axes) => {
                for (index, AxisStop { motor, outcome }) in axes.iter().enumerate() {
                    let separator = if index == 0 { "" } else { "\n" };
                    write!(f, "{separator}{}, motor {motor}: ", device.display())?;
                    match outcome {
                        Ok(state) => write!(f, "{state:?}")?,
                        Err(why) => write!(f, "NOT STOPPED, {why}")?,
                    }
                }
                Ok(())
            }
        }
    }
}
