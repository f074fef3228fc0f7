//! The whole way of a calibration: emulated drives, snake and camera, the controller's own threads, `i2ris calibrate
//! collect` and `i2ris calibrate fit` as processes.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use i2ris::config::Config;
use i2ris::control::runtime;
use i2ris::ipc::{Domain, random_id};
use i2ris::model::Model;
use i2ris_calibration::recording::{ColumnMap, Recording};
use i2ris_emulator::snake::SnakeConfig;
use i2ris_emulator::{Emulator, EmulatorConfig};
use tempfile::TempDir;

/// Emulator and controller, until dropped.
struct Rig {
    emulator: Emulator,
    folder: TempDir,
    shutdown: Arc<AtomicBool>,
    controller: Option<JoinHandle<()>>,
}

impl Rig {
    fn start() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let files = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config");
        let snake = SnakeConfig::load(&files.join("snakes/steel.toml")).unwrap();
        let mut emulator = Emulator::start(EmulatorConfig::new(snake, &folder.path().join("ports"))).unwrap();
        let mut config = Config::load(&files.join("emulator.toml")).unwrap();
        config.ipc.domain = format!("t{:016x}", random_id());
        emulator.publish_camera(&Domain::new(&config.ipc.domain).unwrap()).unwrap();
        for (axis, port) in config.ports.iter_mut().enumerate() {
            port.device = emulator.device(axis).to_owned();
            port.reply_timeout_ms = 500;
        }
        // Tests share the machine: nobody spins, stalls are not what this is about, and the stroke is a short one.
        (config.control.spin_us, config.control.priority, config.control.lock_memory) = (0, 0, false);
        (config.limits.feedback_stale_ms, config.limits.feedback_lost_ms) = (2000, 10_000);
        (config.command.deadline_ms, config.command.lease_ms) = (500, 2000);
        config.condition.half_width_counts = Some(400);
        (config.condition.turns, config.condition.velocity_counts_s) = (1, 2000.0);
        std::fs::write(folder.path().join("robot.toml"), toml::to_string(&config).unwrap()).unwrap();
        let shutdown = Arc::new(AtomicBool::new(false));
        let asked = Arc::clone(&shutdown);
        let controller = thread::spawn(move || runtime::run(&config, &asked, &mut std::io::sink()).unwrap());
        Self { emulator, folder, shutdown, controller: Some(controller) }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs `i2ris` with arguments, those that begin with `@` being files of the rig; returns what it printed.
    fn tool(&self, arguments: &[&str]) -> String {
        let file = |name: &str| self.path(name).into_os_string();
        let arguments = arguments.iter().map(|text| text.strip_prefix('@').map_or_else(|| text.into(), file));
        let output: Output = Command::new(env!("CARGO_BIN_EXE_i2ris")).args(arguments).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        self.shutdown.store(true, Ordering::Release);
        if let Some(controller) = self.controller.take() {
            let _ = controller.join();
        }
    }
}

#[test]
fn what_was_collected_makes_a_model() {
    let rig = Rig::start();
    let printed = rig.tool(&[
        "calibrate",
        "collect",
        "--config",
        "@robot.toml",
        "--output",
        "@take.csv",
        "--enable",
        "--duration-s",
        "20",
        "--range-counts",
        "1200",
        "--speed-counts-s",
        "900",
        "--json",
    ]);
    let sidecar: serde_json::Value = serde_json::from_str(&printed).unwrap();
    assert_eq!(sidecar["outcome"]["complete"], true, "{printed}");
    assert_eq!(sidecar["robot_id"], "i2ris-emulated");
    // The emulated camera stamps the exposure, so there is nothing to find.
    let latency = sidecar["latency"]["estimate_ms"].as_f64().unwrap();
    assert!(latency.abs() < 15.0, "{printed}");

    let (recording, report) = Recording::read(&rig.path("take.csv"), &ColumnMap::default()).unwrap();
    assert!(recording.rows().len() > 300 && report.positions > recording.rows().len(), "{report:?}");
    let reach = |motor: usize| recording.path().iter().map(|place| place.counts[motor].abs()).fold(0.0, f64::max);
    assert!(reach(0) > 600.0 && reach(1) > 600.0 && reach(0).max(reach(1)) < 1205.0, "{} {}", reach(0), reach(1));
    assert_eq!(rig.emulator.host_bugs(), 0);

    rig.tool(&[
        "calibrate",
        "fit",
        "@take.csv",
        "--robot-id",
        "i2ris-emulated",
        "--family",
        "gmr",
        "--components",
        "4",
        "--restarts",
        "2",
        "--output",
        "@model.json",
    ]);
    let model = Model::load(&rig.path("model.json")).unwrap();
    model.check_robot("i2ris-emulated", 2).unwrap();
    for metrics in &model.file().metrics {
        assert!(metrics.training.r2 > 0.9, "{:?}", model.file().metrics);
    }
}
