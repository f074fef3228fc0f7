//! A network in the loop: swaps while it moves, rollback, and replay to the bit.

use i2ris::model::network::NetworkParameters;
use i2ris::process::black_box::replay;
use i2ris_testing::families::{averages, gru};

use super::replay::through_file;
use super::*;

/// A GRU on the straight line of the sample robot.
fn network(units: usize) -> Arc<Model> {
    let mut file = model(OutputUnit::Deg).file().clone();
    let FamilyParameters::Linear { gain, covariance, .. } = file.family.clone() else { panic!() };
    let network = NetworkParameters {
        step_counts: 10.0,
        input_centre: vec![0.0; 2],
        input_scale: vec![0.002; 2],
        layers: vec![gru(units), averages(units)],
        output_gain: vec![vec![1.0, 0.5], vec![-0.5, 1.0]],
        output_offset: vec![0.0; 2],
        skip_gain: gain.clone(),
    };
    file.training.linear_gain = Some(gain.clone());
    file.family =
        FamilyParameters::Network { network, memory_counts: vec![200.0; 2], gain, covariance };
    Arc::new(Model::from_file(file).unwrap())
}

/// Swaps two models back and forth during a motion; the bench checks the motor limits in each tick.
pub fn swap_while_moving(bench: &mut Bench, models: &[Arc<Model>; 2], swaps: u32) {
    bench.home();
    bench.enable();
    bench.carry_out(StateCommand::Condition);
    let mut moved = 0;
    for number in 0..swaps {
        for part in 0..3 {
            let t = f64::from(3 * number + part) * 0.01;
            let before = bench.targets();
            assert_eq!(bench.joint(3.0 * (2.0 * t).sin(), 2.0 * (3.1 * t).sin()), Refusal::None);
            bench.run(4);
            moved += i32::from(bench.targets() != before);
        }
        if number % 7 == 6 {
            assert_eq!(bench.change_model(ModelChange::Rollback, false), Refusal::None);
        } else {
            let active = bench.joints().model;
            let other = models.iter().find(|model| model.id() != active).unwrap();
            let before = bench.targets();
            assert_eq!(bench.swap(other), Refusal::None, "{number}");
            let after = bench.targets();
            let jump = (after[0] - before[0]).abs().max((after[1] - before[1]).abs());
            assert!(jump <= 20, "{number}: {before:?} {after:?}");
            assert_eq!(bench.joints().model, other.id());
        }
        assert_eq!(bench.state(), OperatingState::Enabled, "{number}");
    }
    assert!(moved > 2 * swaps as i32, "it moved in {moved} of {} parts", 3 * swaps);
}

#[test]
fn thousand_swaps_to_and_from_gru_while_moving() {
    let models = [standard_model(), network(64)];
    let mut bench = Bench::new(config(""), Some(models[0].clone()));
    swap_while_moving(&mut bench, &models, 1000);
}

#[test]
fn gru_session_is_replayed_bit_for_bit() {
    let models = [network(24), standard_model()];
    let mut bench = Bench::new(config(""), Some(models[0].clone()));
    bench.recording = Some(Recording::keeping(|ticks| ticks == 1));
    swap_while_moving(&mut bench, &models, 60);
    let replayed = replay(&through_file(&bench.black_box(&models[0]))).unwrap();
    assert_eq!(replayed.difference, None);
    assert!(replayed.swaps > 50 && replayed.ticks > 800, "{replayed:?}");
}
