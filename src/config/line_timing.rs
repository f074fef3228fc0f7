//! What a serial line can carry, and the ages of feedback that follow from it.
//!
//! A port serves its axes in turns, one exchange with each. In every four turns there is one that
//! reads the position, also in a stream of new commands (`drive/axis/schedule.rs`), so the newest
//! position of an axis becomes as old as four turns and the exchange that reads the next one.
//!
//! The motion should not stop because of that, nor because of a single lost reply, which costs the
//! reply timeout. It should not stop later, either: so the limit is exactly this, from the slowest
//! port, and no more than [`LONGEST_WAIT`] is granted to a reply, however long the line may wait.

use super::{Config, Finding, Framing, PortConfig};
use crate::units::Nanos;

/// Turns in which every axis is asked for its position.
const TURNS: u64 = 4;

/// Rounds between two reads of the statusword. A round is a setpoint and a position.
pub const STATUS_EVERY_ROUNDS: u32 = 4;

/// Rounds between two reads of the error code, and of the current.
pub const SLOW_EVERY_ROUNDS: u32 = 32;

/// Bits on the line for a request and its reply: 24 bytes; 33 with a handshake for every part.
const BITS: [u64; 2] = [240, 330];

/// What a drive takes to answer.
const DRIVE: Nanos = Nanos::from_micros(300);

/// Two frames of USB with a latency timer of 1 ms.
const USB: Nanos = Nanos::from_millis(2);

/// What a request to a node behind another takes over CAN, there and back.
const GATEWAY: Nanos = Nanos::from_micros(600);

/// The longest wait for a reply that does not count as the loss of feedback.
const LONGEST_WAIT: Nanos = Nanos::from_millis(20);

/// What a quick start takes.
const SHORTEST_OVER_CURRENT: Nanos = Nanos::from_millis(200);

/// Age of feedback that is lost, in ages that stop the motion.
const LOST: u64 = 3;

impl PortConfig {
    /// How long an exchange with the drive of the port takes, as far as the file tells.
    #[must_use]
    pub fn nominal_exchange(&self) -> Nanos {
        let baud = u64::from(self.baud.max(1));
        let [v2, v1] = BITS.map(|bits| Nanos(bits * 1_000_000_000 / baud) + DRIVE);
        if self.framing == Framing::V1 { v1.max(USB + USB) } else { v2.max(USB) }
    }

    /// The greatest age of the newest position of an axis while every reply arrives.
    ///
    /// `exchange`: with the drive of the port; [`PortConfig::nominal_exchange`], or as measured.
    #[must_use]
    pub fn longest_gap(&self, exchange: Nanos) -> Nanos {
        let last = if self.axes.len() > 1 { exchange + GATEWAY } else { exchange };
        Nanos(self.turn(exchange).0.saturating_mul(TURNS).saturating_add(last.0))
    }

    fn turn(&self, exchange: Nanos) -> Nanos {
        let behind = self.axes.len().saturating_sub(1) as u64;
        Nanos(exchange.0.saturating_add((exchange + GATEWAY).0.saturating_mul(behind)))
    }

    /// The time between two readings of the current of an axis: in so many rounds, of setpoint and
    /// position, some carry the statusword, one the error code and one the current.
    fn current_period(&self, exchange: Nanos) -> Nanos {
        let rounds = u64::from(SLOW_EVERY_ROUNDS);
        let monitored = rounds / u64::from(STATUS_EVERY_ROUNDS) + 2;
        Nanos(self.turn(exchange).0.saturating_mul(2 * rounds + monitored))
    }

    /// The least age of feedback that stops the motion and bears the loss of a reply.
    fn stale(&self, exchange: Nanos) -> Nanos {
        let wait = Nanos::from_millis(self.reply_timeout_ms).min(LONGEST_WAIT);
        whole_ms(self.longest_gap(exchange) + wait)
    }
}

impl Config {
    /// Age of the newest position at which the motion stops.
    #[must_use]
    pub fn feedback_stale(&self) -> Nanos {
        match self.limits.feedback_stale_ms {
            0 => {
                let stale = self.ports.iter().map(|port| port.stale(port.nominal_exchange()));
                stale.max().unwrap_or(LONGEST_WAIT)
            }
            ms => Nanos::from_millis(ms),
        }
    }

    /// Age of the newest position at which the robot goes to FAULT.
    #[must_use]
    pub fn feedback_lost(&self) -> Nanos {
        Nanos(self.feedback_stale().0.saturating_mul(LOST))
    }

    /// Duration of an over-current that leads to FAULT.
    #[must_use]
    pub fn over_current_time(&self) -> Nanos {
        let period = |port: &PortConfig| port.current_period(port.nominal_exchange());
        let period = self.ports.iter().map(period).max().unwrap_or(Nanos::ZERO);
        Nanos(period.0.saturating_mul(5) / 4).max(SHORTEST_OVER_CURRENT)
    }

    /// The limits and timeouts that a port does not keep by itself, with an exchange that takes so
    /// long.
    #[must_use]
    pub fn line_findings(&self, port: &PortConfig, exchange: Nanos) -> Vec<Finding> {
        let (gap, timeout) =
            (port.longest_gap(exchange), Nanos::from_millis(port.reply_timeout_ms));
        let (stale, lost) = (self.feedback_stale(), self.feedback_lost());
        let (period, over_current) = (port.current_period(exchange), self.over_current_time());
        let slowest = if port.axes.len() > 1 { exchange + GATEWAY } else { exchange };
        let is_watched = self.limits.over_current_ma.is_some();
        let aged = format!(
            "with {} axes and {} ms an exchange a position becomes {} ms old, and the robot stops \
             by itself",
            port.axes.len(),
            ms(exchange),
            ms(gap)
        );
        let lossy = format!("one lost reply is a fault, with reply_timeout_ms = {}", ms(timeout));
        let single = format!(
            "with {} ms an exchange the current is read once in {} ms, and a single reading is a \
             fault: a latency timer of 1 ms makes exchanges short",
            ms(exchange),
            ms(period)
        );
        let late = format!("an exchange takes {} ms, and replies come too late", ms(slowest));
        let (twice, needed) = (slowest + slowest, port.stale(exchange));
        let third = Nanos((gap + timeout).0 / LOST);
        let is_single = is_watched && over_current < period;
        let findings = [
            (stale < gap, "limits.feedback_stale_ms", stale, aged, Some(needed)),
            (lost < gap + timeout, "limits.feedback_stale_ms", stale, lossy, Some(third)),
            (is_single, "duration of an over-current, ms", over_current, single, None),
            (timeout < twice, "reply_timeout_ms", timeout, late, Some(twice)),
        ];
        let failed = findings.into_iter().filter(|(is_failed, ..)| *is_failed);
        let device = port.device.display();
        let finding =
            |(_, key, value, reason, least): (bool, &str, Nanos, String, Option<Nanos>)| {
                let least = least.map(|least| format!("; at least {}", ms(whole_ms(least))));
                let reason = format!("{device}: {reason}{}", least.unwrap_or_default());
                Finding { key: key.to_owned(), value: ms(value), reason }
            };
        failed.map(finding).collect()
    }
}

/// The next whole millisecond.
fn whole_ms(time: Nanos) -> Nanos {
    Nanos::from_millis(time.0.div_ceil(1_000_000))
}

fn ms(time: Nanos) -> String {
    format!("{}", (time.as_seconds() * 1e4).round() / 10.0)
}
