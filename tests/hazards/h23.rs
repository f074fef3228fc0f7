//! H23: the adaptation fights the operator.

use super::drifting::{Drifting, ON, shift, truth, wandering};

/// A camera that sees a zero that is off.
fn slipped(_: f64, [pitch, yaw]: [f64; 2]) -> [f64; 2] {
    [pitch + 0.8, yaw - 0.7]
}

#[test]
fn h23_the_correction_never_turns_a_motor_against_the_goal_and_keeps_its_limit() {
    for sign in [1.0, -1.0] {
        let mut drifting = Drifting::new(ON);
        drifting.follow(20.0, wandering, truth);
        let start = drifting.time_s;
        drifting.follow(2.0, move |t| wandering(t.min(start)), truth);
        let from = wandering(start);
        // Both motors in one direction: pitch moves both of them up or down.
        let ramp = move |t: f64| {
            let travel = 1.5 * (t - start - 2.0).clamp(0.0, 8.0);
            [from[0] - sign * travel, from[1]]
        };
        let mut before = drifting.bench.targets();
        let (mut turned, mut applied) = (0, drifting.adaptation().applied);
        for _ in 0..1600 {
            drifting.follow(5e-3, ramp, slipped);
            let now = drifting.bench.targets();
            for (now, before) in now.iter().zip(before) {
                // One count is rounding.
                let back = (now - before) * sign as i32;
                turned += if back > 1 { back } else { 0 };
            }
            before = now;
            let next = drifting.adaptation().applied;
            let pose = ramp(drifting.time_s);
            let (to, from) = (shift(&next, pose), shift(&applied, pose));
            let step = (to[0] - from[0]).hypot(to[1] - from[1]);
            // The limit is 1 deg/s.
            assert!(step <= 1.05 * 5e-3, "{step}");
            applied = next;
        }
        // Where the ramp begins, a motor makes way for the other one: a gap has 60.
        assert!(turned <= 6, "{turned} counts");
    }
}
