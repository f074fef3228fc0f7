//! The port thread allocates nothing once it runs: not in an exchange, not in a change of state,
//! not in a recovery.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may")]

mod drive_fixture;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::io;
use std::path::Path;

use drive_fixture::rig::{NODE, one_drive};
use drive_fixture::*;
use i2ris::config::PortConfig;
use i2ris::drive::transport::Transport;
use i2ris::drive::{AxisLink, AxisPhase, AxisRequest, Demand, Port, PortEvent, PortRunner};
use i2ris::units::{Counts, Nanos};
use i2ris_emulator::snake::SnakeConfig;
use i2ris_emulator::{Emulator, EmulatorConfig};

thread_local! {
    static COUNTING: Cell<bool> = const { Cell::new(false) };
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// Counts what the threads allocate that ask for it.
struct Counting;

// SAFETY: everything is passed on to the system's allocator; the counters are plain cells and
// allocate nothing.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if COUNTING.get() {
            ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        }
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// What `work` allocates in this thread.
fn allocations(work: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.get();
    COUNTING.set(true);
    work();
    COUNTING.set(false);
    ALLOCATIONS.get() - before
}

/// The simulated line may allocate: it stands for hardware.
struct Uncounted(Bench);

impl Uncounted {
    fn paused<R>(&mut self, work: impl FnOnce(&mut Bench) -> R) -> R {
        let counting = COUNTING.replace(false);
        let result = work(&mut self.0);
        COUNTING.set(counting);
        result
    }
}

impl Transport for Uncounted {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.paused(|bench| bench.write(bytes))
    }

    fn read(&mut self, into: &mut [u8], deadline: Nanos) -> io::Result<usize> {
        self.paused(|bench| bench.read(into, deadline))
    }

    fn now(&self) -> Nanos {
        self.0.now()
    }

    fn sleep_until(&mut self, until: Nanos) {
        self.paused(|bench| bench.sleep_until(until));
    }
}

/// Turns until the axis is in a phase.
fn until<T: Transport>(
    runner: &mut PortRunner<T>,
    link: &mut AxisLink,
    request: AxisRequest,
    phase: AxisPhase,
) {
    let mut ignore = |_: PortEvent| {};
    link.requests.write(request);
    for _ in 0..20_000 {
        runner.turn(&mut ignore);
        if link.feedback.read().phase == phase {
            return;
        }
    }
    panic!("never {phase:?}");
}

#[test]
fn the_counter_counts() {
    assert!(allocations(|| drop(std::hint::black_box(Vec::<u8>::with_capacity(10)))) > 0);
}

#[test]
fn nothing_is_allocated_through_a_life_with_faults_and_losses() {
    let drive = one_drive();
    let config = port_config(std::slice::from_ref(&drive));
    let bench = Bench::new(vec![drive]);
    let (mut runner, mut links) = Port::over(Uncounted(bench.clone()), &config)
        .bring_up()
        .unwrap()
        .split();
    let link = &mut links[0];
    let mut request = AxisRequest::default();
    let mut ignore = |_: PortEvent| {};

    let count = allocations(|| {
        until(&mut runner, link, request, AxisPhase::Disabled);
        request.homings = 1;
        until(&mut runner, link, request, AxisPhase::Homing);
        until(&mut runner, link, request, AxisPhase::Disabled);
        request.demand = Demand::Enabled;
        until(&mut runner, link, request, AxisPhase::Enabled);
        for target in 0..1000 {
            request.target = Counts(target);
            link.requests.write(request);
            if target % 50 == 0 {
                uncounted(|| bench.misbehave([Mischief::LoseReply, Mischief::FlipReply(7)]));
            }
            runner.turn(&mut ignore);
        }
        uncounted(|| bench.drive(NODE, |drive| drive.fail(0x8611)));
        until(&mut runner, link, request, AxisPhase::Faulted);
        request.fault_resets = 1;
        request.demand = Demand::Disabled;
        until(&mut runner, link, request, AxisPhase::Disabled);
        uncounted(|| bench.world().dead = true);
        until(&mut runner, link, request, AxisPhase::Lost);
        uncounted(|| bench.world().dead = false);
        until(&mut runner, link, request, AxisPhase::Disabled);
        request.demand = Demand::Enabled;
        until(&mut runner, link, request, AxisPhase::Enabled);
        runner.shut_down(&mut ignore);
    });
    assert_eq!(count, 0);
}

/// Pauses the counting for what a test does to the bench.
fn uncounted<R>(work: impl FnOnce() -> R) -> R {
    let counting = COUNTING.replace(false);
    let result = work();
    COUNTING.set(counting);
    result
}

#[test]
fn nothing_is_allocated_on_a_real_port_with_time_outs() {
    let folder = tempfile::tempdir().unwrap();
    let snake = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/snakes/steel.toml");
    let emulated = EmulatorConfig::new(
        SnakeConfig::load(&snake).unwrap(),
        &folder.path().join("ports"),
    );
    let emulator = Emulator::start(emulated).unwrap();
    let mut drive = one_drive();
    drive.serial_number = 62_000_001;
    let config = PortConfig {
        device: emulator.device(0).to_owned(),
        reply_timeout_ms: 50,
        ..port_config(&[drive])
    };
    let (mut runner, mut links) = Port::open(&config).unwrap().bring_up().unwrap().split();
    let link = &mut links[0];
    let mut ignore = |_: PortEvent| {};
    let request = AxisRequest::default();

    let count = allocations(|| {
        until(&mut runner, link, request, AxisPhase::Disabled);
        (0..100).for_each(|_| runner.turn(&mut ignore));
        emulator.mute(0, true);
        until(&mut runner, link, request, AxisPhase::Lost);
        emulator.mute(0, false);
        until(&mut runner, link, request, AxisPhase::Disabled);
    });
    assert_eq!(count, 0);
}
