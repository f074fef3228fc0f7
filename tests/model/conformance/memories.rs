//! The memory of past motion.

use super::situation::{Situation, each, in_steps, reach};
use super::*;

/// The past of the motors matters only to a family with memory.
pub fn the_past(sample: &Sample) {
    let model = sample.model();
    let [up, down] = [-400.0, 400.0].map(|from| {
        let path = in_steps(&[[from; 2], [0.0; 2]], 4.0);
        model.predict(&[0.0; 2], &memory_after(&model, &path)).mean
    });
    let apart = distance(&up, &down);
    assert!(if sample.promise.has_memory { apart > 1e-3 * DEG } else { apart == 0.0 }, "{apart}");
}

/// A loop slightly wider than the conditioning range, within the hull, ending at its middle.
fn conditioning(model: &Model) -> Vec<MotorVec> {
    let (range, reach) = (model.conditioning_range(), reach(model));
    let [a, b] = [0, 1].map(|motor: usize| (range[motor] + 100.0).min(reach[motor]));
    [[-a, -b], [a, -b], [a, b], [-a, b], [-a, -b], [a, b], [0.0; 2]].into()
}

/// After conditioning a memory is known, and the past is forgotten. Before, it is unknown.
pub fn forgets(sample: &Sample) {
    each(sample, |it| {
        let (model, range) = (&it.model, it.model.conditioning_range());
        assert!(!model.is_memory_known(&model.new_memory()));
        let end = [0.0, range[1]];
        if range[0] > 1.0 {
            let almost = memory_after(model, &[[0.0; 2], [range[0] - 0.5, range[1]], end]);
            assert!(!model.is_memory_known(&almost));
        }
        let after = |past: &[MotorVec]| it.after(&[past, &conditioning(model)].concat());
        let [one, other] = [&it.path, &it.other].map(|past| after(past));
        // Operators that are not centred in a narrow hull may need a wider one.
        let is_wide = |motor: usize| range[motor] + 100.0 <= reach(model)[motor];
        let known = model.is_memory_known(&one) && model.is_memory_known(&after(&[]));
        assert!(known || !(0..model.motors()).all(is_wide));
        if known {
            it.assert_alike("remains", &one, &other, it.promise.remains);
        }
        if it.promise.remains == 0.0 && model.is_memory_known(&it.after(&it.other)) {
            let again = it.after(&[it.path.as_slice(), &it.other].concat());
            it.assert_alike("known", &it.after(&it.other), &again, 0.0);
        }
    });
}

/// A memory stays finite and recovers from any state.
pub fn bounded(sample: &Sample) {
    each(sample, |it| {
        let mut memory = it.memory;
        for far in [[2e9, -2e9], [1e300, 1e300], [it.wild[0], it.wild[1]], [-f64::MAX, 0.0]] {
            it.model.advance(&mut memory, &far);
            let text = serde_json::to_string(&memory).unwrap();
            assert!(!text.contains("null"), "{text}");
            for at in [it.at, far.map(|counts| if counts.is_finite() { counts } else { 0.0 })] {
                let estimate = it.model.predict(&at, &memory);
                assert!(estimate.mean.iter().all(|output| output.is_finite()), "{estimate:?}");
                let inverse = it.model.invert(&estimate.mean, &memory, &Query::new(it.start));
                assert!(it.model.hull().contains(&inverse.counts), "{inverse:?}");
            }
        }
        // Back in long steps, as after wrong readings.
        it.model.advance(&mut memory, &[0.0; 2]);
        let back = in_steps(&[[[0.0; 2]].as_slice(), &conditioning(&it.model)].concat(), 10.0);
        back.iter().for_each(|counts| it.model.advance(&mut memory, counts));
        let expected = it.after(&conditioning(&it.model));
        it.assert_alike("back", &memory, &expected, it.promise.remains);
    });
}

/// Bits of all results.
fn bits(model: &Model, memory: &Memory, it: &Situation) -> Vec<u8> {
    let estimate = model.predict(&it.at, memory);
    let inverse = model.invert(&estimate.mean, memory, &Query::new(it.start)).counts;
    postcard::to_allocvec(&(memory, estimate, inverse, model.jacobian(&it.at, memory))).unwrap()
}

/// The same motion gives the same bits: again, from copy, snapshot, and a model read from its file.
pub fn same_bits(sample: &Sample) {
    each(sample, |it| {
        let file = ModelFile::parse(&serde_json::to_string(it.model.file()).unwrap()).unwrap();
        assert_eq!((&file, file.id().unwrap()), (it.model.file(), it.model.id()));
        let again = Model::from_file(file).unwrap();
        let snapshot = postcard::to_allocvec(&it.memory).unwrap();
        let memories = [
            (&again, memory_after(&again, &in_steps(&it.path, 10.0))),
            (&*it.model, it.memory),
            (&*it.model, postcard::from_bytes(&snapshot).unwrap()),
            (&again, serde_json::from_str(&serde_json::to_string(&it.memory).unwrap()).unwrap()),
        ];
        let on = in_steps(&[&[it.present()], it.other.as_slice()].concat(), 10.0);
        let ends = memories.map(|(model, mut memory)| {
            let before = bits(model, &memory, it);
            on.iter().for_each(|counts| model.advance(&mut memory, counts));
            (before, bits(model, &memory, it))
        });
        assert!(ends.iter().all(|end| *end == ends[0]));
    });
}

