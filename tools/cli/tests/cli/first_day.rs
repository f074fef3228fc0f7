//! The first days of a user, on emulated drives: the shipped templates with devices, serial
//! numbers, domain and record folder filled in, as root and as a plain user; and `i2ris calibrate`
//! without a command: all steps in a pipe, an interruption, and resuming.

use std::io::{BufRead, BufReader};
use std::{fs, os::unix::fs::chown, process::Command, sync::atomic::Ordering};

use i2ris::ipc::{Domain, OperatingState, StateCommand};
use i2ris::{clock, ipc::client::Client, model::Model, units::Nanos};
use i2ris_calibration::recording::{ColumnMap, Recording};
use i2ris_testing::bench::{WorkFolder, assert_says, end, ends, fails, interrupt, prints};
use i2ris_testing::bench::{repository, robot, run, start, succeeds};
use i2ris_testing::{Program, settle_in, unique_domain, wait_until};
use nix::sys::signal::{Signal, kill};

/// The restarted controller has not loaded the model, and the drives have lost their zero.
#[test]
fn second_day_resumes_with_the_model_of_the_first() {
    // The model is linear, but the snake is not.
    let (rig, mut client) = robot(|rig| rig.config.limits.plausibility_deg = 0.0);
    let domain = rig.domain();
    let bench = WorkFolder::empty();
    fs::create_dir(bench.path("here")).unwrap();
    let rows = (0..100).map(|k| {
        let (t, q) = (f64::from(k) * 0.1, 5.0 * f64::from(k));
        format!("{t},{q},{},{},{}\n", 500.0 - q, 0.02 * q, -0.02 * q)
    });
    let recording =
        format!("t_s,q0_counts,q1_counts,pitch_deg,yaw_deg\n{}", rows.collect::<String>());
    for name in ["recording", "unseen"] {
        bench.write(&format!("here/{name}.csv"), &recording);
        bench.write(&format!("here/{name}.toml"), "[outcome]\ncomplete = true\n");
    }
    let file = bench.path("here/recording.csv");
    let read = Recording::read(&file, &ColumnMap::default()).unwrap().0;
    let model = fs::read_to_string(rig.sample_model("second.json", "rig", 1.02)).unwrap();
    bench.write("here/model.json", &model.replace(&"0".repeat(64), read.sha256()));
    let id = Model::load(&bench.path("here/model.json")).unwrap().id();
    for step in ["compare", "check", "refine"] {
        bench.write(&format!("here/{step}.done"), &format!("{id}\n"));
    }

    let words = bench.words("calibrate --folder @here --home");
    let calibrate = |steps: &str| {
        let mut result = run(&domain, &words);
        let first = result.output.clone();
        assert_says(&first, &steps.split('|').collect::<Vec<_>>());
        // The snake does not follow while its drives stall; the same command repeats the check.
        for _ in 0..5 {
            if result.error.contains("tracking error") {
                result = run(&domain, &words);
            }
        }
        assert_says(&result.output, &["done: the robot is ENABLED and runs with "]);
        first
    };
    calibrate("fit: done before|i2ris home|i2ris enable|model use|condition  done|command circle");
    assert_eq!(client.models().unwrap().slots[0].model_id, id.0);

    // Off again: only enabling and conditioning remain, and are done.
    client.state_command(StateCommand::Disable).unwrap();
    settle_in(&mut client, OperatingState::Disabled);
    let output = calibrate("$ i2ris enable|$ i2ris command state condition");
    assert!(!output.contains("model use"), "{output}");

    // Completing the circle does not mean following it.
    rig.camera_is_shut.store(true, Ordering::Relaxed);
    fs::remove_file(bench.path("here/check.done")).unwrap();
    let doubt = ["done, but check: ", "the camera did not see the circle", "it repeats the check"];
    fails(&domain, &words, 8, &doubt);
}

#[test]
fn start_keeps_a_configuration_changed_by_the_user() {
    let bench = WorkFolder::empty();
    let (domain, words) = (unique_domain(), bench.words("start --no-monitor --folder @robot"));
    let runs = || {
        let started = start(&domain, &words);
        wait_until("the controller", || Client::connect(&domain, Nanos::ZERO).is_ok());
        interrupt(started);
    };
    runs();
    let file = "robot/controller.toml";
    let changed = format!("# mine\n{}", bench.read(file));
    bench.write(file, &changed);
    runs();
    assert_eq!(bench.read(file), changed);
    let other = unique_domain();
    fails(&other, &words, 1, &[&format!("is for domain {}, not {}", domain.name(), other.name())]);
}

