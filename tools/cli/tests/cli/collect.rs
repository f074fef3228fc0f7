//! `i2ris calibrate collect` without drives, without a lens, and on emulated drives.

use std::{fs, path::Path};

use i2ris::ipc::{Domain, OperatingState, Refusal, StateCommand};
use i2ris::{clock, config::Config, ipc::client::ExternalPublisher};
use i2ris::{model::Model, process::robot_description, units::Nanos};
use i2ris_calibration::recording::{ColumnMap, Recording};
use i2ris_testing::bench::{WorkFolder, assert_says, ends};
use i2ris_testing::bench::{expect_stalls, interrupt, start, succeeds};
use i2ris_testing::{Background, Controller, Program, Rig, wait_until};
use i2ris_vision::scene::{JointPose, Rig as Scene};
use i2ris_vision::{drawing::save_grey, scene_setup::setup};

const ROBOT: &str = "
    robot_id = 'fake'
    [[ports]]
    device = '/dev/null'
    axes = [
        { motor = 0, node_id = 0, serial_number = 1, \
          position_min_counts = -400, position_max_counts = 400 },
        { motor = 1, node_id = 1, serial_number = 2, \
          position_min_counts = -300, position_max_counts = 400 },
    ]
";

#[derive(Clone, Copy, PartialEq)]
enum Shows {
    Angles,
    Nothing,
    WallClock,
}

/// A camera at 50 Hz, until dropped.
fn camera(domain: &Domain, shows: Shows) -> Background {
    let domain = domain.clone();
    Background::start(move |stop| {
        let mut publisher = ExternalPublisher::new(&domain);
        while !stop.load(std::sync::atomic::Ordering::Relaxed) {
            let now = clock::now();
            let angle = 0.2 * now.as_seconds().sin();
            let other_clock = now + Nanos::from_millis(1_700_000_000_000);
            let _ = match shows {
                Shows::Angles => publisher.publish(now, &[angle, 0.1 - angle], &[]),
                Shows::Nothing => publisher.publish_nothing(now),
                Shows::WallClock => publisher.publish(other_clock, &[angle; 2], &[]),
            };
            clock::sleep(Nanos::from_millis(20));
        }
    })
}

/// A running controller with the configuration of the bench, and its folder.
fn described(controller: Controller) -> (WorkFolder, Controller) {
    let config = Config::parse(ROBOT, Path::new("robot.toml")).unwrap();
    controller.robot().description = robot_description(&config);
    (WorkFolder::empty(), controller)
}

fn collect(bench: &WorkFolder, domain: &Domain, options: &str) -> Program {
    start(domain, &bench.words(&format!("calibrate collect --output @take.csv {options}")))
}

#[track_caller]
fn collects_nothing(bench: &WorkFolder, domain: &Domain, options: &str, parts: &[&str]) {
    let (success, _, error) = collect(bench, domain, options).end();
    assert!(!success && !bench.exists("take.csv") && !bench.exists("take.toml"), "{options}");
    assert_says(&error, parts);
}

fn read(file: &Path) -> Recording {
    Recording::read(file, &ColumnMap::default()).unwrap().0
}

#[test]
fn a_short_run_moves_records_and_lets_go() {
    let (bench, controller) = described(Controller::start());
    let _camera = camera(&controller.domain, Shows::Angles);
    let options = "--duration-s 3 --home --json --speed-counts-s 400";
    let result = ends(collect(&bench, &controller.domain, options), 0, &[]);
    let robot = controller.robot();
    let (enable, home) = (StateCommand::Enable, StateCommand::Home);
    let rest = [StateCommand::Condition, StateCommand::Release];
    assert_eq!(robot.requested, [&[enable, home, enable][..], &rest].concat());
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
    let outcome: serde_json::Value = serde_json::from_str(&result.output).unwrap();
    assert_eq!(outcome["outcome"]["complete"], true);
    assert_eq!(outcome["outcome"]["samples"], recording.rows().len());
    let sidecar: toml::Value = toml::from_str(&bench.read("take.toml")).unwrap();
    assert_eq!(sidecar["robot_id"].as_str(), Some("fake"));
    assert_eq!(sidecar["protocol"]["seed"].as_integer(), Some(1));
}

