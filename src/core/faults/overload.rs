//! Too much at once, for too long: late ticks, and motor current.

use serde::{Deserialize, Serialize};

use crate::units::Nanos;

/// A bucket that leaks: full after so many drops within a window, never full at a steady rate below
/// that.
///
/// The leaky bucket as a meter (J. S. Turner 1986): no list of instants, so no size depends on the
/// window.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Bucket {
    size: f64,
    /// Drops per nanosecond.
    leak: f64,
    level: f64,
    last: Nanos,
}

impl Bucket {
    /// Full after `size` drops within `window`; never, if `size` is 0.
    pub fn new(size: u32, window: Nanos) -> Self {
        let size = f64::from(size);
        Self {
            size,
            leak: size / (window.0.max(1) as f64),
            level: 0.0,
            last: Nanos::ZERO,
        }
    }

    /// Adds drops; true if it is full now.
    pub fn add(&mut self, drops: u32, now: Nanos) -> bool {
        let leaked = now.since(self.last).0 as f64 * self.leak;
        self.level = (self.level - leaked).max(0.0) + f64::from(drops);
        self.last = now;
        self.size > 0.0 && self.level >= self.size
    }
}

/// Something that may hold for a while, but not for longer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Patience {
    span: Nanos,
    since: Option<Nanos>,
}

impl Patience {
    /// For `span`.
    pub fn new(span: Nanos) -> Self {
        Self { span, since: None }
    }

    /// Whether it has held for longer than that.
    pub fn is_over(&mut self, holds: bool, now: Nanos) -> bool {
        let since = self.since.get_or_insert(now);
        let over = holds && now.since(*since) >= self.span;
        if !holds {
            self.since = None;
        }
        over
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(milliseconds: u64) -> Nanos {
        Nanos::from_millis(10_000 + milliseconds)
    }

    #[test]
    fn a_burst_fills_the_bucket_and_a_trickle_does_not() {
        let mut bucket = Bucket::new(10, Nanos::from_millis(1000));
        assert!((0..9).all(|k| !bucket.add(1, ms(k))));
        assert!(bucket.add(2, ms(9)));
        // Nine in a second, for ten seconds, once it has run dry.
        assert!((0..90).all(|k| !bucket.add(1, ms(2000 + k * 112))));
        let mut never = Bucket::new(0, Nanos::from_millis(1000));
        assert!((0..1000).all(|k| !never.add(9, ms(k))));
    }

    #[test]
    fn patience_ends_only_for_what_goes_on() {
        let mut patience = Patience::new(Nanos::from_millis(50));
        assert!(!patience.is_over(true, ms(0)));
        assert!(!patience.is_over(true, ms(49)));
        assert!(patience.is_over(true, ms(50)));
        assert!(!patience.is_over(false, ms(51)));
        assert!(!patience.is_over(true, ms(52)));
        assert!(!patience.is_over(true, ms(101)));
        assert!(patience.is_over(true, ms(102)));
    }
}
