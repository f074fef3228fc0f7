//! The modes of operation, from step to step.

use super::code::Fault;
use super::control::{HALT, START};
use super::motor::Limits;
use super::profile::{Demand, Pace};
use super::state::State;
use super::{Drive, Homing, Mode, Setpoints};
use crate::log::EventKind;

/// For how long the current must be above its threshold to tell a hard stop.
const PRESSED_S: f64 = 0.01;

/// What the drive does with its motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Task {
    /// Power stage off.
    Off,
    /// Powered, holding the demand.
    Hold,
    /// The demand is object 0x607A.
    Cyclic,
    /// A trapezoidal profile to a target, counts of the motor.
    Profile {
        /// The target.
        target: f64,
    },
    /// The speed of object 0x60FF, reached by ramps.
    Velocity,
    /// The speed of object 0x60FF at once.
    CyclicVelocity,
    /// The torque of object 0x6071.
    Torque,
    /// Towards a hard stop, until the current has told it for long enough.
    SearchStop {
        /// Counts per second, signed.
        speed: f64,
        /// For how long the current has been above its threshold.
        pressed_s: f64,
    },
    /// A ramp to a stand; then holding, or the power off and another state.
    Brake {
        /// Counts per second squared.
        deceleration: f64,
        /// The state that waits at the end.
        then: Option<State>,
    },
}

impl Task {
    /// Whether the drive is on its way out of the present state.
    pub(super) const fn is_leaving(self) -> bool {
        matches!(self, Self::Brake { then: Some(_), .. })
    }
}

impl Drive {
    /// Lets time pass.
    pub fn advance(&mut self, dt_s: f64) {
        if self.state == State::NotReadyToSwitchOn {
            self.boot_left_s -= dt_s;
            if self.boot_left_s <= 0.0 {
                self.finish_boot();
            }
        }
        self.move_demand(dt_s);
        self.supervise(dt_s);
        self.move_motor(dt_s);
    }

    /// Starts what the mode of operation does, unless the controlword says halt.
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

    /// Another mode of operation, at once.
    pub(super) fn change_mode(&mut self, mode: Mode) {
        if mode == self.mode {
            return;
        }
        self.mode = mode;
        self.homing = Homing::Idle;
        self.setpoints = Setpoints::default();
        self.events.push(EventKind::Mode(mode));
        if self.state == State::OperationEnabled && !self.task.is_leaving() {
            self.demand = Demand {
                position: self.measured(),
                velocity: self.motor.velocity,
            };
            self.start_mode();
        }
    }

    /// Starts a ramp to a stand.
    pub(super) fn brake(&mut self, deceleration: f64, then: Option<State>) {
        if matches!(
            self.task,
            Task::Cyclic | Task::CyclicVelocity | Task::Torque | Task::SearchStop { .. }
        ) {
            self.demand = Demand {
                position: self.measured(),
                velocity: self.motor.velocity,
            };
        }
        self.task = Task::Brake { deceleration, then };
    }

    /// An object in rpm (or rpm per second), as counts per second (squared).
    pub(super) fn per_second(&self, index: u16) -> f64 {
        let sub = u8::from(index == 0x6099);
        self.rpm(self.dictionary.get(index, sub))
    }

    /// The limit of the motor speed, counts per second.
    fn top_speed(&self) -> f64 {
        self.rpm(self.stored(self.config.family.places().top_speed))
    }

    /// The set-point that acts at once, counts of the motor: cut to the limits, where the family
    /// has no fault for that.
    fn direct_target(&self) -> f64 {
        let places = self.config.family.places();
        let target = self.stored(places.direct_target) + self.dictionary.get(0x60B0, 0);
        let (low, high) = (
            self.dictionary.get(0x607D, 1),
            self.dictionary.get(0x607D, 2),
        );
        let cut = places.beyond_limits.is_none() && low <= high;
        self.to_motor(if cut { target.clamp(low, high) } else { target })
    }

    /// Whether a target, counts of the motor, lies beyond the software position limits. Both 0
    /// means there are none.
    pub(super) fn is_beyond_limits(&self, target: f64) -> bool {
        let (low, high) = (
            self.dictionary.get(0x607D, 1),
            self.dictionary.get(0x607D, 2),
        );
        (low, high) != (0, 0) && (target < self.to_motor(low) || target > self.to_motor(high))
    }

    pub(super) fn rpm(&self, rpm: i64) -> f64 {
        let turn = 4.0 * self.stored(self.config.family.places().encoder_pulses) as f64;
        rpm as f64 / 60.0 * turn
    }

    fn pace(&self) -> Pace {
        let fastest = self.per_second(0x607F).min(self.top_speed());
        let most = self.per_second(0x60C5);
        Pace {
            speed: self.per_second(0x6081).min(fastest),
            acceleration: self.per_second(0x6083).min(most),
            deceleration: self.per_second(0x6084).min(most),
        }
    }

