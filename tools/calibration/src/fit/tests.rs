//! Properties of the fit of whole recordings.

use i2ris::model::Model;
use i2ris::model::file::{FamilyParameters, Mixture};

use super::all_families::fit;
use super::metrics::{clipped_rows, predictions};
use super::model_file::constant_covariance;
use super::options::{Choice, Components, Family, FitOptions};
use super::outcome::{FitError, FitOutcome};
use super::split::HoldOut;
use crate::em::EmOptions;
use crate::progress::Silent;
use crate::quality::SpikeOptions;
use crate::recording::Recording;
use crate::testing::{
    assert_contains, assert_near, bent, few_starts, noise, one_motor, play, recording, straight,
    wander,
};

#[track_caller]
fn fitted(recording: &Recording, options: &FitOptions) -> FitOutcome {
    fit(recording, options, &Silent).unwrap()
}

#[track_caller]
fn refused(recording: &Recording, options: &FitOptions) -> FitError {
    fit(recording, options, &Silent).unwrap_err()
}

fn of_family(family: Family) -> FitOptions {
    FitOptions { choice: Choice::One(family), ..options() }
}

fn with_components(components: Components) -> FitOptions {
    FitOptions { components, ..options() }
}

fn holding_out(hold_out: HoldOut) -> FitOptions {
    FitOptions { hold_out, ..options() }
}

fn options() -> FitOptions {
    let (choice, components) = (Choice::One(Family::Gmr), Components::UpTo(4));
    FitOptions { choice, components, em: few_starts(3), ..FitOptions::default() }
}

/// Components of the mixture that was chosen on the rows used for training.
fn components(outcome: &FitOutcome) -> usize {
    let judged = outcome.families.iter().find(|found| found.family == Family::Gmr);
    match &judged.unwrap().result.as_ref().unwrap().file().family {
        FamilyParameters::Gmr { mixture } => mixture.components(),
        other => panic!("{other:?}"),
    }
}

/// Both motors on one circle, the angles delayed by a phase, as in the recording of the robot.
fn circle() -> Recording {
    let mut random = noise(2);
    recording(250, |time| {
        let phase = 0.5 * time;
        let at = |phase: f64| [350.0 * phase.cos(), 350.0 * phase.sin()];
        let [pitch, yaw] = straight(at(phase - 0.3));
        let waves = [2.0 * (3.0 * phase).sin(), -1.5 * (2.0 * phase).cos()];
        let lifted = [pitch + waves[0], yaw + waves[1]];
        (at(phase).map(f64::round), lifted.map(|angle| angle + 0.2 * random()))
    })
}

fn held_out(model: &Model, output: usize) -> f64 {
    model.file().metrics[output].held_out.unwrap().rmsd
}

fn deviation(model: &Model, output: usize) -> f64 {
    constant_covariance(&mut model.file().family.clone()).unwrap()[output][output].sqrt()
}

#[test]
fn a_mixture_follows_a_bend_that_a_straight_model_cannot() {
    let outcome = fitted(&bent(2000), &options());
    for output in 0..2 {
        let [gmr, linear] = [&outcome.model, &outcome.linear].map(|m| held_out(m, output));
        assert!(gmr < 0.6 * linear && gmr < 0.45, "{gmr}, linear {linear}");
    }
    assert!(components(&outcome) > 1 && outcome.model.file().training.bic.is_some());
}

#[test]
fn gain_and_noise_of_a_straight_snake_are_found() {
    let outcome = fitted(&wandering_with_noise(), &of_family(Family::Linear));
    assert_eq!(outcome.model.id(), outcome.linear.id());
    let FamilyParameters::Linear { gain, .. } = &outcome.model.file().family else {
        panic!("not linear")
    };
    for (gain, expected) in gain.concat().iter().zip([0.02, -0.015, 0.015, 0.02]) {
        assert_near(*gain, expected, 1e-4);
    }
    assert_near(held_out(&outcome.model, 0), 0.1, 0.02);
}

#[test]
fn one_motor_and_one_output_are_enough() {
    let mut random = noise(4);
    let probe = one_motor(300, |time| {
        let count = (600.0 * (0.4 * time).sin()).round();
        (count, 20.0 * (count / 400.0).tanh() + 0.1 * random())
    });
    let outcome = fitted(&probe, &options());
    assert_eq!((outcome.model.motors(), outcome.model.outputs()), (1, 1));
    assert!(held_out(&outcome.model, 0) < 0.6 * held_out(&outcome.linear, 0));
}

