//! The modes of operation in every time step.

use super::controlword::{HALT, START};
use super::device::{Drive, Homing, Setpoints};
use super::event::{EventKind, Fault};
use super::family::Mode;
use super::motor::{Demand, Limits, ProfileLimits};
use super::state::{State, Task};

/// How long the current must be above its threshold to indicate a hard stop, s.
const PRESSED_S: f64 = 0.01;

impl Drive {
    /// Advances the drive by `dt_s` seconds.
    pub fn advance(&mut self, dt_s: f64) {
        if self.state == State::NotReadyToSwitchOn {
            self.boot_left_s -= dt_s;
            if self.boot_left_s <= 0.0 {
                self.finish_boot();
            }
        }
        self.since_request_s += dt_s;
        let silence_ms = self.config.silence_fault_ms.filter(|_| self.state.is_powered());
        if silence_ms.is_some_and(|ms| self.since_request_s > ms as f64 * 1e-3) {
            self.raise(Fault(0x8130), false);
        }
        self.move_demand(dt_s);
        self.detect_fault(dt_s);
        self.move_motor(dt_s);
    }

    /// Starts the mode of operation, unless the controlword commands a halt.
    pub(super) fn start_mode(&mut self) {
        if self.controlword & HALT != 0 {
            self.brake(self.per_second(0x6084), None);
            return;
        }
        self.since_setpoint_s = 0.0;
        self.task = match (self.mode, self.setpoints.active) {
            (Mode::CyclicPosition | Mode::Position, _) => Task::Cyclic,
            (Mode::ProfilePosition, Some(target)) => Task::Profile { target },
            (Mode::ProfilePosition, None) | (Mode::Homing, _) => Task::Hold,
            (Mode::ProfileVelocity, _) => Task::Velocity,
            (Mode::CyclicVelocity | Mode::Velocity, _) => Task::CyclicVelocity,
            (Mode::CyclicTorque | Mode::Current, _) => Task::Torque,
        };
    }

    /// Changes the mode of operation at once.
    pub(super) fn change_mode(&mut self, mode: Mode) {
        if mode == self.mode {
            return;
        }
        self.mode = mode;
        self.homing = Homing::Idle;
        self.setpoints = Setpoints::default();
        self.events.push(EventKind::Mode(mode));
        if self.state == State::OperationEnabled && !self.task.is_leaving() {
            self.demand = self.actual();
            self.start_mode();
        }
    }

    pub(super) fn brake(&mut self, deceleration: f64, then: Option<State>) {
        let from_motor = matches!(
            self.task,
            Task::Cyclic | Task::CyclicVelocity | Task::Torque | Task::SearchStop { .. }
        );
        if from_motor {
            self.demand = self.actual();
        }
        self.task = Task::Brake { deceleration, then };
    }

    /// Position and velocity of the motor as the drive measures them.
    pub(super) fn actual(&self) -> Demand {
        Demand::new(self.measured(), self.motor.velocity)
    }

    /// An object in rpm (or rpm per second), as counts per second (squared).
    pub(super) fn per_second(&self, index: u16) -> f64 {
        let sub = u8::from(index == 0x6099);
        self.rpm(self.dictionary.get(index, sub))
    }

    /// The limit of the motor speed, counts per second.
    fn max_motor_speed(&self) -> f64 {
        self.rpm(self.stored(self.map().max_motor_speed))
    }

    fn position_limits(&self) -> (i64, i64) {
        (self.dictionary.get(0x607D, 1), self.dictionary.get(0x607D, 2))
    }

    /// The setpoint that acts at once, counts of the motor; clamped if the family has no fault.
    fn direct_target(&self) -> f64 {
        let target = self.stored(self.map().direct_target) + self.dictionary.get(0x60B0, 0);
        let (low, high) = self.position_limits();
        let has_fault = self.map().position_limit_fault.is_some() && !self.config.clips_setpoints;
        let clamps = !has_fault && low <= high;
        self.to_motor(if clamps { target.clamp(low, high) } else { target })
    }

    /// Whether a target, counts of the motor, is beyond the software limits. Both 0: no limits.
    pub(super) fn is_beyond_limits(&self, target: f64) -> bool {
        let (low, high) = self.position_limits();
        (low, high) != (0, 0) && (target < self.to_motor(low) || target > self.to_motor(high))
    }

    pub(super) fn rpm(&self, rpm: i64) -> f64 {
        rpm as f64 / 60.0 * (4.0 * self.stored(self.map().encoder_pulses) as f64)
    }

    fn profile_limits(&self) -> ProfileLimits {
        let acceleration = self.per_second(0x60C5);
        ProfileLimits {
            speed: self.per_second(0x6081).min(self.max_profile_speed()),
            acceleration: self.per_second(0x6083).min(acceleration),
            deceleration: self.per_second(0x6084).min(acceleration),
        }
    }

    fn max_profile_speed(&self) -> f64 {
        self.per_second(0x607F).min(self.max_motor_speed())
    }