/// A prediction is the state after the motion of a tick; repeating a position changes nothing.
pub fn tick(sample: &Sample) {
    each(sample, |it| {
        let [x, y] = it.present();
        let at = [x + 8.0 * it.part - 4.0, y + 4.0 * (it.at[1] / (it.at[1].abs() + 100.0))];
        let at = if it.model.motors() == 1 { [at[0], 0.0] } else { at };
        let predicted = it.pose(&at, &it.memory);
        let mut memory = it.memory;
        it.model.advance(&mut memory, &at);
        let apart = distance(&predicted, &it.pose(&at, &memory));
        it.assert_within("tick", apart / it.worth, it.promise.tick);
        let once = memory;
        it.model.advance(&mut memory, &at);
        it.assert_alike("again", &once, &memory, it.promise.tick);
    });
}

/// A shorter motion moves the snake less, even at a turning point, after a count back and forth,
/// during creep and while gaps are scaled: the prediction has no jumps.
pub fn still(sample: &Sample) {
    const SHORT: f64 = 1e-6;
    each(sample, |it| {
        let at = it.present();
        let moved = |motor: usize, counts: f64| {
            let mut moved = at;
            moved[motor] += if motor < it.model.motors() { counts } else { 0.0 };
            moved
        };
        let mut memories = [it.memory; 4];
        it.model.advance(&mut memories[1], &moved(0, 1.0));
        it.model.advance(&mut memories[1], &at);
        it.model.advance_over(&mut memories[2], &at, 0.1);
        it.model.advance_over(&mut memories[2], &at, 1e-3);
        memories[3].set_gap_scale(&[1.2, 0.9]);
        for (motor, side) in [(0, -SHORT), (0, SHORT), (1, -SHORT), (1, SHORT)] {
            for memory in &memories {
                let (to, from) = (moved(motor, side), it.pose(&at, memory));
                let predicted = distance(&it.pose(&to, memory), &from) / it.worth;
                it.assert_within("a step of nothing", predicted, 100.0 * SHORT);
                let mut after = *memory;
                if it.promise.has_gap && memory == &memories[3] {
                    // What narrower gaps drag along is a motion.
                    continue;
                }
                it.model.advance_over(&mut after, &to, 1e-9);
                let moved = distance(&it.pose(&to, &after), &from) / it.worth;
                it.assert_within("a motion of nothing", moved, 100.0 * SHORT);
            }
        }
    });
}

/// The past is a path, and its steps do not matter.
pub fn steps(sample: &Sample) {
    each(sample, |it| {
        let long = if it.promise.steps == 0.0 { f64::INFINITY } else { 8.0 };
        let [fine, coarse] =
            [2.0, long].map(|step| memory_after(&it.model, &in_steps(&it.path, step)));
        for at in [it.at, it.start, it.present(), [0.0; 2]] {
            let [fine, coarse] = [fine, coarse].map(|memory| it.pose(&at, &memory));
            it.assert_within("steps", distance(&fine, &coarse) / it.worth, it.promise.steps);
        }
    });
}

/// A memory can be recalled from a history.
pub fn recall(sample: &Sample) {
    each(sample, |it| {
        let (mut memory, mut history) = (it.model.new_memory(), History::default());
        for counts in in_steps(&it.path, 1.0).iter().map(|at| at.map(f64::round)) {
            it.model.advance(&mut memory, &counts);
            history.note(&counts);
        }
        let recalled = it.model.recall(&history);
        assert_eq!(it.model.is_memory_known(&recalled), it.model.is_memory_known(&memory));
        it.assert_alike("recall", &recalled, &memory, it.promise.recall);
    });
}

/// A gap scale of 1 changes no bit; a larger one widens the gaps, and the inverse follows. Families
/// without gaps have no scale.
pub fn gap_scale(sample: &Sample) {
    each(sample, |it| {
        let [mut usual, mut wide] = [it.model.new_memory(); 2];
        for counts in in_steps(&it.path, 10.0) {
            let scale = if it.promise.has_gap { [1.0; 2] } else { [1.5, 0.5] };
            usual.set_gap_scale(&scale);
            it.model.advance(&mut usual, &counts);
            it.model.advance(&mut wide, &counts);
            wide.set_gap_scale(&[1.5, 1.2]);
        }
        assert_eq!(usual, it.memory);
        let goal = it.mean(&it.at, &wide);
        let inverse = it.model.invert(&goal, &wide, &Query::new(it.start));
        let missed = distance(&it.mean(&inverse.counts, &wide), &goal);
        if !inverse.clipped {
            it.assert_within("wide gap", missed / it.worth, it.may_miss(&inverse.counts));
        }
    });
    let model = sample.model();
    assert_eq!(model.has_backlash(), sample.promise.has_gap);
    let path = in_steps(&[[600.0, -500.0], [-600.0, 500.0], [200.0, 0.0]], 10.0);
    let [mut usual, mut wide] = [model.new_memory(); 2];
    let mut apart = 0.0_f64;
    for counts in path {
        model.advance(&mut usual, &counts);
        model.advance(&mut wide, &counts);
        wide.set_gap_scale(&[1.5, 1.0]);
        let [a, b] = [usual, wide].map(|memory| model.predict(&counts, &memory).mean);
        apart = apart.max(distance(&a, &b));
    }
    assert!(if sample.promise.has_gap { apart > 0.1 * DEG } else { apart == 0.0 }, "{apart}");
}
