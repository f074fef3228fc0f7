//! `i2ris calibrate collect` against a controller without drives, and a camera without a lens.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use i2ris::clock;
use i2ris::config::Config;
use i2ris::ipc::client::ExternalPublisher;
use i2ris::ipc::{Domain, OperatingState, Refusal, StateCommand, random_id};
use i2ris::process::robot_description;
use i2ris::units::Nanos;
use i2ris_calibration::recording::{ColumnMap, Recording};
use i2ris_testing::{Controller, Program};
use tempfile::TempDir;

const ROBOT: &str = r#"
    robot_id = "fake"
    [[ports]]
    device = "/dev/null"
    [[ports.axes]]
    motor = 0
    node_id = 0
    serial_number = 1
    position_min_counts = -400
    position_max_counts = 400
    [[ports.axes]]
    motor = 1
    node_id = 1
    serial_number = 2
    position_min_counts = -300
    position_max_counts = 400
"#;

/// What a camera sends.
#[derive(Clone, Copy, PartialEq)]
enum Shows {
    /// Angles that follow the time.
    Angles,
    /// That it sees nothing.
    Nothing,
    /// Stamps of another clock.
    WallClock,
}

/// A camera at 50 Hz, until dropped.
struct Camera {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Camera {
    fn start(domain: &Domain, shows: Shows) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let (domain, stopped) = (domain.clone(), Arc::clone(&stop));
        let thread = thread::spawn(move || {
            let mut publisher = ExternalPublisher::new(&domain);
            while !stopped.load(Ordering::Relaxed) {
                let now = clock::now();
                let angle = 0.2 * now.as_seconds().sin();
                let _ = match shows {
                    Shows::Angles => publisher.publish(now, &[angle, 0.1 - angle], &[]),
                    Shows::Nothing => publisher.publish_nothing(now),
                    Shows::WallClock => publisher.publish(
                        now + Nanos::from_millis(1_700_000_000_000),
                        &[angle; 2],
                        &[],
                    ),
                };
                clock::sleep(Nanos::from_millis(20));
            }
        });
        Self { stop, thread: Some(thread) }
    }
}

impl Drop for Camera {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// A controller that runs with the configuration of the bench.
fn described(controller: Controller) -> Controller {
    let config = Config::parse(ROBOT, Path::new("robot.toml")).unwrap();
    controller.robot().description = robot_description(&config);
    controller
}

/// A folder with a configuration.
struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("robot.toml"), ROBOT).unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn arguments(&self, more: &[&str]) -> Vec<String> {
        let (config, output) = (self.path("robot.toml"), self.path("take.csv"));
        let own = [
            "calibrate",
            "collect",
            "--config",
            config.to_str().unwrap(),
            "--output",
            output.to_str().unwrap(),
        ];
        own.iter().chain(more).map(|&argument| argument.to_owned()).collect()
    }

    fn start(&self, domain: &Domain, more: &[&str]) -> Program {
        let arguments = self.arguments(more);
        Program::start(domain, &arguments.iter().map(String::as_str).collect::<Vec<_>>())
    }

    /// What it says when it fails; nothing may have been written.
    fn refusal(&self, domain: &Domain, more: &[&str]) -> String {
        let (success, _, error) = self.start(domain, more).end();
        assert!(
            !success && !self.path("take.csv").exists() && !self.path("take.toml").exists(),
            "{more:?}: {error}"
        );
        error
    }
}

fn nobody() -> Domain {
    Domain::new(&format!("t{:016x}", random_id())).unwrap()
}

