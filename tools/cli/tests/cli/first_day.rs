//! The shipped templates with devices, serial numbers, domain and record folder filled in, on
//! emulated drives: the first day of a user, as root and as a plain user.

use std::os::unix::fs::chown;

use i2ris::ipc::Domain;
use i2ris_testing::bench::{WorkFolder, assert_says, end, ends, repository};
use i2ris_testing::{Program, unique_domain, wait_until};

/// A user without rights.
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
        ends(self.start(words), 0, &[]);
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
    let template = std::fs::read_to_string(repository("config").join(template)).unwrap();
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
    let collect = "calibrate collect --home --output @take.csv";
    day.succeeds(&format!("{collect} --duration-s 12"));
    day.succeeds("calibrate fit @take.csv --robot-id i2ris-1 --family linear --output @model.json");
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
#[ignore = "a minute, as root, who may do more than a plain user: for .ci/nightly"]
fn template_is_calibrated_by_root_with_a_port_per_drive() {
    assert!(nix::unistd::geteuid().is_root(), "needs root");
    first_day(None, "robot-rs232.toml", "rs232");
}

#[test]
#[ignore = "a minute, as root, who may do more than a plain user: for .ci/nightly"]
fn template_is_calibrated_by_root_with_three_nodes_per_port() {
    assert!(nix::unistd::geteuid().is_root(), "needs root");
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
