//! Properties of models with play operators.

use i2ris::model::file::{FamilyParameters, HullParameters, ModelFile};
use i2ris::model::hysteresis::backlash_play::PlayParameters;
use i2ris::model::hysteresis::residual::{ResidualParameters, count};
use i2ris::model::{History, Inverse, Model, Query};
use i2ris::units::MotorVec;
use proptest::collection::vec;
use proptest::prelude::*;

use super::samples::{
    REACH, any_number, distance, file, memory_after, one_count, position, region, smooth_gmr,
};

/// The least weight of threshold 0 in these tests. Where virtual counts differ by one, counts may
/// differ by its reciprocal.
const LEAST_WEIGHT: f64 = 0.1;

/// Thresholds and weights of one motor.
fn one_motor() -> impl Strategy<Value = (Vec<f64>, Vec<f64>)> {
    (LEAST_WEIGHT..1.0_f64, vec((2.0..60.0_f64, 0.0..1.0_f64), 0..5)).prop_map(|(first, others)| {
        let total: f64 = others.iter().map(|(_, weight)| weight).sum::<f64>().max(1e-9);
        let mut thresholds = vec![0.0];
        let mut weights = vec![if others.is_empty() { 1.0 } else { first }];
        for (step, weight) in others {
            thresholds.push(thresholds[thresholds.len() - 1] + step);
            weights.push((1.0 - first) * weight / total);
        }
        let sum: f64 = weights.iter().sum();
        for weight in &mut weights {
            *weight /= sum;
        }
        (thresholds, weights)
    })
}

pub fn plays(motors: usize, planar: usize) -> impl Strategy<Value = PlayParameters> {
    (vec(one_motor(), motors), vec(5.0..50.0_f64, 0..=planar)).prop_map(|(each, steps)| {
        let (thresholds_counts, weights) = each.into_iter().unzip();
        let planar_thresholds_counts = steps.iter().scan(0.0, |sum, step| {
            *sum += step;
            Some(*sum)
        });
        PlayParameters {
            thresholds_counts,
            weights,
            planar_thresholds_counts: planar_thresholds_counts.collect::<Vec<f64>>(),
        }
    })
}

/// A residual of some tenths of a degree that depends on the virtual counts and the lags.
fn residual(plays: &PlayParameters, outputs: usize, size: f64) -> ResidualParameters {
    let motors = plays.weights.len();
    let lags = plays.weights.iter().map(|w| w.len() - 1).sum::<usize>()
        + 2 * plays.planar_thresholds_counts.len();
    let features = if motors == 1 { count::<1>(2, 1, lags) } else { count::<2>(2, 1, lags) };
    let coefficient = |i: usize, j: usize| size * (1.7 * i as f64 + 2.3 * j as f64).sin();
    let coefficients =
        (0..outputs).map(|i| (0..features).map(|j| coefficient(i, j)).collect()).collect();
    ResidualParameters { scale_counts: REACH, shape_degree: 2, lag_degree: 1, coefficients }
}

fn play_file(motors: usize, outputs: usize) -> impl Strategy<Value = ModelFile> {
    let parts =
        (smooth_gmr(motors, outputs), plays(motors, if motors == 2 { 3 } else { 0 }), 0.0..0.3_f64);
    parts.prop_map(move |(map, plays, size)| {
        let FamilyParameters::Gmr { mixture } = map.family() else { panic!() };
        let corners = region(motors, REACH);
        let residual = Some(residual(&plays, outputs, size));
        let virtual_hull = HullParameters { corners: corners.clone() };
        file(outputs, FamilyParameters::GmrPlay { plays, mixture, residual, virtual_hull }, corners)
    })
}

/// The same model without memory.
fn memoryless(file: &ModelFile) -> Model {
    let FamilyParameters::GmrPlay { mixture, .. } = &file.family else { panic!() };
    let family = FamilyParameters::Gmr { mixture: mixture.clone() };
    Model::from_file(ModelFile { family, ..file.clone() }).unwrap()
}

fn path(motors: usize) -> impl Strategy<Value = Vec<MotorVec>> {
    vec(position(motors), 1..12)
}

fn check_round_trip(file: ModelFile, path: &[MotorVec], at: MotorVec, start: MotorVec) {
    let model = Model::from_file(file).unwrap();
    let memory = memory_after(&model, path);
    let goal = model.predict(&at, &memory).mean;
    let inverse = model.invert(&goal, &memory, &Query::new(start));
    let missed = distance(&model.predict(&inverse.counts, &memory).mean, &goal);
    assert!(missed <= one_count(&model, &at, &memory), "{inverse:?} for {at:?} misses {missed}");
    assert!(distance(&inverse.counts, &at) <= 1.0, "{inverse:?} is not {at:?}");
    assert!(!inverse.clipped && model.hull().contains(&inverse.counts), "{inverse:?}");
}

