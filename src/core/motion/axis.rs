//! One motor as the loop sees it: its set-point, and what is asked of its drive.

use serde::{Deserialize, Serialize};

use crate::config::{AxisConfig, Config};
use crate::core::faults::overload::Patience;
use crate::core::motion::jerk_limit::Smooth;
use crate::core::motion::velocity_limit::{Limiter, Limits, Target};
use crate::core::states::drive_status::{AxisSight, age};
use crate::drive::{AxisFeedback, AxisPhase, AxisRequest, Demand};
use crate::units::{Counts, Nanos};

/// Who decides where the set-point is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
enum Grip {
    /// The encoder: the drive does not follow, the set-point goes with the motor.
    Loose,
    /// The encoder, until the drive reports that it is enabled.
    Closing {
        /// Since when power is asked for.
        since: Nanos,
    },
    /// The limiter: the drive follows.
    Firm {
        /// Since when power was asked for.
        since: Nanos,
    },
}

/// One motor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Axis {
    lowest: Counts,
    highest: Counts,
    following_error: i64,
    limiter: Limiter,
    smooth: Smooth,
    grip: Grip,
    /// mA, absolute; above it for longer than the patience is a fault.
    current_trip: Option<u32>,
    patience: Patience,
    overloaded: bool,
    fault_resets: u32,
    homings: u32,
    /// The zero counts only if it comes from this homing or a later one.
    zero_from: u32,
    /// The last report.
    pub feedback: AxisFeedback,
}

impl Axis {
    /// A motor whose drive has not reported yet.
    pub fn new(axis: &AxisConfig, config: &Config) -> Self {
        let (lowest, highest) = (axis.position_min_counts, axis.position_max_counts);
        let limits = Limits {
            velocity: config.limits.velocity_counts_s,
            acceleration: config.limits.acceleration_counts_s2,
            deceleration: config.limits.stop_deceleration_counts_s2,
            lowest: lowest.as_f64(),
            highest: highest.as_f64(),
        };
        Self {
            lowest,
            highest,
            following_error: i64::from(config.limits.following_error_counts),
            limiter: Limiter::new(&limits, config.control.period()),
            smooth: Smooth::new(
                config
                    .limits
                    .window_ticks(config.control.period())
                    .unwrap_or(1),
            ),
            grip: Grip::Loose,
            current_trip: config.limits.over_current_ma,
            patience: Patience::new(Nanos::from_millis(config.limits.over_current_ms)),
            overloaded: false,
            fault_resets: 0,
            homings: 0,
            zero_from: 0,
            feedback: AxisFeedback::default(),
        }
    }

    /// Takes in a report.
    pub fn hear(&mut self, feedback: &AxisFeedback, now: Nanos) {
        self.feedback = *feedback;
        let firm = matches!(self.grip, Grip::Firm { .. });
        let high = self
            .current_trip
            .is_some_and(|trip| feedback.current_ma.unsigned_abs() > trip);
        self.overloaded = self.patience.is_over(firm && high, now);
    }

    /// What decisions need to know.
    pub fn sight(&self, now: Nanos) -> AxisSight {
        AxisSight {
            phase: self.feedback.phase,
            age: age(&self.feedback, now),
            strayed: self.strayed(),
            overloaded: self.overloaded,
        }
    }

    /// The drive knows its zero, and nobody has asked to forget it.
    pub fn homed(&self) -> bool {
        self.feedback.homed && self.feedback.homings >= self.zero_from
    }

    /// The motor stands within its position limits. Outside of them a drive cannot be enabled on
    /// the spot: it would cut its target to its own limits, which is a jump.
    pub fn in_range(&self) -> bool {
        self.allows(self.feedback.position)
    }

    /// A position that may be asked for.
    pub fn allows(&self, position: Counts) -> bool {
        (self.lowest..=self.highest).contains(&position)
    }

    /// The nearest position that may be asked for.
    pub fn cut(&self, position: f64) -> f64 {
        position
            .max(self.lowest.as_f64())
            .min(self.highest.as_f64())
    }

