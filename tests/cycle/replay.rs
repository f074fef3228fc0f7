//! A session replays to the bit: with swaps, faults and homings, and from any snapshot.

use std::collections::BTreeSet;
use std::path::Path;

use i2ris::process::black_box::{BlackBox, ReplayError, replay};

use super::*;

/// A session: motion, swaps, conditioning, a fault and its acknowledgement, on a model with memory.
fn run_session(bench: &mut Bench, second: &Arc<Model>) {
    bench.home();
    bench.enable();
    bench.carry_out(StateCommand::Condition);
    for k in 0..200 {
        let t = f64::from(k) * 0.005;
        assert_eq!(bench.joint(3.0 * (4.0 * t).sin(), 2.0 * (3.0 * t).sin()), Refusal::None);
        bench.run(4);
        match k {
            60 => assert_eq!(bench.swap(second), Refusal::None),
            90 => assert_eq!(bench.change_model(ModelChange::Rollback, false), Refusal::None),
            120 => assert_eq!(bench.change_model(ModelChange::Rollback, false), Refusal::None),
            _ => {}
        }
    }
    assert_eq!(bench.joint(f64::NAN, 0.0), Refusal::NotFinite);
    bench.run(300);
    bench.drives[1].feedback.phase = AxisPhase::Faulted;
    bench.run(50);
    assert_eq!(bench.ask(StateCommand::Acknowledge), Refusal::None);
    bench.until("DISABLED", |bench| {
        bench.state() == OperatingState::Disabled && !bench.report().busy
    });
}

/// A recorded session, with the snapshots after those ticks.
fn recorded(keeps: fn(usize) -> bool) -> BlackBox {
    let (first, second) = (standard_model(), scaled_standard_model(1.2));
    let mut bench = Bench::new(config(""), Some(Arc::clone(&first)));
    bench.recording = Some(Recording::keeping(keeps));
    run_session(&mut bench, &second);
    bench.black_box(&first)
}

pub fn through_file(content: &BlackBox) -> BlackBox {
    BlackBox::from_bytes(&content.to_bytes().unwrap(), Path::new("session.box")).unwrap()
}

/// Replays from every snapshot to the end, after a round trip through a file.
fn assert_replayed(content: &BlackBox) {
    let mut content = through_file(content);
    while !content.snapshots.is_empty() {
        assert_eq!(replay(&content).unwrap().difference, None);
        content.snapshots.remove(0);
    }
}

#[test]
fn every_tick_is_replayed_bit_for_bit_from_file() {
    let content = through_file(&recorded(|ticks| ticks == 1));
    let replayed = replay(&content).unwrap();
    assert_eq!(replayed.difference, None);
    // The first snapshot comes after the first tick.
    assert_eq!((replayed.skipped, replayed.ticks), (1, content.ticks.len() as u64 - 1));
    assert_eq!(replayed.swaps, 3);
    assert!(replayed.ticks > 2000);
}

/// Motion that adapts, a swap, a rollback and a fault on the way.
fn run_adapting_session(bench: &mut Bench, second: &Arc<Model>) {
    let follow = |bench: &mut Bench, phase: f64| {
        for k in 0..1000 {
            let t = f64::from(k) * 0.005;
            let goal = [5.0 * (3.0 * t).sin(), 4.0 * (2.0 * t + phase).sin() * t.min(1.0)];
            assert_eq!(bench.joint(goal[0], goal[1]), Refusal::None);
            bench.run(4);
        }
        bench.until("the start", |bench| bench.report().holding);
        bench.run(50);
        bench.pose = Some(([0.0; 3], 2));
        assert_eq!(bench.ask(StateCommand::Move), Refusal::None);
        bench.run(3000);
        assert_eq!(bench.ask(StateCommand::Hold), Refusal::None);
        bench.run(50);
    };
    bench.home();
    bench.enable();
    bench.carry_out(StateCommand::Condition);
    follow(bench, 0.0);
    assert_eq!(bench.swap(second), Refusal::None);
    follow(bench, 0.3);
    assert_eq!(bench.change_model(ModelChange::Rollback, false), Refusal::None);
    follow(bench, 0.6);
    bench.drives[1].feedback.phase = AxisPhase::Faulted;
    bench.run(50);
    bench.carry_out(StateCommand::Acknowledge);
    bench.enable();
    follow(bench, 0.9);
}

