//! Properties of generalised play operators.

use i2ris::model::hysteresis::Operator;
use i2ris::model::hysteresis::prandtl_ishlinskii::{
    PlayParameters, PrandtlIshlinskii, PrandtlIshlinskiiParameters, PrandtlIshlinskiiState,
};
use i2ris::units::MotorVec;
use nalgebra::SVector;
use proptest::collection::vec;
use proptest::prelude::*;

use super::samples::{REACH, position};

/// The least direct weight in these tests: the slope of the inverse is at most its reciprocal.
const LEAST_WEIGHT: f64 = 0.05;

/// Plays that move one motor, along its axis or a direction near it.
fn play() -> impl Strategy<Value = PlayParameters> {
    (0..2_usize, -0.8..0.8_f64, 2.0..150.0_f64, [-0.7..0.7_f64, -0.7..0.7_f64], 0.0..0.5_f64)
        .prop_map(|(motor, share, threshold_counts, growth, size)| {
            let (mut direction, mut weight) = (vec![share; 2], vec![0.0; 2]);
            direction[motor] = 1.0;
            weight[motor] = size;
            PlayParameters { direction, threshold_counts, growth, weight }
        })
}

fn parameters() -> impl Strategy<Value = PrandtlIshlinskiiParameters> {
    (
        [-100.0..100.0_f64, -100.0..100.0_f64],
        [LEAST_WEIGHT..1.0_f64, LEAST_WEIGHT..1.0_f64],
        vec(play(), 0..16),
    )
        .prop_map(|(centre, direct, plays)| PrandtlIshlinskiiParameters {
            centre_counts: centre.to_vec(),
            direct_weights: direct.to_vec(),
            plays,
        })
}

fn after(operator: &PrandtlIshlinskii<2>, path: &[MotorVec]) -> PrandtlIshlinskiiState {
    let mut state = operator.begin(&SVector::from(path[0]));
    for counts in path {
        operator.advance(&mut state, &SVector::from(*counts));
    }
    state
}