#[test]
fn the_model_file_names_its_origin() {
    let recording = bent(400);
    let options = FitOptions { robot_id: "left".to_owned(), ..holding_out(HoldOut::Fraction(0.3)) };
    let outcome = fitted(&recording, &options);
    let file = outcome.model.file();
    assert_eq!((file.robot_id.as_str(), file.training.rows), ("left", 400));
    assert_eq!((file.training.seed, file.training.restarts), (1, 3));
    assert_eq!(file.training.data_sha256, recording.sha256());
    for row in &outcome.report.training {
        let counts = &recording.rows()[*row].counts;
        assert!(outcome.model.hull().contains(counts));
    }
}

#[test]
fn the_same_seed_gives_the_same_model() {
    let recording = bent(400);
    let id = |seed| {
        let em = EmOptions { seed, ..few_starts(2) };
        fitted(&recording, &FitOptions { em, ..options() }).model.id()
    };
    assert_eq!(id(5), id(5));
    assert_ne!(id(5), id(6));
}

#[test]
fn held_out_metrics_need_held_out_rows() {
    let outcome = fitted(&bent(400), &holding_out(HoldOut::Nothing));
    assert_eq!(outcome.report.training.len(), 400);
    let mut metrics = outcome.model.file().metrics.iter();
    assert!(metrics.all(|metrics| metrics.held_out.is_none()));
}

#[test]
fn spikes_are_tested_but_not_trained_on() {
    let mut random = noise(5);
    let spiky = recording(400, |time| {
        // Row 100 is for training, row 350 is held out.
        let spike = if [20.0, 70.0].contains(&time) { 50.0 } else { 0.0 };
        let angles = straight(wander(time)).map(|angle| angle + spike + 0.1 * random());
        (wander(time), angles)
    });
    let outcome = fitted(&spiky, &options());
    let report = &outcome.report;
    let flagged: Vec<_> = report.quality.spikes.iter().map(|spike| spike.row).collect();
    assert_eq!(flagged, [100, 100, 350, 350]);
    assert!(!report.training.contains(&100) && report.training.contains(&99));
    let metrics = &outcome.model.file().metrics[0];
    assert!(metrics.training.max < 2.0 && metrics.held_out.unwrap().max > 45.0);

    let spikes = SpikeOptions { keep: true, ..SpikeOptions::default() };
    let keep = FitOptions { spikes, ..of_family(Family::Linear) };
    assert!(fitted(&spiky, &keep).report.training.contains(&100));
}

/// The note of the mixture that was fitted to the rows used for training.
fn note(outcome: &FitOutcome) -> &str {
    let judged = outcome.families.iter().find(|found| found.family == Family::Gmr);
    judged.unwrap().note.as_deref().unwrap_or_default()
}

/// Inside the circle a mixture has no data, and folds there.
#[test]
fn smoothing_gives_a_mixture_an_inverse_and_a_note() {
    let outcome = fitted(&circle(), &with_components(Components::Exactly(8)));
    assert_eq!(components(&outcome), 8);
    assert!(note(&outcome).contains("of the covariance of all rows"), "{}", note(&outcome));
}

/// One motor at a time, as published: full strokes of the first, then of the second, with play.
fn one_motor_at_a_time() -> Recording {
    let (mut random, mut played) = (noise(5), [0.0; 2]);
    recording(1600, |time| {
        let stroke = (700.0 * (0.5 * time).sin()).round();
        let counts = if time < 160.0 { [stroke, 0.0] } else { [0.0, stroke] };
        play(&mut played, counts, 40.0);
        (counts, straight(played).map(|angle| angle + 0.05 * random()))
    })
}

#[test]
fn single_motor_recordings_fit_with_any_number_of_components() {
    for count in [3, 5, 8, 12, 20] {
        let outcome = fitted(&one_motor_at_a_time(), &with_components(Components::Exactly(count)));
        let FamilyParameters::Gmr { mixture: Mixture::PerMotor(parts) } =
            &outcome.model.file().family
        else {
            panic!("a mixture of both motors knows nothing between the axes")
        };
        let left = components(&outcome);
        let is_noted =
            note(&outcome).contains(&format!("{count} components requested, {left} left"));
        assert!(parts.len() == 2 && (left == count || (left < count && is_noted)), "{left}");
        let examined = outcome.model.examine();
        assert!(examined.error < 0.1 && examined.usable > 0.99, "{count}: {examined:?}");
    }
    let outcome = fitted(&one_motor_at_a_time(), &of_family(Family::GmrPlay));
    let found = held_out(&outcome.model, 0);
    assert!(found < 0.3 && found < 0.5 * held_out(&outcome.linear, 0), "{found}");
}

#[test]
fn three_components_are_the_least_that_are_chosen() {
    let outcome = fitted(&wandering_with_noise(), &options());
    assert_eq!((components(&outcome), note(&outcome)), (3, ""));
    let outcome = fitted(&wandering_with_noise(), &with_components(Components::UpTo(2)));
    assert_eq!(components(&outcome), 2);
    assert_eq!(super::one_family::tried(17), [3, 4, 5, 6, 8, 10, 12, 14, 16]);
}

