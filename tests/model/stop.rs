//! Stop operators: what friction and slack must do, whatever the parameters.

use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::stop::{StopElement, StopParameters, StopState, Stops};
use nalgebra::SVector;
use proptest::prelude::*;

use super::samples::{some_stops, stops};

/// Half the range of the motions.
const REACH: f64 = 1200.0;

/// Turning points of a motion.
fn turns() -> impl Strategy<Value = Vec<[f64; 2]>> {
    prop::collection::vec(prop::array::uniform2(-REACH..REACH), 1..6)
}

fn cut<const D: usize>(counts: [f64; 2]) -> SVector<f64, D> {
    SVector::from_fn(|i, _| counts[i])
}

/// In steps of at most `step` counts per motor.
fn go<const D: usize>(
    operator: &Stops<D>,
    state: &mut StopState,
    from: [f64; 2],
    to: [f64; 2],
    step: f64,
) {
    let (from, to) = (cut::<D>(from), cut::<D>(to));
    let steps = ((to - from).amax() / step).ceil().max(1.0) as u32;
    for i in 1..=steps {
        operator.advance(
            state,
            &(from + (to - from) * (f64::from(i) / f64::from(steps))),
        );
    }
}

fn walk<const D: usize>(operator: &Stops<D>, turns: &[[f64; 2]], step: f64) -> StopState {
    let mut state = operator.begin(&cut([0.0, 0.0]));
    let mut at = [0.0, 0.0];
    for turn in turns {
        go(operator, &mut state, at, *turn, step);
        at = *turn;
    }
    state
}

fn mean<const D: usize>(operator: &Stops<D>, state: &StopState, at: [f64; 2]) -> SVector<f64, D> {
    operator.local(state, &cut(at)).mean
}

fn inverse_leads_back<const D: usize>(file: &StopParameters, turns: &[[f64; 2]], to: [f64; 2]) {
    let operator = Stops::<D>::prepare(file).unwrap();
    let state = walk(&operator, turns, 10.0);
    let back = operator.invert(&state, &mean(&operator, &state, to), 1.0);
    assert!((back - cut::<D>(to)).amax() < 1e-3, "{back:?} for {to:?}");
}

