//! Motor, encoder and position controller of one drive.

use serde::{Deserialize, Serialize};

/// What the motor and its controller can do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MotorConfig {
    /// Pulses of the encoder per turn; four increments (counts) each.
    pub encoder_pulses: u32,
    /// Bandwidth of the closed position loop, Hz. Its lag behind a ramp is the ramp divided by pi
    /// times this.
    pub bandwidth_hz: f64,
    /// Acceleration per current, counts per second squared and mA.
    pub acceleration_per_ma: f64,
    /// Current that overcomes friction, mA.
    pub friction_ma: f64,
    /// Hard stops, counts from where the motor stood at the start of the emulator: it cannot pass
    /// them.
    pub stops: [f64; 2],
}

impl Default for MotorConfig {
    /// Close to a maxon DCX 8 M with a gearhead: 0.9 mNm at 300 mA on 3e-9 kg m2, a third of it
    /// left by the gear.
    fn default() -> Self {
        Self {
            encoder_pulses: 256,
            bandwidth_hz: 60.0,
            acceleration_per_ma: 33_000.0,
            friction_ma: 2.0,
            stops: [-100_000.0, 100_000.0],
        }
    }
}

impl MotorConfig {
    /// Counts per turn of the motor.
    #[must_use]
    pub fn counts_per_turn(&self) -> f64 {
        4.0 * f64::from(self.encoder_pulses)
    }
}

/// What the drive allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Output current, mA (object 0x3001:02).
    pub current_ma: f64,
    /// Speed, counts per second (object 0x6080).
    pub speed: f64,
}

/// The motor. Positions are true ones: fractional, from where the motor stood at the start of the
/// emulator.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Motor {
    /// Counts.
    pub position: f64,
    /// Counts per second.
    pub velocity: f64,
    /// mA.
    pub current_ma: f64,
    /// The last step met a limit.
    pub limited: bool,
}

/// Speeds below this are standing still, counts per second.
const STANDSTILL: f64 = 20.0;

impl Motor {
    /// Whether it stands.
    #[must_use]
    pub fn stands(&self) -> bool {
        self.velocity.abs() < STANDSTILL
    }

    /// One step under the position controller (proportional and derivative, critically damped),
    /// friction by Coulomb.
    pub fn follow(&mut self, config: &MotorConfig, demand: f64, limits: Limits, dt_s: f64) {
        let rate = std::f64::consts::TAU * config.bandwidth_hz;
        let wanted = rate * rate * (demand - self.position) - 2.0 * rate * self.velocity;
        self.push(config, wanted / config.acceleration_per_ma, limits, dt_s);
    }

    /// One step under a given current.
    pub fn push(&mut self, config: &MotorConfig, wanted_ma: f64, limits: Limits, dt_s: f64) {
        self.current_ma = wanted_ma.clamp(-limits.current_ma, limits.current_ma);
        let velocity = self.velocity;
        self.advance(config, dt_s);
        self.limited = self.current_ma != wanted_ma || self.velocity.abs() > limits.speed;
        self.velocity = self.velocity.clamp(-limits.speed, limits.speed);
        self.position += 0.5 * (velocity + self.velocity) * dt_s;
        self.meet_stops(config);
    }

    /// One step without power: friction brakes, the gear does not let the wires pull it back.
    pub fn coast(&mut self, config: &MotorConfig, dt_s: f64) {
        self.current_ma = 0.0;
        self.limited = false;
        let velocity = self.velocity;
        self.advance(config, dt_s);
        self.position += 0.5 * (velocity + self.velocity) * dt_s;
        self.meet_stops(config);
    }

    fn meet_stops(&mut self, config: &MotorConfig) {
        let [low, high] = config.stops;
        if self.position < low || self.position > high {
            self.position = self.position.clamp(low, high);
            self.velocity = 0.0;
        }
    }

    fn advance(&mut self, config: &MotorConfig, dt_s: f64) {
        let driven = self.velocity + self.current_ma * config.acceleration_per_ma * dt_s;
        let braked = config.friction_ma * config.acceleration_per_ma * dt_s;
        self.velocity = if driven.abs() <= braked {
            0.0
        } else {
            driven - braked.copysign(driven)
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits {
        current_ma: 300.0,
        speed: 50_000.0,
    };

    fn run(motor: &mut Motor, limits: Limits, seconds: f64, demand: impl Fn(f64) -> f64) -> f64 {
        let dt_s = 0.0005;
        let mut top = 0.0f64;
        for step in 0..(seconds / dt_s) as usize {
            motor.follow(
                &MotorConfig::default(),
                demand(step as f64 * dt_s),
                limits,
                dt_s,
            );
            top = top.max(motor.velocity.abs());
        }
        top
    }

    #[test]
    fn settles_within_a_count_and_does_not_overshoot_far() {
        let mut motor = Motor::default();
        run(&mut motor, LIMITS, 0.2, |_| 200.0);
        assert!(
            (motor.position - 200.0).abs() < 1.0 && motor.stands(),
            "{motor:?}"
        );
    }

    #[test]
    fn lags_behind_a_ramp_by_the_bandwidth() {
        let mut motor = Motor::default();
        run(&mut motor, LIMITS, 0.5, |time| 1000.0 * time);
        let lag = 500.0 - motor.position;
        assert!((4.0..8.0).contains(&lag), "{lag}");
    }

    #[test]
    fn keeps_to_speed_and_current() {
        let top = run(
            &mut Motor::default(),
            Limits {
                speed: 1000.0,
                ..LIMITS
            },
            0.1,
            |_| 5000.0,
        );
        assert!(top <= 1000.0);
        let mut weak = Motor::default();
        run(
            &mut weak,
            Limits {
                current_ma: 1.0,
                ..LIMITS
            },
            0.2,
            |_| 500.0,
        );
        assert_eq!(weak.position, 0.0, "1 mA does not overcome the friction");
    }

    #[test]
    fn a_stop_ends_the_way_and_costs_current() {
        let config = MotorConfig {
            stops: [-100.0, 100.0],
            ..MotorConfig::default()
        };
        let mut motor = Motor::default();
        (0..400).for_each(|_| motor.follow(&config, 300.0, LIMITS, 0.0005));
        assert_eq!((motor.position, motor.velocity), (100.0, 0.0));
        assert!(motor.current_ma > 100.0, "{motor:?}");
    }

    #[test]
    fn coasts_to_a_stand() {
        let mut motor = Motor {
            velocity: 2000.0,
            ..Motor::default()
        };
        (0..400).for_each(|_| motor.coast(&MotorConfig::default(), 0.0005));
        assert!(motor.velocity == 0.0 && motor.position > 5.0);
    }
}
