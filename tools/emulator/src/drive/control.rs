//! What a controlword sets in motion, and what a fault does.

use super::code::{Fault, Reaction};
use super::motion::Task;
use super::profile::Demand;
use super::state::{Command, State};
use super::{Drive, Homing, Mode, Setpoints};
use crate::log::{EventKind, HostBug};

/// Controlword bit 4: new set-point, or start homing.
pub(super) const START: u16 = 1 << 4;
/// Controlword bit 5: go there at once.
const IMMEDIATELY: u16 = 1 << 5;
/// Controlword bit 6: from here, not from zero.
const RELATIVE: u16 = 1 << 6;
/// Controlword bit 7: reset the fault.
const FAULT_RESET: u16 = 1 << 7;
/// Controlword bit 8: stop and hold.
pub(super) const HALT: u16 = 1 << 8;

impl Drive {
    /// Carries out a controlword.
    pub(super) fn write_controlword(&mut self, controlword: u16) {
        let before = std::mem::replace(&mut self.controlword, controlword);
        let rising = controlword & !before;
        if rising & FAULT_RESET != 0 {
            self.reset_fault();
        }
        self.command(controlword);
        if self.state == State::OperationEnabled && !self.task.is_leaving() {
            self.halt_or_go_on(before);
            self.start(rising, before);
        }
    }

    /// Brings the drive to another state, at once and without a ramp.
    pub(super) fn enter(&mut self, state: State) {
        let from = std::mem::replace(&mut self.state, state);
        if from != state {
            self.events.push(EventKind::State { from, to: state });
        }
    }

    /// Cuts the power stage.
    pub(super) fn power_off(&mut self) {
        self.task = Task::Off;
        self.setpoints = Setpoints::default();
    }

    /// The ramp of a stop has ended: carries out what it was for, then the controlword that came in
    /// the meantime.
    pub(super) fn finish_stop(&mut self, then: State) {
        self.power_off();
        self.enter(then);
        self.command(self.controlword);
    }

    /// Carries out the state command of a controlword. During a ramp only cutting the power is
    /// taken: one command must finish before the next is handled.
    fn command(&mut self, controlword: u16) {
        let Some(command) = Command::of(controlword) else {
            return;
        };
        if self.task.is_leaving() && command != Command::DisableVoltage {
            return;
        }
        let Some(to) = command.leads(self.state) else {
            return;
        };
        match (self.state, to) {
            (_, State::OperationEnabled) => self.enable(),
            (State::OperationEnabled, State::QuickStopActive) => {
                self.brake(self.per_second(0x6085), None);
                self.enter(to);
            }
            (State::OperationEnabled, State::ReadyToSwitchOn) => self.leave(0x605B, to),
            (State::OperationEnabled, State::SwitchedOn) => self.leave(0x605C, to),
            _ => {
                self.power_off();
                self.enter(to);
            }
        }
    }

    /// Powers the motor. In the cyclic position mode it goes to object 0x607A at once, however old
    /// that is.
    fn enable(&mut self) {
        self.demand = Demand {
            position: self.measured(),
            velocity: self.motor.velocity,
        };
        self.setpoints = Setpoints::default();
        self.enter(State::OperationEnabled);
        self.start_mode();
    }

    /// Leaves operation as an option code says: 0 at once, 1 after a ramp.
    fn leave(&mut self, option: u16, to: State) {
        if self.dictionary.get(option, 0) == 0 {
            self.power_off();
            self.enter(to);
        } else {
            self.brake(self.per_second(0x6084), Some(to));
        }
    }

    fn halt_or_go_on(&mut self, before: u16) {
        let halted = matches!(self.task, Task::Brake { .. });
        if self.controlword & HALT != 0 && !halted {
            self.brake(self.per_second(0x6084), None);
        } else if self.controlword & HALT == 0 && before & HALT != 0 {
            self.start_mode();
        }
    }

    /// Bit 4: only its rising edge starts something, and in the profile position mode a set-point
    /// behind a bit that was never lowered is lost without a word.
    fn start(&mut self, rising: u16, before: u16) {
        match self.mode {
            Mode::ProfilePosition if rising & START != 0 => self.take_setpoint(),
            Mode::ProfilePosition if self.controlword & START == 0 => {
                self.setpoints.acknowledged = self.setpoints.queued.is_some();
            }
            Mode::ProfilePosition
                if before & START != 0
                    && self.setpoints.taken != Some(self.dictionary.get(0x607A, 0)) =>
            {
                self.events
                    .push(EventKind::HostBug(HostBug::SetpointIgnored));
            }
            Mode::Homing if rising & START != 0 => self.home(),
            _ => {}
        }
    }