#[test]
fn an_interrupt_stops_softly_and_keeps_the_recording() {
    let (bench, controller) = described(Controller::enabled());
    let _camera = camera(&controller.domain, Shows::Angles);
    let mut program = collect(&bench, &controller.domain, "");
    controller.wait("it moves", |robot| robot.places.len() > 300);
    program.interrupt();
    assert_says(&ends(program, 1, &["interrupted", "kept"]).output, &["recorded"]);
    assert_eq!(controller.robot().lease, 0);
    assert!(read(&bench.path("take.csv")).rows().len() > 20);
    assert_says(&bench.read("take.toml"), &["complete = false", "interrupted"]);
}

/// Another program moves the robot; Ctrl-C ends the recording without a failure.
#[test]
fn watch_records_other_clients_until_interrupted_without_requests() {
    let (bench, controller) = described(Controller::start());
    let _camera = camera(&controller.domain, Shows::Angles);
    let run = collect(&bench, &controller.domain, "--watch");
    wait_until("it records", || {
        fs::metadata(bench.path("take.csv")).is_ok_and(|file| file.len() > 500)
    });
    interrupt(run);
    assert!(controller.robot().requested.is_empty(), "{:?}", controller.robot().requested);
    assert!(bench.read("take.toml").contains("complete = true"));
    assert!(bench.read("take.csv").lines().count() > 20);
}

#[test]
fn a_killed_program_leaves_what_it_had() {
    let (bench, controller) = described(Controller::enabled());
    let _camera = camera(&controller.domain, Shows::Angles);
    let mut program = collect(&bench, &controller.domain, "");
    controller.wait("it moves", |robot| robot.places.len() > 500);
    program.child().kill().unwrap();
    drop(program);
    let text = bench.read("take.csv");
    assert!(text.lines().count() > 200 && text.ends_with('\n'), "{} lines", text.lines().count());
    assert_says(&bench.read("take.toml"), &["protocol"]);
}

#[test]
fn without_a_camera_nothing_moves() {
    let (bench, controller) = described(Controller::enabled());
    let domain = &controller.domain;
    collects_nothing(&bench, domain, "", &["external/measured_jp", "i2ris emulate --domain"]);
    let blind = camera(domain, Shows::Nothing);
    collects_nothing(&bench, domain, "", &["sees nothing"]);
    drop(blind);
    let _other_clock = camera(domain, Shows::WallClock);
    collects_nothing(&bench, domain, "", &["CLOCK_MONOTONIC"]);
    let robot = controller.robot();
    assert!(robot.requested.is_empty() && robot.places.is_empty());
}

#[test]
fn silent_camera_ends_the_run_and_keeps_the_recording() {
    let (bench, controller) = described(Controller::enabled());
    let camera = camera(&controller.domain, Shows::Angles);
    let program = collect(&bench, &controller.domain, "");
    controller.wait("it moves", |robot| robot.places.len() > 300);
    drop(camera);
    ends(program, 1, &["silent"]);
    assert_eq!(controller.robot().lease, 0);
    assert_says(&bench.read("take.toml"), &["silent"]);
    assert!(bench.read("take.csv").lines().count() > 100);
}

#[test]
fn controller_without_conditioning_reports_the_option() {
    let (bench, controller) = described(Controller::enabled());
    controller.robot().conditions = false;
    let _camera = camera(&controller.domain, Shows::Angles);
    ends(collect(&bench, &controller.domain, ""), 1, &["--no-condition"]);
    assert!(controller.robot().places.is_empty());
}

#[test]
fn disabled_or_refusing_robot_is_not_moved() {
    let (bench, controller) = described(Controller::start());
    let _camera = camera(&controller.domain, Shows::Angles);
    collects_nothing(&bench, &controller.domain, "", &["--enable"]);
    controller.robot().homed = true;
    controller.robot().state = OperatingState::Enabled;
    controller.robot().refuse = Some(Refusal::Range);
    ends(collect(&bench, &controller.domain, ""), 4, &["outside the position limits"]);
    assert!(controller.robot().places.is_empty());
}

