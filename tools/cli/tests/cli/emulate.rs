//! `i2ris emulate` as a process: starts, serves, ends cleanly, and reports errors in one sentence.

use std::io::{BufRead, BufReader, Read};

use i2ris::{config::Config, ipc::DomainLock};
use i2ris_simulation::physics::Physics;
use i2ris_testing::bench::{WorkFolder, assert_says, end, repository, start};
use i2ris_testing::{Program, unique_domain};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

struct Running {
    program: Program,
    output: BufReader<std::process::ChildStdout>,
    lines: String,
}

impl Running {
    fn until(word: &str, mut program: Program) -> Self {
        let mut output = BufReader::new(program.child().stdout.take().unwrap());
        let mut lines = String::new();
        while !lines.contains(word) {
            assert!(output.read_line(&mut lines).unwrap() > 0, "{lines}");
        }
        Self { program, output, lines }
    }

    fn end(mut self, signal: Signal) -> String {
        kill(Pid::from_raw(self.program.child().id().try_into().unwrap()), signal).unwrap();
        self.output.read_to_string(&mut self.lines).unwrap();
        let result = end(self.program);
        assert_eq!(result.code, Some(0), "{}{}", self.lines, result.error);
        self.lines
    }
}

#[test]
fn signals_end_it_cleanly() {
    let snake = repository("config/snakes/multi.toml");
    for signal in [Signal::SIGINT, Signal::SIGTERM] {
        let (bench, snake) = (WorkFolder::empty(), snake.display());
        let emulate = format!("emulate --no-camera --line rs232 --snake {snake}");
        let words = bench.words(&format!("{emulate} --ports @ports --log @log.csv"));
        let running = Running::until("ready", start(&unique_domain(), &words));
        assert!(bench.exists("ports/axis0") && bench.exists("ports/axis1"));
        assert_says(&running.lines, &[&bench.file("ports/axis1"), "Epos4, serial number 62000002"]);
        running.end(signal);
        assert!(!bench.exists("ports"));
        assert_says(&bench.read("log.csv"), &[",boot,"]);
    }
}

/// The configuration of a controller for emulated drives in the folder `ports` of a bench.
fn write_config(bench: &WorkFolder, change: impl Fn(String) -> String) {
    let text = std::fs::read_to_string(repository("config/emulator.toml")).unwrap();
    bench.write("robot.toml", &change(text.replace("/tmp/i2ris-emulator", &bench.file("ports"))));
}

#[test]
fn doctor_checks_drives_and_computer_on_configured_line() {
    for baud in ["1000000", "115200"] {
        let bench = WorkFolder::empty();
        write_config(&bench, |text| text.replace("baud = 1000000", &format!("baud = {baud}")));
        let emulate = bench.words("emulate --no-camera --config @robot.toml --ports @ports");
        let _running = Running::until("ready", start(&unique_domain(), &emulate));
        let healthy = bench.run("doctor --config robot.toml");
        assert_eq!(healthy.code, Some(0), "{}{}", healthy.output, healthy.error);
        let machine = ["kernel", "scheduling", "shared memory", "ms an exchange", "not homed"];
        let drives = [1, 2, 3].map(|number| format!("EPOS2, serial number 6200000{number}"));
        let drives: Vec<&str> = drives.iter().map(String::as_str).collect();
        assert_says(&healthy.output, &[&machine[..], &drives].concat());
        assert!(!healthy.output.contains("to paste"), "{}", healthy.output);
        bench.write("robot.toml", &bench.read("robot.toml").replace("62000001", "62000007"));
        let sick = bench.run("doctor --config robot.toml --json");
        assert_ne!(sick.code, Some(0));
        let json: serde_json::Value = serde_json::from_str(&sick.output).unwrap();
        let checks = json["checks"].as_array().unwrap().iter();
        let failed: Vec<_> = checks.filter(|check| check["level"] == "fail").collect();
        let [failed] = failed[..] else { panic!("{failed:?}") };
        let found = "62000001 (0x03B20B81) instead of 62000007";
        assert_says(failed["found"].as_str().unwrap(), &[found]);
        assert!(!failed["fix"].as_str().unwrap().is_empty());
        let table = json["found_tables"][0].as_str().unwrap().to_owned();
        let table: toml::Table = table.parse().unwrap();
        let first = &table["ports"][0]["axes"][0];
        assert_eq!(first["serial_number"].as_integer(), Some(62_000_001));
    }
}

#[test]
fn the_doctor_lists_the_drives_behind_a_port_to_paste() {
    let bench = WorkFolder::empty();
    let emulate = bench.words("emulate --no-camera --ports @ports");
    let _running = Running::until("ready", start(&unique_domain(), &emulate));
    // As delivered: one drive, with unknown number. All three are found.
    write_config(&bench, |text| {
        let first = text.match_indices("[[ports.axes]]").nth(1).unwrap().0;
        text[..first].replace("62000001", "0")
    });
    let found = bench.run("doctor --config robot.toml");
    let (_, table) = found.output.split_once("to paste into the configuration").unwrap();
    let table: toml::Table = table.split_once('\n').unwrap().1.parse().unwrap();
    let axes = table["ports"][0]["axes"].as_array().unwrap().iter();
    let numbers = axes.map(|axis| [&axis["node_id"], &axis["serial_number"]]);
    let numbers: Vec<_> = numbers.map(|it| it.map(|it| it.as_integer().unwrap())).collect();
    assert_eq!(numbers, [[1, 62_000_001], [2, 62_000_002], [3, 62_000_003]]);
}

