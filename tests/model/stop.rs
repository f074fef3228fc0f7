//! Properties of stop operators with friction and slack, for all valid parameters.

use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::stop::{StopElement, StopParameters, StopState, Stops};
use nalgebra::SVector;
use proptest::prelude::*;

use super::samples::{some_stops, stops};

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

fn check_inverse<const D: usize>(file: &StopParameters, turning_points: &[[f64; 2]], to: [f64; 2]) {
    let operator = Stops::<D>::prepare(file).unwrap();
    let state = state_after(&operator, turning_points, 10.0);
    let back = operator.invert(&state, &mean(&operator, &state, to), 1.0);
    assert!((back - to_vector::<D>(to)).amax() < 1e-3, "{back:?} for {to:?}");
}

fn check_jacobian<const D: usize>(
    file: &StopParameters,
    turning_points: &[[f64; 2]],
    to: [f64; 2],
) {
    let operator = Stops::<D>::prepare(file).unwrap();
    let state = state_after(&operator, turning_points, 10.0);
    let local = operator.local(&state, &to_vector(to));
    for motor in 0..D {
        let (mut above, mut below) = (to, to);
        above[motor] += 1e-3;
        below[motor] -= 1e-3;
        let found = [above, to, below].map(|at| mean::<D>(&operator, &state, at));
        let (right, left) = ((found[0] - found[1]) / 1e-3, (found[1] - found[2]) / 1e-3);
        // When a stop begins to slip, the slope is one-sided.
        let error = (0.5 * (left + right) - local.jacobian.column(motor)).amax();
        assert!(
            error <= (right - left).amax() + 1e-4,
            "{error}: {left} {right} {}",
            local.jacobian
        );
    }
    let at = |row: usize, column: usize| local.jacobian[(row.min(D - 1), column.min(D - 1))];
    let determinant = if D == 1 { at(0, 0) } else { at(0, 0) * at(1, 1) - at(0, 1) * at(1, 0) };
    let minors = [at(0, 0), at(1, 1), determinant];
    assert!(minors.iter().all(|minor| *minor > 0.0), "{minors:?}");
}

