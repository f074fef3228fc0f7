//! Capacity of a serial line, and the ages of feedback that follow from it.
//!
//! A port serves the axis that needs it most (`drive/axis/schedule.rs`), within bounds in turns: as
//! many exchanges as it has axes. A position at its bound is read before everything but a stop, so
//! one is as old as its bound, an exchange, and one with each of the other axes that may come
//! first.
//!
//! The motion should not stop because of that, nor because of a single lost reply, which costs the
//! reply timeout. It should not stop later, either: so the limit is exactly this, from the slowest
//! port, and no more than [`MAX_REPLY_WAIT`] is granted to a reply, however long the line may wait.

use super::{Config, Finding, PortConfig};
use crate::units::Nanos;

/// Turns in which the position of every axis is read.
pub(crate) const POSITION_BOUND_TURNS: u64 = 4;

/// Turns in which the statusword of every axis is read.
pub(crate) const STATUS_BOUND_TURNS: u64 = 12;

/// Turns in which current and error code of every axis are read.
pub(crate) const CURRENT_BOUND_TURNS: u64 = 72;

/// Bits on the line for a request and its reply: 24 bytes.
const BITS: u64 = 240;

/// Response time of a drive.
const DRIVE: Nanos = Nanos::from_micros(300);

/// Two frames of USB with a latency timer of 1 ms.
const USB: Nanos = Nanos::from_millis(2);

/// Additional time of a request over a gateway's CAN bus, there and back.
const GATEWAY: Nanos = Nanos::from_micros(600);

/// Longer than computed, in an exchange that is delayed.
const DELAY: Nanos = Nanos::from_millis(2);

/// Maximum wait for a reply that does not count as loss of feedback.
const MAX_REPLY_WAIT: Nanos = Nanos::from_millis(20);

/// Duration of a quick start's current.
const MIN_OVER_CURRENT_TIME: Nanos = Nanos::from_millis(200);

/// Age of feedback that is lost, in ages that stop the motion.
const LOST: u64 = 3;

/// Timing that the slowest line of a robot allows.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct LineBounds {
    /// An exchange with the drive of the port.
    pub exchange: Nanos,
    /// Longest time until a stop reaches the last drive.
    pub stop: Nanos,
    /// Age of a position at which the motion stops.
    pub stale: Nanos,
    /// For each axis while all of them move.
    pub setpoints_per_s: f64,
}

impl PortConfig {
    /// Duration of an exchange with the drive at the port, computed from the file.
    pub fn nominal_exchange(&self) -> Nanos {
        let baud = u64::from(self.baud.max(1));
        (Nanos(BITS * 1_000_000_000 / baud) + DRIVE).max(USB)
    }

    /// Something delays exchanges that take 2 ms longer than computed, most likely the latency
    /// timer of an FTDI adapter.
    pub fn is_delayed(&self, exchange: Nanos) -> bool {
        exchange > self.nominal_exchange() + DELAY
    }

    /// Greatest age of the newest position of an axis while every reply arrives. `exchange`: with
    /// the drive of the port; [`PortConfig::nominal_exchange`], or as measured.
    pub fn longest_gap(&self, exchange: Nanos) -> Nanos {
        Nanos(self.turn(exchange).0.saturating_mul(POSITION_BOUND_TURNS + 1))
    }

    /// An exchange with every axis: also the longest time until a stop reaches the last drive, in
    /// addition to the exchange in progress.
    pub fn turn(&self, exchange: Nanos) -> Nanos {
        let others = self.axes.len().saturating_sub(1) as u64;
        Nanos(exchange.0.saturating_add((exchange + GATEWAY).0.saturating_mul(others)))
    }

    /// Setpoints per second of each axis while all axes move, in addition to the reads that are
    /// due: at three quarters of the statusword bound, and five sixths of the current bound.
    pub fn setpoints_per_s(&self, exchange: Nanos) -> f64 {
        let [position, status, current] =
            [POSITION_BOUND_TURNS, STATUS_BOUND_TURNS, CURRENT_BOUND_TURNS].map(|it| it as f64);
        let reads = 1.0 / position + 4.0 / 3.0 / status + 2.0 * 6.0 / 5.0 / current;
        (1.0 - reads) / self.turn(exchange).as_seconds()
    }

    /// Describes the capacity of the line in a sentence.
    pub fn describe_line(&self, exchange: Nanos) -> String {
        format!(
            "{} ms an exchange: {:.0} setpoints a second for each of {} axes if all move, more if \
             one rests; a position at most {} ms old; a stop reaches the last drive within {} ms",
            ms(exchange),
            self.setpoints_per_s(exchange),
            self.axes.len(),
            ms(self.longest_gap(exchange)),
            ms(self.longest_stop(exchange))
        )
    }

    /// Longest time until a stop reaches the last drive, including the exchange in progress.
    fn longest_stop(&self, exchange: Nanos) -> Nanos {
        exchange + GATEWAY + self.turn(exchange)
    }

    /// The least age of feedback that stops the motion and bears the loss of a reply.
    fn stale(&self, exchange: Nanos) -> Nanos {
        let wait = Nanos::from_millis(self.reply_timeout_ms).min(MAX_REPLY_WAIT);
        whole_ms(self.longest_gap(exchange) + wait)
    }
}

