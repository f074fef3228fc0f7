//! Properties of the play operators of one motor.

use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::backlash_play::{PlayParameters, PlayState, Plays};
use nalgebra::SVector;
use proptest::collection::vec;
use proptest::prelude::*;

use super::plays::plays;
use super::samples::REACH;

fn operator(parameters: &PlayParameters) -> Plays<1> {
    Plays::prepare(parameters).unwrap()
}

fn state_after(operator: &Plays<1>, motion: &[f64]) -> PlayState {
    let mut state = operator.begin(&SVector::from([motion[0]]));
    for at in motion {
        operator.advance(&mut state, &SVector::from([*at]));
    }
    state
}

fn virtual_counts(operator: &Plays<1>, state: &PlayState, at: f64) -> f64 {
    operator.local(state, &SVector::from([at])).mean[0]
}

fn motion() -> impl Strategy<Value = Vec<f64>> {
    vec(-REACH..REACH, 1..10)
}

proptest! {
    #![proptest_config(i2ris_testing::cases(64))]

    /// A closed excursion leaves the state unchanged.
    #[test]
    fn a_closed_minor_loop_is_forgotten(
        p in plays(1, 0),
        w in motion(),
        to in -REACH..REACH,
        part in 0.0..1.0_f64,
    ) {
        let operator = operator(&p);
        let from = w[w.len() - 1];
        let inside = from + part * (to - from);
        let (without, with) = (
            [w.as_slice(), &[to]].concat(),
            [w.as_slice(), &[to, inside, to]].concat(),
        );
        let [without, with] = [without, with].map(|motion| state_after(&operator, &motion));
        for at in [-REACH, -77.0, 0.0, 200.0, REACH] {
            let difference =
                virtual_counts(&operator, &without, at) - virtual_counts(&operator, &with, at);
            prop_assert!(difference.abs() < 1e-9);
        }
    }

    /// Minor loops between the same counts have the same shape after every past.
    #[test]
    fn minor_loops_are_congruent(
        p in plays(1, 0),
        a in motion(),
        b in motion(),
        low in -REACH..0.0_f64,
        high in 0.0..REACH,
        part in 0.0..1.0_f64,
    ) {
        let operator = operator(&p);
        let rise = |motion: &[f64]| {
            let state = state_after(&operator, &[motion, &[low, high, low]].concat());
            let between = low + part * (high - low);
            virtual_counts(&operator, &state, between) - virtual_counts(&operator, &state, low)
        };
        prop_assert!((rise(&a) - rise(&b)).abs() < 1e-9);
    }

    /// Higher counts give higher virtual counts. The slope is at least the first weight and at most
    /// 1.
    #[test]
    fn virtual_counts_increase_with_the_counts(
        p in plays(1, 0),
        w in motion(),
        at in -REACH..REACH,
        by in 0.01..50.0_f64,
    ) {
        let operator = operator(&p);
        let state = state_after(&operator, &w);
        let rise =
            virtual_counts(&operator, &state, at + by) - virtual_counts(&operator, &state, at);
        prop_assert!(rise >= p.weights[0][0] * by - 1e-9 && rise <= by + 1e-9, "{rise} over {by}");
    }

    /// The inverse is exact, its slope is bounded, and its distance from the virtual counts is at
    /// most the widest threshold.
    #[test]
    fn inverse_of_the_plays_is_exact_and_bounded(
        p in plays(1, 0), w in motion(), goal in -REACH..REACH, by in 0.0..50.0_f64,
    ) {
        let operator = operator(&p);
        let state = state_after(&operator, &w);
        let inverse = |goal: f64| operator.invert(&state, &SVector::from([goal]), 1.0)[0];
        let found = inverse(goal);
        prop_assert!((virtual_counts(&operator, &state, found) - goal).abs() < 1e-6);
        let step = inverse(goal + by) - found;
        prop_assert!(step >= by - 1e-6 && step <= by / p.weights[0][0] + 1e-6, "{step} for {by}");
        let widest = p.thresholds_counts[0][p.thresholds_counts[0].len() - 1];
        prop_assert!((found - goal).abs() <= widest + 1e-6, "{found} for {goal}, gap {widest}");
    }

    #[test]
    fn jacobian_matches_the_numerical_derivative_of_the_virtual_counts(
        p in plays(1, 0),
        w in motion(),
        at in -REACH..REACH,
    ) {
        const STEP: f64 = 1e-4;
        let operator = operator(&p);
        let state = state_after(&operator, &w);
        let local = operator.local(&state, &SVector::from([at])).jacobian[(0, 0)];
        let [behind, ahead] =
            [-STEP, STEP].map(|by| operator.local(&state, &SVector::from([at + by])));
        // At a kink the slopes on both sides differ.
        if behind.jacobian == ahead.jacobian {
            prop_assert!((local - (ahead.mean[0] - behind.mean[0]) / (2.0 * STEP)).abs() < 1e-6);
        }
    }
}