fn slope_is_the_slope<const D: usize>(file: &StopParameters, turns: &[[f64; 2]], to: [f64; 2]) {
    let operator = Stops::<D>::prepare(file).unwrap();
    let state = walk(&operator, turns, 10.0);
    let local = operator.local(&state, &cut(to));
    for motor in 0..D {
        let (mut above, mut below) = (to, to);
        above[motor] += 1e-3;
        below[motor] -= 1e-3;
        let found = [above, to, below].map(|at| mean::<D>(&operator, &state, at));
        let (right, left) = ((found[0] - found[1]) / 1e-3, (found[1] - found[2]) / 1e-3);
        // Where a stop begins to slip, the slope is one-sided.
        let error = (0.5 * (left + right) - local.jacobian.column(motor)).amax();
        assert!(
            error <= (right - left).amax() + 1e-4,
            "{error}: {left} {right} {}",
            local.jacobian
        );
    }
    let at = |row: usize, column: usize| local.jacobian[(row.min(D - 1), column.min(D - 1))];
    let determinant = if D == 1 {
        at(0, 0)
    } else {
        at(0, 0) * at(1, 1) - at(0, 1) * at(1, 0)
    };
    let minors = [at(0, 0), at(1, 1), determinant];
    assert!(minors.iter().all(|minor| *minor > 0.0), "{minors:?}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn the_inverse_of_a_prediction_is_where_it_was_made(
        one in stops(1),
        two in stops(2),
        turns in turns(),
        to in prop::array::uniform2(-REACH..REACH),
    ) {
        inverse_leads_back::<1>(&one, &turns, to);
        inverse_leads_back::<2>(&two, &turns, to);
    }

    #[test]
    fn the_jacobian_is_the_slope_and_every_motor_pushes_forwards(
        one in stops(1),
        two in stops(2),
        turns in turns(),
        to in prop::array::uniform2(-REACH..REACH),
    ) {
        slope_is_the_slope::<1>(&one, &turns, to);
        slope_is_the_slope::<2>(&two, &turns, to);
    }

    #[test]
    fn a_motor_that_goes_further_bends_further(
        file in stops(1),
        turns in turns(),
        to in -REACH..REACH,
        more in 0.0..9.0,
    ) {
        let operator = Stops::<1>::prepare(&file).unwrap();
        let state = walk(&operator, &turns, 10.0);
        let [near, far] = [to, to + more].map(|at| mean(&operator, &state, [at, 0.0])[0]);
        prop_assert!(near <= far + 1e-9);
    }

    #[test]
    fn a_step_of_a_tick_is_what_the_prediction_of_it_was(
        file in stops(2), turns in turns(), to in prop::array::uniform2(-4.0..4.0),
    ) {
        let operator = Stops::<2>::prepare(&file).unwrap();
        let mut state = walk(&operator, &turns, 10.0);
        let at = turns.last().map_or([0.0; 2], |last| [last[0] + to[0], last[1] + to[1]]);
        let predicted = mean(&operator, &state, at);
        operator.advance(&mut state, &cut(at));
        let reached = mean(&operator, &state, at);
        // The forces of the step itself widen or narrow the stops a little.
        prop_assert!((predicted - reached).amax() < 2.0, "{predicted} {reached}");
    }

    #[test]
    fn motion_over_the_range_that_wipes_out_leaves_nothing_of_the_past(
        file in stops(2), first in turns(), second in turns(),
    ) {
        let operator = Stops::<2>::prepare(&file).unwrap();
        let [a, b] = operator.wipe_counts();
        let forget = [[-a / 2.0, b / 2.0], [a / 2.0, b / 2.0], [a / 2.0, -b / 2.0], [0.0, 0.0]];
        let run = |turns: &[[f64; 2]]| walk(&operator, &[turns, &forget].concat(), 10.0);
        let apart = mean(&operator, &run(&first), [0.0, 0.0]) - mean(
            &operator,
            &run(&second),
            [0.0, 0.0],
        );
        prop_assert!(apart.amax() < 0.5, "{apart}");
    }

    #[test]
    fn how_fast_it_goes_hardly_matters(file in stops(2), turns in turns()) {
        let operator = Stops::<2>::prepare(&file).unwrap();
        let at = *turns.last().unwrap();
        let [slow, fast] =
            [2.0, 8.0].map(|step| mean(&operator, &walk(&operator, &turns, step), at));
        prop_assert!((slow - fast).amax() < 6.0, "{slow} {fast}");
    }

    /// With friction that does not depend on the load, a straight spring and no slack, the loop
    /// between two turning points has one shape, wherever it lies.
    #[test]
    fn without_load_minor_loops_are_congruent(
        low in -400.0..0.0_f64,
        width in 5.0..300.0_f64,
        first in turns(),
        second in turns(),
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
            let state = walk(&operator, &[past, &[low, high, low]].concat(), 5.0);
            mean(&operator, &state, between) - mean(&operator, &state, low)
        };
        prop_assert!((rise(&first) - rise(&second)).amax() < 1e-6);
    }

    #[test]
    fn compensation_goes_from_no_memory_to_all_of_it(
        file in stops(2),
        turns in turns(),
        part in 0.0..1.0_f64,
    ) {
        let operator = Stops::<2>::prepare(&file).unwrap();
        let at = *turns.last().unwrap();
        let goal = cut::<2>(at) * 0.9;
        let states = [walk(&operator, &turns, 10.0), operator.begin(&cut([0.0, 0.0]))];
        let none = states.map(|state| operator.invert(&state, &goal, 0.0));
        prop_assert!((none[0] - none[1]).amax() < 1e-9, "without memory the past does not count");
        let full = operator.invert(&states[0], &goal, 1.0);
        let some = operator.invert(&states[0], &goal, part);
        prop_assert!((some - (none[0] + (full - none[0]) * part)).amax() < 1e-6);
    }

    #[test]
    fn whatever_happens_everything_stays_finite(
        file in stops(2),
        turns in prop::collection::vec(prop::array::uniform2(-2e9..2e9_f64), 1..8),
    ) {
        let operator = Stops::<2>::prepare(&file).unwrap();
        let mut state = operator.begin(&cut([0.0, 0.0]));
        for turn in turns {
            operator.advance(&mut state, &cut(turn));
            let local = operator.local(&state, &cut([-turn[1], turn[0]]));
            let counts = operator.invert(&state, &cut(turn), 1.0);
            let all = local.mean.iter().chain(&local.jacobian).chain(&counts);
            let lags = operator.lags(&state);
            prop_assert!(all.chain(lags.as_slice()).copied().all(f64::is_finite));
        }
    }
}

