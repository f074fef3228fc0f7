//! Interoperation with Cyclone DDS by its Python wheel, with the types in `crtk_arm.py`.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use i2ris::clock;
use i2ris::units::Nanos;
use i2ris_needs::needs;
use i2ris_testing::Rig;

use crate::common::{Bridge, robot, ros_domain};

fn python(ros_domain: u16) -> Command {
    let mut command = i2ris_testing::python();
    command.env("PYTHONPATH", examples()).env("ROS_DOMAIN_ID", ros_domain.to_string());
    command
}

fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples")
}

fn finish(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let [out, err] =
        [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(output.status.success(), "{out}\n{err}");
    out
}

/// A robot, its bridge, and Python that meets them.
fn meet(arguments: &[&str]) -> (Rig, Bridge, Command) {
    let (domain, robot) = (ros_domain(), robot());
    let bridge = Bridge::start(&robot.domain(), domain, arguments);
    (robot, bridge, python(domain))
}

fn run(arguments: &[&str], script: &str) -> String {
    let (_robot, _bridge, mut command) = meet(arguments);
    finish(command.args(["-c", script]))
}

fn runs(script: &str) {
    let out = run(&[], script);
    assert!(out.contains("done"), "{out}");
}

#[needs("python: cyclonedds.sub")]
#[test]
fn the_example_runs_as_it_is() {
    let (robot, bridge, mut command) = meet(&[]);
    let from = clock::now();
    let out = finish(command.arg(examples().join("crtk_arm.py")).arg("i2ris"));
    let lines: Vec<&str> = out.lines().collect();
    assert_eq!(lines[0], "state: DISABLED", "{out}");
    assert!(lines.contains(&"state: DISABLED") && out.contains("moved to ["), "{out}");
    assert!(robot.moved_since(from));
    let lines = bridge.lines();
    let refused = lines.iter().any(|line| line.starts_with("warning"));
    assert!(!refused, "nothing is refused: {lines:?}");
}

#[needs("python: cyclonedds.sub")]
#[test]
fn stored_commands_of_foreign_clients_are_not_carried_out() {
    let domain = ros_domain();
    let mut command = python(domain);
    let robot = robot();
    command.args(["-c", include_str!("python/stored_commands.py")]);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    clock::sleep(Nanos::from_millis(5000));
    let bridge = Bridge::start(&robot.domain(), domain, &[]);
    let output = child.wait_with_output().unwrap();
    let err = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{err}");
    // Cyclone DDS delivers them although they are not requested.
    let lines = bridge.lines();
    let enabled = lines.iter().any(|line| line.contains("enable;"));
    assert!(!enabled, "{lines:?}");
}

#[needs("python: cyclonedds.sub")]
#[test]
fn foreign_clients_match_by_quality_of_service() {
    let out = run(&[], include_str!("python/quality_of_service.py"));
    assert!(out.contains("publishes BEST_EFFORT"), "{out}");
}

#[needs("python: cyclonedds.sub")]
#[test]
fn late_foreign_client_gets_latched_messages() {
    runs(include_str!("python/late_client.py"));
}

#[needs("python: cyclonedds.sub")]
#[test]
fn late_foreign_client_with_volatile_reader_can_move() {
    runs(include_str!("python/volatile_reader.py"));
}

/// Configuration of rmw_cyclonedds for ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST: no interface is
/// named, so Cyclone DDS uses that of the network.
#[needs("python: cyclonedds.sub")]
#[test]
fn foreign_client_without_an_interface_finds_the_robot() {
    let (_robot, _bridge, mut command) = meet(&[]);
    command.env(
        "CYCLONEDDS_URI",
        "<CycloneDDS><Domain><General><AllowMulticast>false</AllowMulticast></General><Discovery>\
         <ParticipantIndex>auto</ParticipantIndex>\
         <MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>\
         <Peers><Peer address='localhost'/></Peers></Discovery></Domain></CycloneDDS>",
    );
    let out = finish(command.args(["-c", include_str!("python/without_interface.py")]));
    assert!(out.contains("done"), "{out}");
}

#[needs("python: cyclonedds.sub")]
#[test]
fn services_answer_as_cyclone_dds_asks() {
    let out = run(&["--rmw", "rmw_cyclonedds_cpp"], include_str!("python/services.py"));
    assert_eq!(out.trim(), "7 0x1234567890abcdef DISABLED");
}

/// For `cargo test -p i2ris-ros --release --test ros -- --ignored --nocapture campaign`:
/// seconds in `I2RIS_SOAK_S`, default one minute.
#[test]
#[ignore = "takes a minute, and needs python: cyclonedds"]
fn campaign_a_kilohertz_without_gaps_and_with_flat_memory() {
    let (_robot, bridge, mut command) = meet(&["--rate-hz", "1000"]);
    let seconds = std::env::var("I2RIS_SOAK_S").map_or(60, |seconds| seconds.parse().unwrap());
    let script = include_str!("python/kilohertz.py");
    command.args(["-c", &format!("SECONDS = {seconds}\n{script}")]);
    let child = command.stdout(Stdio::piped()).spawn().unwrap();
    let (mut memory, start) = (Vec::new(), clock::now());
    while (clock::now() - start).as_seconds() < f64::from(seconds) + 10.0 {
        clock::sleep(Nanos::from_millis(5000));
        memory.push(bridge.memory_kb());
    }
    let output = child.wait_with_output().unwrap();
    eprintln!("{}", String::from_utf8_lossy(&output.stdout));
    assert!(output.status.success());
    eprintln!("resident memory of i2ris-ros every 5 s, kB: {memory:?}");
    let (early, late) = (memory[2], memory[memory.len() - 2]);
    assert!(late < early + 4096, "memory grows: {memory:?}");
}
