//! H20: the robot adapts to a contact.

use i2ris::core::adaptation::AdaptationEvent;

use super::drifting::{Drifting, ON, truth, wandering};

#[test]
fn h20_a_push_of_two_degrees_is_not_learned_and_leaves_nothing_behind() {
    let mut drifting = Drifting::new(ON);
    drifting.follow(20.0, wandering, truth);
    let before = drifting.adaptation();
    drifting.follow(30.0, wandering, |_, [pitch, yaw]| [pitch + 1.4, yaw - 1.4]);
    assert!(drifting.has(AdaptationEvent::CameraDisbelieved));
    assert!(drifting.adaptation().frames.refused > before.frames.refused + 500);
    for pose in [[0.0, 0.0], [8.0, -8.0], [-8.0, -8.0]] {
        let shift = drifting.shift(pose);
        assert!(shift < 0.2, "{shift} deg at {pose:?}");
    }
    drifting.follow(10.0, wandering, truth);
    assert!(drifting.has(AdaptationEvent::CameraBelieved));
    assert!(drifting.shift([8.0, 8.0]) < 0.2);
}

#[test]
fn h20_a_push_too_slow_to_be_told_from_drift_is_bounded_by_the_budget_and_said() {
    let mut drifting = Drifting::new(ON);
    drifting.follow(20.0, wandering, truth);
    let start = drifting.time_s;
    drifting.follow(120.0, wandering, |t, [pitch, yaw]| [pitch + 0.05 * (t - start), yaw]);
    assert!(drifting.has(AdaptationEvent::BudgetWarning));
    assert!(drifting.has(AdaptationEvent::BudgetUsed));
    let budget = 3.0;
    let zero = drifting.adaptation().applied.zero[0].to_degrees();
    assert!((0.9 * budget..=budget + 1e-6).contains(&zero), "{zero}");
    let learned = drifting.adaptation().frames.used;
    drifting.follow(10.0, wandering, |_, pose| pose);
    assert_eq!(drifting.adaptation().frames.used, learned);
}