#[test]
fn adaptation_is_replayed_through_swap_rollback_and_fault() {
    let (first, second) = (standard_model(), scaled_standard_model(1.1));
    let mut bench = Bench::new(config("[adaptation]\nenabled = true"), Some(Arc::clone(&first)));
    bench.camera = Some([0.008, -0.006]);
    bench.recording = Some(Recording::keeping(|ticks| ticks.is_multiple_of(3001)));
    run_adapting_session(&mut bench, &second);
    let content = bench.black_box(&first);
    let adapted = content.ticks.iter().filter_map(|tick| {
        let adaptation = tick.outputs.report.adaptation?;
        (adaptation.applied.zero != [0.0; 2]).then_some(adaptation.model)
    });
    let models: BTreeSet<_> = adapted.flatten().collect();
    assert_eq!(models.len(), 2, "both models were adapted");
    // In motion, between models, after the fault.
    assert_replayed(&content);
}

/// A model staged from the state of the slower threads also accounts for the elapsed time.
#[test]
fn creep_during_hold_is_replayed_bit_for_bit() {
    let creeping = |factor| {
        let mut file = scaled_balance_model(factor).file().clone();
        let FamilyParameters::ForceBalance { balance, .. } = &mut file.family else {
            panic!("another family")
        };
        balance.creep = [0.05, 0.05, 0.05];
        Arc::new(Model::from_file(file).unwrap())
    };
    let (first, second) = (creeping(1.0), creeping(1.01));
    let mut bench = Bench::new(config(""), Some(Arc::clone(&first)));
    bench.recording = Some(Recording::keeping(|ticks| ticks.is_multiple_of(901)));
    bench.home();
    bench.enable();
    bench.carry_out(StateCommand::Condition);
    bench.pose = Some(([0.1, 0.05, 0.0], 2));
    bench.carry_out(StateCommand::Move);
    let (targets, measured) = (bench.targets(), bench.joints().measured[0]);
    bench.run(2000);
    assert_eq!(bench.targets(), targets);
    let crept = bench.joints().measured[0];
    assert!(crept - measured > 1e-4, "{measured} {crept}");
    bench.offer(bench.candidate(&first));
    bench.run(2);
    assert_eq!(bench.change_model(ModelChange::Activate(first.id()), false), Refusal::None);
    let recalled = bench.joints().measured[0];
    assert!((recalled - crept).abs() < 0.1 * (crept - measured), "{measured} {crept} {recalled}");
    assert_eq!(bench.swap(&second), Refusal::None);
    bench.run(500);
    assert_replayed(&bench.black_box(&first));
}

#[test]
fn replay_can_start_anywhere_and_resume_after_gap() {
    let mut content = recorded(|ticks| ticks % 250 == 138);
    content.ticks.drain(1000..1010);
    let replayed = replay(&content).unwrap();
    assert_eq!(replayed.difference, None);
    assert!(replayed.skipped > 137 && replayed.skipped < 137 + 260, "{replayed:?}");
    assert_eq!(replayed.ticks + replayed.skipped, content.ticks.len() as u64);
}

#[test]
fn the_first_difference_is_named() {
    let mut content = recorded(|ticks| ticks == 1);
    content.ticks[700].inputs.feedback[0].position.0 += 1;
    let difference = replay(&content).unwrap().difference.expect("a count more is a difference");
    assert_eq!(difference.number, content.ticks[700].number);
    assert_ne!(difference.recorded, difference.replayed);
    let mut content = recorded(|ticks| ticks == 1);
    content.ticks[900].outputs.report.since = Nanos(1);
    let difference = replay(&content).unwrap().difference.unwrap();
    assert_eq!((difference.number, difference.field), (content.ticks[900].number, "report"));
}

#[test]
fn a_missing_model_or_snapshot_is_an_error() {
    let mut content = recorded(|ticks| ticks == 1);
    content.models.clear();
    assert!(matches!(replay(&content), Err(ReplayError::NoModel(_))));
    assert!(matches!(replay(&recorded(|_| false)), Err(ReplayError::NoSnapshot)));
}
