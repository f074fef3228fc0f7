//! The control cycle in simulated time, with two simulated drives, and benches in the states of the
//! controller. Every tick of every test is checked against the invariants.

mod bench;
mod invariants;
mod sample_models;

use std::sync::Arc;

use i2ris::config::Config;
use i2ris::drive::{AxisFeedback, AxisPhase, AxisRequest, Demand, WrittenTarget};
use i2ris::ipc::{Fault, OperatingState, Refusal, StateCommand};
use i2ris::model::Model;
use i2ris::units::{Counts, Nanos};

pub use bench::*;
pub use invariants::{InvariantCheck, Recording};
pub use sample_models::*;

impl Bench {
    pub fn homed() -> Self {
        let mut bench = Self::standard();
        bench.home();
        bench
    }

    pub fn home(&mut self) {
        assert_eq!(self.ask(StateCommand::Home), Refusal::None);
        self.idle();
        assert!(self.report().homed);
    }

    pub fn enable(&mut self) {
        assert_eq!(self.ask(StateCommand::Enable), Refusal::None);
        self.until("ENABLED", |bench| bench.state() == OperatingState::Enabled);
    }

    pub fn enabled() -> Self {
        Self::with("")
    }

    /// Enabled with additional tables and the standard model.
    pub fn with(tables: &str) -> Self {
        Self::enabled_with(config(tables), Some(standard_model()))
    }

    pub fn enabled_with(config: Config, model: Option<Arc<Model>>) -> Self {
        let mut bench = Self::new(config, model);
        bench.home();
        bench.enable();
        bench
    }

    /// Enabled and moving to a far goal, at full speed, just after an accepted command.
    pub fn moving() -> Self {
        let mut bench = Self::enabled();
        for _ in 0..7 {
            bench.run(9);
            assert_eq!(bench.actuator([250, 250]), Refusal::None);
        }
        let before = bench.targets();
        bench.tick();
        assert_eq!(bench.targets(), before.map(|target| target + 2), "2000 counts/s");
        bench
    }

    pub fn paused() -> Self {
        let mut bench = Self::enabled();
        assert_eq!(bench.ask(StateCommand::Pause), Refusal::None);
        bench.idle();
        bench
    }

    pub fn faulted() -> Self {
        let mut bench = Self::enabled();
        bench.fault(0);
        bench
    }

    pub fn fault(&mut self, axis: usize) {
        self.drives[axis].fail(0x8611);
        self.run(2);
        assert_eq!((self.state(), self.report().fault), (OperatingState::Fault, Fault::Drive));
    }

    pub fn quirk(&mut self, axis: usize, quirk: Quirk) {
        self.drives[axis].quirk = quirk;
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Quirk {
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
    Homeless,
    /// The line is too late to read the current.
    CurrentUnread,
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
        // As a port does: an old request must not be carried out much later.
        let phase = self.feedback.phase;
        if !matches!(phase, AxisPhase::Faulted | AxisPhase::Starting | AxisPhase::Lost) {
            self.feedback.fault_resets = request.fault_resets;
        }
        if !matches!(phase, AxisPhase::Homing | AxisPhase::Starting | AxisPhase::Lost) {
            self.feedback.homings = request.homings;
        }
    }

    fn follow_request(&mut self, now: Nanos, request: &AxisRequest) {
        use AxisPhase as P;
        match (self.feedback.phase, request.demand) {
            (P::Starting | P::Lost, _) => {}
            (P::Faulted, _) if request.fault_resets != self.feedback.fault_resets => {
                self.feedback.fault_resets = request.fault_resets;
                if self.quirk != Quirk::Broken {
                    self.feedback.phase = P::Disabled;
                    self.feedback.error_code = 0;
                }
            }
            (P::Faulted, _) => {}
            (P::Disabled, Demand::Enabled) => {
                if self.quirk != Quirk::SilentPreload {
                    self.write(now, self.feedback.position, request);
                }
                self.begin(P::Enabling);
            }
            (P::Disabled, _) if request.homings != self.feedback.homings => self.begin(P::Homing),
            (P::Disabled, _) => {}
            (P::Homing, Demand::QuickStop) => self.begin(P::Disabling),
            (P::Homing, _) => self.after_delay(|drive| {
                drive.feedback.homed = drive.quirk != Quirk::Homeless;
                drive.feedback.position = Counts(0);
                drive.feedback.phase = P::Disabled;
            }),
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
            (P::Enabling | P::Enabled | P::QuickStopped, _) => self.begin(P::Disabling),
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
