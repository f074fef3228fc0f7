//! The cycle takes no memory: counted over 10,000 ticks of work, faults, recoveries and swaps of
//! models.

#![allow(clippy::unwrap_used, clippy::expect_used)]

#[allow(
    dead_code,
    reason = "shared with the tests of the cycle, which use all of it"
)]
#[path = "cycle/bench.rs"]
mod bench;
#[allow(
    dead_code,
    reason = "shared with the tests of the cycle, which use all of it"
)]
#[path = "cycle/drive.rs"]
mod drive;
#[path = "cycle/invariant.rs"]
mod invariant;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;

use bench::Bench;
use drive::Quirk;
use i2ris::core::ModelChange;
use i2ris::drive::AxisPhase;
use i2ris::ipc::{OperatingState, Refusal, StateCommand};
use i2ris::model::Model;
use i2ris::model::file::OutputUnit;

/// The system's allocator, with a count per thread of every call that takes or gives back memory.
struct Counting;

thread_local! {
    static CALLS: Cell<u64> = const { Cell::new(0) };
}

fn count() {
    CALLS.with(|calls| calls.set(calls.get() + 1));
}

fn calls() -> u64 {
    CALLS.with(Cell::get)
}

// SAFETY: every call goes on to the system's allocator unchanged; the counter is a plain cell
// without a destructor, so counting neither allocates nor fails.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: as promised by the caller.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: as promised by the caller.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: as promised by the caller.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Everything that happens in a day, in some 700 ticks.
fn a_day(bench: &mut Bench, models: &[Arc<Model>; 2], day: u32) {
    bench.home();
    bench.enable();
    for k in 0..20 {
        let angle = f64::from(k) * 0.2;
        assert_eq!(bench.joint(angle, -angle), Refusal::None);
        bench.run(4);
    }
    assert_eq!(bench.joint(f64::NAN, 0.0), Refusal::NotFinite);
    assert_eq!(bench.joint(40.0, 0.0), Refusal::Step);
    bench.run(60);
    assert_eq!(bench.report().stale_stops, u64::from(day) + 1);
    let goal = bench.targets().map(|target| target - 100);
    assert_eq!(bench.actuator(goal), Refusal::None);
    bench.run(10);
    assert_eq!(bench.ask(StateCommand::Pause), Refusal::None);
    bench.run(10);
    assert_eq!(bench.ask(StateCommand::Resume), Refusal::None);
    swap_models(bench, models, day);
    assert_eq!(bench.ask(StateCommand::Condition), Refusal::None);
    bench.run(200);
    assert!(bench.report().busy);
    break_down(bench, day);
    assert_eq!(bench.ask(StateCommand::Acknowledge), Refusal::None);
    bench.idle();
    assert_eq!(bench.state(), OperatingState::Disabled);
}

/// Forward, back, and forward again while angles are followed. The models are built before: that
/// takes memory.
fn swap_models(bench: &mut Bench, models: &[Arc<Model>; 2], day: u32) {
    let here = bench.joints().setpoint.map(f64::to_degrees);
    assert_eq!(bench.joint(here[0], here[1]), Refusal::None);
    let next = &models[(day % 2) as usize];
    bench.offer(bench.candidate(next));
    bench.run(2);
    assert_eq!(
        bench.change_model(ModelChange::Activate(next.id()), true),
        Refusal::None
    );
    bench.run(5);
    assert_eq!(
        bench.change_model(ModelChange::Rollback, true),
        Refusal::None
    );
    bench.run(5);
    assert_eq!(
        bench.change_model(ModelChange::Rollback, true),
        Refusal::None
    );
    bench.run(20);
}

fn break_down(bench: &mut Bench, day: u32) {
    match day % 3 {
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
fn ten_thousand_ticks_with_faults_recoveries_and_swaps_take_no_memory() {
    let mut bench = Bench::standard();
    bench.probe = calls;
    let models = [bench::play_model(), bench::model(OutputUnit::Deg)];
    let begin = bench.now;
    for day in 0..20 {
        a_day(&mut bench, &models, day);
    }
    let ticks = bench.now.since(begin).0 / bench.config.control.period().0;
    assert!(ticks >= 10_000, "{ticks} ticks");
    bench.shutdown = true;
    bench.until("the end", |bench| bench.out.finished);
    assert_eq!(bench.probed, 0, "calls of the allocator in {ticks} ticks");
    assert!(calls() > 0, "the allocator is the counting one");
}
