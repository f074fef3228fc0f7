//! Ports whose drives could not be stopped: a cable that comes back a second later finds drives
//! that still hold, and they are stopped then.

use std::path::{Path, PathBuf};

use super::event::WatchdogEvent;
use crate::units::Nanos;

/// Between two tries: one that gets no answer takes some hundred milliseconds.
const PERIOD: Nanos = Nanos::from_millis(500);

/// Tries end after this. By then a person is there, or nobody.
const LONGEST: Nanos = Nanos::from_millis(60_000);

/// The ports to try again.
#[derive(Debug, Default)]
pub(super) struct Unstopped {
    ports: Vec<PathBuf>,
    next: Nanos,
    end: Nanos,
}

/// Whether every axis of a port was stopped.
pub(super) fn is_complete_stop(event: &WatchdogEvent) -> bool {
    matches!(event, WatchdogEvent::Stopped(_, axes) if axes.iter().all(|it| it.outcome.is_ok()))
}

impl Unstopped {
    /// Takes note of a try. The time for more begins with the first one that fails on a port.
    pub fn note(&mut self, stopped: &[WatchdogEvent], now: Nanos) {
        for event in stopped {
            let WatchdogEvent::Stopped(device, _) = event else { continue };
            let is_known = self.contains(device);
            self.ports.retain(|port| port != device);
            if !is_complete_stop(event) {
                self.ports.push(device.clone());
                if !is_known {
                    (self.next, self.end) = (now + PERIOD, now + LONGEST);
                }
            }
        }
    }

    /// Another controller takes care of the drives.
    pub fn clear(&mut self) {
        self.ports.clear();
    }

    /// Whether to try again now.
    pub fn is_due(&mut self, now: Nanos) -> bool {
        let is_due = !self.ports.is_empty() && now >= self.next && now < self.end;
        if is_due {
            self.next = now + PERIOD;
        }
        is_due
    }

    pub fn contains(&self, device: &Path) -> bool {
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
    fn a_port_that_was_not_stopped_is_tried_again_until_it_is() {
        let (ms, mut unstopped) = (Nanos::from_millis, Unstopped::default());
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
        assert!(!unstopped.is_due(ms(1000) + LONGEST), "not for ever");
        unstopped.note(&first, ms(1000));
        unstopped.clear();
        assert!(!unstopped.is_due(ms(2000)), "another controller has the port");
    }
}
