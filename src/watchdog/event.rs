//! Events of the watchdog, as lines of its log.

use std::fmt;
use std::path::PathBuf;

use super::heartbeat_monitor::ControllerStatus;
use crate::drive::cia402::DriveState;
use crate::drive::quick_stop::QuickStopError;
use crate::units::Nanos;

#[derive(Debug, Clone, PartialEq)]
pub enum WatchdogEvent {
    PortOpened(PathBuf),
    PortRefused(PathBuf, String),
    /// The controller is present, and monitored from now on.
    Monitoring,
    /// The controller died or hangs; age of the last heartbeat.
    ControllerLost(ControllerStatus, Nanos),
    /// The thread of a port hangs, in a controller whose loop lives; age of its last sign of life.
    PortLost(PathBuf, Nanos),
    Stopped(PathBuf, Vec<AxisStop>),
    ControllerEnded,
    /// The adapter of the pulse works again, or why it does not.
    Pulse(Option<String>),
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AxisStop {
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
            Self::Pulse(None) => f.write_str("the pulse adapter works again"),
            Self::Pulse(Some(why)) => {
                write!(f, "no pulse: {why}; see [watchdog]; retrying every 200 ms")
            }
            Self::ControllerEnded => f.write_str("the controller ended with its drives off"),
            Self::ControllerLost(status, age) => {
                let died = *status == ControllerStatus::Died;
                let what = if died { "is gone" } else { "hangs" };
                let ms = age.as_seconds() * 1e3;
                write!(f, "the controller {what}; its last heartbeat was {ms:.1} ms ago")
            }
            Self::PortLost(device, age) => {
                let (device, ms) = (device.display(), age.as_seconds() * 1e3);
                write!(f, "the port thread of {device} hangs; last sign of life {ms:.1} ms ago")
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lost_controller_is_reported_with_heartbeat_age() {
        let age = Nanos::from_micros(41_500);
        for (status, what) in
            [(ControllerStatus::Died, "is gone"), (ControllerStatus::Hangs, "hangs")]
        {
            let text = format!("the controller {what}; its last heartbeat was 41.5 ms ago");
            assert_eq!(WatchdogEvent::ControllerLost(status, age).to_string(), text);
        }
    }

    #[test]
    fn a_stop_has_a_line_for_every_axis() {
        let stop = |motor, outcome| AxisStop { motor, outcome };
        let stopped = WatchdogEvent::Stopped(
            PathBuf::from("/dev/ttyUSB0"),
            vec![stop(0, Ok(DriveState::QuickStopActive)), stop(1, Err(QuickStopError::NotHeld))],
        );
        let text = stopped.to_string();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 2, "{text}");
        assert_eq!(lines[0], "/dev/ttyUSB0, motor 0: QuickStopActive");
        assert!(lines[1].starts_with("/dev/ttyUSB0, motor 1: NOT STOPPED, "), "{text}");
    }
}
