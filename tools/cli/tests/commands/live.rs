//! The Python client against a whole controller with emulated drives: models staged, swapped and
//! rolled back while the snake moves.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use i2ris::config::Config;
use i2ris::ipc::{Domain, DomainLock, random_id};
use i2ris::process::controller;
use i2ris_emulator::snake::SnakeConfig;
use i2ris_emulator::{Emulator, EmulatorConfig};
use tempfile::TempDir;

use i2ris_testing::python;

/// Emulated drives and a controller on them, until dropped.
pub struct Robot {
    pub domain: Domain,
    pub config: Config,
    folder: TempDir,
    stop: Arc<AtomicBool>,
    controller: Option<JoinHandle<()>>,
    emulator: Emulator,
}

impl Robot {
    pub fn start() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let files = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config");
        let snake = SnakeConfig::load(&files.join("snakes/steel.toml")).unwrap();
        let emulator =
            Emulator::start(EmulatorConfig::new(snake, &folder.path().join("ports"))).unwrap();
        let mut config = Config::load(&files.join("emulator.toml")).unwrap();
        config.ipc.domain = format!("t{:016x}", random_id());
        for (axis, port) in config.ports.iter_mut().enumerate() {
            port.device = emulator.device(axis).to_owned();
        }
        i2ris_testing::run_on_shared_machine(&mut config);
        config.control.model = Some(linear_model(folder.path(), "first.json", 1.0));
        config.record.folder = folder.path().join("records");
        let (domain, stop) =
            (Domain::new(&config.ipc.domain).unwrap(), Arc::new(AtomicBool::new(false)));
        let asked = Arc::clone(&stop);
        let own = config.clone();
        let controller =
            thread::spawn(move || controller::run(&own, "", &asked, &mut std::io::sink()).unwrap());
        Self { domain, config, folder, stop, controller: Some(controller), emulator }
    }

    /// The emulated camera publishes the pose.
    #[allow(dead_code)]
    pub fn publish_camera(&mut self) {
        self.emulator.publish_camera(&self.domain).unwrap();
    }
}

impl Drop for Robot {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        let _ = self.controller.take().map(JoinHandle::join);
        drop(DomainLock::acquire(&self.domain));
    }
}

/// A linear model of the emulated snake, good to a few degrees; `factor` scales its angles.
pub fn linear_model(folder: &Path, name: &str, factor: f64) -> PathBuf {
    let gain = factor * 0.022 * std::f64::consts::FRAC_1_SQRT_2;
    let metrics = serde_json::json!({
        "training": { "r2": 1.0, "rmsd": 1.0, "nrmsd": 0.1, "mae": 1.0, "max": 2.0 },
        "held_out": null,
    });
    let model = serde_json::json!({
        "format": "i2ris-model", "schema_version": 1, "robot_id": "i2ris-emulated",
        "outputs": [{ "name": "pitch", "unit": "deg" }, { "name": "yaw", "unit": "deg" }],
        "family": {
            "kind": "linear", "gain": [[gain, -gain], [gain, gain]], "offset": [0.0, 0.0],
            "covariance": [[1.0, 0.0], [0.0, 1.0]],
        },
        "hull": { "corners": [
            [-1000.0, -1000.0], [1000.0, -1000.0], [1000.0, 1000.0], [-1000.0, 1000.0]
        ] },
        "training": {
            "data_file": "none", "data_sha256": "0".repeat(64),
            "rows": 10, "seed": 0, "restarts": 0,
            "log_likelihood": null, "bic": null, "software": "test",
        },
        "metrics": [metrics, metrics],
    });
    let file = folder.join(name);
    fs::write(&file, model.to_string()).unwrap();
    file
}

const SCRIPT: &str = "
import math, sys, threading, time
from i2ris.arm import Arm, OutOfReach, Refused, Stopped