#[test]
#[ignore = "five minutes of motion"]
fn guided_calibration_resumes_and_ends_with_an_active_model() {
    let (rig, mut client) = robot(|rig| rig.config.command.max_step_counts = 250);
    let domain = rig.domain();
    let bench = WorkFolder::empty();
    let options = "--home --duration-s 60 --motion-s 20 --family force-balance";
    let words = bench.words(&format!("calibrate --folder @here {options}"));

    // Ctrl-C while recording: only the recording is set aside.
    let mut first = start(&domain, &words);
    let mut lines = BufReader::new(first.child().stdout.take().unwrap()).lines();
    let line = lines.next().unwrap().unwrap();
    assert!(line.starts_with("step 1 of 6: collect: ") && line.contains(" to go"), "{line}");
    settle_in(&mut client, OperatingState::Enabled);
    wait_until("it records", || {
        fs::metadata(bench.path("here/recording.csv")).is_ok_and(|data| data.len() > 2000)
    });
    // Ctrl-C reaches every process of a terminal, so the step as well.
    let children = Command::new("pgrep").args(["-P", &first.child().id().to_string()]).output();
    let step: i32 = String::from_utf8_lossy(&children.unwrap().stdout).trim().parse().unwrap();
    first.interrupt();
    kill(nix::unistd::Pid::from_raw(step), Signal::SIGINT).unwrap();
    let _rest = lines.by_ref().count();
    let result = end(first);
    assert_ne!(result.code, Some(0));
    assert_says(&result.error, &["run `i2ris calibrate` again: it resumes"]);
    clock::sleep(Nanos::from_millis(1100)); // Its `hold` holds the next program for a second.

    let steps = [
        "step 1 of 6: collect: ",
        "step 1 of 6 done; next: fit",
        "$ i2ris calibrate fit ",
        "step 3 of 6 done; next: use",
        "$ i2ris model use ",
        "$ i2ris command state condition",
        "$ i2ris command circle ",
        "$ i2ris calibrate collect ",
        "$ i2ris command file ",
        "in use     ",
        "done: the robot is ENABLED and runs with ",
    ];
    prints(start(&domain, &words), &steps);
    let [active, ..] = client.models().unwrap().slots;
    // Refined if that is better in use, otherwise as calibrated.
    let refined = Model::load(&bench.path("here/refined.json"));
    let model = refined.or_else(|_| Model::load(&bench.path("here/model.json")));
    assert_eq!(active.model_id, model.unwrap().id().0);
    let mut left = fs::read_dir(bench.path("here")).unwrap();
    assert!(left.any(|entry| entry.unwrap().path().extension() == Some("part".as_ref())));

    // All steps are done, and none is repeated.
    assert_eq!(succeeds(&domain, &words).matches(": done before").count(), 6);
}

const PLAIN: u32 = 65_534;

/// Raises limits: on a shared machine, stalls of emulated drives are not a fault.
const SHARED_MACHINE: &str = "[limits]\nfeedback_stale_ms = 5000\n\
     following_error_counts = 3000\noverrun_ticks = 0\n[command]\ndeadline_ms = 1000\n\
     lease_timeout_ms = 2000\n";
const SHARED_PORT: &str = "\nreply_timeout_ms = 1000\n";
const SHARED_AXIS: &str = "\nfollowing_error_counts = 3000\n";

struct FirstDay {
    bench: WorkFolder,
    domain: Domain,
    user: Option<u32>,
}

impl FirstDay {
    fn start(&self, words: &str) -> Program {
        let words = self.bench.words(words);
        Program::start_as(self.user, &self.domain, &words.split_whitespace().collect::<Vec<_>>())
    }

    #[track_caller]
    fn succeeds(&self, words: &str) {
        let mut result = end(self.start(words));
        // A motor catches up with full current after a stall of its emulated drive.
        if result.error.contains("motor over-current for too long") {
            ends(self.start("command state acknowledge"), 0, &[]);
            ends(self.start("enable"), 0, &[]);
            let _removed = ["take.csv", "take.toml"].map(|it| fs::remove_file(self.bench.path(it)));
            result = end(self.start(words));
        }
        assert_eq!(result.code, Some(0), "{words}: {}{}", result.output, result.error);
    }