#[test]
fn configured_devices_are_created_with_their_drives_and_removed() {
    let bench = WorkFolder::empty();
    let text = std::fs::read_to_string(repository("config/robot.toml")).unwrap();
    let device = "/dev/serial/by-id/usb-maxon-drive-of-the-snake";
    bench.write("robot.toml", &text.replace(device, &bench.file("dev/drive")));
    let emulate = bench.words("emulate --no-camera --ports @ports --config @robot.toml");
    let running = Running::until("ready", start(&unique_domain(), &emulate));
    let found = bench.run("doctor --config robot.toml");
    assert_says(&found.output, &["is not filled in: this drive is 62000003", "commission --apply"]);
    running.end(Signal::SIGINT);
    assert!(!bench.path("dev/drive").is_symlink());
}

#[test]
fn doctor_names_a_missing_port_and_unwritable_records() {
    let bench = WorkFolder::empty();
    write_config(&bench, |text| text.replace("../target/records", "robot.toml"));
    let result = bench.run("doctor --config robot.toml");
    assert_ne!(result.code, Some(0));
    assert_says(&result.output, &["FAIL", "axis0", "-> plug in the drive", "is not a folder"]);
}

#[test]
fn named_snakes_exist_in_every_folder_and_duration_ends_emulation() {
    for name in ["", "--snake brass", "--snake springs:2", "--snake lugre:3", "--snake wire"] {
        let domain = unique_domain();
        let options = format!("--duration-s 0.2 --ports ports --domain {} {name}", domain.name());
        let printed = WorkFolder::empty().succeeds(&format!("emulate {options}"));
        let name = name.strip_prefix("--snake ").unwrap_or("steel");
        assert_says(&printed, &[&format!("ready: snake {name}"), "ended: 0 rule violations"]);
    }
    let help = WorkFolder::empty().succeeds("emulate --help");
    Physics::NAMES.iter().for_each(|name| assert_says(&help, &[&format!("- {name}: ")]));
}

#[test]
fn start_runs_emulator_controller_and_watchdog_and_ends_all() {
    let (bench, domain) = (WorkFolder::empty(), unique_domain());
    let words = bench.words("start --no-monitor --folder @here");
    let running = Running::until("ready", start(&domain, &words));
    assert_says(&running.lines, &[domain.name()]);
    running.end(Signal::SIGINT);
    assert!(!bench.exists("here/ports"), "the emulator has ended");
    assert_says(&bench.read("here/emulator.log"), &["ended"]);
    assert_says(&bench.read("here/watchdog.log"), &["holding"]);
    let served = format!("serves domain `{}`", domain.name());
    assert_says(&bench.read("here/controller.log"), &[&served]);
    // The lock is free: the controller has ended.
    drop(DomainLock::acquire(&domain).unwrap());
}

/// A rehearsal neither opens nor writes anything of the robot, and leaves its file unchanged.
#[test]
fn rehearsal_emulates_drives_for_a_robot_configuration() {
    let shared_machine = "reply_timeout_ms = 1000\nfamily";
    for (template, serial_number) in
        [("robot.toml", "0"), ("robot-rs232.toml", "0"), ("robot.toml", "0x42E_03C0")]
    {
        let (bench, domain) = (WorkFolder::empty(), unique_domain());
        let text = std::fs::read_to_string(repository("config").join(template)).unwrap();
        let text = text.replace("\nfamily", &format!("\n{shared_machine}"));
        let known = format!("serial_number = {serial_number} #");
        let text = text.replacen("serial_number = 0 #", &known, 1);
        let positions = "positions_file = \"positions.toml\"\n[[ports.axes]]";
        bench.write("robot.toml", &text.replacen("[[ports.axes]]", positions, 1));
        let before = bench.read("robot.toml");
        let words = bench.words("start --no-monitor --config @robot.toml --folder @here");
        let running = Running::until("next", start(&domain, &words));
        let device = "device /dev/serial/by-id/usb-maxon-drive-of-";
        let unknown = "serial_number = 0: valid for emulated";
        assert_says(&running.lines, &[device, "here/ports/axis0", unknown, domain.name()]);
        running.end(Signal::SIGINT);
        let log = bench.read("here/controller.log");
        assert_says(&log, &[&format!("serves domain `{}`", domain.name())]);
        let copy = Config::parse(&bench.read("here/rehearsal.toml"), "copy".as_ref()).unwrap();
        let robot = Config::parse(&before, "robot".as_ref()).unwrap();
        assert_eq!((&copy.limits, &copy.control), (&robot.limits, &robot.control));
        let of_axes = |config: &Config| config.axes().cloned().collect::<Vec<_>>();
        assert_eq!(of_axes(&copy), of_axes(&robot));
        assert!(copy.ports.iter().all(|port| port.device.starts_with(bench.path("here"))));
        assert!(bench.exists("here/positions0.toml") && !bench.exists("positions.toml"));
        assert!(!bench.exists("records") && bench.read("robot.toml") == before);
    }
}
