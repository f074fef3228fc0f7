//! The watchdog and the controller as real processes: if the controller dies or hangs, the watchdog
//! stops the drives.
//!
//! Latency: `cargo test --test real_time -- --ignored --nocapture stop_latency`.

mod dead_node;
mod hangs;
mod pulse;
mod replug;

use std::os::unix::net::UnixDatagram;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, PoisonError};

use hangs::HungThread;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{OperatingState, StateCommand};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::*;

/// A rig whose watchdog was started first, with an enabled robot.
struct WatchedRig {
    rig: Rig,
    watchdog: Child,
    log: PathBuf,
    client: Option<Client>,
}

impl WatchedRig {
    /// `silence_ms`: loop silence that counts as hanging, longer than any stall of the machine.
    fn new(silence_ms: u64) -> Self {
        Self::with(Rig::start(), silence_ms)
    }

    fn with(rig: Rig, silence_ms: u64) -> Self {
        let mut watched = Self::without_controller(rig, silence_ms);
        watched.enable();
        watched.until_logged("watching");
        watched
    }

    fn without_controller(rig: Rig, silence_ms: u64) -> Self {
        let file = rig.folder.path().join("watched.toml");
        let log = rig.folder.path().join("watchdog.log");
        fs::write(&file, toml::to_string(&rig.config).unwrap()).unwrap();
        let watchdog = Command::new(env!("CARGO_BIN_EXE_i2ris-watchdog"))
            .arg("--config")
            .arg(&file)
            .args(["--silence-ms", &silence_ms.to_string()])
            .envs(rig.environment.iter().cloned())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(fs::File::create(&log).unwrap())
            .spawn()
            .unwrap();
        wait_until("the watchdog holds every port", || {
            let text = fs::read_to_string(&log).unwrap();
            text.matches("holding").count() == rig.config.ports.len()
        });
        Self { rig, watchdog, log, client: None }
    }

    /// Starts a controller and enables its drives.
    fn enable(&mut self) {
        self.client = Some(self.rig.enabled());
        assert_eq!(self.states(), [State::OperationEnabled; 2]);
    }

    /// Sends a signal that ends the controller, and waits for the end.
    fn end_with(&mut self, signal: Signal) {
        self.rig.signal(signal);
        self.rig.wait_for_end();
    }

    fn log_text(&self) -> String {
        fs::read_to_string(&self.log).unwrap()
    }

    fn until_logged(&self, what: &str) {
        wait_until(what, || self.log_text().contains(what));
    }

    fn states(&self) -> [State; 2] {
        self.rig.emulator.snapshot().axes.map(|axis| axis.drive.state)
    }

    fn until_watching_again(&self) {
        wait_until("the watchdog watches again", || {
            self.log_text().matches("watching").count() == 2
        });
    }

    fn until_stopped(&self) {
        wait_until("both drives are stopped", || self.states() == [State::QuickStopActive; 2]);
    }

    /// When a drive took its first quick stop since an instant.
    fn stop_since(&self, axis: usize, since: Nanos) -> Option<Nanos> {
        let mut states = dead_node::states(&self.rig, axis, since).into_iter();
        states.find(|(_, to)| *to == State::QuickStopActive).map(|(stamp, _)| stamp)
    }
}

impl Drop for WatchedRig {
    fn drop(&mut self) {
        // A clean exit, so that it removes its file.
        let id = Pid::from_raw(self.watchdog.id() as i32);
        if self.watchdog.try_wait().is_ok_and(|ended| ended.is_none()) {
            let _ = kill(id, Signal::SIGTERM);
            let _ = kill(id, Signal::SIGCONT); // A test may have stopped it.
        }
        let _ = self.watchdog.wait();
    }
}

/// Whether a program has a port for itself, as a controller does.
fn is_locked(device: &Path) -> bool {
    fs::File::open(device).is_ok_and(|file| file.try_lock().is_err())
}

