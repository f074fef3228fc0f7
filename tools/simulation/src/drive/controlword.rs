//! Effects of controlwords and faults; the statusword and other objects computed when read.

use super::device::{Drive, Homing, Setpoints};
use super::event::{EventKind, Fault, HostBug, Reaction};
use super::family::Mode;
use super::state::{DeviceCommand, State, Task};

/// Bit 4: new setpoint, or start homing.
pub(super) const START: u16 = 1 << 4;
/// Bit 5: change the setpoint immediately.
const IMMEDIATELY: u16 = 1 << 5;
/// Bit 6: the setpoint is relative.
const RELATIVE: u16 = 1 << 6;
/// Bit 7: fault reset.
const FAULT_RESET: u16 = 1 << 7;
/// Bit 8: halt.
pub(super) const HALT: u16 = 1 << 8;

/// Bit 4: voltage at the power stage.
const VOLTAGE_ENABLED: u16 = 1 << 4;
const WARNING: u16 = 1 << 7;
/// Bit 9: NMT operational. On a serial line it is 0 until an NMT start.
const REMOTE: u16 = 1 << 9;
const TARGET_REACHED: u16 = 1 << 10;
const LIMIT: u16 = 1 << 11;
/// Bit 12, by mode: setpoint acknowledged, homing attained, demand followed.
const MODE_12: u16 = 1 << 12;
/// Bit 13, by mode: following error, homing error.
const MODE_13: u16 = 1 << 13;
const REFERENCED: u16 = 1 << 15;

impl Drive {
    pub(super) fn write_controlword(&mut self, controlword: u16) {
        let before = std::mem::replace(&mut self.controlword, controlword);
        let rising = controlword & !before;
        if rising & FAULT_RESET != 0 {
            self.reset_fault();
        }
        self.command(controlword);
        if self.state == State::OperationEnabled && !self.task.is_leaving() {
            self.halt_or_continue(before);
            self.start(rising, before);
        }
    }

    /// Changes the state at once and without a ramp.
    pub(super) fn enter(&mut self, state: State) {
        let from = std::mem::replace(&mut self.state, state);
        if from != state {
            self.events.push(EventKind::State { from, to: state });
        }
    }

    /// Enters a state without power.
    pub(super) fn power_off(&mut self, state: State) {
        self.task = Task::Off;
        self.setpoints = Setpoints::default();
        self.enter(state);
    }

    /// Ends the ramp of a stop: enters the next state, then executes the newest controlword.
    pub(super) fn finish_stop(&mut self, then: State) {
        self.power_off(then);
        self.command(self.controlword);
    }

    /// Executes a state command; during a ramp only disable voltage: one command must finish first.
    fn command(&mut self, controlword: u16) {
        let is_free = !self.task.is_leaving();
        let command = DeviceCommand::from_controlword(controlword)
            .filter(|command| is_free || *command == DeviceCommand::DisableVoltage);
        let Some(to) = command.and_then(|command| command.next_state(self.state)) else {
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
            _ => self.power_off(to),
        }
    }

    /// Enables the power stage. In cyclic position the motor moves to an old 0x607A at once.
    fn enable(&mut self) {
        self.demand = self.actual();
        self.setpoints = Setpoints::default();
        self.enter(State::OperationEnabled);
        self.start_mode();
    }

    /// Leaves operation according to an option code: 0 at once, 1 after a ramp.
    fn leave(&mut self, option: u16, to: State) {
        if self.dictionary.get(option, 0) == 0 {
            self.power_off(to);
        } else {
            self.brake(self.per_second(0x6084), Some(to));
        }
    }

    fn halt_or_continue(&mut self, before: u16) {
        let is_deaf = !self.config.cyclic_halt && self.task == Task::Cyclic;
        let halted = matches!(self.task, Task::Brake { .. }) || is_deaf;
        if self.controlword & HALT != 0 && !halted {
            self.brake(self.per_second(0x6084), None);
        } else if self.controlword & HALT == 0 && before & HALT != 0 {
            self.start_mode();
        }
    }