    fn take_setpoint(&mut self) {
        let written = self.dictionary.get(0x607A, 0);
        let base = self
            .setpoints
            .queued
            .or(self.setpoints.active)
            .unwrap_or(self.demand.position);
        let target = if self.controlword & RELATIVE != 0 {
            base + written as f64
        } else {
            self.to_motor(written)
        };
        if self.is_beyond_limits(target) {
            let fault = self
                .config
                .family
                .places()
                .beyond_limits
                .unwrap_or(Fault(0xFF09));
            self.raise(fault, false);
            return;
        }
        let moving = matches!(self.task, Task::Profile { .. });
        if !moving || self.controlword & IMMEDIATELY != 0 {
            self.setpoints.active = Some(target);
            self.setpoints.queued = None;
        } else if self.setpoints.queued.is_none() {
            self.setpoints.queued = Some(target);
        } else {
            self.events
                .push(EventKind::HostBug(HostBug::SetpointIgnored));
            return;
        }
        self.setpoints.acknowledged = true;
        self.setpoints.taken = Some(written);
        if self.controlword & HALT == 0 {
            self.start_mode();
        }
    }

    /// Here is the home position, or at the stop in a direction. The other methods need switches or
    /// an index, and fail here.
    fn home(&mut self) {
        let method = self.dictionary.get(0x6098, 0);
        match method {
            -3 | -4 => {
                let speed = self.per_second(0x6099) * if method == -3 { 1.0 } else { -1.0 };
                self.homing = Homing::Idle;
                self.task = Task::SearchStop {
                    speed,
                    pressed_s: 0.0,
                };
            }
            method => self.end_homing(method == self.config.family.places().here),
        }
    }

    /// Homing ends here.
    pub(super) fn end_homing(&mut self, done: bool) {
        if done {
            self.origin = self.encoder() - self.stored(self.config.family.places().home_position);
            self.homed = true;
        }
        self.homing = if done {
            Homing::Attained
        } else {
            Homing::Failed
        };
        self.events.push(EventKind::Homing(done));
    }

    /// Raises a fault. While `persists`, it cannot be reset.
    pub fn raise(&mut self, fault: Fault, persists: bool) {
        self.events.push(EventKind::Fault(fault.0));
        self.remember(fault);
        if fault.reaction(self.config.family) == Reaction::Warning {
            self.warning = true;
            return;
        }
        self.fault = Some(fault);
        self.cause = persists;
        let ramp = match fault.reaction(self.config.family) {
            Reaction::FaultOption => match self.dictionary.get(0x605E, 0) {
                0 => None,
                1 => Some(0x6084),
                _ => Some(0x6085),
            },
            Reaction::AbortOption => (self.dictionary.get(0x6007, 0) == 3).then_some(0x6085),
            Reaction::Disable | Reaction::Warning => None,
        };
        match ramp {
            Some(_) if self.state == State::FaultReactionActive => {}
            Some(deceleration) if self.state.is_powered() => {
                self.enter(State::FaultReactionActive);
                self.brake(self.per_second(deceleration), Some(State::Fault));
            }
            _ => {
                self.power_off();
                self.enter(State::Fault);
            }
        }
    }

    /// The cause of a persistent fault is gone.
    pub fn remove_cause(&mut self) {
        self.cause = false;
        self.warning = false;
    }

    fn reset_fault(&mut self) {
        if self.state != State::Fault || self.cause {
            return;
        }
        if self
            .fault
            .is_some_and(|fault| fault.clears_position(self.config.family))
        {
            self.lose_position();
        }
        self.fault = None;
        self.enter(State::SwitchOnDisabled);
    }

    /// Puts a fault into the history (object 0x1003), newest first.
    fn remember(&mut self, fault: Fault) {
        for entry in (1..5).rev() {
            self.dictionary
                .set(0x1003, entry + 1, self.dictionary.get(0x1003, entry));
        }
        self.dictionary.set(0x1003, 1, i64::from(fault.0));
        self.dictionary
            .set(0x1003, 0, (self.dictionary.get(0x1003, 0) + 1).min(5));
    }
}