#[test]
fn what_the_controller_does_not_allow_moves_nothing() {
    let (bench, controller) = described(Controller::start());
    let _camera = camera(&controller.domain, Shows::Angles);
    for (options, result) in [
        ("--range-counts 320", "leave 300 counts"),
        ("--centre-counts 500,0", "not within the position limits"),
        ("--centre-counts 5", "1 value(s) for the 2 motor(s)"),
        ("--speed-counts-s 2500", "the controller allows 500"),
    ] {
        collects_nothing(&bench, &controller.domain, &format!("--home {options}"), &[result]);
    }
    assert_eq!(controller.robot().requested, []);
}

/// Emulated drives, snake and camera with a controller, whose folder is the bench.
struct Whole {
    rig: Rig,
    domain: Domain,
}

impl Whole {
    fn start(change: impl FnOnce(&mut Config)) -> Self {
        let mut rig = Rig::start();
        expect_stalls(&mut rig);
        rig.config.compensation.conditioning_counts = Some(400);
        rig.config.command.max_step_counts = 250;
        change(&mut rig.config);
        let mut whole = Self { domain: rig.domain(), rig };
        whole.control(None);
        whole
    }

    /// Ends the controller, if one runs, and starts one with this model.
    fn control(&mut self, model: Option<&str>) {
        self.rig.stop_controller_thread();
        let folder = self.rig.folder.path();
        self.rig.config.control.model = model.map(|name| folder.join(name));
        self.rig.start_controller_thread();
        drop(self.rig.client());
    }

    /// Words, where `@` marks files of the folder.
    fn words(&self, words: &str) -> String {
        let folder = self.rig.folder.path().to_str().unwrap();
        words.replace('@', &format!("{folder}/"))
    }

    #[track_caller]
    fn tool(&self, words: &str) -> String {
        succeeds(&self.domain, &self.words(words))
    }

    fn recording(&self, name: &str) -> Recording {
        read(&self.rig.folder.path().join(name))
    }

    fn fit(&self, recording: &str, output: &str) -> Model {
        let options = "--family gmr --components 4 --restarts 2";
        self.tool(&format!(
            "calibrate fit @{recording} --robot-id rig {options} --output @{output}"
        ));
        let model = Model::load(&self.rig.folder.path().join(output)).unwrap();
        model.check_robot("rig", 2).unwrap();
        let metrics = &model.file().metrics;
        assert!(metrics.iter().all(|it| it.training.r2 > 0.9), "{metrics:?}");
        model
    }
}

/// RMS distance between the angles of two recordings at common times, and their number.
fn apart_deg(one: &Recording, other: &Recording) -> (f64, usize) {
    let mut squares = Vec::new();
    for row in one.rows() {
        let is_same = |time_s: f64| (time_s - row.time_s.unwrap()).abs() < 1e-6;
        let same = other.rows().iter().find(|seen| is_same(seen.time_s.unwrap()));
        squares.extend(same.map(|seen| {
            (0..2).map(|axis| (seen.outputs[axis] - row.outputs[axis]).powi(2)).sum::<f64>()
        }));
    }
    ((squares.iter().sum::<f64>() / squares.len() as f64).sqrt(), squares.len())
}

/// Images of the snake at rest, before the recording, and of every sixth row.
fn draw(recording: &Recording, folder: &Path) {
    let rig = Scene::laboratory(640, 480, 100.0);
    setup(&rig).save(&folder.join("vision.toml")).unwrap();
    (0..2).for_each(|view| fs::create_dir(folder.join(format!("view{view}"))).unwrap());
    let rest = (0..6_u32).map(|number| (1e-4 * f64::from(number), JointPose::default()));
    let rows = recording.rows().iter().step_by(6).map(|row| {
        let [pitch_rad, yaw_rad, _] = row.outputs.map(f64::to_radians);
        (row.time_s.unwrap(), JointPose { pitch_rad, yaw_rad })
    });
    for (number, (time_s, pose)) in rest.chain(rows).enumerate() {
        for (view, image) in rig.render_views(pose, number as u64).iter().enumerate() {
            let name = format!("view{view}/frame_t{time_s:.9}.png");
            save_grey(&folder.join(name), image).unwrap();
        }
    }
}

