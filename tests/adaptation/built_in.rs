//! A drift that was built into a model: budget, plausibility and regions go by the calibration that
//! it was built into.

use std::f64::consts::TAU;
use std::sync::Arc;

use i2ris::ipc::{Fault, Refusal, StateCommand};
use i2ris::model::Model;
use i2ris::model::file::{BuiltInDrift, FamilyParameters};
use i2ris_testing::cycle::{Bench, GAIN_DEG, config, lag_counts, standard_model};

/// The model with a shift of pitch built in.
fn shifted(model: &Model, deg: f64) -> Arc<Model> {
    let mut file = model.file().clone();
    *match &mut file.family {
        FamilyParameters::Linear { offset, .. } => &mut offset[0],
        FamilyParameters::ForceBalance { read_out, .. } => &mut read_out.coefficients[0][0],
        _ => unreachable!("no standard model"),
    } += deg;
    let (base, gain, gap) = (model.id().to_string(), [[0.0; 2]; 2], [0.0; 2]);
    file.built_in = Some(BuiltInDrift { base, zero: [deg, 0.0], gain, gap });
    Arc::new(Model::from_file(file).unwrap())
}

/// Both motors over more than the gap.
fn swing(bench: &mut Bench, ticks: u32) {
    for tick in 0..ticks {
        let phase = TAU * 4e-4 * f64::from(tick);
        let refusal = bench.joint(7.0 * phase.sin(), 5.0 * (0.7 * phase).sin());
        assert_eq!(refusal, Refusal::None);
    }
}

#[test]
fn what_is_built_in_counts_against_the_budget_of_the_calibration() {
    let tables = "[adaptation]\nenabled = true";
    let mut bench = Bench::enabled_with(config(tables), Some(shifted(&standard_model(), 2.8)));
    // A camera that always sees a little more: it is followed as far as the budget goes.
    bench.camera = Some([0.2_f64.to_radians(), 0.0]);
    swing(&mut bench, 90_000);
    let adaptation = bench.report().adaptation.unwrap();
    // The gain that is followed enlarges what is built in.
    let gain = adaptation.applied.gain[0][0];
    let applied = adaptation.applied.zero[0].to_degrees() + 2.8 * gain;
    assert!((0.1..0.25).contains(&applied), "{applied} deg more, of a budget of 3");
    assert!(adaptation.budget_used[0] > 0.98, "{adaptation:?}");
}

#[test]
fn plausibility_compares_with_the_calibration_that_a_drift_was_built_into() {
    let tables = "[limits]\nplausibility_deg = 4.9";
    for (built_in, fault) in [(0.0, Fault::None), (2.8, Fault::Implausible)] {
        let start = shifted(&standard_model(), built_in);
        let mut bench = Bench::enabled_with(config(tables), Some(start));
        assert_eq!(bench.ask(StateCommand::Condition), Refusal::None);
        bench.idle();
        bench.camera = Some([2.5_f64.to_radians(), 0.0]);
        bench.run(3000);
        assert_eq!(bench.report().fault, fault, "{built_in} deg built in");
    }
}

#[test]
fn regions_are_kept_at_the_calibration_that_a_drift_was_built_into() {
    let wall = "[[virtual_fixtures]]\nname = \"wall\"\n\
         shape = { half_plane = { normal = [1.0, 0.0], offset_deg = 6.0 } }";
    let Some(lag) = lag_counts() else { return };
    let start = shifted(&standard_model(), -2.8);
    let mut bench = Bench::enabled_with(config(wall), Some(start));
    for tick in 0..4000 {
        assert_eq!(bench.joint(-2.8 + 8.2 * f64::from(tick) / 4000.0, 0.0), Refusal::None);
        let [a, b] = bench.targets().map(f64::from);
        assert!(GAIN_DEG * (a + b - 2.0 * lag) < 6.0, "{a} {b} lie behind the wall");
    }
    assert_eq!(bench.ask(StateCommand::Hold), Refusal::None);
}