/// Two of these tests at once: a rig has twenty threads, and its drives must reply in time.
fn in_turn() -> MutexGuard<'static, ()> {
    static TURNS: [Mutex<()>; 2] = [const { Mutex::new(()) }; 2];
    static NEXT: AtomicUsize = AtomicUsize::new(0);
    TURNS[NEXT.fetch_add(1, Relaxed) % 2].lock().unwrap_or_else(PoisonError::into_inner)
}

#[test]
fn h03_the_drives_of_a_killed_controller_are_stopped() {
    let _turn = in_turn();
    let mut watched = WatchedRig::new(3000);
    watched.end_with(Signal::SIGKILL);
    watched.until_stopped();
    watched.until_logged("the controller is gone");
    // The watchdog releases the ports, and watches the next controller.
    watched.enable();
    watched.until_watching_again();
}

#[test]
fn h03_the_drives_of_a_hanging_controller_are_stopped() {
    let _turn = in_turn();
    let watched = WatchedRig::new(3000);
    watched.rig.signal(Signal::SIGSTOP);
    watched.until_stopped();
    watched.until_logged("the controller hangs");
    // It continues: it must not enable the drives again.
    watched.rig.signal(Signal::SIGCONT);
    clock::sleep(Nanos::from_millis(500));
    assert!(
        watched.states().iter().all(|state| *state != State::OperationEnabled),
        "{:?}",
        watched.states()
    );
}

/// A silent drive is not off, even if the controller is in a fault because of it.
#[test]
fn h03_lost_drive_is_stopped_after_controller_dies_in_fault() {
    let _turn = in_turn();
    let mut rig = Rig::start();
    rig.config.limits.feedback_stale_ms = 1000;
    let mut watched = WatchedRig::with(rig, 3000);
    watched.rig.emulator.silence(0, true);
    let mut client = watched.client.take().unwrap();
    wait_for(&mut client, |state| state.state == OperatingState::Fault.number());
    assert_eq!(watched.states()[0], State::OperationEnabled);
    watched.rig.signal(Signal::SIGKILL);
    watched.rig.emulator.silence(0, false);
    wait_until("it is stopped", || watched.states()[0] == State::QuickStopActive);
    watched.rig.wait_for_end();
}

#[test]
fn clean_controller_exit_triggers_no_watchdog_stop() {
    let _turn = in_turn();
    let mut watched = WatchedRig::new(3000);
    watched.end_with(Signal::SIGTERM);
    watched.until_logged("ended with its drives off");
    assert_eq!([0, 1].map(|axis| watched.stop_since(axis, Nanos::ZERO)), [None; 2]);
    assert_eq!(watched.states(), [State::ReadyToSwitchOn; 2]);
    watched.enable();
}

#[test]
fn h03_a_controller_killed_while_disabled_starts_again() {
    let _turn = in_turn();
    let mut watched = WatchedRig::without_controller(Rig::start(), 3000);
    drop(watched.rig.started());
    watched.until_logged("watching");
    watched.end_with(Signal::SIGKILL);
    watched.enable();
    watched.until_watching_again();
}

#[test]
fn h03_a_controller_killed_before_it_serves_starts_again() {
    let _turn = in_turn();
    let mut watched = WatchedRig::without_controller(Rig::start(), 3000);
    // It waits for replies with its ports open.
    watched.rig.emulator.mute(0, true);
    watched.rig.start_controller();
    let device = watched.rig.config.ports[0].device.clone();
    wait_until("the controller has opened its port", || is_locked(&device));
    watched.end_with(Signal::SIGKILL);
    watched.rig.emulator.mute(0, false);
    watched.enable();
}

#[test]
fn h03_silent_port_does_not_delay_stop_of_other_port() {
    let _turn = in_turn();
    let mut watched = WatchedRig::with(Rig::on(Line::UsbEach), 3000);
    watched.rig.emulator.mute(0, true);
    watched.end_with(Signal::SIGKILL);
    wait_until("the drive that answers is stopped", || {
        watched.states()[1] == State::QuickStopActive
    });
    // It is written when the attempts with the silent drive have ended.
    assert_eq!(watched.log_text().matches("is gone").count(), 0);
    watched.until_logged("NOT STOPPED");
}

