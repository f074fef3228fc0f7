//! The demand that moves: trapezoidal profiles and ramps.

/// Speed and accelerations of a movement, counts and seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// Top speed.
    pub speed: f64,
    /// While getting faster.
    pub acceleration: f64,
    /// While getting slower.
    pub deceleration: f64,
}

/// A demand with a speed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Demand {
    /// Counts.
    pub position: f64,
    /// Counts per second.
    pub velocity: f64,
}

impl Demand {
    /// One step towards a target at rest; true when there.
    pub fn approach(&mut self, target: f64, pace: Pace, dt_s: f64) -> bool {
        let way = target - self.position;
        let braking = (2.0 * pace.deceleration * way.abs()).sqrt();
        let wanted = braking.min(pace.speed).copysign(way);
        self.change_speed(wanted, pace, dt_s);
        let next = self.position + self.velocity * dt_s;
        let slow = self.velocity.abs() <= 2.0 * pace.deceleration * dt_s;
        if (target - next) * way <= 0.0 && slow {
            *self = Self {
                position: target,
                velocity: 0.0,
            };
            return true;
        }
        self.position = next;
        false
    }

    /// One step at a speed.
    pub fn run(&mut self, speed: f64, pace: Pace, dt_s: f64) {
        self.change_speed(speed.clamp(-pace.speed, pace.speed), pace, dt_s);
        self.position += self.velocity * dt_s;
    }

    /// One step of braking; true when standing.
    pub fn brake(&mut self, deceleration: f64, dt_s: f64) -> bool {
        let pace = Pace {
            speed: f64::MAX,
            acceleration: deceleration,
            deceleration,
        };
        self.run(0.0, pace, dt_s);
        self.velocity == 0.0
    }

    fn change_speed(&mut self, wanted: f64, pace: Pace, dt_s: f64) {
        let slower = wanted * self.velocity <= 0.0 || wanted.abs() < self.velocity.abs();
        let most = dt_s
            * if slower && self.velocity != 0.0 {
                pace.deceleration
            } else {
                pace.acceleration
            };
        self.velocity += (wanted - self.velocity).clamp(-most, most);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_profile_arrives_within_its_limits(target in -5000.0..5000.0f64, start in -3000.0..3000.0f64) {
            let pace = Pace { speed: 2000.0, acceleration: 20_000.0, deceleration: 30_000.0 };
            let mut demand = Demand { position: 0.0, velocity: start.clamp(-2000.0, 2000.0) };
            let dt_s = 0.0005;
            let mut arrived = false;
            for _ in 0..20_000 {
                let before = demand;
                arrived = demand.approach(target, pace, dt_s);
                prop_assert!(demand.velocity.abs() <= 2000.0 + 1e-9);
                // The very last step ends on the target and may stop from a little more than one
                // step of braking.
                prop_assert!((demand.velocity - before.velocity).abs() <= 3.0 * 30_000.0 * dt_s + 1e-9);
                if arrived {
                    break;
                }
            }
            prop_assert!(arrived && demand.position == target, "{:?}", demand);
        }
    }

    #[test]
    fn braking_takes_the_way_that_physics_says() {
        let mut demand = Demand {
            position: 0.0,
            velocity: 2000.0,
        };
        while !demand.brake(100_000.0, 1e-5) {}
        assert!((demand.position - 20.0).abs() < 0.1, "{demand:?}");
    }
}
