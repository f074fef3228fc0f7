//! Ports whose drives could not be stopped: when their cable is reconnected, the drives still hold
//! and are stopped then.

use std::path::{Path, PathBuf};

use super::event::WatchdogEvent;
use crate::units::Nanos;

/// Interval between two attempts: one without a reply takes some hundred milliseconds.
const PERIOD: Nanos = Nanos::from_millis(500);

/// Time after which attempts end: an operator has had time to act.
const RETRY_TIMEOUT: Nanos = Nanos::from_millis(60_000);

/// Ports to stop again.
#[derive(Debug, Default)]
pub(super) struct PendingStops {
    ports: Vec<PathBuf>,
    next: Nanos,
    end: Nanos,
}

/// Whether every axis of a port was stopped.
pub(super) fn is_complete_stop(event: &WatchdogEvent) -> bool {
    matches!(event, WatchdogEvent::Stopped(_, axes) if axes.iter().all(|it| it.outcome.is_ok()))
}

impl PendingStops {
    /// Records an attempt. The retry time begins with the first failure on a port.
    pub(super) fn note(&mut self, stopped: &[WatchdogEvent], now: Nanos) {
        for event in stopped {
            let WatchdogEvent::Stopped(device, _) = event else { continue };
            let is_known = self.contains(device);
            self.ports.retain(|port| port != device);
            if !is_complete_stop(event) {
                self.ports.push(device.clone());
                if !is_known {
                    (self.next, self.end) = (now + PERIOD, now + RETRY_TIMEOUT);
                }
            }
        }
    }

    /// Another controller takes care of the drives.
    pub(super) fn clear(&mut self) {
        self.ports.clear();
    }

    /// Whether to try again now.
    pub(super) fn is_due(&mut self, now: Nanos) -> bool {
        let is_due = !self.ports.is_empty() && now >= self.next && now < self.end;
        if is_due {
            self.next = now + PERIOD;
        }
        is_due
    }

    pub(super) fn contains(&self, device: &Path) -> bool {
        self.ports.iter().any(|port| port == device)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::cia402::DriveState;
    use crate::drive::quick_stop::QuickStopError;
    use crate::watchdog::AxisStop;

    fn stopped(device: &str, outcome: Result<DriveState, QuickStopError>) -> WatchdogEvent {
        WatchdogEvent::Stopped(device.into(), vec![AxisStop { motor: 0, outcome }])
    }

    #[test]
    fn unstopped_port_is_retried_until_stopped() {
        let (ms, mut unstopped) = (Nanos::from_millis, PendingStops::default());
        assert!(!unstopped.is_due(ms(0)), "nothing to stop");
        let stop = Ok(DriveState::QuickStopActive);
        let first = [stopped("a", stop), stopped("b", Err(QuickStopError::NotHeld))];
        unstopped.note(&first, ms(1000));
        assert!(unstopped.contains(Path::new("b")) && !unstopped.contains(Path::new("a")));
        let due: Vec<u64> = (1000..3000).filter(|now| unstopped.is_due(ms(*now))).collect();
        assert_eq!(due, [1500, 2000, 2500]);
        unstopped.note(&[stopped("b", Err(QuickStopError::NotHeld))], ms(2500));
        assert!(unstopped.is_due(ms(3000)));
        unstopped.note(&[stopped("b", stop)], ms(3000));
        assert!(!unstopped.is_due(ms(4000)), "stopped");
        unstopped.note(&first, ms(1000));
        assert!(!unstopped.is_due(ms(1000) + RETRY_TIMEOUT), "not for ever");
        unstopped.note(&first, ms(1000));
        unstopped.clear();
        assert!(!unstopped.is_due(ms(2000)), "another controller has the port");
    }
}
