//! Properties of play operators.

use i2ris::model::hysteresis::backlash_play::{PlayParameters, PlayState, Plays};
use proptest::prelude::*;

use super::*;

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

    /// Higher counts give higher virtual counts. The slope is between the first weight and 1.
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

}

proptest! {
    #![proptest_config(i2ris_testing::cases(32))]

    #[test]
    fn counts_without_compensation_equal_those_of_regression(
        file in (gmr_play().random)(2, 2),
        path in vec(position(2), 1..12),
        at in position(2),
    ) {
        let FamilyParameters::GmrPlay { mixture, .. } = &file.family else { panic!() };
        let family = FamilyParameters::Gmr { mixture: mixture.clone() };
        let plain = Model::from_file(ModelFile { family, ..file.clone() }).unwrap();
        let model = Model::from_file(file).unwrap();
        let memory = memory_after(&model, &path);
        let goal = model.predict(&at, &memory).mean;
        let start = Query::new([0.0; 2]);
        let query = Query { correction: Some([0.0; 3]), compensation: 0.0, ..start };
        let [none, without] = [
            model.invert(&goal, &memory, &query),
            plain.invert(&goal, &plain.new_memory(), &start),
        ];
        prop_assert!(distance(&none.counts, &without.counts) < 0.1, "{none:?} {without:?}");
    }

    /// Bit for bit, if no planar play drags a disc.
    #[test]
    fn motion_over_the_conditioning_range_forgets_the_past(
        mut file in (gmr_play().random)(2, 2),
        a in vec(position(2), 1..12),
        b in vec(position(2), 1..12),
    ) {
        let FamilyParameters::GmrPlay { plays, residual, .. } = &mut file.family else { panic!() };
        plays.planar_thresholds_counts.clear();
        *residual = None;
        let model = Model::from_file(file).unwrap();
        let wide = [[-REACH, -REACH], [REACH, REACH]];
        let [a, b] = [a, b].map(|path| memory_after(&model, &[path.as_slice(), &wide].concat()));
        prop_assert!(model.is_memory_known(&a) && model.is_memory_known(&b));
        for at in [[-450.0, 300.0], [0.0, 0.0], [480.0, -20.0], [500.0, 500.0]] {
            prop_assert_eq!(model.predict(&at, &a), model.predict(&at, &b));
        }
    }
}
