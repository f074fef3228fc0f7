//! Measurements of a preflight at rest.

use std::fs;
use std::path::Path;

use i2ris::config::{Config, PortConfig};
use i2ris::drive::fingerprint::differences_of_model;
use i2ris::ipc::Domain;
use i2ris::ipc::client::{Client, Latest};
use i2ris::ipc::payload::{ExternalPosition, JointState, Message, OperatingStateMsg, Version};
use i2ris::ipc::watchdog_presence::WatchdogStatus;
use i2ris::model::{Model, ModelId};
use i2ris::process::run_log;
use i2ris::units::Nanos;
use i2ris::{clock, wall_clock};
use i2ris_calibration::recording::seconds;
use i2ris_report::statistics::median;
use i2ris_report::{Failure, while_working};
use nix::sys::statvfs::statvfs;
use nix::unistd::{AccessFlags, access};
use serde_json::Value;

use super::judgement::{CameraFacts, Measured, Swing};
use super::motion::Pair;

/// Long enough for the frames of a slow camera.
const LOOK: Nanos = Nanos::from_millis(3000);
const PERIOD: Nanos = Nanos::from_millis(5);

pub fn gather(
    client: &Client,
    domain: &Domain,
    config: &Config,
    version: &Version,
) -> Result<Measured, Failure> {
    let model_id = ModelId(version.model_id);
    let model = config.control.model.as_deref().and_then(|file| Model::load(file).ok());
    let training = model.filter(|model| model.id() == model_id);
    let training = training.as_ref().map(|model| &model.file().training);
    let calibrated = training.map(|training| &*training.drives).unwrap_or_default();
    let recorded = training.and_then(|training| unix_s(training.recorded_at.as_ref()?));
    let now_s = wall_clock::unix_time().as_seconds();
    let runs = fs::read_to_string(config.record_folder.join(run_log::FILE)).unwrap_or_default();
    let runs: Vec<Value> =
        runs.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
    let model_id = model_id.to_string();
    let is_its_begin = |run: &&Value| run["event"] == "begin" && run["model"] == model_id;
    let mut measured = Measured {
        drive_differences: differences_of_model(calibrated, &domain.drives(), config.motors()),
        model_days: recorded.map(|recorded| (now_s - recorded) / 86_400.0),
        model_runs: runs.iter().filter(is_its_begin).count(),
        is_memory_known: false,
        is_homed: false,
        counts: [0; 2],
        lines: Vec::new(),
        camera: None,
        free_mb: free_mb(&config.record_folder),
        clock_step_s: clock_step_s(&runs, version.boot_id),
        priority: [u32::from(config.control.priority), 0],
        watchdog: WatchdogStatus::read(domain, &config.ports_digest(), clock::now()),
        swing: Swing::None(Default::default()),
    };
    while_working("checking drives, camera and clock", || look(client, config, &mut measured))?;
    Ok(measured)
}

/// Reads the streams of a robot at rest.
fn look(client: &Client, config: &Config, measured: &mut Measured) -> Result<(), Failure> {
    let watcher = client.watcher();
    let (mut motors, mut frames) = (watcher.actuators(), watcher.external());
    let mut joint = Latest::new(watcher.measured_js());
    let mut state = Latest::new(watcher.operating_state());
    let mut timing = Latest::new(watcher.period_statistics());
    let (mut ages, mut late, mut places) = ([Vec::new(), Vec::new()], Vec::new(), Vec::new());
    let start = clock::now();
    while clock::now().duration_since(start) < LOOK {
        clock::sleep(PERIOD);
        motors.drain(|seen| {
            measured.counts = seen.measured_counts;
            for (ages, stamp) in ages.iter_mut().zip(seen.measured_stamp_ns) {
                ages.push(seen.stamp().duration_since(Nanos(stamp)).as_seconds());
            }
        })?;
        let now = clock::now();
        frames.drain(|frame| {
            late.push((now.0 as f64 - frame.stamp_ns as f64) * 1e-9);
            if frame.flags & ExternalPosition::VALID != 0 {
                places.push(Pair::new(frame.position[0], frame.position[1]).map(f64::to_degrees));
            }
        })?;
        if let Some(joint) = joint.refresh()? {
            measured.is_memory_known = joint.flags & JointState::MEMORY_KNOWN != 0;
        }
        if let Some(state) = state.refresh()? {
            measured.is_homed = state.flags & OperatingStateMsg::HOMED != 0;
        }
        if let Some(timing) = timing.refresh()? {
            measured.priority[1] = timing.priority;
        }
    }
    // The median norm of the difference of two equal scatters is 1.67 times their deviation.
    let mut steps: Vec<f64> = places.windows(2).map(|it| (it[1] - it[0]).norm() / 1.67).collect();
    // A single frame may be the last of a camera that has ended.
    measured.camera = (late.len() > 1).then(|| CameraFacts {
        frames_per_s: late.len() as f64 / LOOK.as_seconds(),
        seen: places.len() as f64 / late.len() as f64,
        late_s: median(&mut late).unwrap_or(f64::INFINITY),
        // 0 means a frozen picture, not a rounded one.
        scatter_deg: match steps.iter().any(|step| *step > 0.0) {
            true => median(&mut steps).unwrap_or(0.0).max(f64::MIN_POSITIVE),
            false => 0.0,
        },
    });
    let mut line = |port: &PortConfig| {
        let motors = port.axes.iter().map(|axis| axis.motor);
        let of_motors = motors.filter_map(|motor| median(ages.get_mut(motor)?));
        let longest_s = port.longest_gap(port.nominal_exchange()).as_seconds();
        Some((port.device.display().to_string(), [of_motors.reduce(f64::max)?, longest_s]))
    };
    measured.lines = config.ports.iter().filter_map(&mut line).collect();
    Ok(())
}

/// Free space in the record folder, for the present user.
fn free_mb(folder: &Path) -> Option<f64> {
    access(folder, AccessFlags::W_OK).ok()?;
    let found = statvfs(folder).ok()?;
    Some(found.blocks_available() as f64 * found.fragment_size() as f64 * 1e-6)
}

/// Change of the wall clock since the first run-log line with both clocks, s.
fn clock_step_s(runs: &[Value], boot_id: u64) -> f64 {
    let run = format!("{boot_id:016x}");
    let offset = |line: &Value| {
        let monotonic_s = line["monotonic_ns"].as_u64()? as f64 * 1e-9;
        (line["run"] == run).then_some(unix_s(line["time"].as_str()?)? - monotonic_s)
    };
    let now = wall_clock::unix_time().as_seconds() - clock::now().as_seconds();
    runs.iter().find_map(offset).map_or(0.0, |before| now - before)
}

/// `2026-01-31T23:59:59Z` as seconds since 1970.
fn unix_s(text: impl AsRef<str>) -> Option<f64> {
    seconds(text.as_ref(), false)
}