    /// Evaluates bit 4. Only its rising edge starts something. In the profile position mode a
    /// setpoint without a new edge is lost without an error.
    fn start(&mut self, rising: u16, before: u16) {
        let is_new = self.setpoints.taken != Some(self.dictionary.get(0x607A, 0));
        match self.mode {
            Mode::ProfilePosition if rising & START != 0 => self.take_setpoint(),
            Mode::ProfilePosition if self.controlword & START == 0 => {
                self.setpoints.acknowledged = self.setpoints.queued.is_some();
            }
            Mode::ProfilePosition if before & START != 0 && is_new => {
                self.events.push(EventKind::HostBug(HostBug::SetpointIgnored));
            }
            Mode::Homing if rising & START != 0 => self.home(),
            _ => {}
        }
    }

    fn take_setpoint(&mut self) {
        let written = self.dictionary.get(0x607A, 0);
        let previous = self.setpoints.queued.or(self.setpoints.active);
        let target = if self.controlword & RELATIVE != 0 {
            previous.unwrap_or(self.demand.position) + written as f64
        } else {
            self.to_motor(written)
        };
        if self.is_beyond_limits(target) {
            let fault = self.map().position_limit_fault.unwrap_or(Fault(0xFF09));
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
            self.events.push(EventKind::HostBug(HostBug::SetpointIgnored));
            return;
        }
        self.setpoints.acknowledged = true;
        self.setpoints.taken = Some(written);
        if self.controlword & HALT == 0 {
            self.start_mode();
        }
    }

    /// Homes on the present position or at a hard stop. Other methods need switches, and fail.
    fn home(&mut self) {
        let method = self.dictionary.get(0x6098, 0);
        if matches!(method, -3 | -4) {
            let speed = self.per_second(0x6099) * if method == -3 { 1.0 } else { -1.0 };
            self.homing = Homing::Idle;
            self.task = Task::SearchStop { speed, pressed_s: 0.0 };
        } else {
            self.end_homing(method == self.map().actual_position_method);
        }
    }

    /// Ends homing at the present position.
    pub(super) fn end_homing(&mut self, done: bool) {
        self.homing = Homing::Failed;
        if done {
            self.homing = Homing::Attained;
            self.origin = self.encoder() - self.stored(self.map().home_position);
            self.homed = true;
        }
        self.events.push(EventKind::Homing(done));
    }

    /// Raises a fault. While it `persists`, it cannot be reset.
    pub fn raise(&mut self, fault: Fault, persists: bool) {
        self.events.push(EventKind::Fault(fault.0));
        self.add_to_history(fault);
        let reaction = fault.reaction(self.config.family);
        if reaction == Reaction::Warning {
            self.warning = true;
            return;
        }
        self.fault = Some(fault);
        self.cause_persists = persists;
        let ramp = match (reaction, self.dictionary.get(0x605E, 0)) {
            (Reaction::FaultOption, 0) => None,
            (Reaction::FaultOption, 1) => Some(0x6084),
            (Reaction::FaultOption, _) => Some(0x6085),
            (Reaction::AbortOption, _) => (self.dictionary.get(0x6007, 0) == 3).then_some(0x6085),
            (Reaction::Disable | Reaction::Warning, _) => None,
        };
        match ramp {
            Some(_) if self.state == State::FaultReactionActive => {}
            Some(deceleration) if self.state.is_powered() => {
                self.enter(State::FaultReactionActive);
                self.brake(self.per_second(deceleration), Some(State::Fault));
            }
            _ => self.power_off(State::Fault),
        }
    }

    /// Clears the cause of a persistent fault.
    pub fn remove_cause(&mut self) {
        self.cause_persists = false;
        self.warning = false;
    }

    fn reset_fault(&mut self) {
        if self.state != State::Fault || self.cause_persists {
            return;
        }
        let family = self.config.family;
        if self.fault.is_some_and(|fault| fault.clears_position(family)) {
            self.lose_position();
        }
        self.fault = None;
        self.enter(State::SwitchOnDisabled);
    }

