//! Stopping by name and by key, and reports of commands that were interrupted.

use std::fs;
use std::process::{Command, Stdio};

use i2ris::ipc::client::{Client, Watcher};
use i2ris::ipc::{OperatingState, StateCommand};
use i2ris::ipc::{payload::OperatingStateMsg, watchdog_presence::WatchdogStatus};
use i2ris::{clock, units::Nanos};
use i2ris_simulation::Injection;
use i2ris_testing::bench::{assert_says, ends, fails, robot, run, start, succeeds};
use i2ris_testing::{Controller, Rig, TIMEOUT, Terminal, has, home_and_enable, program};
use i2ris_testing::{unique_domain, wait_for, wait_until, wait_until_holding};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

fn enabled(change: impl FnOnce(&mut Rig)) -> (Rig, Client) {
    let (rig, mut client) = robot(|rig| {
        rig.config.compensation.conditioning_counts = Some(300);
        change(rig);
    });
    home_and_enable(&mut client, TIMEOUT).unwrap();
    (rig, client)
}

fn is_busy(state: &OperatingStateMsg) -> bool {
    has(state, OperatingStateMsg::BUSY)
}

#[test]
fn cycle_ended_by_a_stalled_line_is_not_done() {
    let (rig, mut client) = enabled(|rig| rig.config.limits.feedback_stale_ms = 300);
    let program = start(&rig.domain(), "command state condition");
    wait_for(&mut client, is_busy);
    rig.emulator.inject(1, Injection::Mute { for_ms: 900 });
    ends(program, 4, &["`condition` was not carried out: stop 2: no recent position from a drive"]);
}

#[test]
fn whatever_ends_a_cycle_is_named_with_its_exit_code() {
    let (rig, mut client) = enabled(|_| ());
    let domain = rig.domain();
    let mut interrupted = |by: &dyn Fn(&mut Client), code: i32, parts: &[&str]| {
        let program = start(&domain, "command state condition");
        wait_for(&mut client, is_busy);
        by(&mut client);
        ends(program, code, parts);
    };
    let hold = |client: &mut Client| _ = client.state_command(StateCommand::Hold).unwrap();
    interrupted(&hold, 4, &["stop 4: move, homing or conditioning interrupted by a later command"]);
    // The hold also blocks the next program, until the client has been silent for a second.
    clock::sleep(Nanos::from_millis(1100));
    let fault = |_: &mut Client| rig.emulator.raise_fault(0, 0x2310, false);
    interrupted(&fault, 5, &["`condition` was not carried out: fault 1: a drive reports an error"]);
}

#[test]
fn a_controller_that_ends_during_a_cycle_ends_the_wait() {
    let controller = Controller::enabled();
    controller.robot().busy_for = Nanos::from_millis(3_600_000);
    let program = start(&controller.domain, "command state condition");
    controller.wait("the request", |robot| !robot.requested.is_empty());
    drop(controller);
    ends(program, 3, &["no controller serves domain"]);
}

/// The power state of a silent drive is unknown.
#[test]
fn silent_drives_are_not_reported_to_be_off() {
    let (rig, mut client) = enabled(|rig| {
        rig.config.limits.feedback_stale_ms = 300;
        rig.config.ports.iter_mut().for_each(|port| port.reply_timeout_ms = 200);
    });
    rig.emulator.mute(1, true);
    wait_for(&mut client, |state| state.state == OperatingState::Fault.number());
    let parts = ["effect of `disable` is not confirmed", "cut the power"];
    fails(&rig.domain(), "disable", 8, &parts);
    fails(&rig.domain(), "stop", 8, &["FAULT, NOT CONFIRMED to be at rest"]);
    let result = succeeds(&rig.domain(), "disable --no-wait");
    let power = "until `i2ris command state acknowledge`; a drive has not confirmed power-off";
    assert_says(&result, &["accepted: disable; the controller is FAULT", power]);
    rig.emulator.mute(1, false);
}

