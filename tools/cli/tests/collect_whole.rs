//! A whole calibration: emulated drives, snake and camera, the controller's own threads,
//! `i2ris calibrate collect` and `i2ris calibrate fit` as processes; then the same through pictures
//! of the snake, and a command with the model that came of them.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use i2ris::config::Config;
use i2ris::ipc::{Domain, random_id};
use i2ris::model::Model;
use i2ris::process::controller;
use i2ris_calibration::recording::{ColumnMap, Recording};
use i2ris_emulator::snake::SnakeConfig;
use i2ris_emulator::{Emulator, EmulatorConfig};
use i2ris_testing::Program;
use tempfile::TempDir;

/// Emulator and controller, until dropped.
struct Rig {
    emulator: Emulator,
    folder: TempDir,
    config: Config,
    controller: Option<(Arc<AtomicBool>, JoinHandle<()>)>,
}

impl Rig {
    fn start() -> Self {
        Self::start_with(|_| {})
    }

    fn start_with(change: impl FnOnce(&mut Config)) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let files = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config");
        let snake = SnakeConfig::load(&files.join("snakes/steel.toml")).unwrap();
        let mut emulator =
            Emulator::start(EmulatorConfig::new(snake, &folder.path().join("ports"))).unwrap();
        let mut config = Config::load(&files.join("emulator.toml")).unwrap();
        config.ipc.domain = format!("t{:016x}", random_id());
        emulator.publish_camera(&Domain::new(&config.ipc.domain).unwrap()).unwrap();
        for (axis, port) in config.ports.iter_mut().enumerate() {
            port.device = emulator.device(axis).to_owned();
        }
        i2ris_testing::run_on_shared_machine(&mut config);
        config.conditioning.half_width_counts = Some(400);
        (config.conditioning.turns, config.conditioning.velocity_counts_s) = (1, 2000.0);
        change(&mut config);
        let mut rig = Self { emulator, folder, config, controller: None };
        rig.control(None);
        rig
    }

    /// Ends the controller, if one runs, and starts one with this model.
    fn control(&mut self, model: Option<&str>) {
        self.stop();
        self.config.control.model = model.map(|name| self.path(name));
        std::fs::write(self.path("robot.toml"), toml::to_string(&self.config).unwrap()).unwrap();
        let (config, shutdown) = (self.config.clone(), Arc::new(AtomicBool::new(false)));
        let asked = Arc::clone(&shutdown);
        let thread = thread::spawn(move || {
            controller::run(&config, "", &asked, &mut std::io::sink()).unwrap()
        });
        self.controller = Some((shutdown, thread));
    }

    fn stop(&mut self) {
        if let Some((shutdown, thread)) = self.controller.take() {
            shutdown.store(true, Ordering::Release);
            let _ = thread.join();
        }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Arguments of which those that begin with `@` are files of the rig.
    fn arguments(&self, arguments: &str) -> Vec<String> {
        let file = |name: &str| self.path(name).to_str().unwrap().to_owned();
        arguments
            .split_whitespace()
            .map(|text| text.strip_prefix('@').map_or_else(|| text.to_owned(), file))
            .collect()
    }

    /// Runs `i2ris` with `arguments`; returns what it printed.
    fn tool(&self, arguments: &str) -> String {
        let output: Output = Command::new(env!("CARGO_BIN_EXE_i2ris"))
            .args(self.arguments(arguments))
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        self.stop();
    }
}

/// Root mean square distance between the angles of two recordings at their common instants, and how
/// many those are.
fn apart_deg(one: &Recording, other: &Recording) -> (f64, usize) {
    let mut squares = Vec::new();
    for row in one.rows() {
        let same = other
            .rows()
            .iter()
            .find(|seen| (seen.time_s.unwrap() - row.time_s.unwrap()).abs() < 1e-6);
        squares.extend(same.map(|seen| {
            (0..2).map(|axis| (seen.outputs[axis] - row.outputs[axis]).powi(2)).sum::<f64>()
        }));
    }
    ((squares.iter().sum::<f64>() / squares.len() as f64).sqrt(), squares.len())
}

/// Pictures of what was recorded, the angles that are in them, and a model of those.
fn through_pictures(rig: &Rig) -> Model {
    rig.tool("vision render --angles @take.csv --output @pictures --size 640x480 --every 6");
    let setup = "vision calibrate --setup @pictures/vision.toml --output @vision.toml";
    rig.tool(&format!("{setup} --rest @pictures/rest0 @pictures/rest1"));
    let measure = "vision --setup @vision.toml @pictures/view0 @pictures/view1 --rest-s 0";
    rig.tool(&format!("{measure} --output @angles.csv"));
    rig.tool("calibrate merge @take.csv @angles.csv --output @seen.csv");
    let read = |name: &str| Recording::read(&rig.path(name), &ColumnMap::default()).unwrap().0;
    let (apart, common) = apart_deg(&read("seen.csv"), &read("take.csv"));
    assert!(common > 80 && apart < 0.1, "{common} pictures, {apart} deg");
    assert!(apart > 0.0, "the angles are those of the pictures");
    fit(rig, "@seen.csv", "@seen.json")
}