/// What the control loop computes together is what it would compute alone.
fn check_shared_work(file: ModelFile, path: &[MotorVec], at: MotorVec, near: MotorVec) {
    let model = Model::from_file(file).unwrap();
    let memory = memory_after(&model, path);
    let correction = model.correction(&memory);
    let whole = model.predict(&at, &memory);
    let terms = model.memory_terms(&memory);
    assert_eq!(terms.correction, correction);
    assert_eq!(model.predict_with(&at, &memory, &terms), whole);
    let present = path.last().unwrap();
    let whole_there = model.predict(present, &memory);
    assert_eq!(model.predict_with(present, &memory, &terms), whole_there);
    assert_eq!(model.pose(&at, &memory, &correction), whole.mean);
    let (pose, slope) = model.pose_and_slope(&at, &memory, &correction);
    assert!(distance(&pose, &whole.mean) < 1e-12);
    assert_eq!(slope, model.jacobian(&at, &memory));
    let goals = [whole.mean, model.predict(&near, &memory).mean];
    let [first, second] = model.invert_each(&goals, &memory, &Query::new(near));
    assert_eq!(first, model.invert(&goals[0], &memory, &Query::new(near)));
    // The second search starts at the first result.
    let alone = model.invert(&goals[1], &memory, &Query::new(first.counts));
    assert!(distance(&second.counts, &alone.counts) < 1e-6, "{second:?} is not {alone:?}");
}

fn check_any_goal(file: ModelFile, path: &[MotorVec], goal: [f64; 3], start: MotorVec) {
    let model = Model::from_file(file).unwrap();
    let memory = memory_after(&model, path);
    let inverse = model.invert(&goal, &memory, &Query::new(start));
    assert!(model.hull().contains(&inverse.counts), "{inverse:?}");
    assert!(inverse.residual >= 0.0, "{inverse:?}");
    if goal[..model.outputs()].iter().any(|g| !g.is_finite()) {
        assert!(inverse.clipped && inverse.residual.is_infinite(), "{inverse:?}");
    } else if distance(&goal[..model.outputs()], &[0.0; 3]) > 3.0 {
        // No map here reaches 3 rad.
        assert!(inverse.clipped && inverse.residual > 0.0, "{inverse:?}");
    }
}