fn wandering_with_noise() -> Recording {
    let mut random = noise(3);
    recording(400, |time| {
        (wander(time), straight(wander(time)).map(|angle| angle + 0.1 * random()))
    })
}

#[test]
fn recordings_that_cannot_be_fitted_are_refused_with_the_reason() {
    let together = recording(100, |time| {
        let [a, _] = wander(time);
        ([a, 2.0 * a + 5.0], straight([a, a]))
    });
    let late_motor = recording(100, |time| {
        let [a, b] = wander(time);
        let counts = [a, if time > 18.0 { b } else { 0.0 }];
        (counts, straight(counts))
    });
    let late_output = recording(100, |time| {
        let pitch = straight(wander(time))[0];
        (wander(time), [pitch, (time - 18.0).max(0.0)])
    });
    let greedy = with_components(Components::Exactly(60));
    let too_much = holding_out(HoldOut::Fraction(0.99));
    let late = holding_out(HoldOut::Fraction(0.25));
    for (recording, options, reason) in [
        (&together, &options(), "the motors move together"),
        (&late_motor, &late, "motor 1 does not move in the rows used for training"),
        (&late_output, &late, "output `yaw` does not change"),
        (&bent(400), &greedy, "component(s); 60 were requested; record more"),
        (&bent(400), &too_much, "leaves 4 for training"),
    ] {
        assert_contains(&refused(recording, options), &[reason]);
    }
}

#[test]
fn fit_uses_all_rows_and_is_judged_on_unseen_rows() {
    // The middle of the third held-out block lies outside the hull of the training rows.
    let far = recording(400, |time| {
        let at = wander(time).map(|it| if (39.0..41.0).contains(&time) { 3.0 * it } else { it });
        (at, straight(at).map(|angle| 12.0 * (angle / 12.0).tanh()))
    });
    let outcome = fitted(&far, &of_family(Family::Linear));
    assert_eq!(outcome.report.training.len(), 300);
    assert_eq!(outcome.model.file().training.rows, 400);
    let judged = outcome.families[0].result.as_ref().unwrap();
    assert_eq!(judged.file().training.rows, 300);
    assert_eq!(outcome.model.file().slow_error, judged.file().slow_error);
    for output in 0..2 {
        assert_eq!(held_out(&outcome.model, output), held_out(judged, output));
        assert!(held_out(judged, output) < 1.5 * judged.file().metrics[output].training.rmsd);
    }
}

#[test]
fn all_families_fit_a_recording_of_single_axes() {
    let mut random = noise(8);
    let mut played = [0.0; 2];
    let axes = recording(1000, |time| {
        let [a, b] = wander(time);
        let counts = if time < 100.0 { [a, 0.0] } else { [0.0, b] };
        play(&mut played, counts, 60.0);
        (counts, straight(played).map(|angle| angle + 0.03 * random()))
    });
    let best = FitOptions { choice: Choice::Best, ..options() };
    let outcome = fitted(&axes, &best);
    assert!(outcome.families.iter().all(|it| it.result.is_ok()), "{:?}", outcome.families);
    assert_eq!(outcome.family, Family::ForceBalance, "{:?}", outcome.report.scores);
    for output in 0..2 {
        let [found, linear] = [&outcome.model, &outcome.linear].map(|m| held_out(m, output));
        assert!(found < 0.5 * linear, "{found}, linear {linear}");
        // The deviation is larger where the recording shows nothing.
        let deviation = deviation(&outcome.model, output);
        assert!(deviation > 1.2 * found, "{deviation}, found {found}");
    }
}

/// Gaps of 15 counts and noise of 0.03 deg; one of a hundred rows is a spike.
fn with_gaps_and_spikes(rows: usize) -> Recording {
    let (mut random, mut played, mut row) = (noise(8), [0.0; 2], 0_usize);
    recording(rows, |time| {
        let counts = wander(time);
        play(&mut played, counts, 15.0);
        row += 1;
        let spike = if row % 100 == 0 { 25.0 } else { 0.0 };
        (counts, straight(played).map(|angle| angle + 0.03 * random() + spike))
    })
}

#[test]
#[ignore = "a minute of fits: for .ci/nightly"]
fn estimate_deviation_holds_on_later_motion_despite_spikes() {
    let model = fitted(&with_gaps_and_spikes(1000), &of_family(Family::ForceBalance)).model;
    let later = with_gaps_and_spikes(3000);
    let predicted = predictions(&model, &later);
    for output in 0..2 {
        let deviation = deviation(&model, output);
        let rows = later.rows().iter().zip(&predicted).skip(1000);
        let within = rows
            .filter(|(row, found)| (row.outputs[output] - found[output]).abs() < 1.96 * deviation);
        let share = within.count() as f64 / 2000.0;
        // 1 % are spikes.
        assert!((0.90..0.97).contains(&share), "{share} within 1.96 * {deviation}");
    }
}

