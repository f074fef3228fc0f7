//! Prediction and inverse.

use super::situation::{Situation, each};
use super::*;

/// The Jacobian is the numerical derivative.
pub fn slopes(sample: &Sample) {
    const STEP: f64 = 1e-3;
    each(sample, |it| {
        let jacobian = it.model.jacobian(&it.at, &it.memory);
        for motor in 0..it.model.motors() {
            let [before, here, ahead] = [-STEP, 0.0, STEP].map(|by| {
                let mut there = it.at;
                there[motor] += by;
                it.mean(&there, &it.memory)
            });
            for output in 0..it.model.outputs() {
                let right = (ahead[output] - here[output]) / STEP;
                let left = (here[output] - before[output]) / STEP;
                let found = jacobian[output][motor];
                // Where a gap ends or friction slips, the slope has a side.
                let error = (found - 0.5 * (left + right)).abs() - (right - left).abs();
                it.assert_within("slope", error / it.worth, it.promise.slope);
            }
        }
    });
}

/// Outputs never reverse: a motor that continues moves them on; two motors never oppose each other.
pub fn rises(sample: &Sample) {
    each(sample, |it| {
        let (model, memory) = (&it.model, &it.memory);
        let [low, high] = [it.at[0], it.at[0] + 9.0 * it.part]
            .map(|counts| model.virtual_counts(&[counts, it.at[1]], memory)[0]);
        assert!(low <= high + 1e-6, "{low} {high}");
        let area = |at: &MotorVec| {
            let [[a, b], [c, d], _] = model.jacobian(at, memory);
            (a * d - b * c) / (it.worth * it.worth)
        };
        if (model.motors(), model.outputs()) == (2, 2) {
            let product = area(&it.at) * area(&it.start);
            assert!(product >= -1e-9, "{} {}", area(&it.at), area(&it.start));
        }
    });
}

/// The inverse of a prediction returns the counts.
pub fn inverse(sample: &Sample) {
    each(sample, |it| {
        let goal = it.mean(&it.at, &it.memory);
        let inverse = it.model.invert(&goal, &it.memory, &Query::new(it.start));
        let missed = distance(&it.mean(&inverse.counts, &it.memory), &goal);
        it.assert_within("inverse, outputs", missed / it.worth, it.may_miss(&inverse.counts));
        assert!(!inverse.clipped && it.model.hull().contains(&inverse.counts), "{inverse:?}");
        if it.model.motors() <= it.model.outputs() {
            let apart = distance(&inverse.counts, &it.at);
            it.assert_within("inverse, counts", apart, it.promise.inverse[1]);
        }
        assert!(it.promise.has_memory || (missed - inverse.residual).abs() < 1e-12);
    });
}

/// No gap is crossed for a rounding error, which is less than the error of a search. For the force
/// balance this depends on its slack: see `tests/model/force_balance.rs`.
pub fn stays(sample: &Sample) {
    each(sample, |it| {
        let present = it.present();
        let invert = |goal| it.model.invert(&goal, &it.memory, &Query::new(present)).counts;
        let mut goal = it.mean(&present, &it.memory);
        for part in [0.0, 2e-4, -4e-4] {
            goal[0] += part * it.worth;
            it.assert_within("stays", distance(&invert(goal), &present), it.promise.stays);
        }
        if it.model.motors() == 2 && it.model.outputs() > 1 {
            let found = invert(it.mean(&[0.9 * present[0], present[1]], &it.memory));
            it.assert_within("one stays", (found[1] - present[1]).abs(), it.promise.stays);
        }
    });
}

/// The inverse of any goal from any start is in the hull.
pub fn any_goal(sample: &Sample) {
    each(sample, |it| {
        let [x, y, z, a, b] = it.wild;
        let goal = [x, y, z];
        let query = Query { compensation: it.part, ..Query::new([a, b]) };
        let inverse = it.model.invert(&goal, &it.memory, &query);
        assert!(it.model.hull().contains(&inverse.counts), "{inverse:?}");
        assert!(inverse.residual >= 0.0 && inverse.iterations <= 400, "{inverse:?}");
        let used = &goal[..it.model.outputs()];
        if used.iter().any(|goal| !goal.is_finite()) {
            assert!(inverse.clipped && inverse.residual.is_infinite(), "{inverse:?}");
            assert_eq!(inverse.counts, it.model.hull().project(&query.start));
        } else if distance(used, &[0.0; 3]) > 100.0 {
            assert!(inverse.clipped && inverse.residual > 0.0, "{inverse:?}");
        }
    });
}

/// Compensation interpolates from the counts of a model without memory to the exact inverse.
pub fn compensation(sample: &Sample) {
    each(sample, |it| {
        let goal = it.mean(&it.at, &it.memory);
        let with = |compensation, memory: &Memory| -> Inverse {
            let query = Query { correction: Some([0.0; 3]), compensation, ..Query::new([0.0; 2]) };
            it.model.invert(&goal, memory, &query)
        };
        let [none, some, all] = [0.0, it.part, 1.0].map(|part| with(part, &it.memory));
        if !none.clipped && !all.clipped {
            for motor in 0..2 {
                let way = all.counts[motor] - none.counts[motor];
                let expected = none.counts[motor] + it.part * way;
                it.assert_within("part", (some.counts[motor] - expected).abs(), 1e-6);
            }
        }
        let other = with(0.0, &it.after(&it.other));
        if it.promise.compensates || !it.promise.has_memory {
            it.assert_within("without", distance(&other.counts, &none.counts), 0.1);
        }
    });
}

