//! Every process with its output blocked, closed or on a full disk, or suspended: the robot still
//! stops. One row per case; each must stop within its deadline.
//!
//! The whole table: `cargo test --test real_time -- --ignored --nocapture campaign_whole`.

use std::fs::{self, File};
use std::os::fd::OwnedFd;
use std::sync::{Mutex, PoisonError};

use i2ris_testing::program::{self, c_library, full_pipe};

use super::*;

/// Silence of the loop at which the watchdog stops the drives, ms: more than stalls of a machine.
const SILENCE_MS: u64 = 1000;
/// Margin for measurements from outside, on a shared test machine.
const TOLERANCE_MS: u64 = 250;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Subject {
    Controller,
    Watchdog,
    Ros,
    Recorder,
    Monitor,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Trouble {
    /// Standard output and error are a full pipe without a reader.
    Blocked,
    /// The other end of the pipe is closed.
    Gone,
    FullDisk,
    /// The process is stopped (SIGSTOP).
    Stopped,
}

const SUBJECTS: [Subject; 5] =
    [Subject::Controller, Subject::Watchdog, Subject::Ros, Subject::Recorder, Subject::Monitor];
const TROUBLES: [Trouble; 4] =
    [Trouble::Blocked, Trouble::Gone, Trouble::FullDisk, Trouble::Stopped];

/// Standard output and error, as long as it is held.
struct Output {
    /// Held, and never read.
    _reader: Option<std::io::PipeReader>,
    end: Option<OwnedFd>,
}

impl Output {
    fn new(trouble: Option<Trouble>) -> Self {
        let (mut _reader, mut end) = (None, None);
        match trouble {
            None | Some(Trouble::Stopped) => {}
            Some(Trouble::FullDisk) => {
                end = Some(File::options().write(true).open("/dev/full").unwrap().into());
            }
            Some(Trouble::Gone) => end = Some(std::io::pipe().unwrap().1.into()),
            Some(Trouble::Blocked) => {
                let (reader, writer) = full_pipe();
                (_reader, end) = (Some(reader), Some(writer.into()));
            }
        }
        Self { _reader, end }
    }

    fn stdio(&self) -> Stdio {
        self.end.as_ref().map_or_else(Stdio::null, |end| end.try_clone().unwrap().into())
    }
}

fn start(rig: &Rig, name: &str, arguments: &[&str], output: &Output) -> Killed {
    let mut command = Command::new(program::path(name));
    command.args(arguments).current_dir(rig.folder.path()).stdin(Stdio::null());
    command.env("I2RIS_DOMAIN", &rig.config.domain).env("ROS_DOMAIN_ID", "98");
    command.stdout(output.stdio()).stderr(output.stdio());
    Killed::start(&mut command)
}

/// A robot with a watchdog and the disturbed process.
struct Scene {
    rig: Rig,
    watchdog: Killed,
    /// Further processes.
    other: Option<Killed>,
    client: Client,
    _outputs: [Output; 2],
}

impl Scene {
    fn new(subject: Subject, trouble: Trouble) -> Self {
        let mut rig = Rig::start();
        let file = rig.folder.path().join("watched.toml");
        fs::write(&file, toml::to_string(&rig.config).unwrap()).unwrap();
        let output = |of| Output::new((of == subject).then_some(trouble));
        let (watchdog_output, output_of) = (output(Subject::Watchdog), Output::new(Some(trouble)));
        let arguments =
            ["--config", file.to_str().unwrap(), "--silence-ms", &SILENCE_MS.to_string()];
        let watchdog = start(&rig, "i2ris-watchdog", &arguments, &watchdog_output);
        let ports = rig.config.ports_digest();
        wait_until("the watchdog holds every port", || {
            WatchdogStatus::read(&rig.domain(), &ports, clock::now()) == WatchdogStatus::Watching
        });
        match subject {
            Subject::Controller => rig.start_controller_with(output_of.stdio()),
            _ => rig.start_controller(),
        }
        let mut client = rig.client();
        home(&mut client);
        enable(&mut client);
        wait_for(&mut client, |state| has(state, OperatingStateMsg::WATCHED));
        let other = Self::other(&rig, subject, &output_of);
        Self { rig, watchdog, other, client, _outputs: [watchdog_output, output_of] }
    }

    fn other(rig: &Rig, subject: Subject, output: &Output) -> Option<Killed> {
        let start = |name: &str, arguments: &[&str]| Some(start(rig, name, arguments, output));
        match subject {
            Subject::Controller | Subject::Watchdog => None,
            Subject::Ros => start("i2ris-ros", &["--command"]),
            Subject::Recorder => start("i2ris-record", &["--output", "all.mcap"]),
            Subject::Monitor => start("i2ris-status", &["--watch"]),
        }
    }

    fn stop_subject(&self, subject: Subject) {
        match (subject, &self.other) {
            (Subject::Controller, _) => self.rig.signal(Signal::SIGSTOP),
            (Subject::Watchdog, _) => self.watchdog.signal(Signal::SIGSTOP),
            (_, Some(other)) => other.signal(Signal::SIGSTOP),
            (_, None) => {}
        }
    }

    /// Waits until the watchdog has stopped both drives; ms since `from`.
    fn until_stopped(&self, from: Nanos) -> u64 {
        wait_until("both drives are stopped", || {
            let states = self.rig.emulator.snapshot().axes.map(|axis| axis.drive.state);
            states == [State::QuickStopActive; 2]
        });
        clock::now().duration_since(from).0 / 1_000_000
    }

    /// Time of the last setpoint change; ms since `from`.
    fn until_held(&self, from: Nanos) -> u64 {
        self.rig.wait_until_still();
        let last_change = |axis| {
            let setpoints = self.rig.setpoints(axis);
            let change = setpoints.windows(2).rev().find(|pair| pair[0].1 != pair[1].1);
            change.map_or(Nanos::ZERO, |pair| pair[1].0)
        };
        last_change(0).max(last_change(1)).duration_since(from).0 / 1_000_000
    }
}

/// Times to a hold without commands and to a stop without a controller, ms; `None`: suspended.
fn run(subject: Subject, trouble: Trouble) -> [Option<u64>; 2] {
    let mut scene = Scene::new(subject, trouble);
    let is_stopped = trouble == Trouble::Stopped;
    let from = while_streaming(&scene.client, swing, || {
        wait_until("the robot moves", || scene.rig.positions().iter().all(|it| it.abs() > 30));
        if is_stopped {
            scene.stop_subject(subject);
        }
        clock::now()
    });
    if is_stopped && subject == Subject::Controller {
        let stop = scene.until_stopped(from);
        scene.rig.signal(Signal::SIGCONT);
        return [None, Some(stop)];
    }
    let hold = scene.until_held(from);
    if is_stopped && subject == Subject::Watchdog {
        wait_for(&mut scene.client, |state| !has(state, OperatingStateMsg::WATCHED));
        return [Some(hold), None];
    }
    let killed = clock::now();
    scene.rig.signal(Signal::SIGKILL);
    scene.rig.wait_for_end();
    [Some(hold), Some(scene.until_stopped(killed))]
}

/// Runs cases, prints the table, and asserts that every one stopped in time.
fn campaign(cases: impl Iterator<Item = (Subject, Trouble)>) {
    let deadline_ms = Rig::start().config.command.deadline_ms + TOLERANCE_MS;
    let mut failed = Vec::new();
    println!("| process | trouble | holds after, ms | drives stopped after, ms | in time |");
    println!("|---|---|---|---|---|");
    for (subject, trouble) in cases {
        let [hold, stop] = run(subject, trouble);
        let is_in_time = hold.is_none_or(|ms| ms <= deadline_ms)
            && stop.is_none_or(|ms| ms <= SILENCE_MS + 2 * TOLERANCE_MS);
        let text = |ms: Option<u64>| ms.map_or("-".to_owned(), |ms| ms.to_string());
        let (hold, stop) = (text(hold), text(stop));
        println!("| {subject:?} | {trouble:?} | {hold} | {stop} | {is_in_time} |");
        if !is_in_time {
            failed.push((subject, trouble));
        }
    }
    assert!(failed.is_empty(), "not in time: {failed:?}");
}

/// A rig has about twenty threads, so the rigs run one at a time.
static ONE: Mutex<()> = Mutex::new(());

#[test]
fn campaign_robot_is_stopped_whatever_happens_to_output() {
    let _one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    campaign(
        [
            (Subject::Watchdog, Trouble::Blocked),
            (Subject::Watchdog, Trouble::FullDisk),
            (Subject::Watchdog, Trouble::Stopped),
            (Subject::Controller, Trouble::Blocked),
            (Subject::Controller, Trouble::Stopped),
        ]
        .into_iter(),
    );
}

#[test]
#[ignore = "every process and every trouble: two minutes"]
fn campaign_whole() {
    let _one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    campaign(SUBJECTS.into_iter().flat_map(|subject| TROUBLES.map(|trouble| (subject, trouble))));
}

/// A library preloaded before the C library: SIGUSR1 advances the clock that includes suspend time
/// by a minute, as if the computer had slept.
const FAKE_CLOCK: &str = r"
#define _GNU_SOURCE
#include <signal.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>
static volatile sig_atomic_t slept;
static void sleep_for_a_minute(int signal) { (void)signal; slept = 60; }
__attribute__((constructor)) static void start(void) { signal(SIGUSR1, sleep_for_a_minute); }
int clock_gettime(clockid_t clock, struct timespec *now) {
    int outcome = syscall(SYS_clock_gettime, clock, now);
    if (outcome == 0 && clock == CLOCK_BOOTTIME) now->tv_sec += slept;
    return outcome;
}
";

#[test]
fn computer_suspend_raises_fault_and_snake_holds() {
    let _one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    let mut rig = Rig::start();
    rig.environment.push(("LD_PRELOAD".into(), c_library(rig.folder.path(), FAKE_CLOCK).into()));
    let mut client = rig.enabled();
    let commander = rig.client();
    while_streaming(&commander, swing, || {
        wait_for(&mut client, |state| state.accepted > 50);
        rig.signal(Signal::SIGUSR1);
        settle_in(&mut client, OperatingState::Fault);
        rig.wait_until_still();
    });
    wait_until("the log says why", || rig.log_text("controller").contains("suspended for 60.0 s"));
    client.state_command(StateCommand::Acknowledge).unwrap();
}

/// Thousands of messages per second on every input, from clients of this process.
#[test]
fn flood_on_every_input_does_not_delay_stop() {
    let _one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    let mut rig = Rig::with_model();
    let mut client = rig.enabled();
    let (domain, end) = (rig.domain(), AtomicBool::new(false));
    let until_end = |mut send: Box<dyn FnMut(u64) + Send>| {
        let mut number = 0;
        while !end.load(Ordering::Relaxed) {
            number += 1;
            send(number);
            // Without it the floods take both processors of a small machine, and the drives, which
            // are threads here, do not answer in time.
            clock::sleep(Nanos::from_micros(100));
        }
    };
    let held = thread::scope(|scope| {
        let _end = SetOnDrop(&end);
        let (mut joints, mut counts) = (Forwarder::new(&domain), Forwarder::new(&domain));
        let mut requests = RequestForwarder::new(&domain);
        let mut camera = ExternalPublisher::new(&domain);
        let floods: [Box<dyn FnMut(u64) + Send>; 4] = [
            Box::new(move |sequence| {
                let command = ServoJp { sequence, client_id: sequence, ..ServoJp::default() };
                let _ = joints.servo_jp(command);
            }),
            Box::new(move |sequence| {
                let stamp_ns = clock::now().0;
                let _ = counts.servo_actuators(ServoActuator {
                    sequence,
                    stamp_ns,
                    client_id: 5,
                    position_counts: [30_000, 0],
                    count: 2,
                    ..ServoActuator::default()
                });
            }),
            Box::new(move |_| {
                let command = StateCommand::Acknowledge.number();
                let request = StateCommandRequest { client_id: 6, command, ..Default::default() };
                let _ = requests.state_command(request);
            }),
            Box::new(move |_| {
                let _ = camera.publish(clock::now(), &[f64::NAN, 0.0], &[]);
            }),
        ];
        for flood in floods {
            let until_end = &until_end;
            scope.spawn(move || until_end(flood));
        }
        wait_for(&mut client, |state| state.refused > 200);
        client.state_command(StateCommand::Pause).unwrap();
        settle_in(&mut client, OperatingState::Paused);
        client.state_command(StateCommand::Disable).unwrap();
        settle_in(&mut client, OperatingState::Disabled)
    });
    assert_eq!(held.fault, 0, "{held:?}");
}