impl Config {
    /// Age of the newest position at which the motion stops.
    pub fn feedback_stale(&self) -> Nanos {
        match self.limits.feedback_stale_ms {
            0 => {
                let stale = self.ports.iter().map(|port| port.stale(port.nominal_exchange()));
                stale.max().unwrap_or(MAX_REPLY_WAIT)
            }
            ms => Nanos::from_millis(ms),
        }
    }

    /// Worst timing of all ports, for the given exchange times in the order of the ports.
    pub(crate) fn slowest_line(&self, exchanges: &[Nanos]) -> LineBounds {
        let ports = || self.ports.iter().zip(exchanges.iter().copied());
        let worst =
            |of: fn(&PortConfig, Nanos) -> Nanos| ports().map(|(port, it)| of(port, it)).max();
        let setpoints = ports().map(|(port, it)| port.setpoints_per_s(it)).reduce(f64::min);
        LineBounds {
            exchange: worst(|_, exchange| exchange).unwrap_or_default(),
            stop: worst(PortConfig::longest_stop).unwrap_or_default(),
            stale: self.feedback_stale(),
            setpoints_per_s: setpoints.unwrap_or_default(),
        }
    }

    /// The time that the slowest line takes to carry a setpoint to each of its axes while all of
    /// them move.
    pub fn setpoint_interval(&self) -> Nanos {
        let per_s = |port: &PortConfig| port.setpoints_per_s(port.nominal_exchange());
        let slowest = self.ports.iter().map(per_s).fold(f64::INFINITY, f64::min);
        Nanos((1e9 / slowest) as u64)
    }

    /// Age of the newest position at which the robot goes to FAULT.
    pub fn feedback_lost(&self) -> Nanos {
        Nanos(self.feedback_stale().0.saturating_mul(LOST))
    }

    /// Duration of an over-current that leads to FAULT: two readings on the slowest line, which are
    /// due at five sixths of their bound.
    pub fn over_current_time(&self) -> Nanos {
        let turn = |port: &PortConfig| port.turn(port.nominal_exchange());
        let slowest = self.ports.iter().map(turn).max().unwrap_or_default();
        Nanos(slowest.0.saturating_mul(CURRENT_BOUND_TURNS * 3 / 4)).max(MIN_OVER_CURRENT_TIME)
    }

    /// Limits and timeouts that a port cannot keep with this exchange time.
    pub fn line_findings(&self, port: &PortConfig, exchange: Nanos) -> Vec<Finding> {
        let (gap, timeout) =
            (port.longest_gap(exchange), Nanos::from_millis(port.reply_timeout_ms));
        let (stale, lost) = (self.feedback_stale(), self.feedback_lost());
        let slowest = if port.axes.len() > 1 { exchange + GATEWAY } else { exchange };
        // No axis waits longer for a setpoint than for a position.
        let step = self.limits.velocity_counts_s * gap.as_seconds();
        let aged = format!(
            "with {} axes and {} ms an exchange a position becomes {} ms old, so the robot stops \
             without a command",
            port.axes.len(),
            ms(exchange),
            ms(gap)
        );
        let lossy = format!("one lost reply is a fault, with reply_timeout_ms = {}", ms(timeout));
        let late = format!("an exchange takes {} ms, and replies come too late", ms(slowest));
        let (twice, needed) = (slowest + slowest, port.stale(exchange));
        let third = Nanos((gap + timeout).0 / LOST);
        let findings = [
            (stale < gap, "limits.feedback_stale_ms", stale, aged, Some(needed)),
            (lost < gap + timeout, "limits.feedback_stale_ms", stale, lossy, Some(third)),
            (timeout < twice, "reply_timeout_ms", timeout, late, Some(twice)),
        ];
        let failed = findings.into_iter().filter(|(is_failed, ..)| *is_failed);
        let device = port.device.display();
        let narrow = port.axes.iter().filter(|axis| f64::from(axis.following_error_counts) < step);
        let narrow = narrow.map(|axis| Finding {
            key: format!("following_error_counts of motor {}", axis.motor),
            value: axis.following_error_counts.to_string(),
            reason: format!(
                "{device}: with {} ms an exchange a setpoint may be {step:.0} counts from the \
                 previous one, and its drive faults; raise it to that, or lower \
                 limits.velocity_counts_s",
                ms(exchange)
            ),
        });
        let finding =
            |(_, key, value, reason, least): (bool, &str, Nanos, String, Option<Nanos>)| {
                let least = least.map(|least| format!("; at least {}", ms(whole_ms(least))));
                let reason = format!("{device}: {reason}{}", least.unwrap_or_default());
                Finding { key: key.to_owned(), value: ms(value), reason }
            };
        failed.map(finding).chain(narrow).collect()
    }

    /// Sets the automatic feedback age for measured exchange times, in the order of the ports: at
    /// most twice the age that follows from the file alone.
    pub(crate) fn with_exchanges(&self, exchanges: &[Nanos]) -> Self {
        let mut config = self.clone();
        if config.limits.feedback_stale_ms == 0 {
            let nominal = self.feedback_stale();
            let measured = self.ports.iter().zip(exchanges).map(|(port, it)| port.stale(*it));
            let stale = measured.max().unwrap_or(nominal).clamp(nominal, nominal + nominal);
            config.limits.feedback_stale_ms = stale.0.div_ceil(1_000_000);
        }
        config
    }
}

fn whole_ms(time: Nanos) -> Nanos {
    Nanos::from_millis(time.0.div_ceil(1_000_000))
}

fn ms(time: Nanos) -> String {
    format!("{}", (time.as_seconds() * 1e4).round() / 10.0)
}