#[test]
fn virtual_counts_are_counts_on_the_whole() {
    for axes in [[38.0, 135.0], [45.0, -45.0], [120.0, 200.0]] {
        let mut file = some_stops(2);
        file.motors
            .iter_mut()
            .zip(axes)
            .for_each(|(motor, axis)| motor.axis_deg = axis);
        let operator = Stops::<2>::prepare(&file).unwrap();
        let ends = [[-600.0, 0.0], [600.0, 0.0]]
            .map(|at| mean(&operator, &walk(&operator, &[[-900.0, 0.0], at], 5.0), at));
        let slope = (ends[1][0] - ends[0][0]) / 1200.0;
        assert!((0.7..1.1).contains(&slope), "{slope} at {axes:?}");
    }
}

#[test]
fn the_way_back_is_another_way() {
    let operator = Stops::<1>::prepare(&some_stops(1)).unwrap();
    let from = |turn: f64| {
        mean(
            &operator,
            &walk(&operator, &[[turn, 0.0], [300.0, 0.0]], 5.0),
            [300.0, 0.0],
        )[0]
    };
    let loop_counts = from(1000.0) - from(-1000.0);
    assert!((20.0..400.0).contains(&loop_counts), "{loop_counts}");
}

#[test]
fn a_file_that_makes_no_sense_is_refused() {
    type Spoil = fn(&mut StopParameters);
    let spoil: [(&str, Spoil); 12] = [
        ("softness", |file| file.softness = 0.0),
        ("loose_stiffness", |file| file.loose_stiffness = 0.0),
        ("base_friction", |file| file.base_friction = f64::NAN),
        ("shared", |file| file.shared = 1.5),
        ("stops.share", |file| file.stops[0].share = 0.9),
        ("stops:", |file| file.stops.clear()),
        ("stops =", |file| {
            file.stops = vec![
                StopElement {
                    stiffness: 1.0,
                    share: 1.0 / 6.0
                };
                6
            ]
        }),
        ("segments:", |file| file.segments.clear()),
        ("segments[0].axes", |file| file.segments[0].axes.truncate(1)),
        ("segments[0].friction", |file| {
            file.segments[0].friction = 0.0
        }),
        ("axis_deg", |file| {
            file.motors[1].axis_deg = file.motors[0].axis_deg + 179.0
        }),
        ("travel_per_count", |file| {
            file.motors[1].travel_per_count = -0.1
        }),
    ];
    for (field, spoil) in spoil {
        let mut file = some_stops(2);
        spoil(&mut file);
        let error = Stops::<2>::prepare(&file).unwrap_err().to_string();
        assert!(
            error.contains(field.trim_end_matches([':', '=', ' '])),
            "{field}: {error}"
        );
    }
    assert!(
        Stops::<1>::prepare(&some_stops(2)).is_err(),
        "two motors are not one"
    );
    let mut shared = some_stops(1);
    shared.shared = 0.2;
    assert!(
        Stops::<1>::prepare(&shared).is_err(),
        "a single motor shares with none"
    );
}
