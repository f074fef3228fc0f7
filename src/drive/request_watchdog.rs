//! Notices a control loop that sends no requests any more.

use crate::units::Nanos;

/// Age of the last request at which a port stops its enabled axes. The loop writes a request every
/// tick, so this means that it hangs. It is for a controller without a watchdog, which would act
/// after 50 ms, and long, because without real time the loop may stall while the drive safely
/// holds.
const LOOP_TIMEOUT: Nanos = Nanos::from_millis(1000);

/// Watches the sequence numbers of the requests.
#[derive(Debug, Default)]
pub(super) struct RequestWatchdog {
    sequence: u64,
    /// When the newest request was first seen.
    seen: Nanos,
    pub reported: bool,
}

impl RequestWatchdog {
    /// The time since the last new request, if it exceeds the timeout.
    pub(super) fn expired(&mut self, sequence: u64, now: Nanos) -> Option<Nanos> {
        if sequence != self.sequence {
            (self.sequence, self.seen, self.reported) = (sequence, now, false);
        }
        let silence = now - self.seen;
        (silence >= LOOP_TIMEOUT).then_some(silence)
    }
}
