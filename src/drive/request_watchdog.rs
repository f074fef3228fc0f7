//! Notices a control loop that sends no requests any more.

use crate::units::Nanos;

/// Watches the sequence numbers of the requests.
#[derive(Debug)]
pub(super) struct RequestWatchdog {
    /// `None`: never expires.
    pub timeout: Option<Nanos>,
    pub sequence: u64,
    /// When the newest request was first seen.
    pub seen: Nanos,
    pub reported: bool,
}

impl RequestWatchdog {
    /// The time since the last new request, if it exceeds the timeout.
    pub fn expired(&mut self, sequence: u64, now: Nanos) -> Option<Nanos> {
        if sequence != self.sequence {
            (self.sequence, self.seen, self.reported) = (sequence, now, false);
        }
        let silence = now - self.seen;
        self.timeout.is_some_and(|timeout| silence >= timeout).then_some(silence)
    }
}
