//! The moving demand: trapezoidal profiles and ramps.

/// Limits of speed and acceleration, counts and seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfileLimits {
    pub speed: f64,
    pub acceleration: f64,
    pub deceleration: f64,
}

impl ProfileLimits {
    /// The same ramp for acceleration and deceleration.
    pub fn with_ramp(speed: f64, ramp: f64) -> Self {
        Self { speed, acceleration: ramp, deceleration: ramp }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Demand {
    pub position: f64,
    /// Counts per second.
    pub velocity: f64,
}

impl Demand {
    pub fn new(position: f64, velocity: f64) -> Self {
        Self { position, velocity }
    }

    /// Moves one step towards a target at rest. Returns true at the target.
    pub fn approach(&mut self, target: f64, limits: ProfileLimits, dt_s: f64) -> bool {
        let distance = target - self.position;
        let braking = (2.0 * limits.deceleration * distance.abs()).sqrt();
        self.change_speed(braking.min(limits.speed).copysign(distance), limits, dt_s);
        let next = self.position + self.velocity * dt_s;
        let slow = self.velocity.abs() <= 2.0 * limits.deceleration * dt_s;
        if (target - next) * distance <= 0.0 && slow {
            *self = Self::new(target, 0.0);
            return true;
        }
        self.position = next;
        false
    }

    /// Moves one step at a speed.
    pub fn run(&mut self, speed: f64, limits: ProfileLimits, dt_s: f64) {
        self.change_speed(speed.clamp(-limits.speed, limits.speed), limits, dt_s);
        self.position += self.velocity * dt_s;
    }

    /// Brakes for one step. Returns true at standstill.
    pub fn brake(&mut self, deceleration: f64, dt_s: f64) -> bool {
        self.run(0.0, ProfileLimits::with_ramp(f64::MAX, deceleration), dt_s);
        self.velocity == 0.0
    }

    fn change_speed(&mut self, target: f64, limits: ProfileLimits, dt_s: f64) {
        let slower = target * self.velocity <= 0.0 || target.abs() < self.velocity.abs();
        let brakes = slower && self.velocity != 0.0;
        let ramp = if brakes { limits.deceleration } else { limits.acceleration };
        let most = dt_s * ramp;
        self.velocity += (target - self.velocity).clamp(-most, most);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_profile_reaches_its_target_within_its_limits(
            target in -5000.0..5000.0f64,
            start in -3000.0..3000.0f64,
        ) {
            let ramp = 30_000.0;
            let limits = ProfileLimits::with_ramp(2000.0, ramp);
            let limits = ProfileLimits { acceleration: 20_000.0, ..limits };
            let mut demand = Demand::new(0.0, start.clamp(-2000.0, 2000.0));
            let dt_s = 0.0005;
            let mut arrived = false;
            for _ in 0..20_000 {
                let before = demand;
                arrived = demand.approach(target, limits, dt_s);
                prop_assert!(demand.velocity.abs() <= 2000.0 + 1e-9);
                // The last step ends on the target and may brake by a little more than one step.
                let change = (demand.velocity - before.velocity).abs();
                prop_assert!(change <= 3.0 * ramp * dt_s + 1e-9);
                if arrived {
                    break;
                }
            }
            prop_assert!(arrived && demand.position == target, "{:?}", demand);
        }
    }

    #[test]
    fn the_braking_distance_is_the_physical_one() {
        let mut demand = Demand::new(0.0, 2000.0);
        while !demand.brake(100_000.0, 1e-5) {}
        assert!((demand.position - 20.0).abs() < 0.1, "{demand:?}");
    }
}