proptest! {
    #![proptest_config(i2ris_testing::cases(32))]

    #[test]
    fn inverse_recovers_the_counts(
        one in stops(1),
        two in stops(2),
        turning_points in turning_points(),
        to in prop::array::uniform2(-REACH..REACH),
    ) {
        check_inverse::<1>(&one, &turning_points, to);
        check_inverse::<2>(&two, &turning_points, to);
    }

    #[test]
    fn jacobian_matches_the_numerical_derivative_and_has_positive_minors(
        one in stops(1),
        two in stops(2),
        turning_points in turning_points(),
        to in prop::array::uniform2(-REACH..REACH),
    ) {
        check_jacobian::<1>(&one, &turning_points, to);
        check_jacobian::<2>(&two, &turning_points, to);
    }

    #[test]
    fn virtual_counts_increase_with_the_counts(
        file in stops(1),
        turning_points in turning_points(),
        to in -REACH..REACH,
        more in 0.0..9.0,
    ) {
        let operator = Stops::<1>::prepare(&file).unwrap();
        let state = state_after(&operator, &turning_points, 10.0);
        let [near, far] = [to, to + more].map(|at| mean(&operator, &state, [at, 0.0])[0]);
        prop_assert!(near <= far + 1e-9);
    }

    #[test]
    fn prediction_matches_the_state_after_a_tick(
        file in stops(2),
        turning_points in turning_points(),
        to in prop::array::uniform2(-4.0..4.0),
    ) {
        let operator = Stops::<2>::prepare(&file).unwrap();
        let mut state = state_after(&operator, &turning_points, 10.0);
        let at = turning_points.last().map_or([0.0; 2], |last| [last[0] + to[0], last[1] + to[1]]);
        let predicted = mean(&operator, &state, at);
        operator.advance(&mut state, &to_vector(at));
        let reached = mean(&operator, &state, at);
        // The forces of the step itself change the reach of the stops slightly.
        prop_assert!((predicted - reached).amax() < 2.0, "{predicted} {reached}");
    }

    #[test]
    fn motion_over_the_conditioning_range_forgets_the_past(
        file in stops(2), first in turning_points(), second in turning_points(),
    ) {
        let operator = Stops::<2>::prepare(&file).unwrap();
        let [a, b] = operator.wipe_counts();
        let conditioning =
            [[-a / 2.0, b / 2.0], [a / 2.0, b / 2.0], [a / 2.0, -b / 2.0], [0.0, 0.0]];
        let run = |past: &[[f64; 2]]| {
            let state = state_after(&operator, &[past, &conditioning].concat(), 10.0);
            mean(&operator, &state, [0.0, 0.0])
        };
        let difference = run(&first) - run(&second);
        prop_assert!(difference.amax() < 0.5, "{difference}");
    }

    #[test]
    fn step_size_has_little_effect(file in stops(2), turning_points in turning_points()) {
        let operator = Stops::<2>::prepare(&file).unwrap();
        let at = *turning_points.last().unwrap();
        let [slow, fast] =
            [2.0, 8.0].map(|step| {
                mean(&operator, &state_after(&operator, &turning_points, step), at)
            });
        prop_assert!((slow - fast).amax() < 6.0, "{slow} {fast}");
    }

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
    fn compensation_interpolates_linearly(
        file in stops(2),
        turning_points in turning_points(),
        part in 0.0..1.0_f64,
    ) {
        let operator = Stops::<2>::prepare(&file).unwrap();
        let at = *turning_points.last().unwrap();
        let goal = to_vector::<2>(at) * 0.9;
        let states = [
            state_after(&operator, &turning_points, 10.0),
            operator.begin(&to_vector([0.0, 0.0])),
        ];
        let none = states.map(|state| operator.invert(&state, &goal, 0.0));
        prop_assert!((none[0] - none[1]).amax() < 1e-9, "without memory the past does not count");
        let full = operator.invert(&states[0], &goal, 1.0);
        let some = operator.invert(&states[0], &goal, part);
        prop_assert!((some - (none[0] + (full - none[0]) * part)).amax() < 1e-6);
    }

    #[test]
    fn results_are_finite_for_every_finite_position(
        file in stops(2),
        turning_points in prop::collection::vec(prop::array::uniform2(-2e9..2e9_f64), 1..8),
    ) {
        let operator = Stops::<2>::prepare(&file).unwrap();
        let mut state = operator.begin(&to_vector([0.0, 0.0]));
        for turn in turning_points {
            operator.advance(&mut state, &to_vector(turn));
            let local = operator.local(&state, &to_vector([-turn[1], turn[0]]));
            let counts = operator.invert(&state, &to_vector(turn), 1.0);
            let all = local.mean.iter().chain(&local.jacobian).chain(&counts);
            let lags = operator.lags(&state);
            prop_assert!(all.chain(lags.as_slice()).copied().all(f64::is_finite));
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
fn forward_and_backward_motion_differ_by_the_hysteresis_loop() {
    let operator = Stops::<1>::prepare(&some_stops(1)).unwrap();
    let from = |turn: f64| {
        mean(&operator, &state_after(&operator, &[[turn, 0.0], [300.0, 0.0]], 5.0), [300.0, 0.0])[0]
    };
    let loop_counts = from(1000.0) - from(-1000.0);
    assert!((20.0..400.0).contains(&loop_counts), "{loop_counts}");
}

#[test]
fn invalid_parameters_are_refused() {
    type Change = fn(&mut StopParameters);
    let change: [(&str, Change); 12] = [
        ("softness", |file| file.softness = 0.0),
        ("loose_stiffness", |file| file.loose_stiffness = 0.0),
        ("base_friction", |file| file.base_friction = f64::NAN),
        ("shared", |file| file.shared = 1.5),
        ("stops.share", |file| file.stops[0].share = 0.9),
        ("stops:", |file| file.stops.clear()),
        ("stops =", |file| file.stops = vec![StopElement { stiffness: 1.0, share: 1.0 / 6.0 }; 6]),
        ("segments:", |file| file.segments.clear()),
        ("segments[0].axes", |file| file.segments[0].axes.truncate(1)),
        ("segments[0].friction", |file| file.segments[0].friction = 0.0),
        ("axis_deg", |file| file.motors[1].axis_deg = file.motors[0].axis_deg + 179.0),
        ("travel_per_count", |file| file.motors[1].travel_per_count = -0.1),
    ];
    for (field, change) in change {
        let mut file = some_stops(2);
        change(&mut file);
        let error = Stops::<2>::prepare(&file).unwrap_err().to_string();
        assert!(error.contains(field.trim_end_matches([':', '=', ' '])), "{field}: {error}");
    }
    assert!(Stops::<1>::prepare(&some_stops(2)).is_err(), "two motors are not one");
    let mut shared = some_stops(1);
    shared.shared = 0.2;
    assert!(Stops::<1>::prepare(&shared).is_err(), "a single motor shares with none");
}
