//! The cycle allocates nothing: counted over 10,000 ticks of work, faults, recoveries and swaps.

use std::sync::Arc;

use i2ris::core::ModelChange;
use i2ris::drive::AxisPhase;
use i2ris::ipc::{OperatingState, Refusal, StateCommand};
use i2ris::model::Model;
use i2ris_testing::cycle::{Bench, Quirk, config, flying, standard_model};

use crate::calls;

/// A session with every kind of event, about 700 ticks.
fn run_session(bench: &mut Bench, models: &[Arc<Model>], session: u32) {
    bench.home();
    bench.enable();
    for k in 0..20 {
        let angle = f64::from(k) * 0.2;
        assert_eq!(bench.joint(angle, -angle), Refusal::None);
        bench.run(4);
    }
    assert_eq!(bench.joint(f64::NAN, 0.0), Refusal::NotFinite);
    assert_eq!(bench.joint(40.0, 0.0), Refusal::StepTooLarge);
    bench.run(60);
    assert_eq!(bench.report().stale_stops, u64::from(session) + 1);
    let goal = bench.targets().map(|target| target - 100);
    assert_eq!(bench.actuator(goal), Refusal::None);
    bench.run(10);
    assert_eq!(bench.ask(StateCommand::Pause), Refusal::None);
    bench.run(10);
    assert_eq!(bench.ask(StateCommand::Resume), Refusal::None);
    swap_models(bench, models, session);
    assert_eq!(bench.ask(StateCommand::Condition), Refusal::None);
    bench.run(200);
    assert!(bench.report().busy);
    cause_fault(bench, session);
    bench.carry_out(StateCommand::Acknowledge);
    assert_eq!(bench.state(), OperatingState::Disabled);
}

/// Forward, back, and forward again while angles are followed, with models that are built before.
fn swap_models(bench: &mut Bench, models: &[Arc<Model>], session: u32) {
    let here = bench.joints().setpoint.map(f64::to_degrees);
    assert_eq!(bench.joint(here[0], here[1]), Refusal::None);
    let next = &models[session as usize % models.len()];
    bench.offer(bench.candidate(next));
    bench.run(2);
    assert_eq!(bench.change_model(ModelChange::Activate(next.id()), true), Refusal::None);
    bench.run(5);
    assert_eq!(bench.change_model(ModelChange::Rollback, true), Refusal::None);
    bench.run(5);
    assert_eq!(bench.change_model(ModelChange::Rollback, true), Refusal::None);
    bench.run(20);
}

fn cause_fault(bench: &mut Bench, session: u32) {
    match session % 3 {
        0 => bench.drives[0].feedback.phase = AxisPhase::Faulted,
        1 => bench.drives[1].feedback.phase = AxisPhase::QuickStopped,
        _ => bench.quirk(1, Quirk::Silent),
    }
    bench.run(260);
    assert_eq!(bench.state(), OperatingState::Fault);
    bench.quirk(1, Quirk::None);
    bench.run(20);
}

#[test]
fn ten_thousand_ticks_with_faults_and_swaps_do_not_allocate() {
    count_calls(Bench::standard());
}

#[test]
fn ten_thousand_ticks_with_adaptation_do_not_allocate() {
    let mut bench = Bench::new(config("[adaptation]\nenabled = true"), Some(standard_model()));
    bench.camera = Some([0.01, -0.01]);
    count_calls(bench);
}

#[test]
fn other_families_fly_too() {
    i2ris_testing::cycle::with_other_families("cycle::");
}

fn count_calls(mut bench: Bench) {
    bench.probe = calls;
    let models = flying().into_iter().map(|(_, model)| model()).collect::<Vec<_>>();
    let begin = bench.now;
    for session in 0..20 {
        run_session(&mut bench, &models, session);
    }
    let ticks = bench.now.duration_since(begin).0 / bench.config.control.period().0;
    assert!(ticks >= 10_000, "{ticks} ticks");
    bench.shutdown = true;
    bench.until("the end", |bench| bench.out.finished);
    assert_eq!(bench.probed, 0, "calls of the allocator in {ticks} ticks");
    assert!(calls() > 0, "the allocator is the counting one");
}
