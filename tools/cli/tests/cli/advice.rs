//! Every advice, followed on a robot with emulated drives, resolves its problem. Mistakes of new
//! users: message and exit code of each row in the table of the manual, by real processes.
//! `I2RIS_UPDATE=1` writes the messages; a new row needs no message.

use std::fs;

use i2ris::ipc::client::{Client, Latest};
use i2ris::ipc::payload::{ActuatorState, OperatingStateMsg};
use i2ris::ipc::{Domain, OperatingState};
use i2ris::{clock, ipc::watchdog_presence::WatchdogPresence, units::Nanos};
use i2ris_testing::bench::{WorkFolder, assert_says, expect_stalls, fails, interrupt, repository};
use i2ris_testing::bench::{robot, run, start, succeeds};
use i2ris_testing::{Rig, TIMEOUT, has, unique_domain, wait_for, wait_until, wait_until_idle};
use nix::sys::signal::Signal;

const POSE: &str = "command pose 1 1 --duration-s 0.2";

fn commands(text: &str) -> Vec<String> {
    let quoted = text.split('`').skip(1).step_by(2);
    let words = quoted.filter_map(|it| it.strip_prefix("i2ris "));
    // Commands that only print something help the operator to find the cause.
    let changes = ["command", "home", "enable", "disable"];
    let is_change = |words: &&str| changes.iter().any(|it| words.starts_with(it));
    words.filter(is_change).map(str::to_owned).collect()
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
        for command in commands(text.lines().nth(1).unwrap()) {
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
        has(&client.wait_for(TIMEOUT, |_| true).unwrap(), OperatingStateMsg::WATCHED)
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
    let first = "fault 1: a drive reports an error (motor 0: error code 0x8611)";
    assert!(why.starts_with(first), "{why}");
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

const CHAPTER: &str = "tools/manual/src/stops-and-faults.md";
const ROBOT: &str = "i2ris-emulated";
const HEAD: &str = "| mistake | command | message | exit code |\n|---|---|---|---|\n";

/// The row with its message, or the exit code where it is not that of the row.
fn made(bench: &WorkFolder, domain: &Domain, row: &str) -> Result<String, String> {
    let cells = row.trim_start_matches("| ").trim_end_matches(" |");
    let [what, command, shown, code] = cells.split(" | ").collect::<Vec<_>>()[..] else {
        panic!("{row}")
    };
    let folder = bench.file("").trim_end_matches('/').to_owned();
    let words = command.trim_matches('`').trim_start_matches("i2ris ");
    let result = run(domain, &words.replace("FOLDER", &folder));
    let message = result.error.lines().find_map(|line| line.strip_prefix("error: "));
    if result.code != code.parse().ok() || message.is_none() {
        return Err(format!("{what}: {:?}, not {code}\n{}", result.code, result.error));
    }
    // Other tests serve separate domains.
    let message = message.and_then(|it| it.split(" (served: ").next()).unwrap_or_default();
    let message = message.replace(&folder, "FOLDER").replace(domain.name(), "DOMAIN");
    let message = message.replace('|', "\\|");
    let is_same = shown.split(' ').count() == message.split(' ').count()
        && shown.split(' ').zip(message.split(' ')).all(|(shown, word)| is_like(shown, word));
    let message = if is_same { shown } else { &message };
    Ok(format!("| {what} | {command} | {message} | {code} |\n"))
}

/// Whether a word is as shown; measured values, and numbers of processes and users are `N`.
fn is_like(shown: &str, word: &str) -> bool {
    shown == word
        || shown.strip_prefix('N').is_some_and(|end| {
            word.strip_suffix(end).is_some_and(|number| number.parse::<f64>().is_ok())
        })
}

fn write_files(bench: &WorkFolder) {
    let head = "t_s,q0_counts,q1_counts,pitch_deg,yaw_deg";
    let rows = |count: u32, step: u32| {
        let row = |k: u32| format!("{},{k},{},{k},{k}\n", step * k, 2 * k);
        format!("{head}\n{}", (0..count).map(row).collect::<String>())
    };
    let config = include_str!("../../../../config/emulator.toml");
    for (name, text) in [
        ("milliseconds.csv", rows(100, 50)),
        ("short.csv", rows(3, 1)),
        ("angles.csv", "t_s,pitch_deg,yaw_deg\n0,1,2\n1,2,3\n".to_owned()),
        ("waypoints.csv", "pitch_deg,yaw_deg\n0,0\n1,1\n".to_owned()),
        ("there.csv", rows(100, 1)),
        ("there.json", "{}".to_owned()),
        ("typo.toml", config.replacen("robot_id", "robot_name", 1)),
        ("broken.toml", "robot_id = [".to_owned()),
    ] {
        bench.write(name, &text);
    }
    fs::write(bench.path("trial.mcap"), b"\x89MCAP0\r\n\xff\xfe\x00\x01").unwrap();
}

#[test]
fn user_mistakes_end_with_a_message_and_exit_code() {
    let bench = WorkFolder::empty();
    write_files(&bench);
    let mut rig = Rig::start();
    expect_stalls(&mut rig);
    rig.config.robot_id = ROBOT.to_owned();
    rig.config.control.model = Some(rig.sample_model("model.json", ROBOT, 1.0));
    let other = rig.sample_model("other-robot.json", "another-robot", 1.0);
    fs::copy(other, bench.path("other-robot.json")).unwrap();
    let file = repository(CHAPTER);
    let text = fs::read_to_string(&file).unwrap();
    let (before, rest) = text.split_once(HEAD).unwrap();
    let (written, after) = rest.split_once("\n<!-- end -->").unwrap();
    let (mut domain, mut first) = (unique_domain(), None);
    let (mut rows, mut wrong) = (String::new(), String::new());
    for row in written.lines() {
        match row.split(" | ").next().unwrap() {
            "| enable before home" => {
                rig.start_controller_thread();
                domain = rig.domain();
                wait_until_idle(&mut rig.client());
            }
            "| home while enabled" => {
                succeeds(&domain, "home");
                succeeds(&domain, "enable");
            }
            "| a second commander" => {
                first = Some(start(&domain, "command pose"));
                wait_for(&mut rig.client(), |state| state.lease_client_id != 0);
            }
            "| a command while the robot is busy" => {
                interrupt(first.take().unwrap());
                succeeds(&domain, "command state condition --no-wait");
            }
            _ => {}
        }
        match made(&bench, &domain, row) {
            Ok(row) => rows += &row,
            Err(reason) => wrong += &reason,
        }
    }
    assert!(wrong.is_empty() && domain.name() == rig.domain().name(), "{wrong}");
    if std::env::var_os("I2RIS_UPDATE").is_some() {
        fs::write(&file, format!("{before}{HEAD}{rows}\n<!-- end -->{after}")).unwrap();
        return;
    }
    let differs = "the messages differ; look at the difference, and set I2RIS_UPDATE=1";
    assert!(written == rows, "{}: {differs}\n{rows}", file.display());
}
