//! Networks of the inverse beside a forward network.

use i2ris::model::file::FamilyParameters;
use i2ris::model::network::{InverseParameters, Layer};
use i2ris::model::{Memory, Model, Query};
use i2ris::units::{MotorVec, OutputVec};

use i2ris_testing::families::{
    DEG, averages, distance, gru, inverse, lstm, memory_after, pair_file, region,
};

/// What the forward network may be contradicted by: twice its deviation.
const MOST: f64 = 2.0 * 0.173_205_080_756_887_73 * DEG;

fn path(steps: i32) -> Vec<MotorVec> {
    let at = |k: i32| {
        let t = f64::from(k) * 0.01;
        [(1.3 * t).sin() * 600.0, (0.9 * t + 1.0).sin() * 500.0]
    };
    (0..steps).map(at).collect()
}

/// The counts for a goal, and how far the forward network says they are from it.
fn found(model: &Model, goal: &OutputVec, memory: &Memory) -> (MotorVec, f64, u32) {
    let inverse = model.invert(goal, memory, &Query::new([0.0; 2]));
    let missed = distance(&model.predict(&inverse.counts, memory).mean, goal);
    assert!((missed - inverse.residual).abs() < 1e-12, "{inverse:?} {missed}");
    assert!(model.hull().contains(&inverse.counts), "{inverse:?}");
    (inverse.counts, missed, inverse.iterations)
}

/// Goals along a line through the range. Returns on how many of them the network answered alone,
/// and on how many the search took a part.
fn sweep(size: f64, steps: i32, yaw: f64) -> [u32; 2] {
    let mut file = pair_file(size);
    let FamilyParameters::Network { inverse: Some(inverse), .. } = &mut file.family else {
        unreachable!()
    };
    // So wide that within it the networks come to differ by more than is allowed.
    inverse.step = 10.0;
    let model = Model::from_file(file).unwrap();
    let memory = memory_after(&model, &path(steps));
    let (mut last, mut answers): (Option<MotorVec>, _) = (None, [0, 0]);
    for number in -1200..=1200 {
        // Half a count further on the straight line.
        let goal = [0.01 * f64::from(number) * DEG, yaw * DEG, 0.0];
        let (counts, missed, iterations) = found(&model, &goal, &memory);
        assert!(missed <= 1.2 * MOST, "{size} {steps} {goal:?}: {missed}");
        let moved = last.map_or(0.0, |last| distance(&last, &counts));
        assert!(moved < 2.0, "{size} {steps} {goal:?}: {last:?} {counts:?}");
        last = Some(counts);
        answers[usize::from(iterations > 0)] += 1;
    }
    answers
}

#[test]
fn a_pair_does_what_its_forward_network_says_without_a_jump() {
    let mut takes_over = 0;
    for size in [10.0, 20.0, 30.0, 40.0, 60.0] {
        for (steps, yaw) in [(1, 0.0), (150, 5.0), (400, -5.0), (592, 0.0), (890, 2.0)] {
            let [alone, searched] = sweep(size, steps, yaw);
            takes_over += u32::from(alone > 0 && searched > 0);
        }
    }
    assert!(takes_over > 5, "{takes_over}");
}

#[test]
fn an_exact_inverse_answers_without_a_search() {
    let model = Model::from_file(pair_file(0.0)).unwrap();
    let memory = memory_after(&model, &path(700));
    for counts in [[100.0, -50.0], [-700.0, 300.0], [600.0, 480.0]] {
        let goal = model.predict(&counts, &memory).mean;
        let (inverse, missed, iterations) = found(&model, &goal, &memory);
        assert!(missed < 1e-9 && iterations == 0 && distance(&inverse, &counts) < 1e-6);
    }
    let beyond = model.invert(&[1.0, 0.0, 0.0], &memory, &Query::new([0.0; 2]));
    assert!(beyond.clipped && beyond.residual > 0.3, "{beyond:?}");
    let none = model.invert(&[f64::NAN, 0.0, 0.0], &memory, &Query::new([5e3, 0.0]));
    assert!(none.clipped && none.residual.is_infinite() && none.counts == [1000.0, 0.0]);
}

/// The sentence of a refusal.
fn refused(change: impl FnOnce(&mut InverseParameters)) -> String {
    let mut file = pair_file(20.0);
    let FamilyParameters::Network { inverse: Some(inverse), .. } = &mut file.family else {
        unreachable!()
    };
    change(inverse);
    let text = Model::from_file(file).unwrap_err().to_string();
    assert!(!text.contains('\n'), "{text}");
    text
}

#[test]
fn an_inverse_of_something_else_is_refused_by_name() {
    let is_other = |change: fn(&mut InverseParameters)| {
        let text = refused(change);
        assert!(text.contains("family.inverse = ") && text.contains("not the inverse"), "{text}");
    };
    // Another robot, radians, axes exchanged, a sign turned, and counts that stay where they are.
    is_other(|it| *it = inverse(&[vec![0.03, -0.005], vec![0.005, 0.03]], 0.0));
    is_other(|it| {
        let to_radians = |gain: &mut f64| *gain = gain.to_degrees();
        it.skip_gain.iter_mut().flatten().for_each(to_radians);
        it.input_scale = vec![0.05_f64.to_degrees(); 2];
    });
    is_other(|it| it.skip_gain.iter_mut().for_each(|row| row.swap(0, 1)));
    is_other(|it| it.skip_gain[1].iter_mut().for_each(|gain| *gain = -*gain));
    is_other(|it| it.skip_gain.clear());
}

#[test]
fn an_inverse_that_is_none_is_refused_by_its_place() {
    let text = refused(|it| it.layers = vec![gru(64), gru(64), averages(64)]);
    assert!(text.contains("family.inverse.layers"), "{text}");
    let text = refused(|it| {
        let Layer::Lstm { input_weight, recurrent_weight, mut input_bias, recurrent_bias } =
            lstm(6)
        else {
            panic!()
        };
        // Nothing is forgotten, and something is added at every step.
        input_bias[6..12].fill(30.0);
        input_bias[12..18].fill(0.5);
        let grows = Layer::Lstm { input_weight, recurrent_weight, input_bias, recurrent_bias };
        it.layers = vec![grows, averages(6)];
    });
    assert!(text.contains("family.inverse.layers") && text.contains("grows"), "{text}");
}

#[test]
fn two_networks_share_the_numbers_of_one_memory() {
    let mut file = pair_file(0.0);
    let FamilyParameters::Network { network, inverse: Some(inverse), .. } = &mut file.family else {
        unreachable!()
    };
    network.layers = vec![gru(64), averages(64)];
    inverse.layers = vec![gru(63), averages(63)];
    Model::from_file(file.clone()).unwrap();
    let FamilyParameters::Network { inverse: Some(inverse), .. } = &mut file.family else {
        unreachable!()
    };
    inverse.layers = vec![gru(64), averages(64)];
    let text = Model::from_file(file).unwrap_err().to_string();
    assert!(text.contains("514 numbers") && text.contains("at most 512"), "{text}");
}

#[test]
fn a_file_without_an_inverse_says_nothing_of_it() {
    let mut file = pair_file(5.0);
    let FamilyParameters::Network { inverse, .. } = &mut file.family else { unreachable!() };
    *inverse = None;
    assert!(!serde_json::to_string(&file).unwrap().contains("inverse"));
    assert_eq!(file.hull.corners, region(2, 1000.0));
}
