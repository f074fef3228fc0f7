//! H22: the robot adapts without excitation.

use i2ris::core::adaptation::{Drift, Pause};

use super::drifting::{Drifting, ON, wandering};

#[test]
fn h22_at_rest_nothing_is_learned() {
    let mut drifting = Drifting::new(ON);
    // From where the conditioning cycle left the snake.
    drifting.begin_anew();
    let rest = |t: f64| [1.0, 0.5].map(|angle| angle * (2.0 * t).min(1.0));
    drifting.follow(60.0, rest, |_, [pitch, yaw]| [pitch + 0.3, yaw + 0.2]);
    let found = drifting.adaptation();
    assert_eq!(found.estimate, Drift::default());
    assert!(found.pauses.contains(Pause::NoMotion));
}

#[test]
fn h22_a_parameter_that_the_motion_does_not_show_is_not_learned() {
    let mut drifting = Drifting::new(ON);
    // Up and down within 4 deg: too little for a gain; and yaw rests.
    let small = |t: f64| [2.0 * (1.5 * t).sin(), 0.0];
    drifting.follow(60.0, small, |_, [pitch, yaw]| [1.1 * pitch + 0.4, yaw]);
    let found = drifting.adaptation();
    assert!(found.estimate.zero[0].to_degrees() > 0.3, "{found:?}");
    assert_eq!(found.estimate.gain, [[0.0; 2]; 2]);
    drifting.follow(60.0, wandering, |_, [pitch, yaw]| [1.1 * pitch + 0.4, yaw]);
    let gain = drifting.adaptation().estimate.gain[0][0];
    assert!((0.07..0.13).contains(&gain), "{gain}");
}

#[test]
fn h22_without_reversals_the_gap_is_not_learned() {
    let mut drifting = Drifting::new(ON);
    // Slowly in one direction, after the conditioning cycle has set all gaps to a mixture of
    // branches.
    let ramp = |t: f64| [0.12 * t, 0.0];
    drifting.follow(60.0, ramp, |_, [pitch, yaw]| [pitch - 0.4, yaw]);
    let found = drifting.adaptation();
    assert_eq!(found.estimate.gap, [0.0; 2], "{found:?}");
}