#[test]
fn stop_holds_every_client_ends_motion_and_reports_it() {
    let (rig, mut client) = enabled(|_| ());
    let domain = rig.domain();
    let mut named = false;
    for name in ["stop", "estop"].into_iter().cycle().take(10) {
        let circle = start(&domain, "command circle --radius-deg 4 --period-s 3");
        wait_for(&mut client, |state| state.lease_client_id != 0 && state.accepted > 50);
        let output = succeeds(&domain, name);
        assert_says(&output, &["the robot is ENABLED, holds still"]);
        ends(circle, 4, &["refusal 24"]);
        // On a loaded machine the earlier state may arrive too late for the stop.
        named |= output.contains("stopped: i2ris, process");
        if named && name == "estop" {
            break;
        }
    }
    assert!(named);
    clock::sleep(Nanos::from_millis(1100)); // A `hold` holds every other client for a second.
    client.move_jp(&[0.15, 0.0]).unwrap();
    succeeds(&domain, "stop");
    let state = wait_until_holding(&mut client);
    assert!(has(&state, OperatingStateMsg::AT_REST) && !is_busy(&state));
    assert_says(&succeeds(&domain, "stop"), &["holds still; stopped: nothing"]);
    assert_says(&succeeds(&domain, "disable"), &["the controller is DISABLED; every drive is off"]);
    assert_says(&succeeds(&domain, "stop"), &["DISABLED, every drive is off"]);
    let unserved = ["NOT CONFIRMED to be stopped: no controller serves domain"];
    fails(&unique_domain(), "stop", 3, &unserved);
}

#[test]
fn a_stop_is_sent_and_seen_however_many_watch() {
    let (rig, mut client) = enabled(|_| ());
    let domain = rig.domain();
    let circle = start(&domain, "command circle --radius-deg 4 --period-s 3");
    wait_for(&mut client, |state| state.lease_client_id != 0 && state.accepted > 50);
    let watchers: Vec<_> = (0..64)
        .map_while(|_| {
            let mut states = Watcher::new(&domain).operating_state();
            states.newest().map(|_| states).inspect_err(|error| println!("{error}")).ok()
        })
        .collect();
    assert!((20..40).contains(&watchers.len()), "{}", watchers.len());
    assert_says(&succeeds(&domain, "stop"), &["the robot is ENABLED, holds still"]);
    ends(circle, 4, &[]);
    succeeds(&domain, "command state pause");
    succeeds(&domain, "disable");
    let state = client.wait_for(TIMEOUT, |_| true).unwrap().state;
    assert_eq!(state, OperatingState::Disabled.number());
}

#[test]
fn a_watchdog_that_hangs_is_named_by_its_process() {
    let rig = Rig::start();
    let (domain, file) = (rig.domain(), rig.folder.path().join("watched.toml"));
    fs::write(&file, toml::to_string(&rig.config).unwrap()).unwrap();
    let mut command = Command::new(program::path("i2ris-watchdog"));
    let mut watchdog = command.arg("--config").arg(&file).stderr(Stdio::null()).spawn().unwrap();
    let status = || WatchdogStatus::read(&domain, &rig.config.ports_digest(), clock::now());
    wait_until("it watches", || status() == WatchdogStatus::Watching);
    let pid = Pid::from_raw(watchdog.id().cast_signed());
    kill(pid, Signal::SIGSTOP).unwrap();
    wait_until("it hangs", || status() == WatchdogStatus::Silent);
    let result = run(&domain, &format!("doctor --no-drives --config {}", file.display()));
    watchdog.kill().unwrap();
    watchdog.wait().unwrap();
    let named = format!("process {pid} is running, but hung or suspended");
    assert_says(&result.output, &[&named, "`kill -KILL` this process"]);
}

#[test]
fn s_stops_while_the_keyboard_steers() {
    let controller = Controller::enabled();
    let mut terminal = Terminal::start(&controller.domain, &["teleop", "--keyboard"], 24, 100);
    controller.wait("commands", |robot| robot.poses.len() > 20);
    terminal.type_keys(" ");
    controller.wait("a closed clutch", |robot| robot.flags == 0);
    terminal.type_keys("s");
    assert!(terminal.end().success());
    let shown = terminal.screen.screen().contents();
    assert!(shown.contains("the robot is ENABLED, holds still"), "{shown}");
    assert_eq!(controller.robot().requested, [StateCommand::Hold, StateCommand::Release]);
}