    fn move_demand(&mut self, dt_s: f64) {
        let pace = self.pace();
        match self.task {
            Task::Off | Task::Torque => {
                self.demand = Demand {
                    position: self.measured(),
                    velocity: self.motor.velocity,
                };
            }
            Task::Hold => {}
            Task::Cyclic => {
                self.demand = Demand {
                    position: self.direct_target(),
                    velocity: 0.0,
                };
            }
            Task::Profile { target } => {
                if self.demand.approach(target, pace, dt_s) {
                    self.task = Task::Hold;
                    self.next_setpoint();
                }
            }
            Task::Velocity => {
                let fastest = Pace {
                    speed: self.per_second(0x607F).min(self.top_speed()),
                    ..pace
                };
                self.demand.run(self.per_second(0x60FF), fastest, dt_s);
            }
            Task::CyclicVelocity => {
                let at_once = Pace {
                    speed: self.top_speed(),
                    acceleration: f64::MAX,
                    deceleration: f64::MAX,
                };
                let speed = self.rpm(self.stored(self.config.family.places().direct_velocity));
                self.demand.run(speed, at_once, dt_s);
            }
            Task::SearchStop { speed, pressed_s } => self.search_stop(speed, pressed_s, dt_s),
            Task::Brake { deceleration, then } => {
                let stands = self.demand.brake(deceleration, dt_s) && self.seems_to_stand();
                if stands && let Some(state) = then {
                    self.finish_stop(state);
                }
            }
        }
    }

    /// Runs against the stop; the current that the stop causes tells it.
    fn search_stop(&mut self, speed: f64, pressed_s: f64, dt_s: f64) {
        let threshold = self.stored(self.config.family.places().homing_current) as f64;
        let pressed_s = if self.motor.current_ma.abs() >= threshold {
            pressed_s + dt_s
        } else {
            0.0
        };
        if pressed_s >= PRESSED_S {
            self.demand = Demand {
                position: self.measured(),
                velocity: 0.0,
            };
            self.task = Task::Hold;
            self.end_homing(true);
            return;
        }
        self.demand.position += speed * dt_s;
        self.task = Task::SearchStop { speed, pressed_s };
    }

    fn next_setpoint(&mut self) {
        self.setpoints.active = self.setpoints.queued.take();
        self.setpoints.acknowledged &= self.controlword & START != 0;
        if let Some(target) = self.setpoints.active {
            self.task = Task::Profile { target };
        }
    }

    fn move_motor(&mut self, dt_s: f64) {
        let current_ma = self.stored(self.config.family.places().current_limit) as f64;
        let limits = Limits {
            current_ma,
            speed: self.top_speed(),
        };
        // What the position controller sees; the motor may be elsewhere.
        let error = self.demand.position - self.measured();
        let wanted_ma = self.torque_ma();
        let motor = &self.config.motor;
        match self.task {
            Task::Off => self.motor.coast(motor, dt_s),
            Task::Torque => self.motor.push(motor, wanted_ma, limits, dt_s),
            _ => self
                .motor
                .follow(motor, self.motor.position + error, limits, dt_s),
        }
    }

    /// The current that the torque or current mode asks for, mA.
    fn torque_ma(&self) -> f64 {
        match self.mode {
            Mode::Current => self.dictionary.get(0x2030, 0) as f64,
            _ => {
                self.dictionary.get(0x6071, 0) as f64 / 1000.0
                    * self.dictionary.get(0x3001, 1) as f64
            }
        }
    }

    /// Whether the motor stands, as far as its encoder tells.
    fn seems_to_stand(&self) -> bool {
        self.frozen.is_some() || self.motor.stands()
    }

    /// Looks for what ends in a fault.
    fn supervise(&mut self, dt_s: f64) {
        self.since_setpoint_s += dt_s;
        let watched = matches!(self.task, Task::Hold | Task::Cyclic | Task::Profile { .. });
        if !watched {
            return;
        }
        let window = self.dictionary.get(0x6065, 0) as f64;
        let beyond = self.config.family.places().beyond_limits;
        if let Some(fault) = beyond
            .filter(|_| self.task == Task::Cyclic && self.is_beyond_limits(self.demand.position))
        {
            self.raise(fault, false);
        } else if (self.demand.position - self.measured()).abs() > window {
            self.raise(Fault::FOLLOWING_ERROR, false);
        } else if self.task == Task::Cyclic && self.is_setpoint_late() {
            self.raise(Fault::RPDO_TIMEOUT, false);
        }
    }

    /// With interpolation on, a set-point is expected every period; two periods without one is too
    /// long.
    fn is_setpoint_late(&self) -> bool {
        let period = self.dictionary.get(0x60C2, 1) as f64
            * 10f64.powi(self.dictionary.get(0x60C2, 2) as i32);
        self.config.interpolation_timeout && period > 0.0 && self.since_setpoint_s > 2.0 * period
    }
}