domain, second, broken = sys.argv[1:]
end = time.monotonic() + 20.0
while True:
    try:
        arm = Arm(domain, deadline_s=0.5).__enter__()
        arm.wait_for(lambda state: not state.busy)
        break
    except Exception:
        assert time.monotonic() < end
        time.sleep(0.05)

try:
    arm.enable()
    raise AssertionError('it is not homed')
except Refused as refused:
    assert refused.code == 6 and 'not homed' in refused.reason, refused
arm.home().wait()
assert arm.enable().wait().state == 'ENABLED'
arm.move_jp([math.radians(3.0), math.radians(-2.0)]).wait()
assert abs(math.degrees(arm.setpoint_js().position[0]) - 3.0) < 0.2, arm.setpoint_js()
try:
    arm.move_jp([math.radians(60.0), 0.0]).wait()
    raise AssertionError('out of reach')
except OutOfReach as out:
    assert '60' in str(out), out
arm.move_jp([0.0, 0.0]).wait()
moving = arm.move_jp([math.radians(10.0), 0.0])
assert not moving.is_done()
arm.hold()
try:
    moving.wait()
    raise AssertionError('it was stopped')
except Stopped:
    pass
arm.move_jp([0.0, 0.0]).wait()
try:
    while True:
        arm.servo_jp([math.radians(20.0), 0.0])
        time.sleep(0.005)
except Refused as refused:
    assert 'step too large' in refused.reason, refused

done, lead = threading.Event(), Arm(domain, deadline_s=0.5)
def move():
    start = time.monotonic()
    while not done.is_set():
        t = time.monotonic() - start
        lead.servo_jp([math.radians(2.0 * math.sin(t)), math.radians(2.0 * math.sin(1.3 * t))])
        time.sleep(0.005)
mover = threading.Thread(target=move)
mover.start()
try:
    arm.wait_for(lambda state: state.accepted > 50)
    first = arm.model.list()
    assert first.active.family == 'linear', first
    assert first.staged is None and first.previous is None, first
    try:
        arm.model.stage(broken)
        raise AssertionError('a broken model')
    except Refused as refused:
        assert 'broken.json' in str(refused), refused
    try:
        arm.model.rollback(force=True)
        raise AssertionError('nothing to go back to')
    except Refused as refused:
        assert 'no model was in use before' in str(refused), refused
    staged = arm.model.stage(second)
    assert staged.active.id == first.active.id and staged.staged.id != first.active.id, staged
    try:
        arm.model.activate('0' * 64, force=True)
        raise AssertionError('another model than the staged one')
    except Refused as refused:
        assert 'not staged' in str(refused), refused
    arm.model.activate(staged.staged.id, force=True)
    def in_use(model):
        limit = time.monotonic() + 15.0
        while (models := arm.model.list()).active.id != model:
            assert time.monotonic() < limit, models
            time.sleep(0.02)
        return models
    swapped = in_use(staged.staged.id)
    assert swapped.previous.id == first.active.id, swapped
    arm.model.rollback(force=True)
    in_use(first.active.id)
    before = arm.operating_state().accepted
    state = arm.wait_for(lambda state: state.accepted > before + 20)
    assert state.state == 'ENABLED' and state.fault == 'none', state
finally:
    done.set()
    mover.join()
lead.close()
arm.close()
print('swapped and back')
";

#[test]
fn models_are_swapped_from_python_while_the_snake_moves() {
    let Some(mut command) = python("iceoryx2, numpy") else {
        return;
    };
    let robot = Robot::start();
    let second = linear_model(robot.folder.path(), "second.json", 1.1);
    let broken = robot.folder.path().join("broken.json");
    fs::write(&broken, "{}").unwrap();
    let output = command
        .args(["-c", SCRIPT, robot.domain.name()])
        .args([&second, &broken])
        .output()
        .unwrap();
    let (out, err) =
        (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success() && out.contains("swapped and back"), "{out}{err}");
}