#[test]
fn a_short_run_moves_records_and_lets_go() {
    let (bench, controller) = (Bench::new(), described(Controller::start()));
    let _camera = Camera::start(&controller.domain, Shows::Angles);
    let more = ["--duration-s", "3", "--home", "--json", "--speed-counts-s", "400"];
    let (success, output, error) = bench.start(&controller.domain, &more).end();
    assert!(success, "{error}");
    let robot = controller.robot();
    assert_eq!(
        robot.asked,
        [
            StateCommand::Enable,
            StateCommand::Home,
            StateCommand::Enable,
            StateCommand::Condition,
            StateCommand::Release
        ]
    );
    assert_eq!(robot.lease, 0);
    assert!(robot.places.len() > 100, "{}", robot.places.len());
    for place in &robot.places {
        // Three quarters of the 300 counts to the nearest limit, and rounding.
        assert!(f64::from(place[0]).hypot(f64::from(place[1])) < 226.0, "{place:?}");
    }
    assert_eq!(robot.counts, [0, 0], "it ends in the centre");
    let (recording, report) =
        Recording::read(&bench.path("take.csv"), &ColumnMap::default()).unwrap();
    assert!(recording.rows().len() > 50 && report.positions > 500, "{report:?}");
    let outcome: serde_json::Value = serde_json::from_str(&output).unwrap();
    assert_eq!(outcome["outcome"]["complete"], true);
    assert_eq!(outcome["outcome"]["samples"], recording.rows().len());
    let sidecar: toml::Value =
        toml::from_str(&fs::read_to_string(bench.path("take.toml")).unwrap()).unwrap();
    assert_eq!(sidecar["robot_id"].as_str(), Some("fake"));
    assert_eq!(sidecar["protocol"]["seed"].as_integer(), Some(1));
}

#[test]
fn an_interrupt_stops_softly_and_keeps_the_recording() {
    let (bench, controller) = (Bench::new(), described(Controller::enabled()));
    let _camera = Camera::start(&controller.domain, Shows::Angles);
    let mut program = bench.start(&controller.domain, &[]);
    controller.wait("it moves", |robot| robot.places.len() > 300);
    program.interrupt();
    let (success, output, error) = program.end();
    assert!(!success && error.contains("interrupted") && error.contains("kept"), "{error}");
    assert!(output.contains("recorded"), "{output}");
    assert_eq!(controller.robot().lease, 0);
    let (recording, _) = Recording::read(&bench.path("take.csv"), &ColumnMap::default()).unwrap();
    assert!(recording.rows().len() > 20);
    let sidecar = fs::read_to_string(bench.path("take.toml")).unwrap();
    assert!(sidecar.contains("complete = false") && sidecar.contains("interrupted"), "{sidecar}");
}

#[test]
fn a_killed_program_leaves_what_it_had() {
    let (bench, controller) = (Bench::new(), described(Controller::enabled()));
    let _camera = Camera::start(&controller.domain, Shows::Angles);
    let mut program = bench.start(&controller.domain, &[]);
    controller.wait("it moves", |robot| robot.places.len() > 500);
    program.child().kill().unwrap();
    drop(program);
    let text = fs::read_to_string(bench.path("take.csv")).unwrap();
    assert!(text.lines().count() > 200 && text.ends_with('\n'), "{} lines", text.lines().count());
    assert!(fs::read_to_string(bench.path("take.toml")).unwrap().contains("protocol"));
}

#[test]
fn without_a_camera_nothing_moves() {
    let (bench, controller) = (Bench::new(), described(Controller::enabled()));
    let error = bench.refusal(&controller.domain, &[]);
    assert!(
        error.contains("external/measured_jp") && error.contains("i2ris emulate --domain"),
        "{error}"
    );
    let camera = Camera::start(&controller.domain, Shows::Nothing);
    let error = bench.refusal(&controller.domain, &[]);
    assert!(error.contains("sees nothing"), "{error}");
    drop(camera);
    let _camera = Camera::start(&controller.domain, Shows::WallClock);
    let error = bench.refusal(&controller.domain, &[]);
    assert!(error.contains("CLOCK_MONOTONIC"), "{error}");
    let robot = controller.robot();
    assert!(robot.asked.is_empty() && robot.places.is_empty());
}

#[test]
fn a_camera_that_falls_silent_ends_the_run_and_keeps_the_recording() {
    let (bench, controller) = (Bench::new(), described(Controller::enabled()));
    let camera = Camera::start(&controller.domain, Shows::Angles);
    let program = bench.start(&controller.domain, &[]);
    controller.wait("it moves", |robot| robot.places.len() > 300);
    drop(camera);
    let (success, _, error) = program.end();
    assert!(!success && error.contains("silent"), "{error}");
    assert_eq!(controller.robot().lease, 0);
    assert!(fs::read_to_string(bench.path("take.toml")).unwrap().contains("silent"));
    assert!(fs::read_to_string(bench.path("take.csv")).unwrap().lines().count() > 100);
}