    fn move_demand(&mut self, dt_s: f64) {
        let limits = self.profile_limits();
        match self.task {
            Task::Off | Task::Torque => self.demand = self.actual(),
            Task::Hold => {}
            Task::Cyclic => self.demand = Demand::new(self.direct_target(), 0.0),
            Task::Profile { target } => {
                if self.demand.approach(target, limits, dt_s) {
                    self.task = Task::Hold;
                    self.start_next_setpoint();
                }
            }
            Task::Velocity => {
                let limits = ProfileLimits { speed: self.max_profile_speed(), ..limits };
                self.demand.run(self.per_second(0x60FF), limits, dt_s);
            }
            Task::CyclicVelocity => {
                let limits = ProfileLimits::with_ramp(self.max_motor_speed(), f64::MAX);
                let speed = self.rpm(self.stored(self.map().direct_velocity));
                self.demand.run(speed, limits, dt_s);
            }
            Task::SearchStop { speed, pressed_s } => self.search_stop(speed, pressed_s, dt_s),
            Task::Brake { deceleration, then } => {
                let stopped = self.demand.brake(deceleration, dt_s) && self.is_at_standstill();
                if stopped && let Some(state) = then {
                    self.finish_stop(state);
                }
            }
        }
    }

    /// Moves against the hard stop until the current indicates it.
    fn search_stop(&mut self, speed: f64, pressed_s: f64, dt_s: f64) {
        let threshold = self.stored(self.map().homing_current) as f64;
        let is_pressed = self.motor.current_ma.abs() >= threshold;
        let pressed_s = if is_pressed { pressed_s + dt_s } else { 0.0 };
        if pressed_s >= PRESSED_S {
            self.demand = Demand::new(self.measured(), 0.0);
            self.task = Task::Hold;
            self.end_homing(true);
            return;
        }
        self.demand.position += speed * dt_s;
        self.task = Task::SearchStop { speed, pressed_s };
    }

    fn start_next_setpoint(&mut self) {
        self.setpoints.active = self.setpoints.queued.take();
        self.setpoints.acknowledged &= self.controlword & START != 0;
        if let Some(target) = self.setpoints.active {
            self.task = Task::Profile { target };
        }
    }

    fn move_motor(&mut self, dt_s: f64) {
        // A drive limits the speed that its encoder reports, with the sign that it assumes.
        let sees_speed = self.frozen.is_none() && !self.config.motor.reversed;
        let limits = Limits {
            current_ma: self.stored(self.map().current_limit) as f64,
            speed: if sees_speed { self.max_motor_speed() } else { f64::INFINITY },
        };
        // The error seen by the position controller. The motor may be elsewhere.
        let error = self.demand.position - self.measured();
        let target_ma = self.target_current_ma();
        let (motor, config) = (&mut self.motor, &self.config.motor);
        match self.task {
            Task::Off => motor.coast(config, dt_s),
            Task::Torque => motor.push(config, target_ma, limits, dt_s),
            _ => motor.follow(config, motor.position + error, limits, dt_s),
        }
    }

    /// The current setpoint of the torque or current mode, mA.
    fn target_current_ma(&self) -> f64 {
        let get = |index, sub| self.dictionary.get(index, sub) as f64;
        match self.mode {
            Mode::Current => get(0x2030, 0),
            _ => get(0x6071, 0) / 1000.0 * get(0x3001, 1),
        }
    }

    /// Whether the motor is at standstill, as far as its encoder shows.
    fn is_at_standstill(&self) -> bool {
        self.frozen.is_some() || self.motor.is_at_standstill()
    }

    /// Raises the faults of position control: limits, following error, setpoint timeout.
    fn detect_fault(&mut self, dt_s: f64) {
        self.since_setpoint_s += dt_s;
        let is_cyclic = self.task == Task::Cyclic;
        if !is_cyclic && !matches!(self.task, Task::Hold | Task::Profile { .. }) {
            return;
        }
        let window = self.dictionary.get(0x6065, 0) as f64;
        let is_outside = is_cyclic && self.is_beyond_limits(self.demand.position);
        if let Some(fault) = self.map().position_limit_fault.filter(|_| is_outside) {
            self.raise(fault, false);
        } else if (self.demand.position - self.measured()).abs() > window {
            self.raise(Fault::FOLLOWING_ERROR, false);
        } else if is_cyclic && self.is_setpoint_late() {
            self.raise(Fault::RPDO_TIMEOUT, false);
        }
    }

    /// With interpolation on, two periods without a setpoint are too long.
    fn is_setpoint_late(&self) -> bool {
        let exponent = self.dictionary.get(0x60C2, 2) as i32;
        let period = self.dictionary.get(0x60C2, 1) as f64 * 10f64.powi(exponent);
        let expects = self.mode == Mode::CyclicPosition && self.config.interpolation_timeout;
        expects && period > 0.0 && self.since_setpoint_s > 2.0 * period
    }
}
