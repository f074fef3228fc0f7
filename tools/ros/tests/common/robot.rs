//! Emulated drives and a controller on them.

use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use i2ris::clock;
use i2ris::config::Config;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{Domain, DomainLock, random_id};
use i2ris::process::controller;
use i2ris::units::Nanos;
use i2ris_emulator::log::{Event, EventKind};
use i2ris_emulator::snake::SnakeConfig;
use i2ris_emulator::{Emulator, EmulatorConfig};
use tempfile::TempDir;

use super::{TIMEOUT, eventually};

/// See above; until dropped.
pub struct Robot {
    pub domain: Domain,
    pub emulator: Emulator,
    config: Config,
    stop: Arc<AtomicBool>,
    controller: Option<JoinHandle<()>>,
    _folder: TempDir,
}

impl Robot {
    /// A robot that is neither homed nor enabled.
    pub fn start() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let files = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config");
        let snake = SnakeConfig::load(&files.join("snakes/steel.toml")).unwrap();
        let emulator = EmulatorConfig::new(snake, &folder.path().join("ports"));
        let emulator = Emulator::start(emulator).unwrap();
        let mut config = Config::load(&files.join("emulator.toml")).unwrap();
        config.ipc.domain = format!("t{:016x}", random_id());
        for (axis, port) in config.ports.iter_mut().enumerate() {
            port.device = emulator.device(axis).to_owned();
        }
        i2ris_testing::run_on_shared_machine(&mut config);
        config.command.deadline_ms = 200;
        config.command.lease_timeout_ms = 1000;
        config.record.folder = folder.path().join("records");
        let model = folder.path().join("model.json");
        fs::write(&model, linear_model()).unwrap();
        config.control.model = Some(model);
        let mut robot = Self {
            domain: Domain::new(&config.ipc.domain).unwrap(),
            emulator,
            config,
            stop: Arc::default(),
            controller: None,
            _folder: folder,
        };
        robot.start_controller();
        robot.wait_for(|state| state.flags & OperatingStateMsg::BUSY == 0);
        robot
    }

    pub fn start_controller(&mut self) {
        let (config, stop) = (self.config.clone(), Arc::default());
        self.stop = Arc::clone(&stop);
        let run = move || controller::run(&config, "", &stop, &mut std::io::sink()).unwrap();
        self.controller = Some(thread::spawn(run));
    }

    pub fn stop_controller(&mut self) {
        self.stop.store(true, Ordering::Release);
        let _ = self.controller.take().map(JoinHandle::join);
    }

    /// A client in shared memory, beside those of ROS.
    pub fn client(&self) -> Client {
        Client::connect(&self.domain, TIMEOUT).unwrap()
    }

    /// Waits for an operating state.
    pub fn wait_for(&self, condition: impl Fn(&OperatingStateMsg) -> bool) -> OperatingStateMsg {
        self.client().wait_for(TIMEOUT, condition).unwrap()
    }

    /// The setpoints that the drives received, oldest first: axis, when, counts.
    pub fn setpoints(&self) -> Vec<(usize, Nanos, i32)> {
        let setpoint = |event: Event| match event.kind {
            EventKind::Setpoint(counts) => Some((event.axis, event.stamp, counts)),
            _ => None,
        };
        self.emulator.log().into_iter().filter_map(setpoint).collect()
    }

    /// Whether the setpoints of an axis changed since an instant.
    pub fn moved_since(&self, instant: Nanos) -> bool {
        let setpoints = self.setpoints();
        (0..2).any(|axis| {
            let after = { setpoints.iter() }
                .filter(|(of, stamp, _)| *of == axis && *stamp > instant)
                .map(|(_, _, counts)| *counts);
            let (least, most) = (after.clone().min(), after.max());
            least != most
        })
    }

    /// Waits until the snake has held still for a while.
    pub fn wait_until_still(&self) -> Nanos {
        const STILL: Nanos = Nanos::from_millis(400);
        eventually("the snake holds still", || {
            let from = clock::now();
            clock::sleep(STILL);
            (!self.moved_since(from)).then_some(from)
        })
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        self.stop_controller();
        drop(DomainLock::acquire(&self.domain));
    }
}

/// A linear model of the emulated snake, good to a few degrees.
fn linear_model() -> String {
    let gain = 0.022 * std::f64::consts::FRAC_1_SQRT_2;
    let metrics = r#"{"training": {"r2": 1.0, "rmsd": 1.0, "nrmsd": 0.1, "mae": 1.0, "max": 2.0},
        "held_out": null}"#;
    format!(
        r#"{{"format": "i2ris-model", "schema_version": 1, "robot_id": "i2ris-emulated",
            "outputs": [{{"name": "pitch", "unit": "deg"}}, {{"name": "yaw", "unit": "deg"}}],
            "family": {{"kind": "linear", "gain": [[{gain}, -{gain}], [{gain}, {gain}]],
                "offset": [0.0, 0.0], "covariance": [[1.0, 0.0], [0.0, 1.0]]}},
            "hull": {{"corners": [[-1000.0, -1000.0], [1000.0, -1000.0], [1000.0, 1000.0],
                [-1000.0, 1000.0]]}},
            "training": {{"data_file": "none", "data_sha256": "{sha}", "rows": 10, "seed": 0,
                "restarts": 0, "log_likelihood": null, "bic": null, "software": "test"}},
            "metrics": [{metrics}, {metrics}]}}"#,
        sha = "0".repeat(64)
    )
}