#[test]
fn a_controller_that_cannot_condition_is_told_how_to_go_on() {
    let (bench, controller) = (Bench::new(), described(Controller::enabled()));
    controller.robot().conditions = false;
    let _camera = Camera::start(&controller.domain, Shows::Angles);
    let (success, _, error) = bench.start(&controller.domain, &[]).end();
    assert!(!success && error.contains("--no-condition"), "{error}");
    assert!(controller.robot().places.is_empty());
}

#[test]
fn a_robot_that_is_not_enabled_or_refuses_is_not_moved() {
    let (bench, controller) = (Bench::new(), described(Controller::start()));
    let _camera = Camera::start(&controller.domain, Shows::Angles);
    let error = bench.refusal(&controller.domain, &[]);
    assert!(error.contains("--enable"), "{error}");
    controller.robot().homed = true;
    controller.robot().state = OperatingState::Enabled;
    controller.robot().refuse = Some(Refusal::Range);
    let (success, _, error) = bench.start(&controller.domain, &[]).end();
    assert!(!success && error.contains("outside the position limits"), "{error}");
    assert!(controller.robot().places.is_empty());
}

#[test]
fn what_makes_no_sense_is_refused_before_a_controller_is_looked_for() {
    let (bench, domain) = (Bench::new(), nobody());
    for (more, said) in [
        (&["--range-counts", "320"][..], "leave 300 counts"),
        (&["--centre-counts", "500,0"], "not within the position limits"),
        (&["--centre-counts", "5"], "1 value(s) for the 2 motor(s)"),
        (&["--speed-counts-s", "2500"], "the controller allows 2000"),
        (&["--speed-counts-s", "0"], "must be a number above 0"),
        (&["--duration-s", "nan"], "must be a number above 0"),
        (&["--protocol", "dance"], "possible values: reversals, cycles, decaying-sine, axes"),
        (&["--camera-latency-ms", "5000"], "must be a number from -1000 to 1000"),
        (&[], "no controller serves domain"),
    ] {
        let error = bench.refusal(&domain, more);
        assert!(error.contains(said), "{more:?}: {error}");
    }
    assert!(bench.refusal(&domain, &["--protocol", "axes"]).contains("trap"));
}

#[test]
fn recordings_are_not_written_over_and_folders_not_invented() {
    let (bench, domain) = (Bench::new(), nobody());
    fs::write(bench.path("take.toml"), "precious").unwrap();
    let (success, _, error) = bench.start(&domain, &[]).end();
    assert!(!success && error.contains("not written over"), "{error}");
    assert_eq!(fs::read_to_string(bench.path("take.toml")).unwrap(), "precious");
    let config = bench.path("robot.toml");
    for (output, said) in
        [("/nowhere/take.csv", "there is no folder"), ("take.txt", "must end in .csv")]
    {
        let arguments =
            ["calibrate", "collect", "--config", config.to_str().unwrap(), "--output", output];
        let (success, _, error) = Program::run(&domain, &arguments);
        assert!(!success && error.contains(said), "{error}");
    }
}

#[test]
fn a_configuration_of_another_robot_or_with_other_limits_moves_nothing() {
    let (bench, controller) = (Bench::new(), described(Controller::start()));
    let _camera = Camera::start(&controller.domain, Shows::Angles);
    for (from, to, parts) in [
        ("\"fake\"", "\"other\"", ["`fake`", "`other`"]),
        ("= -400", "= -500", ["position limits", "-500"]),
    ] {
        fs::write(bench.path("robot.toml"), ROBOT.replace(from, to)).unwrap();
        let error = bench.refusal(&controller.domain, &["--home"]);
        assert!(parts.iter().all(|part| error.contains(part)), "{error}");
        // The domain came from the environment, and the file names another one.
        let domain = controller.domain.name();
        assert!(error.contains(&format!("note: I2RIS_DOMAIN={domain}")), "{error}");
    }
    assert_eq!(controller.robot().asked, []);
}