/// Outside the hull the stated deviation grows with the distance.
pub fn beyond(sample: &Sample) {
    each(sample, |it| {
        let hull = it.model.hull();
        let (centre, corner) = (hull.centre(), hull.corners().next().unwrap());
        let at = |part: f64| {
            std::array::from_fn(|motor| corner[motor] + part * (corner[motor] - centre[motor]))
        };
        for part in [0.2, 1.0, 5.0] {
            let deviation = it.model.predict(&at(part), &it.memory).deviation();
            let moved = distance(&at(part), &corner) * it.worth;
            let stated = distance(&deviation, &[0.0; 3]);
            assert!(stated > 0.02 * moved, "{stated} after {moved}");
        }
    });
}

/// Results that the control loop computes together equal those computed alone.
pub fn shared_work(sample: &Sample) {
    each(sample, |it| {
        let (model, memory) = (&it.model, &it.memory);
        let (whole, terms) = (model.predict(&it.at, memory), model.memory_terms(memory));
        let correction = model.correction(memory);
        assert_eq!(terms.correction, correction);
        assert_eq!(model.predict_with(&it.at, memory, &terms), whole);
        let there = model.predict(&it.present(), memory);
        assert_eq!(model.predict_with(&it.present(), memory, &terms), there);
        assert_eq!(model.pose(&it.at, memory, &correction), whole.mean);
        let (pose, slope) = model.pose_and_slope(&it.at, memory, &correction);
        assert!(distance(&pose, &whole.mean) < it.promise.shared, "{pose:?} {whole:?}");
        assert_eq!(slope, model.jacobian(&it.at, memory));
        let query = Query::new(it.start);
        let goals = [whole.mean, it.mean(&it.start, memory)];
        let [first, second] = model.invert_each(&goals, memory, &query);
        assert_eq!(first, model.invert(&goals[0], memory, &query));
        let given = Query { correction: Some(correction), ..query };
        assert_eq!(first, model.invert(&goals[0], memory, &given));
        // The second search starts at the first result.
        let alone = model.invert(&goals[1], memory, &Query::new(first.counts));
        it.assert_within("second goal", distance(&second.counts, &alone.counts), 1e-6);
    });
}

/// Covariances are symmetric and positive semidefinite.
pub fn covariances(sample: &Sample) {
    each(sample, |it| {
        let Estimate { covariance, .. } = it.model.predict(&it.at, &it.memory);
        let scale = (0..3).map(|i| covariance[i][i]).sum::<f64>();
        assert!(scale > 0.0);
        // Sampled directions.
        for number in 0..60 {
            let (a, b) = (f64::from(number) * 0.21, f64::from(number) * 0.53);
            let way = [a.cos() * b.cos(), a.sin() * b.cos(), b.sin()];
            let row = |i: usize| way[i] * (0..3).map(|j| covariance[i][j] * way[j]).sum::<f64>();
            let value = (0..3).map(row).sum::<f64>();
            assert!(value >= -1e-12 * scale, "{covariance:?} has {value}");
        }
        let apart = |i: usize, j: usize| (covariance[i][j] - covariance[j][i]).abs();
        assert!((0..9).all(|k| apart(k / 3, k % 3) <= 1e-12 * scale), "{covariance:?}");
    });
}

/// Every position has an estimate, however far, except NaN.
pub fn not_a_number(sample: &Sample) {
    each(sample, |it| {
        let [a, b, ..] = it.wild;
        for far in [[a, b], [1e9, -1e9], [f64::MAX, f64::MIN], [f64::INFINITY, 0.0], [-2e9, 3e5]] {
            let estimate = it.model.predict(&far, &it.memory);
            let jacobian = it.model.jacobian(&far, &it.memory);
            let mut all = estimate.covariance.as_flattened().iter().chain(&estimate.mean);
            let used = &far[..it.model.motors()];
            if used.iter().any(|counts| counts.is_nan()) {
                assert!(all.any(|number| number.is_nan()), "{estimate:?}");
            } else {
                let mut all = all.chain(jacobian.as_flattened());
                assert!(all.all(|number| number.is_finite()), "{estimate:?} {jacobian:?}");
            }
        }
        is_one(it);
    });
}

fn is_one(it: &Situation) {
    let mut memory = it.memory;
    for counts in [[f64::NAN, 0.0], [0.0, f64::INFINITY]] {
        it.model.advance(&mut memory, &counts);
        assert_eq!(memory, it.memory, "an invalid reading changes nothing");
    }
    assert!(it.mean(&[f64::NAN; 2], &it.memory)[0].is_nan());
}
