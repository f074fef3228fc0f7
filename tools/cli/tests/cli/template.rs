//! The shipped template with devices, serial numbers, domain and record folder filled in, on
//! emulated drives: what a person does on the first day, as root and as a plain user.

use std::os::unix::fs::chown;

use i2ris::ipc::Domain;
use i2ris_testing::{Program, wait_until};

use crate::bench::{Ended, WorkFolder, assert_says, end, nobody, repository};

/// Who has no right to anything.
const PLAIN: u32 = 65_534;

/// A machine that tests share stalls, and the emulated drives with it: that is no fault here.
const SHARED_MACHINE: &str = "[limits]\nfeedback_stale_ms = 2000\n\
     following_error_counts = 3000\noverrun_ticks = 0\n[command]\ndeadline_ms = 500\n\
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
        let words = words.replace('@', &self.bench.file(""));
        Program::start_as(self.user, &self.domain, &words.split_whitespace().collect::<Vec<_>>())
    }

    fn run(&self, words: &str) -> Ended {
        end(self.start(words))
    }

    #[track_caller]
    fn succeeds(&self, words: &str) {
        let said = self.run(words);
        assert_eq!(said.code, Some(0), "{words}: {}{}", said.output, said.error);
    }

    fn controller(&self, table: &str, axes: &str) -> Program {
        self.bench.write("robot.toml", &format!("{table}{SHARED_MACHINE}{axes}"));
        let controller = self.start("control --config @robot.toml");
        wait_until("the controller", || self.run("disable").code == Some(0));
        controller
    }
}

/// The template, filled in: what is before the ports, and the ports.
fn filled_in(bench: &WorkFolder, domain: &Domain, has_jaw: bool) -> (String, String) {
    let template = std::fs::read_to_string(repository("config/robot.toml")).unwrap();
    let port = |motor: usize| format!("/dev/serial/by-id/usb-maxon-drive-of-motor-{motor}");
    let (head, ports) = template.split_once("[[ports]]").unwrap();
    let ports = ports
        .replace(&port(0), &bench.file("ports/axis0"))
        .replace(&port(1), &bench.file("ports/axis1"))
        .replace("\nbaud", &format!("{SHARED_PORT}baud"))
        .replace("\nnode_id", &format!("{SHARED_AXIS}node_id"))
        .replacen("serial_number = 0", "serial_number = 62000001", 1)
        .replacen("serial_number = 0", "serial_number = 62000002", 1);
    let ports = match has_jaw {
        false => ports,
        true => {
            // Both drives and a third one behind the first port.
            let (first, second) = ports.split_once("[[ports]]").unwrap();
            let second = second.split_once("[[ports.axes]]").unwrap().1;
            let second = second.replace("node_id = 0", "node_id = 2");
            let jaw = second.replace("motor = 1", "motor = 2\nauxiliary_counts_per_deg = 20.0");
            let jaw = jaw.replace("node_id = 2", "node_id = 3").replace("62000002", "62000003");
            format!("{first}[[ports.axes]]{second}[[ports.axes]]{jaw}")
        }
    };
    let head = head.replace("\"records\"", &format!("\"{}\"", bench.file("records")));
    (format!("domain = \"{}\"\n{head}", domain.name()), format!("[[ports]]{ports}"))
}

fn first_day(user: Option<u32>, has_jaw: bool) {
    let day = FirstDay { bench: WorkFolder::new(), domain: nobody(), user };
    chown(day.bench.path(""), user, user).unwrap();
    let (head, ports) = filled_in(&day.bench, &day.domain, has_jaw);
    let snake = repository("config/snakes/steel.toml");
    let jaw = if has_jaw { "--wiring jaw" } else { "" };
    let mut emulator =
        day.start(&format!("emulate --ports @ports --snake {} {jaw}", snake.display()));
    wait_until("the ports", || day.bench.exists("ports/axis0"));

    // Counts and conditioning, before anybody knows what an angle is.
    let mut controller = day.controller(&head, &ports);
    let collect = "calibrate collect --home --output @take.csv";
    day.succeeds(&format!("{collect} --duration-s 12"));
    day.succeeds("calibrate fit @take.csv --robot-id i2ris-1 --family linear --output @model.json");
    day.succeeds("model use @model.json --no-condition --force");
    // Now the limits of angles hold, and the same works.
    day.succeeds("command state condition");
    day.succeeds("command circle --radius-deg 2 --period-s 4 --duration-s 4");
    day.succeeds("command state hold");
    day.succeeds("disable");
    controller.interrupt();
    let said = end(controller);
    assert_eq!(said.code, Some(0), "{}{}", said.output, said.error);
    assert_says(&said.error, &["no model: joint_limits hold once one is in use"]);

    let head = format!("{head}[control]\nmodel = \"model.json\"\n");
    let mut controller = day.controller(&head, &ports);
    day.succeeds("enable");
    day.succeeds("command pose 1 1 --duration-s 1");
    controller.interrupt();
    let said = end(controller);
    assert_eq!(said.code, Some(0), "{}{}", said.output, said.error);
    assert!(!said.error.contains("no model"), "{}", said.error);
    emulator.interrupt();
    assert_says(&end(emulator).output, &[" 0 rules broken by the host"]);
}

fn plain() -> Option<u32> {
    nix::unistd::geteuid().is_root().then_some(PLAIN)
}

#[test]
fn the_template_is_calibrated_and_used_by_root_with_a_port_for_each_drive() {
    first_day(None, false);
}

#[test]
fn the_template_is_calibrated_and_used_by_root_with_three_nodes_on_a_port() {
    first_day(None, true);
}

#[test]
fn the_template_is_calibrated_and_used_by_a_plain_user_with_a_port_for_each_drive() {
    first_day(plain(), false);
}

#[test]
fn the_template_is_calibrated_and_used_by_a_plain_user_with_three_nodes_on_a_port() {
    first_day(plain(), true);
}