    /// The set-point does not move.
    pub fn at_rest(&self) -> bool {
        self.limiter.at_rest() && self.smooth.at_rest()
    }

    /// Every homing that was asked for has ended.
    pub fn homing_done(&self) -> bool {
        self.feedback.homings == self.homings && self.feedback.phase == AxisPhase::Disabled
    }

    /// Every fault reset that was asked for has been carried out, and was of use.
    pub fn reset_done(&self) -> bool {
        self.feedback.fault_resets == self.fault_resets && self.feedback.phase != AxisPhase::Faulted
    }

    /// Asks for a homing.
    pub fn home(&mut self) {
        self.homings = self.homings.wrapping_add(1);
    }

    /// Forgets the zero: only a homing that is asked for from now on gives a new one.
    pub fn unhome(&mut self) {
        self.zero_from = self.homings.wrapping_add(1);
    }

    /// Asks for a fault reset, if the drive is at fault.
    pub fn reset(&mut self) {
        if self.feedback.phase == AxisPhase::Faulted {
            self.fault_resets = self.fault_resets.wrapping_add(1);
        }
    }

    /// Decides who has the set-point. When the drive begins to follow, the set-point starts where
    /// the drive holds: on the target that was preloaded, if it is known, else on the encoder.
    pub fn grip(&mut self, demand: Demand, now: Nanos) {
        let follows = self.feedback.phase == AxisPhase::Enabled;
        self.grip = match (demand, self.grip) {
            (Demand::Disabled | Demand::QuickStop, _) => Grip::Loose,
            (Demand::Enabled, Grip::Loose) => Grip::Closing { since: now },
            (Demand::Enabled, Grip::Closing { since }) if follows => {
                self.restart(self.held(since));
                Grip::Firm { since }
            }
            (Demand::Enabled, Grip::Firm { since }) if !follows => Grip::Closing { since },
            (Demand::Enabled, grip) => grip,
        };
        if !matches!(self.grip, Grip::Firm { .. }) {
            self.restart(self.feedback.position);
        }
    }

    /// One tick towards a target, if the drive follows.
    pub fn follow(&mut self, target: Target) {
        if matches!(self.grip, Grip::Firm { .. }) {
            self.limiter.follow(target);
            self.smooth.take(self.limiter.position());
        }
    }

    /// One tick of slowing down.
    pub fn stop(&mut self) {
        self.limiter.stop();
        self.smooth.take(self.limiter.position());
    }

    fn restart(&mut self, position: Counts) {
        self.limiter.restart(position.as_f64());
        self.smooth.restart(position.as_f64());
    }

    /// The set-point before rounding, counts.
    pub fn setpoint(&self) -> f64 {
        self.smooth.mean()
    }

    /// How far the set-point was moved in this tick, counts.
    pub fn moved(&self) -> f64 {
        self.smooth.moved()
    }

    /// The set-point, as sent.
    pub fn target(&self) -> Counts {
        // The set-point stays between positions that are counts; the encoder says where it is if
        // that were not so.
        Counts::from_f64(self.smooth.mean()).unwrap_or(self.feedback.position)
    }

    /// What the drive shall do; sequence and command are the caller's to fill in.
    pub fn request(&self, demand: Demand) -> AxisRequest {
        AxisRequest {
            demand,
            target: self.target(),
            fault_resets: self.fault_resets,
            homings: self.homings,
            ..AxisRequest::default()
        }
    }

    fn held(&self, since: Nanos) -> Counts {
        let preloaded = self
            .feedback
            .written
            .filter(|written| written.stamp >= since);
        preloaded.map_or(self.feedback.position, |written| written.target)
    }

    /// The set-point that was written last, not the newest one, which may still wait for its slot
    /// on the wire, is too far from the encoder.
    fn strayed(&self) -> bool {
        let Grip::Firm { since } = self.grip else {
            return false;
        };
        let Some(written) = self
            .feedback
            .written
            .filter(|written| written.stamp >= since)
        else {
            return false;
        };
        let distance = i64::from(written.target.0) - i64::from(self.feedback.position.0);
        distance.abs() > self.following_error
    }
}
