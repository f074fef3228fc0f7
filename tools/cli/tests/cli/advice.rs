//! Every advice, followed on a robot with emulated drives, resolves its problem.

use i2ris::clock;
use i2ris::ipc::client::{Client, Latest};
use i2ris::ipc::payload::{ActuatorState, OperatingStateMsg};
use i2ris::ipc::watchdog_presence::WatchdogPresence;
use i2ris::ipc::{Domain, OperatingState};
use i2ris::units::Nanos;
use nix::sys::signal::Signal;

use i2ris_testing::bench::{assert_says, fails, interrupt, robot, run, start, succeeds};
use i2ris_testing::{Rig, TIMEOUT, has, wait_for, wait_until};

const POSE: &str = "command pose 1 1 --duration-s 0.2";

fn commands(text: &str) -> Vec<String> {
    let quoted = text.split('`').skip(1).step_by(2);
    let words = quoted.filter_map(|it| it.strip_prefix("i2ris "));
    // Commands that only print something help the operator to find the cause.
    let changes = ["command", "home", "enable", "disable"];
    words
        .filter(|words| changes.iter().any(|it| words.starts_with(it)))
        .map(str::to_owned)
        .collect()
}

/// A command refused with this code, then its advice, then the command again.
fn refused_then_followed(domain: &Domain, words: &str, code: &str) {
    let result = run(domain, words);
    assert_eq!(result.code, Some(4), "{words}: {}{}", result.output, result.error);
    assert_says(&result.error, &[code]);
    let (_, advice) = result.error.split_once(';').unwrap_or_else(|| panic!("{}", result.error));
    let commands = commands(advice);
    assert!(!commands.is_empty(), "{advice}");
    for command in commands {
        follow(domain, &command);
    }
    succeeds(domain, words);
}

/// A `hold` blocks all other clients, so also the next command, for a second.
fn follow(domain: &Domain, command: &str) {
    succeeds(domain, command);
    if command.ends_with("hold") {
        clock::sleep(Nanos::from_millis(1100));
    }
}

/// Follows the first line of `status` until nothing keeps the robot from moving.
fn follow_status(domain: &Domain) {
    for _ in 0..6 {
        let text = succeeds(domain, "status");
        if text.starts_with("nothing keeps the robot from moving") {
            return;
        }
        let advice = text.lines().nth(1).unwrap();
        for command in commands(advice) {
            follow(domain, &command);
        }
    }
    panic!("{}", succeeds(domain, "status"));
}

#[test]
fn ended_watchdog_is_reported_in_log_and_status() {
    let mut rig = Rig::with_model();
    let mut client = rig.enabled();
    let domain = rig.domain();
    let presence = WatchdogPresence::announce(&domain, &rig.config.ports_digest()).unwrap();
    presence.set_complete(true).unwrap();
    wait_until("it is watched", || {
        presence.alive(clock::now()).unwrap();
        let state = client.wait_for(TIMEOUT, |_| true).unwrap();
        has(&state, OperatingStateMsg::WATCHED)
    });
    // The log is updated ten times a second.
    for _ in 0..30 {
        presence.alive(clock::now()).unwrap();
        clock::sleep(Nanos::from_millis(10));
    }
    drop(presence);
    let mut page = String::new();
    wait_until("status", || {
        page = succeeds(&domain, "status");
        page.contains("stop 3: no active watchdog")
    });
    wait_until("log", || rig.log_text("controller").contains("stop 3: no active watchdog"));
    assert!(page.contains(", no watchdog"), "{page}");
}

#[test]
fn every_advice_that_is_followed_succeeds() {
    let (rig, mut client) = robot(|_| ());
    let domain = rig.domain();
    let mut motors = Latest::new(client.watcher().actuators());
    let mut fault = |client: &mut Client| {
        rig.emulator.raise_fault(0, 0x8611, false);
        wait_for(client, |state| state.state == OperatingState::Fault.number());
        wait_until("the drives are where the fault sent them", || {
            let phases = |it: &ActuatorState| [0, 1].map(|motor| it.phase_text(motor));
            let is_there = |phase: &str| ["at fault", "quick-stopped"].contains(&phase);
            motors.refresh().unwrap().is_some_and(|it| phases(it).into_iter().all(is_there))
        });
    };
    for (before, words, code) in [
        (&[][..], "enable", "refusal 6: "),
        (&["disable"], POSE, "is DISABLED, not ENABLED"),
        (&["command state pause"], POSE, "is PAUSED, not ENABLED"),
        (&["disable"], "command state pause", "refusal 5: "),
        (&[], "command state condition --no-wait", "refusal 25: "),
        (&[], "command state condition --no-wait", "refusal 21: "),
        (&["command state hold"], "home", "refusal 27: "),
        (&["enable"], "command state unhome", "refusal 27: "),
    ] {
        before.iter().for_each(|words| follow(&domain, words));
        refused_then_followed(&domain, words, code);
    }
    // Off and without a zero: `status` leads to a moving robot, also from a pause and a fault.
    follow_status(&domain);
    succeeds(&domain, "command state pause");
    follow_status(&domain);
    fault(&mut client);
    refused_then_followed(&domain, "enable", "refusal 26: ");
    fault(&mut client);
    let why = succeeds(&domain, "status");
    assert!(
        why.starts_with("fault 1: a drive reports an error (motor 0: error code 0x8611)"),
        "{why}"
    );
    follow_status(&domain);
    // A state that is already reached is done.
    succeeds(&domain, "enable");
    succeeds(&domain, "command state resume");
    let result = run(&domain, "command state acknowledge");
    assert_says(&result.error, &["refusal 28: there is no fault to acknowledge; action: continue"]);
    // The lease holder is named and can be ended.
    let first = start(&domain, "command pose");
    wait_for(&mut client, |state| state.lease_client_id != 0);
    let result = run(&domain, POSE);
    assert_says(&result.error, &["i2ris, process ", "holds the lease; end that program first"]);
    assert_says(&succeeds(&domain, "status"), &["it follows i2ris command pose, process "]);
    interrupt(first);
    succeeds(&domain, POSE);
}

#[test]
fn status_names_the_end_of_a_controller_and_its_records() {
    let mut rig = Rig::start();
    let domain = rig.domain();
    rig.enabled();
    rig.signal(Signal::SIGKILL);
    rig.wait_for_end();
    let parts = ["was killed or crashed after 20", "records/runs.jsonl; the next start"];
    fails(&domain, "status", 3, &parts);
}
