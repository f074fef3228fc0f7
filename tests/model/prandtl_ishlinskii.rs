//! A generalised play operator by hand.

use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::prandtl_ishlinskii::{
    PlayParameters, PrandtlIshlinskii, PrandtlIshlinskiiParameters,
};
use i2ris_testing::families::REACH;
use nalgebra::SVector;

#[test]
fn a_play_whose_width_grows_follows_later_at_the_end_of_the_range() {
    let file = PrandtlIshlinskiiParameters {
        centre_counts: vec![0.0],
        direct_weights: vec![0.1],
        plays: vec![PlayParameters {
            direction: vec![1.0],
            threshold_counts: 10.0,
            growth: [0.1, 0.0],
            weight: vec![0.9],
        }],
    };
    let operator = PrandtlIshlinskii::<1>::prepare(&file).unwrap();
    let mut state = operator.begin(&SVector::from([-REACH]));
    // The half-width is 10 counts at the centre and 30 counts at 200 counts.
    for (to, virtual_counts) in [
        (0.0, -9.0),
        (200.0, 20.0 + 0.9 * 170.0),
        (150.0, 15.0 + 0.9 * 170.0),
        (100.0, 10.0 + 0.9 * 120.0),
    ] {
        let to = SVector::from([to]);
        operator.advance(&mut state, &to);
        let found = operator.local(&state, &to).mean[0];
        assert!((found - virtual_counts).abs() < 1e-9, "{found} at {to}");
    }
}