    fn controller(&self, table: &str, axes: &str) -> Program {
        self.bench.write("robot.toml", &format!("{table}{SHARED_MACHINE}{axes}"));
        let controller = self.start("control --config @robot.toml");
        wait_until("the controller", || end(self.start("disable")).code == Some(0));
        controller
    }
}

/// A completed template: the part before the ports, and the ports.
fn filled_in(bench: &WorkFolder, domain: &Domain, template: &str) -> (String, String) {
    let template = fs::read_to_string(repository("config").join(template)).unwrap();
    let (head, ports) = template.split_once("[[ports]]").unwrap();
    let by_id = "/dev/serial/by-id/usb-maxon-drive-of-";
    let ports = ports
        .replace(&format!("{by_id}the-snake"), &bench.file("ports/axis0"))
        .replace(&format!("{by_id}motor-0"), &bench.file("ports/axis0"))
        .replace(&format!("{by_id}motor-1"), &bench.file("ports/axis1"))
        .replace("\nbaud", &format!("{SHARED_PORT}baud"))
        .replace("\nnode_id", &format!("{SHARED_AXIS}node_id"));
    let known = |ports: String, number: u32| {
        ports.replacen("serial_number = 0", &format!("serial_number = {number}"), 1)
    };
    let ports = (62_000_001..=62_000_003).fold(ports, known);
    let head = head.replace("\"records\"", &format!("\"{}\"", bench.file("records")));
    (format!("domain = \"{}\"\n{head}", domain.name()), format!("[[ports]]{ports}"))
}

fn first_day(user: Option<u32>, template: &str, line: &str) {
    let day = FirstDay { bench: WorkFolder::empty(), domain: unique_domain(), user };
    chown(day.bench.path(""), user, user).unwrap();
    let (head, ports) = filled_in(&day.bench, &day.domain, template);
    let snake = repository("config/snakes/steel.toml");
    let mut emulator =
        day.start(&format!("emulate --ports @ports --snake {} --line {line}", snake.display()));
    wait_until("the ports", || day.bench.exists("ports/axis0"));

    // Counts and conditioning, before there is a model.
    let mut controller = day.controller(&head, &ports);
    day.succeeds("calibrate collect --home --output @take.csv --duration-s 12");
    // A loaded machine leaves gaps in 12 s of recording: too little to hold rows out.
    let fit = "calibrate fit @take.csv --robot-id i2ris-1 --family linear --hold-out none";
    day.succeeds(&format!("{fit} --output @model.json"));
    day.succeeds("model use @model.json --no-condition --force");
    // Now angle limits apply, and the same works.
    day.succeeds("command state condition");
    day.succeeds("command circle --radius-deg 2 --period-s 4 --duration-s 4");
    day.succeeds("command state hold");
    day.succeeds("disable");
    controller.interrupt();
    ends(controller, 0, &["no model: joint_limits apply once one is in use"]);

    let head = format!("{head}[control]\nmodel = \"model.json\"\n");
    let mut controller = day.controller(&head, &ports);
    day.succeeds("enable");
    day.succeeds("command pose 1 1 --duration-s 1");
    controller.interrupt();
    let result = ends(controller, 0, &[]);
    assert!(!result.error.contains("no model"), "{}", result.error);
    emulator.interrupt();
    assert_says(&end(emulator).output, &[" 0 rule violations by the host"]);
}

fn plain() -> Option<u32> {
    nix::unistd::geteuid().is_root().then_some(PLAIN)
}

#[test]
#[ignore = "minutes, as root, who may do more than a plain user: for .ci/nightly"]
fn template_is_calibrated_by_root_on_both_lines() {
    assert!(nix::unistd::geteuid().is_root(), "needs root");
    first_day(None, "robot-rs232.toml", "rs232");
    first_day(None, "robot.toml", "lab");
}

#[test]
fn template_is_calibrated_by_user_with_a_port_per_drive() {
    first_day(plain(), "robot-rs232.toml", "rs232");
}

#[test]
fn template_is_calibrated_by_user_with_three_nodes_per_port() {
    first_day(plain(), "robot.toml", "lab");
}