proptest! {
    #![proptest_config(i2ris_testing::cases(64))]

    #[test]
    fn the_inverse_is_exact(
        file in parameters(),
        path in vec(position(2), 1..12),
        at in position(2),
    ) {
        let operator = PrandtlIshlinskii::<2>::prepare(&file).unwrap();
        let state = after(&operator, &path);
        let goal = operator.local(&state, &SVector::from(at)).mean;
        let found = operator.invert(&state, &goal, 1.0);
        let missed = (operator.local(&state, &found).mean - goal).norm();
        prop_assert!(missed < 1e-4, "{found} for {at:?} misses {missed} counts");
        let distance = (found - SVector::from(at)).norm();
        prop_assert!(distance < 1e-4 / LEAST_WEIGHT, "{found} is not {at:?}");
    }

    #[test]
    fn the_jacobian_is_the_numerical_derivative(
        file in parameters(),
        path in vec(position(2), 1..12),
        at in position(2),
    ) {
        const STEP: f64 = 1e-4;
        let operator = PrandtlIshlinskii::<2>::prepare(&file).unwrap();
        let state = after(&operator, &path);
        let local = |by: [f64; 2]| {
            operator.local(&state, &SVector::from([at[0] + by[0], at[1] + by[1]]))
        };
        let here = local([0.0, 0.0]).jacobian;
        for (motor, by) in [[STEP, 0.0], [0.0, STEP]].into_iter().enumerate() {
            let (behind, ahead) = (local(by.map(|by| -by)), local(by));
            // At a corner of a play the slopes on both sides differ.
            if behind.jacobian == ahead.jacobian {
                let slope = (ahead.mean - behind.mean) / (2.0 * STEP);
                prop_assert!((slope - here.column(motor)).norm() < 1e-6);
            }
        }
    }

    #[test]
    fn the_order_of_motion_is_remembered_and_its_speed_is_not(
        file in parameters(),
        path in vec(position(2), 2..8),
    ) {
        let operator = PrandtlIshlinskii::<2>::prepare(&file).unwrap();
        let between = path.windows(2).flat_map(|pair| {
            (1..=9).map(move |step| {
                let part = f64::from(step) / 9.0;
                [0, 1].map(|motor| pair[0][motor] + part * (pair[1][motor] - pair[0][motor]))
            })
        });
        let fine: Vec<MotorVec> = path.iter().take(1).copied().chain(between).collect();
        let at = SVector::from([12.0, -34.0]);
        let [fine, coarse] = [&fine, &path]
            .map(|path| operator.local(&after(&operator, path), &at).mean);
        prop_assert!((fine - coarse).norm() < 1e-9, "{fine} {coarse}");
    }

    /// States that say so are the same after every past.
    #[test]
    fn a_state_that_has_forgotten_does_not_depend_on_its_past(
        file in parameters(),
        [a, b] in [vec(position(2), 1..6), vec(position(2), 1..6)],
        common in vec(position(2), 1..6),
    ) {
        let operator = PrandtlIshlinskii::<2>::prepare(&file).unwrap();
        // Without its past a state begins where the common motion does.
        let known = operator.has_forgotten(&after(&operator, &common));
        let at = SVector::from([70.0, 80.0]);
        let ends = [&a, &b].map(|past| {
            let path = [past.as_slice(), &common].concat();
            operator.local(&after(&operator, &path), &at).mean
        });
        prop_assert!(!known || (ends[0] - ends[1]).norm() < 1e-9, "{ends:?}");
    }

    /// A cross over the conditioning range is such a motion.
    #[test]
    fn a_cross_over_the_conditioning_range_forgets(file in parameters()) {
        let centre = [file.centre_counts[0], file.centre_counts[1]];
        let operator = PrandtlIshlinskii::<2>::prepare(&file).unwrap();
        let [a, b] = operator.wipe_counts();
        let ends = [[-a, 0.0], [a, 0.0], [0.0, -b], [0.0, b]];
        let path = ends.map(|end| [centre[0] + end[0], centre[1] + end[1]]);
        prop_assert!(operator.has_forgotten(&after(&operator, &path)));
    }
}

fn refusal(change: impl FnOnce(&mut PrandtlIshlinskiiParameters)) -> String {
    let play = |direction: [f64; 2], weight: [f64; 2]| PlayParameters {
        direction: direction.to_vec(),
        threshold_counts: 10.0,
        growth: [0.0; 2],
        weight: weight.to_vec(),
    };
    let mut file = PrandtlIshlinskiiParameters {
        centre_counts: vec![0.0; 2],
        direct_weights: vec![0.1; 2],
        plays: vec![play([1.0, 0.5], [0.5, 0.0]), play([0.5, 1.0], [0.0, 0.5])],
    };
    PrandtlIshlinskii::<2>::prepare(&file).unwrap();
    change(&mut file);
    PrandtlIshlinskii::<2>::prepare(&file).unwrap_err().to_string()
}

#[test]
fn operators_without_inverse_or_with_odd_numbers_are_refused() {
    for (text, change) in [
        (
            "virtual counts must increase",
            (|file| file.plays[1].direction = vec![0.5, 0.2])
                as fn(&mut PrandtlIshlinskiiParameters),
        ),
        ("virtual counts must increase", |file| {
            file.plays[0].weight = vec![-0.1, 0.0];
        }),
        ("direct_weights", |file| file.direct_weights[1] = 0.0),
        ("plays[1].threshold_counts", |file| {
            file.plays[1].threshold_counts = 0.0;
        }),
        ("plays[0].growth", |file| file.plays[0].growth = [0.0, 1.0]),
        ("plays[0].direction", |file| {
            file.plays[0].direction = vec![1.0];
        }),
        ("at most 64 plays", |file| {
            let play = file.plays[0].clone();
            file.plays = vec![play; 65];
        }),
        ("centre_counts", |file| file.centre_counts[0] = f64::NAN),
    ] {
        let refusal = refusal(change);
        assert!(refusal.contains(text), "{refusal:?} does not name {text:?}");
    }
}

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