proptest! {
    #![proptest_config(i2ris_testing::cases(32))]

    #[test]
    fn work_that_is_shared_gives_the_same_results(
        file in play_file(2, 2),
        path in path(2),
        at in position(2),
        near in position(2),
    ) {
        check_shared_work(file, &path, at, near);
    }

    #[test]
    fn inverse_recovers_the_counts_with_memory(
        (one, two, three) in (play_file(1, 1), play_file(2, 2), play_file(2, 3)),
        (along, p) in (path(1), path(2)),
        at in position(2),
        start in position(2),
    ) {
        check_round_trip(one, &along, [at[0], 0.0], [start[0], 0.0]);
        check_round_trip(two, &p, at, start);
        check_round_trip(three, &p, at, start);
    }

    #[test]
    fn inverse_stays_in_the_hull(
        (one, two, three) in (play_file(1, 1), play_file(2, 2), play_file(2, 3)),
        (along, p) in (path(1), path(2)),
        goal in [any_number(), any_number(), any_number()],
        start in [any_number(), any_number()],
    ) {
        check_any_goal(one, &along, goal, start);
        check_any_goal(two, &p, goal, start);
        check_any_goal(three, &p, goal, start);
    }

    /// Compensation interpolates linearly between the counts of the model without memory and the
    /// exact inverse.
    #[test]
    fn compensation_interpolates_linearly(
        f in play_file(2, 2),
        p in path(2),
        at in position(2),
        part in 0.0..1.0_f64,
    ) {
        let (plain, model) = (memoryless(&f), Model::from_file(f).unwrap());
        let memory = memory_after(&model, &p);
        let goal = model.predict(&at, &memory).mean;
        let with = |compensation| {
            let query = Query { correction: Some([0.0; 3]), compensation, ..Query::new([0.0; 2]) };
            model.invert(&goal, &memory, &query)
        };
        let (none, some, all): (Inverse, Inverse, Inverse) = (with(0.0), with(part), with(1.0));
        let without = plain.invert(&goal, &plain.new_memory(), &Query::new([0.0; 2]));
        prop_assert!(
            distance(&none.counts, &without.counts) < 0.1,
            "{:?} is not {:?}",
            none,
            without,
        );
        if !none.clipped && !all.clipped {
            for motor in 0..2 {
                let expected = none.counts[motor] + part * (all.counts[motor] - none.counts[motor]);
                prop_assert!((some.counts[motor] - expected).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn a_correction_in_the_query_replaces_that_of_the_model(
        f in play_file(2, 2),
        p in path(2),
        at in position(2),
    ) {
        let model = Model::from_file(f).unwrap();
        let memory = memory_after(&model, &p);
        let goal = model.predict(&at, &memory).mean;
        let correction = Some(model.correction(&memory));
        let query = Query { correction, ..Query::new([0.0; 2]) };
        prop_assert_eq!(
            model.invert(&goal, &memory, &query),
            model.invert(&goal, &memory, &Query::new([0.0; 2])),
        );
    }

    #[test]
    fn memory_is_a_function_of_the_motion(
        f in play_file(2, 2),
        p in path(2),
        extra in 0..12_usize,
    ) {
        let model = Model::from_file(f).unwrap();
        let memory = memory_after(&model, &p);
        prop_assert_eq!(memory_after(&model, &p), memory);
        // A repeated position and a NaN reading change nothing.
        let mut again = p.clone();
        again.insert((extra % p.len()) + 1, p[extra % p.len()]);
        again.push([f64::NAN, 0.0]);
        let again = memory_after(&model, &again);
        for at in [[-300.0, 40.0], [0.0, 0.0], [77.0, 410.0]] {
            let [found, expected] = [&again, &memory].map(|memory| model.predict(&at, memory).mean);
            prop_assert!(distance(&found, &expected) < 1e-12);
        }
    }

    #[test]
    fn intermediate_positions_of_a_straight_motion_have_no_effect(
        f in play_file(1, 1),
        p in path(1),
    ) {
        let model = Model::from_file(f).unwrap();
        let between = p.windows(2).flat_map(|pair| {
            let (from, to) = (pair[0][0], pair[1][0]);
            (1..=7).map(move |step| [from + (to - from) * f64::from(step) / 7.0, 0.0])
        });
        let fine: Vec<_> = p.iter().take(1).copied().chain(between).collect();
        let (fine, coarse) = (memory_after(&model, &fine), memory_after(&model, &p));
        for at in [-REACH, -100.0, 0.0, 321.0] {
            let [fine, coarse] =
                [fine, coarse].map(|memory| model.predict(&[at, 0.0], &memory).mean[0]);
            prop_assert!((fine - coarse).abs() < 1e-12);
        }
    }

    /// A loop over the conditioning range makes the model forget every earlier motion.
    #[test]
    fn motion_over_the_conditioning_range_forgets_the_past(
        f in play_file(2, 2),
        a in path(2),
        b in path(2),
    ) {
        let FamilyParameters::GmrPlay { plays, .. } = &f.family else { panic!() };
        let plain = PlayParameters { planar_thresholds_counts: Vec::new(), ..plays.clone() };
        let family = FamilyParameters::GmrPlay {
            residual: None,
            plays: plain,
            mixture: { let FamilyParameters::GmrPlay { mixture, .. } = &f.family else { panic!(
            ) }; mixture.clone() },
            virtual_hull: HullParameters { corners: region(2, REACH) },
        };
        let model = Model::from_file(ModelFile { family, ..f }).unwrap();
        let wide = [[-REACH, -REACH], [REACH, REACH]];
        let [a, b] = [a, b].map(|path| memory_after(&model, &[path.as_slice(), &wide].concat()));
        prop_assert!(model.knows(&a) && model.knows(&b));
        for at in [[-450.0, 300.0], [0.0, 0.0], [480.0, -20.0], [500.0, 500.0]] {
            prop_assert_eq!(model.predict(&at, &a), model.predict(&at, &b));
        }
    }

    #[test]
    fn memory_is_unknown_until_the_conditioning_range_is_covered(f in play_file(2, 2)) {
        let model = Model::from_file(f).unwrap();
        let range = model.wipe_counts();
        prop_assert!(!model.knows(&model.new_memory()));
        if range[0] > 1.0 {
            let almost = [[0.0, 0.0], [range[0] - 0.5, range[1]]];
            prop_assert!(!model.knows(&memory_after(&model, &almost)));
        }
        prop_assert!(model.knows(&memory_after(&model, &[[0.0, 0.0], range])));
    }
}

/// From position to position in steps of one encoder count.
fn in_steps(motion: &[MotorVec]) -> Vec<MotorVec> {
    let straight = |ends: &[MotorVec]| {
        let (from, to) = (ends[0], ends[1]);
        let steps =
            from.iter().zip(to).map(|(from, to)| (to - from).abs()).fold(1.0, f64::max).ceil()
                as u32;
        let at = move |step: u32, motor: usize| {
            from[motor] + f64::from(step) / f64::from(steps) * (to[motor] - from[motor])
        };
        (0..=steps).map(move |step| [at(step, 0).round(), at(step, 1).round()])
    };
    motion.windows(2).flat_map(straight).collect()
}

proptest! {
    #![proptest_config(i2ris_testing::cases(64))]

    #[test]
    fn recall_rebuilds_the_memory_from_the_history(file in play_file(2, 2), motion in path(2)) {
        let model = Model::from_file(file).unwrap();
        let (mut expected_memory, mut history) = (model.new_memory(), History::default());
        for counts in in_steps(&motion) {
            model.advance(&mut expected_memory, &counts);
            history.note(&counts);
        }
        let rebuilt = model.recall(&history);
        prop_assert_eq!(model.knows(&rebuilt), model.knows(&expected_memory));
        for counts in [[0.0, 0.0], [30.0, -20.0], *motion.last().unwrap()] {
            // Planar plays differ slightly after a motion that is not straight: the history has a
            // point only every 8 counts.
            let (a, b) = (
                model.predict(&counts, &rebuilt).mean,
                model.predict(&counts, &expected_memory).mean,
            );
            let difference = (a[0] - b[0]).hypot(a[1] - b[1]).to_degrees();
            prop_assert!(difference < 0.1, "{difference} deg");
        }
    }
}