#[test]
fn h03_operating_state_reports_whether_watchdog_covers_every_port() {
    let _turn = in_turn();
    let mut watched = WatchedRig::new(3000);
    let mut client = watched.client.take().unwrap();
    wait_for(&mut client, |state| has(state, OperatingStateMsg::WATCHED));
    watched.watchdog.kill().unwrap();
    wait_for(&mut client, |state| !has(state, OperatingStateMsg::WATCHED));
}

#[test]
fn service_manager_is_notified_by_controller_and_watchdog() {
    let _turn = in_turn();
    let mut rig = Rig::start();
    let address = rig.folder.path().join("notify");
    let manager = UnixDatagram::bind(&address).unwrap();
    manager.set_read_timeout(Some(std::time::Duration::from_nanos(TIMEOUT.0))).unwrap();
    let expect_state = |expected: &str| loop {
        let mut message = [0; 64];
        let count = manager.recv(&mut message).expect(expected);
        if message[..count] == *expected.as_bytes() {
            break;
        }
    };
    rig.environment = vec![("NOTIFY_SOCKET".into(), address.clone().into())];
    drop(rig.started());
    expect_state("READY=1");
    rig.signal(Signal::SIGTERM);
    rig.wait_for_end();
    expect_state("STOPPING=1");
    let watched = WatchedRig::without_controller(rig, 3000);
    expect_state("READY=1");
    expect_state("WATCHDOG=1");
    drop(watched);
}

/// A process or thread that ends or hangs in motion.
enum Loss {
    Process(Signal),
    Thread(&'static str),
}

/// Prints the time to the last quick stop in motion with the default silence of the watchdog, and
/// what the emulated line counted. `I2RIS_TIMES`: how often, 15 by default.
#[test]
#[ignore = "prints times, which depend on the machine"]
fn stop_latency() {
    let _turn = in_turn();
    let times = std::env::var("I2RIS_TIMES").map_or(15, |times| times.parse().unwrap());
    for (name, loss) in [
        ("SIGKILL", Loss::Process(Signal::SIGKILL)),
        ("SIGSTOP", Loss::Process(Signal::SIGSTOP)),
        ("a hang of the loop", Loss::Thread("control")),
        ("a hang of the port thread", Loss::Thread("port")),
    ] {
        let (mut spans, mut violations) = (Vec::new(), 0);
        for _ in 0..times {
            let mut rig = Rig::start();
            // As on a robot, if the system permits it.
            rig.config.control.priority = 80;
            let mut watched = WatchedRig::with(rig, 50);
            spans.push(watched.while_moving(|watched| {
                let begin = clock::now();
                let _hung = match loss {
                    Loss::Process(signal) => {
                        watched.rig.signal(signal);
                        None
                    }
                    Loss::Thread(name) => Some(HungThread::of(&watched.rig, name)),
                };
                watched.until_all_stopped(begin)
            }));
            violations += watched.violations();
            watched.end_with(Signal::SIGKILL);
        }
        // The emulated gateway waits for 100 ms.
        print_spans(name, spans, 160, &format!("{violations} protocol violations"));
    }
}

/// Prints the number of spans within a limit, and their lengths.
fn print_spans(name: &str, mut spans: Vec<Nanos>, limit_ms: u64, remark: &str) {
    spans.sort_unstable();
    let ms = [0.0, 0.5, 0.9, 1.0].map(|quantile| {
        let index = (spans.len() - 1) as f64 * quantile;
        (spans[index as usize].as_seconds() * 1e3).round()
    });
    let within = spans.iter().filter(|span| **span <= Nanos::from_millis(limit_ms)).count();
    println!(
        "{name}: {within} of {} within {limit_ms} ms; ms, minimum, median, p90, maximum: {ms:?}; \
         {remark}",
        spans.len()
    );
}
