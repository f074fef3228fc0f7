//! H07: a goal outside the calibrated hull is clipped to it and reported.

use i2ris::ipc::Refusal;

use crate::bench::{Bench, GAIN_DEG, HULL};

#[test]
fn h07_a_goal_outside_the_hull_is_clipped_and_reported() {
    let mut bench = Bench::enabled();
    let edge = 2.0 * GAIN_DEG * HULL;
    for k in 0..=400 {
        let pitch = (f64::from(k) * 0.1).min(edge + 5.0);
        assert_eq!(bench.joint(pitch, 0.0), Refusal::None);
        bench.run(9);
        let targets = bench.targets();
        assert!(targets.iter().all(|target| f64::from(*target) <= HULL), "{targets:?}");
        assert_eq!(bench.report().clipped, pitch > edge, "{pitch}");
    }
    assert!((bench.joints().goal[0].to_degrees() - edge).abs() < 1e-6);
}
