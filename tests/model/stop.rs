//! Properties of stop operators with friction and slack.

use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::stop::{StopState, Stops};
use nalgebra::SVector;
use proptest::prelude::*;

use i2ris_testing::families::{some_stops, stops};

/// Half the range of the motions.
const REACH: f64 = 1200.0;

/// Turning points of a motion.
fn turning_points() -> impl Strategy<Value = Vec<[f64; 2]>> {
    prop::collection::vec(prop::array::uniform2(-REACH..REACH), 1..6)
}

fn to_vector<const D: usize>(counts: [f64; 2]) -> SVector<f64, D> {
    SVector::from_fn(|i, _| counts[i])
}

/// Advances the operator in steps of at most `step` counts per motor.
fn move_to<const D: usize>(
    operator: &Stops<D>,
    state: &mut StopState,
    from: [f64; 2],
    to: [f64; 2],
    step: f64,
) {
    let (from, to) = (to_vector::<D>(from), to_vector::<D>(to));
    let steps = ((to - from).amax() / step).ceil().max(1.0) as u32;
    for i in 1..=steps {
        operator.advance(state, &(from + (to - from) * (f64::from(i) / f64::from(steps))));
    }
}

fn state_after<const D: usize>(
    operator: &Stops<D>,
    turning_points: &[[f64; 2]],
    step: f64,
) -> StopState {
    let mut state = operator.begin(&to_vector([0.0, 0.0]));
    let mut at = [0.0, 0.0];
    for turn in turning_points {
        move_to(operator, &mut state, at, *turn, step);
        at = *turn;
    }
    state
}

fn mean<const D: usize>(operator: &Stops<D>, state: &StopState, at: [f64; 2]) -> SVector<f64, D> {
    operator.local(state, &to_vector(at)).mean
}

proptest! {
    #![proptest_config(i2ris_testing::cases(32))]

    /// Without load-dependent friction, stiffening and slack, the loop between two turning points
    /// has the same shape everywhere.
    #[test]
    fn minor_loops_without_load_are_congruent(
        low in -400.0..0.0_f64,
        width in 5.0..300.0_f64,
        first in turning_points(),
        second in turning_points(),
        part in 0.0..1.0_f64,
    ) {
        let mut file = some_stops(1);
        file.motors[0].friction = [0.0; 2];
        file.motors[0].slack = [0.0; 2];
        file.segments[0].axes[0].stiffening = 0.0;
        file.segments[0].axes[0].limit = 1000.0;
        file.softness = 1e3;
        let operator = Stops::<1>::prepare(&file).unwrap();
        let (low, high, between) = ([low, 0.0], [low + width, 0.0], [low + part * width, 0.0]);
        let rise = |past: &[[f64; 2]]| {
            let state = state_after(&operator, &[past, &[low, high, low]].concat(), 5.0);
            mean(&operator, &state, between) - mean(&operator, &state, low)
        };
        prop_assert!((rise(&first) - rise(&second)).amax() < 1e-6);
    }

    #[test]
    fn lags_are_finite_for_every_finite_position(
        file in stops(2),
        turning_points in prop::collection::vec(prop::array::uniform2(-2e9..2e9_f64), 1..8),
    ) {
        let operator = Stops::<2>::prepare(&file).unwrap();
        let mut state = operator.begin(&to_vector([0.0, 0.0]));
        for turn in turning_points {
            operator.advance(&mut state, &to_vector(turn));
            prop_assert!(operator.lags(&state).as_slice().iter().all(|lag| lag.is_finite()));
        }
    }
}

#[test]
fn virtual_counts_have_a_mean_slope_near_one() {
    for axes in [[38.0, 135.0], [45.0, -45.0], [120.0, 200.0]] {
        let mut file = some_stops(2);
        for (motor, axis) in file.motors.iter_mut().zip(axes) {
            motor.axis_deg = axis;
        }
        let operator = Stops::<2>::prepare(&file).unwrap();
        let ends = [[-600.0, 0.0], [600.0, 0.0]]
            .map(|at| mean(&operator, &state_after(&operator, &[[-900.0, 0.0], at], 5.0), at));
        let slope = (ends[1][0] - ends[0][0]) / 1200.0;
        assert!((0.7..1.1).contains(&slope), "{slope} at {axes:?}");
    }
}

#[test]
fn stops_of_another_number_of_motors_are_refused() {
    assert!(Stops::<1>::prepare(&some_stops(2)).is_err(), "two motors are not one");
    let mut shared = some_stops(1);
    shared.shared = 0.2;
    assert!(Stops::<1>::prepare(&shared).is_err(), "a single motor shares with none");
}
