//! Lease: one client commands at a time.
//!
//! The first accepted command takes a free lease, and every accepted command renews it. The lease
//! expires after `command.lease_timeout_ms` without an accepted command. The state command
//! `release` gives it back at once.

use serde::{Deserialize, Serialize};

use crate::units::Nanos;

/// The lease on the commands of the robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Lease {
    duration: Nanos,
    holder: Option<LeaseHolder>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct LeaseHolder {
    client_id: u64,
    /// When the client took or last renewed the lease.
    renewed: Nanos,
}

impl Lease {
    /// A free lease.
    pub fn new(duration: Nanos) -> Self {
        Self { duration, holder: None }
    }

    pub fn duration(&self) -> Nanos {
        self.duration
    }

    /// The client that holds the lease; 0: none.
    pub fn holder(&self) -> u64 {
        self.holder.map_or(0, |holder| holder.client_id)
    }

    /// Takes or renews the lease. Returns whether the holder changes.
    pub fn renew(&mut self, client_id: u64, now: Nanos) -> bool {
        let is_new = self.holder() != client_id;
        self.holder = Some(LeaseHolder { client_id, renewed: now });
        is_new
    }

    /// Frees the lease if it has expired. Returns whether it has.
    pub fn expire(&mut self, now: Nanos) -> bool {
        let is_expired =
            self.holder.is_some_and(|holder| now.duration_since(holder.renewed) >= self.duration);
        if is_expired {
            self.holder = None;
        }
        is_expired
    }

    /// Gives the lease of a client back. Returns whether the client had it.
    pub fn release(&mut self, client_id: u64) -> bool {
        self.holder.take_if(|holder| holder.client_id == client_id).is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DURATION: Nanos = Nanos::from_millis(500);

    #[test]
    fn a_lease_belongs_to_one_client_until_it_expires_or_is_given_back() {
        let ms = Nanos::from_millis;
        let mut lease = Lease::new(DURATION);
        assert!(lease.renew(7, ms(1000)));
        assert!(!lease.renew(7, ms(1100)));
        assert!(!lease.release(8) && !lease.expire(ms(1599)));
        assert_eq!(lease.holder(), 7);
        assert!(lease.expire(ms(1600)) && !lease.expire(ms(1601)));
        assert_eq!(lease.holder(), 0);
        assert!(lease.renew(8, ms(1700)));
        assert!(lease.release(8) && !lease.release(7));
    }
}