#[test]
fn a_model_worse_than_a_constant_needs_force() {
    let mut random = noise(9);
    let unrelated = recording(400, |time| (wander(time), [random(), random()]));
    let linear = of_family(Family::Linear);
    let sentence = "is worthless: on rows held out, R2 of";
    assert_contains(&refused(&unrelated, &linear), &[sentence, "--force"]);
    let forced = FitOptions { force: true, ..linear };
    let outcome = fitted(&unrelated, &forced);
    let mark = outcome.model.file().worthless.clone().unwrap();
    assert_contains(&mark, &["on rows held out, R2 of", "below that of a constant"]);
}

/// Both motors to and fro on one circle, with gaps of 60 counts, and waves along the circle that
/// fold the outputs: a model that follows them has no inverse.
fn folded() -> Recording {
    let mut random = noise(2);
    let mut played = [0.0; 2];
    recording(1000, |time| {
        let phase = 9.0 * (0.06 * time).sin();
        let at = [350.0 * phase.cos(), 350.0 * phase.sin()].map(f64::round);
        play(&mut played, at, 60.0);
        let [pitch, yaw] = straight(played);
        let waves = [4.0 * (3.0 * phase).sin(), -3.0 * (2.0 * phase).cos()];
        let mut lifted = |angle: f64, wave: f64| angle + wave + 0.2 * random();
        (at, [lifted(pitch, waves[0]), lifted(yaw, waves[1])])
    })
}

#[test]
fn a_model_with_memory_without_inverse_is_smoothed() {
    let options = FitOptions { hold_out: HoldOut::Nothing, ..of_family(Family::GmrPlay) };
    let outcome = fitted(&folded(), &options);
    let note = outcome.families[1].note.as_deref().unwrap_or_default();
    assert!(note.contains("of the covariance of all rows"), "{note}");
}

/// Motor 0 goes to its ends while the state is unknown, and then not as far again.
#[test]
fn poses_that_were_measured_are_not_clipped() {
    let (mut random, mut played) = (noise(6), [0.0; 2]);
    let recording = recording(800, |time| {
        let [a, b] = wander(time).map(|counts| 0.8 * counts);
        let counts = if time < 21.0 { [700.0 * (0.3 * time).sin(), 0.0] } else { [a, b] };
        play(&mut played, counts, 30.0);
        (counts, straight(played).map(|angle| angle + 0.03 * random()))
    });
    let outcome = fitted(&recording, &of_family(Family::ForceBalance));
    // A few at the very edge miss by rounding; of the first sweep fifty lie beyond the rest.
    let clipped = clipped_rows(&outcome.model, &recording);
    assert!(clipped.len() < 8, "{clipped:?}");
}

/// A tendon in a sheath: full strokes only, and a gap that exceeds most smaller strokes.
fn sheath(gap: f64) -> Recording {
    let (mut random, mut played) = (noise(11), 0.0_f64);
    one_motor(504, |time| {
        let stroke = 4.0 * ((time / 20.0).fract() - 0.5).abs() - 1.0;
        let counts = (6000.0 * stroke).round();
        played = played.clamp(counts - gap, counts + gap);
        (counts, 0.01 * played + 0.1 * random())
    })
}

/// Friction that slips at 100 of 1500 counts: the straight line through the loop is level.
#[test]
fn a_friction_loop_without_a_slope_is_fitted() {
    let (mut random, mut held, mut before) = (noise(3), 0.0_f64, 0.0);
    let recording = one_motor(1500, |time| {
        let size = 0.4 + 0.6 * (0.0065 * time).sin().abs();
        let counts = (1500.0 * (size * (0.175 * time).sin() + 0.2 * (0.515 * time).sin())).round();
        held = (held + counts - std::mem::replace(&mut before, counts)).clamp(-100.0, 100.0);
        (counts, 0.02 * held + 0.02 * random())
    });
    let outcome = fitted(&recording, &of_family(Family::ForceBalance));
    let [found, linear] = [&outcome.model, &outcome.linear].map(|m| held_out(m, 0));
    assert!(found < 0.6 * linear, "{found}, linear {linear}");
}

/// In the second, most of the motion of an examination lies in the gap.
#[test]
#[ignore = "a minute of fits: for .ci/nightly"]
fn a_gap_wider_than_most_of_the_path_is_usable() {
    for gap in [2400.0, 4200.0] {
        let outcome = fitted(&sheath(gap), &FitOptions { choice: Choice::Best, ..options() });
        assert!(outcome.family.has_memory(), "{} {:?}", outcome.family, outcome.report.scores);
        let [found, linear] = [&outcome.model, &outcome.linear].map(|m| held_out(m, 0));
        assert!(found < 0.2 * linear, "{found}, linear {linear}");
    }
}