#[test]
fn recording_gives_a_model_from_angles_and_from_images() {
    let mut whole = Whole::start(|_| {});
    let collect = "calibrate collect --output @take.csv --home --json";
    let motion = "--duration-s 40 --range-counts 1200 --speed-counts-s 900";
    let printed = whole.tool(&format!("{collect} {motion}"));
    let sidecar: serde_json::Value = serde_json::from_str(&printed).unwrap();
    assert_eq!(sidecar["outcome"]["complete"], true, "{printed}");
    assert_eq!(sidecar["robot_id"], "rig");
    // The emulated camera stamps the exposure, so there is no latency to find; gaps may hide that.
    let has_gaps = sidecar["flags"].as_array().is_some_and(|flags| !flags.is_empty());
    let late_ms = sidecar["latency"]["estimate_ms"].as_f64();
    assert!(late_ms.map_or(has_gaps, |late| late.abs() < 15.0), "{printed}");

    let recording = whole.recording("take.csv");
    let (rows, path) = (recording.rows().len(), recording.path());
    assert!(rows > 300 && path.len() > 2 * rows, "{rows} rows of {}", path.len());
    let reach =
        [0, 1].map(|motor| path.iter().map(|place| place.counts[motor].abs()).fold(0.0, f64::max));
    assert!(reach.iter().all(|reach| (600.0..1205.0).contains(reach)), "{reach:?}");
    assert_eq!(whole.rig.emulator.host_bugs(), 0);
    whole.fit("take.csv", "model.json");

    // Images of the recorded motion, their angles, and a model of those.
    draw(&recording, whole.rig.folder.path());
    let measure = "vision --config @vision.toml @view0 @view1 --rest-s 0.001";
    whole.tool(&format!("{measure} --output @angles.csv"));
    whole.tool("calibrate merge @take.csv @angles.csv --output @seen.csv");
    let (apart, common) = apart_deg(&whole.recording("seen.csv"), &recording);
    assert!(common > 80 && apart < 0.1, "{common} pictures, {apart} deg");
    assert!(apart > 0.0, "the angles are those of the pictures");
    whole.fit("seen.csv", "seen.json");
    whole.control(Some("seen.json"));
    whole.tool("command pose 8 -6 --duration-s 1 --enable");
    let [pitch, yaw] = whole.rig.emulator.snapshot().angles_deg;
    // The model has no memory: half the loop width, and the friction remaining from earlier motion.
    assert!((pitch - 8.0).hypot(yaw + 6.0) < 4.0, "{pitch} {yaw}");
}

#[test]
fn collect_resumes_from_the_setpoint_after_a_stall() {
    // After a stall, a program continues by the motion of 20 ms: 18 counts at 900 counts/s.
    let whole = Whole::start(|config| config.command.max_step_counts = 8);
    let collect = "calibrate collect --output @take.csv --home --no-condition";
    let motion = "--duration-s 8 --range-counts 1200 --speed-counts-s 900";
    let mut collect = start(&whole.domain, &whole.words(&format!("{collect} {motion}")));
    let position = || whole.rig.emulator.snapshot().axes.map(|axis| axis.drive.motor_counts);
    let start = position();
    wait_until("it is under way", || {
        assert!(collect.child().try_wait().unwrap().is_none(), "it ended");
        (0..2).any(|axis| (position()[axis] - start[axis]).abs() > 200.0)
    });
    for _ in 0..3 {
        wait_until("it is fast", || {
            let before = position();
            clock::sleep(Nanos::from_millis(20));
            let is_fast = (0..2).any(|axis| (position()[axis] - before[axis]).abs() > 12.0);
            is_fast || collect.child().try_wait().unwrap().is_some()
        });
        if collect.child().try_wait().unwrap().is_some() {
            // Too early: judged below, with its message.
            break;
        }
        collect.pause();
        clock::sleep(Nanos::from_millis(300));
        collect.resume();
        clock::sleep(Nanos::from_millis(400));
    }
    ends(collect, 0, &["resumes from the present pose"]);
    let sidecar = fs::read_to_string(whole.rig.folder.path().join("take.toml")).unwrap();
    assert_says(&sidecar, &["complete = true"]);
}
