//! The guard and the controller as real processes: whatever ends the controller, its drives are
//! stopped.
//!
//! How long it takes: `cargo test --test drive_guard -- --ignored --nocapture latency`.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

mod rig;

use std::fs;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use i2ris::clock;
use i2ris::ipc::client::Client;
use i2ris::units::Nanos;
use i2ris_emulator::drive::State;
use i2ris_emulator::log::EventKind;
use nix::sys::signal::Signal;
use rig::{Rig, TIMEOUT as PATIENCE};

/// A rig with a guard that was there first, and an enabled robot.
struct Guarded {
    rig: Rig,
    guard: Child,
    said: PathBuf,
    _client: Client,
}

impl Guarded {
    /// A guard that takes this silence for hanging. A test takes more than any stall of the
    /// machine.
    fn new(silence_ms: u64) -> Self {
        Self::with(Rig::new(), silence_ms)
    }

    fn with(mut rig: Rig, silence_ms: u64) -> Self {
        let (file, said) = (
            rig.folder.path().join("guarded.toml"),
            rig.folder.path().join("guard.log"),
        );
        fs::write(&file, toml::to_string(&rig.config).unwrap()).unwrap();
        let guard = Command::new(env!("CARGO_BIN_EXE_i2ris-watchdog"))
            .arg("--config")
            .arg(&file)
            .args(["--silence-ms", &silence_ms.to_string()])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(fs::File::create(&said).unwrap())
            .spawn()
            .unwrap();
        until("the guard holds both ports", || {
            fs::read_to_string(&said)
                .unwrap()
                .matches("holding")
                .count()
                == 2
        });
        let client = rig.enabled();
        let guarded = Self {
            rig,
            guard,
            said,
            _client: client,
        };
        guarded.until_said("watching");
        guarded
    }

    /// Sends a signal that ends the controller, and waits for the end.
    fn end_with(&mut self, signal: Signal) {
        self.rig.signal(signal);
        self.rig.wait_for_end();
    }

    fn said(&self) -> String {
        fs::read_to_string(&self.said).unwrap()
    }

    fn until_said(&self, what: &str) {
        until(what, || self.said().contains(what));
    }

    fn states(&self) -> [State; 2] {
        self.rig
            .emulator
            .snapshot()
            .axes
            .map(|axis| axis.drive.state)
    }

    fn until_stopped(&self) {
        until("both drives are stopped", || {
            self.states() == [State::QuickStopActive; 2]
        });
    }

    /// When each drive was stopped, for the last time.
    fn stops(&self) -> [Option<Nanos>; 2] {
        let log = self.rig.emulator.log();
        [0, 1].map(|axis| {
            let stopped = |kind| {
                matches!(
                    kind,
                    EventKind::State {
                        to: State::QuickStopActive,
                        ..
                    }
                )
            };
            log.iter()
                .rev()
                .find(|event| event.axis == axis && stopped(event.kind))
                .map(|event| event.stamp)
        })
    }
}

impl Drop for Guarded {
    fn drop(&mut self) {
        let _ = self.guard.kill();
        let _ = self.guard.wait();
    }
}

fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let start = clock::now();
    while !holds() {
        assert!(clock::now() - start < PATIENCE, "never: {what}");
        clock::sleep(Nanos::from_millis(5));
    }
}

#[test]
fn h03_a_controller_that_is_killed_leaves_its_drives_stopped() {
    let mut guarded = Guarded::new(3000);
    assert_eq!(guarded.states(), [State::OperationEnabled; 2]);
    guarded.end_with(Signal::SIGKILL);
    guarded.until_stopped();
    guarded.until_said("the controller is gone");
    // The guard lets others have the ports, and watches the next one.
    let _client = guarded.rig.enabled();
    until("the guard watches again", || {
        guarded.said().matches("watching").count() == 2
    });
    assert_eq!(guarded.states(), [State::OperationEnabled; 2]);
}

#[test]
fn h03_a_controller_that_hangs_leaves_its_drives_stopped() {
    let guarded = Guarded::new(3000);
    guarded.rig.signal(Signal::SIGSTOP);
    guarded.until_stopped();
    guarded.until_said("the controller hangs");
    // It wakes up: what it does then must not set the drives going again.
    guarded.rig.signal(Signal::SIGCONT);
    clock::sleep(Nanos::from_millis(500));
    assert!(
        guarded
            .states()
            .iter()
            .all(|state| *state != State::OperationEnabled),
        "{:?}",
        guarded.states()
    );
}

#[test]
fn a_controller_that_ends_in_order_is_left_alone() {
    let mut guarded = Guarded::new(3000);
    guarded.end_with(Signal::SIGTERM);
    guarded.until_said("ended with its drives off");
    assert_eq!(guarded.stops(), [None; 2]);
    assert_eq!(guarded.states(), [State::ReadyToSwitchOn; 2]);
}

/// Prints how long it takes from the signal to the quick stop in the drives, with the silence that
/// the guard has by default.
#[test]
#[ignore = "prints times, which depend on the machine"]
fn latency() {
    const TIMES: usize = 15;
    for (name, signal) in [("SIGKILL", Signal::SIGKILL), ("SIGSTOP", Signal::SIGSTOP)] {
        let mut spans: Vec<Nanos> = Vec::new();
        for _ in 0..TIMES {
            let mut rig = Rig::new();
            // As a robot would be run, if the system allows it.
            (rig.config.control.priority, rig.config.control.lock_memory) = (80, true);
            let mut guarded = Guarded::with(rig, 40);
            let begin = clock::now();
            guarded.rig.signal(signal);
            guarded.until_stopped();
            spans.extend(
                guarded
                    .stops()
                    .into_iter()
                    .flatten()
                    .map(|stamp| stamp - begin),
            );
            guarded.end_with(Signal::SIGKILL);
        }
        spans.sort_unstable();
        let ms = |quantile: f64| {
            spans[((spans.len() - 1) as f64 * quantile) as usize].as_seconds() * 1e3
        };
        println!(
            "{name}: {} stops, ms: min {:.0}, median {:.0}, p90 {:.0}, max {:.0}",
            spans.len(),
            ms(0.0),
            ms(0.5),
            ms(0.9),
            ms(1.0)
        );
    }
}