    /// Puts a fault into the error history (object 0x1003), newest first.
    fn add_to_history(&mut self, fault: Fault) {
        for entry in (1..5).rev() {
            self.dictionary.set(0x1003, entry + 1, self.dictionary.get(0x1003, entry));
        }
        let count = self.dictionary.get(0x1003, 0) + 1;
        self.dictionary.set(0x1003, 1, i64::from(fault.0));
        self.dictionary.set(0x1003, 0, count.min(5));
    }

    /// Statusword (object 0x6041).
    pub(super) fn statusword(&self) -> u16 {
        let flag = |set: bool, bit: u16| if set { bit } else { 0 };
        let following_error = self.fault == Some(Fault::FOLLOWING_ERROR);
        let (twelve, thirteen, reached) = match self.mode {
            Mode::ProfilePosition => {
                (self.setpoints.acknowledged, following_error, self.is_at_target())
            }
            Mode::ProfileVelocity => (self.motor.is_at_standstill(), false, self.is_at_speed()),
            Mode::Homing => {
                let attained = self.homing == Homing::Attained;
                (attained, self.homing == Homing::Failed, attained)
            }
            Mode::CyclicPosition | Mode::Position => {
                (self.task == Task::Cyclic, following_error, false)
            }
            Mode::CyclicVelocity | Mode::Velocity => {
                (self.task == Task::CyclicVelocity, false, false)
            }
            Mode::CyclicTorque | Mode::Current => (self.task == Task::Torque, false, false),
        };
        self.state.bits()
            | flag(self.state.is_powered(), VOLTAGE_ENABLED)
            | flag(self.warning, WARNING)
            | flag(self.operational, REMOTE)
            | flag(reached, TARGET_REACHED)
            | flag(self.motor.limited, LIMIT)
            | flag(twelve, MODE_12)
            | flag(thirteen, MODE_13)
            | flag(self.homed, REFERENCED)
            | flag(!self.is_booting(), self.map().constant_status)
    }

    /// The value of a computed object, or `None` for a stored one.
    pub(super) fn computed_value(&self, index: u16, sub: u8) -> Option<i64> {
        let current = self.motor.current_ma.round() as i64;
        Some(match (index, sub) {
            (0x1001, 0) => i64::from(self.fault.map_or(0, Fault::register)),
            (0x3000, 5) => 4 * self.dictionary.get(0x3010, 1),
            (0x30D0 | 0x6077 | 0x6078 | 0x2027, 0) | (0x30D1, 1 | 2) => current,
            (0x603F, 0) => i64::from(self.fault.map_or(0, |fault| fault.0)),
            (0x6040, 0) => i64::from(self.controlword),
            (0x6041, 0) => i64::from(self.statusword()),
            (0x6061, 0) => i64::from(self.mode.number()),
            (0x6062, 0) => i64::from(self.to_drive(self.demand.position)),
            (0x6064, 0) => i64::from(self.position()),
            (0x606B, 0) => self.to_rpm(self.demand.velocity),
            (0x606C, 0) | (0x30D3, 1) => self.to_rpm(self.motor.velocity),
            (0x60F4 | 0x20F4, 0) => {
                i64::from(self.to_drive(self.demand.position)) - i64::from(self.position())
            }
            _ => return None,
        })
    }

    fn is_at_target(&self) -> bool {
        match self.task {
            Task::Hold => self.state == State::OperationEnabled,
            Task::Brake { then: None, .. } => {
                self.state == State::OperationEnabled && self.motor.is_at_standstill()
            }
            _ => false,
        }
    }

    fn is_at_speed(&self) -> bool {
        self.task == Task::Velocity && (self.demand.velocity - self.per_second(0x60FF)).abs() < 1e-6
    }

    fn to_rpm(&self, counts_s: f64) -> i64 {
        (counts_s / self.rpm(1)).round() as i64
    }
}