fn fit(rig: &Rig, recording: &str, output: &str) -> Model {
    let family = "--robot-id i2ris-emulated --family gmr --components 4 --restarts 2";
    rig.tool(&format!("calibrate fit {recording} {family} --output {output}"));
    let model = Model::load(&rig.path(&output[1..])).unwrap();
    model.check_robot("i2ris-emulated", 2).unwrap();
    model
}

#[test]
fn what_was_collected_makes_a_model_by_its_angles_and_through_pictures() {
    let mut rig = Rig::start();
    let collect = "calibrate collect --config @robot.toml --output @take.csv --home --json";
    let motion = "--duration-s 40 --range-counts 1200 --speed-counts-s 900";
    let printed = rig.tool(&format!("{collect} {motion}"));
    let sidecar: serde_json::Value = serde_json::from_str(&printed).unwrap();
    assert_eq!(sidecar["outcome"]["complete"], true, "{printed}");
    assert_eq!(sidecar["robot_id"], "i2ris-emulated");
    // The emulated camera stamps the exposure, so there is nothing to find.
    let latency = sidecar["latency"]["estimate_ms"].as_f64().unwrap();
    assert!(latency.abs() < 15.0, "{printed}");

    let (recording, report) =
        Recording::read(&rig.path("take.csv"), &ColumnMap::default()).unwrap();
    assert!(
        recording.rows().len() > 300 && report.positions > recording.rows().len(),
        "{report:?}"
    );
    let reach = |motor: usize| {
        recording.path().iter().map(|place| place.counts[motor].abs()).fold(0.0, f64::max)
    };
    assert!(
        reach(0) > 600.0 && reach(1) > 600.0 && reach(0).max(reach(1)) < 1205.0,
        "{} {}",
        reach(0),
        reach(1)
    );
    assert_eq!(rig.emulator.host_bugs(), 0);

    let direct = fit(&rig, "@take.csv", "@model.json");
    for metrics in &direct.file().metrics {
        assert!(metrics.training.r2 > 0.9, "{:?}", direct.file().metrics);
    }

    let seen = through_pictures(&rig);
    for metrics in &seen.file().metrics {
        assert!(metrics.training.r2 > 0.9, "{:?}", seen.file().metrics);
    }
    rig.control(Some("seen.json"));
    let domain = rig.config.ipc.domain.clone();
    let pose = "--enable pose 8 -6 --duration-s 1";
    rig.tool(&format!("command --domain {domain} {pose}"));
    let [pitch, yaw] = rig.emulator.snapshot().angles_deg;
    // The model has no memory: half the width of the loop, and what friction has left of the motion
    // before.
    assert!((pitch - 8.0).hypot(yaw + 6.0) < 4.0, "{pitch} {yaw}");
}

#[test]
fn collect_goes_on_from_the_setpoint_after_a_stall() {
    // After a stall, a program goes on by what a motor moves in 20 ms: 18 counts at 900 counts/s.
    let rig = Rig::start_with(|config| config.command.max_step_counts = 8);
    let domain = Domain::new(&rig.config.ipc.domain).unwrap();
    let collect = "calibrate collect --config @robot.toml --output @take.csv --home --no-condition";
    let motion = "--duration-s 8 --range-counts 1200 --speed-counts-s 900";
    let arguments = rig.arguments(&format!("{collect} {motion}"));
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let mut collect = Program::start(&domain, &arguments);
    let position = || -> Vec<f64> {
        let axes = rig.emulator.snapshot().axes;
        axes.iter().map(|axis| axis.drive.motor_counts).collect()
    };
    let start = position();
    let is_under_way = || (0..2).any(|axis| (position()[axis] - start[axis]).abs() > 200.0);
    while !is_under_way() {
        assert!(collect.child().try_wait().unwrap().is_none(), "it ended");
        thread::sleep(Duration::from_millis(1));
    }
    // Some of these are at full speed.
    for _ in 0..5 {
        collect.pause();
        thread::sleep(Duration::from_millis(300));
        collect.resume();
        thread::sleep(Duration::from_millis(400));
    }
    let (ended_well, _, errors) = collect.end();
    assert!(ended_well, "{errors}");
    assert!(errors.contains("goes on from where it is"), "{errors}");
    let text = std::fs::read_to_string(rig.path("take.toml")).unwrap();
    assert!(text.contains("complete = true"), "{text}");
}
