//! A simulated drive with its port thread: carries out a request after a fixed number of ticks and
//! reports it.

use i2ris::drive::{AxisFeedback, AxisPhase, AxisRequest, Demand, WrittenTarget};
use i2ris::units::{Counts, Nanos};

/// How a drive misbehaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Quirk {
    /// None.
    #[default]
    None,
    /// The line is dead: no report and no request gets through.
    Silent,
    /// Positions are read, but requests have no effect.
    Deaf,
    /// The motor is blocked: setpoints are written, but the encoder does not move.
    Blocked,
    /// The target that is preloaded while enabling is not reported.
    SilentPreload,
    /// Homing ends without a zero.
    Homeless,
    /// The line is too late to read the current.
    CurrentUnread,
    /// A fault cannot be reset.
    Broken,
}

#[derive(Debug, Clone, Copy)]
pub struct SimulatedDrive {
    pub feedback: AxisFeedback,
    pub quirk: Quirk,
    /// Ticks between two setpoints that reach the drive, as on a serial line.
    pub slot: u64,
    /// Ticks that a change of phase takes.
    pub delay: u32,
    ticks: u64,
    left: u32,
}

impl SimulatedDrive {
    /// Configured, off, not homed.
    pub fn new(position: i32) -> Self {
        let feedback = AxisFeedback {
            sequence: 1,
            stamp: Nanos(1),
            position: Counts(position),
            phase: AxisPhase::Disabled,
            ..AxisFeedback::default()
        };
        Self { feedback, quirk: Quirk::None, slot: 1, delay: 3, ticks: 0, left: 0 }
    }

    /// The drive reports a fault.
    pub fn fail(&mut self, error_code: u16) {
        (self.feedback.phase, self.feedback.error_code) = (AxisPhase::Faulted, error_code);
    }

    /// One tick after `request` was sent. What is reported belongs to `now`.
    pub fn tick(&mut self, now: Nanos, request: &AxisRequest) {
        self.ticks += 1;
        if self.quirk == Quirk::Silent {
            return;
        }
        if self.quirk != Quirk::Deaf {
            self.apply_request(now, request);
        }
        self.feedback.sequence += 1;
        self.feedback.stamp = now;
        if self.quirk != Quirk::CurrentUnread {
            self.feedback.current_stamp = now;
        }
    }

    fn apply_request(&mut self, now: Nanos, request: &AxisRequest) {
        self.follow_request(now, request);
        // As a port does: an old reset must not be carried out at a later fault.
        let phase = self.feedback.phase;
        if !matches!(phase, AxisPhase::Faulted | AxisPhase::Starting | AxisPhase::Lost) {
            self.feedback.fault_resets = request.fault_resets;
        }
    }

    fn follow_request(&mut self, now: Nanos, request: &AxisRequest) {
        use AxisPhase as P;
        let fresh_reset = request.fault_resets != self.feedback.fault_resets;
        let fresh_homing = request.homings != self.feedback.homings;
        match (self.feedback.phase, request.demand) {
            (P::Starting | P::Lost, _) => {}
            (P::Faulted, _) if fresh_reset => {
                self.feedback.fault_resets = request.fault_resets;
                if self.quirk != Quirk::Broken {
                    self.feedback.phase = P::Disabled;
                    self.feedback.error_code = 0;
                }
            }
            (P::Faulted, _) => {}
            (P::Disabled, Demand::Disabled) if fresh_homing => self.begin(P::Homing),
            (P::Homing, Demand::Disabled) => self.after_delay(|drive| {
                drive.feedback.homings = request.homings;
                drive.feedback.homed = drive.quirk != Quirk::Homeless;
                drive.feedback.position = Counts(0);
                drive.feedback.phase = P::Disabled;
            }),
            (P::Disabled, Demand::Disabled | Demand::QuickStop) => {}
            (P::Disabled, Demand::Enabled) => {
                if self.quirk != Quirk::SilentPreload {
                    self.write(now, self.feedback.position, request);
                }
                self.begin(P::Enabling);
            }
            (P::Enabling, Demand::Enabled) => {
                self.after_delay(|drive| drive.feedback.phase = P::Enabled)
            }
            (P::Enabled, Demand::Enabled) => {
                if self.ticks.is_multiple_of(self.slot) {
                    self.write(now, request.target, request);
                }
            }
            (P::Enabled, Demand::QuickStop) => self.feedback.phase = P::QuickStopped,
            (P::QuickStopped, Demand::QuickStop | Demand::Enabled) => {}
            (P::Disabling, _) => self.after_delay(|drive| drive.feedback.phase = P::Disabled),
            (P::Enabling | P::Enabled | P::QuickStopped | P::Homing, _) => self.begin(P::Disabling),
        }
    }

    fn begin(&mut self, phase: AxisPhase) {
        self.feedback.phase = phase;
        self.left = self.delay;
    }

    fn after_delay(&mut self, change: impl FnOnce(&mut Self)) {
        self.left = self.left.saturating_sub(1);
        if self.left == 0 {
            change(self);
        }
    }

    fn write(&mut self, now: Nanos, target: Counts, request: &AxisRequest) {
        self.feedback.written = Some(WrittenTarget {
            target,
            stamp: now,
            sequence: request.sequence,
            command_stamp: request.command_stamp,
            command_sequence: request.command_sequence,
        });
        if self.quirk != Quirk::Blocked {
            self.feedback.position = target;
        }
    }
}
