//! `i2ris preflight`: go/no-go check before each trial.

mod judgement;
mod motion;
#[cfg(test)]
pub mod tests;

use std::fs;
use std::path::{Path, PathBuf};

use i2ris::config::{Config, PortConfig};
use i2ris::ipc::client::{Client, Latest};
use i2ris::ipc::payload::{ExternalPosition, JointState, Message, OperatingStateMsg, Version};
use i2ris::ipc::{Domain, OperatingState, StateCommand, watchdog_presence::WatchdogStatus};
use i2ris::model::{Model, ModelId};
use i2ris::{clock, drive::fingerprint::differences_of_model, process::run_log};
use i2ris::{realtime::Ticker, units::Nanos, wall_clock};
use i2ris_calibration::recording::seconds;
use i2ris_report::statistics::{mean, median};
use i2ris_report::{DomainOption, Failure, Interrupt, bail, while_working};
use i2ris_report::{preflight::Preflight, programs::served_file};
use nix::sys::statvfs::statvfs;
use nix::unistd::{AccessFlags, access};
use serde_json::Value;

use crate::command::prepare::{FIRST_MESSAGE_TIMEOUT, PrepareOptions, connect, prepare};
use crate::command::stream::present_pose;
use crate::command::stream_monitor::{StopReason, StreamMonitor};
use crate::procedure::{Person, Terminal};
use judgement::{CAMERA, CONDITION, CameraFacts, Measured, PICTURE, Swing, judge};
use motion::{FARTHEST_DEG, LENGTH_S, Observer, Pair, Plan, SWING_DEG, Series};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris preflight                    asks before the snake moves
  i2ris preflight --enable --json    in a script: permit enabling and motion

Checks drives, model, zero, lines, camera, clock, disk and watchdog, and swings the snake by 1.5
deg to one side, in pitch and then in yaw, for half a minute. The next `i2ris record trial start`
stores the result, and warns if there was no check in the last hour. On Ctrl-C the robot stops and
holds.")]
pub struct Arguments {
    /// The configuration of the controller [default: the one it was started with]
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Print JSON instead of lines
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    prepare: PrepareOptions,
    #[command(flatten)]
    domain: DomainOption,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let interrupt = Interrupt::catch()?;
    let domain = arguments.domain.domain()?;
    let mut client = connect(&domain)?;
    let version = client.version()?;
    let file = arguments.config.clone().or_else(|| served_file(version.pid));
    let file = file.ok_or("the configuration of this controller cannot be found; use --config")?;
    let config = Config::load(&file)?;
    let mut measured = gather(&client, &domain, &config, &version)?;
    let swing = swing_if_permitted(&mut client, arguments.prepare, &measured, &interrupt);
    if interrupt.came() {
        bail!("interrupted; the robot holds");
    }
    measured.swing = swing?;
    let report = judge(&measured);
    report.print(arguments.json)?;
    let no_go: Vec<String> = report.failed().map(str::to_owned).collect();
    let outcome = if no_go.is_empty() { Ok(()) } else { Err(no_go.join(", ")) };
    let (time, stamp_ns) = (wall_clock::now().to_string(), clock::now().0);
    Preflight { time, stamp_ns, boot_id: version.boot_id, no_go }.write(&domain)?;
    outcome.map_err(|named| format!("no-go: {named}"))?;
    if !arguments.json {
        println!("go");
    }
    Ok(())
}

/// Long enough for the frames of a slow camera.
const LOOK: Nanos = Nanos::from_millis(3000);
const PERIOD: Nanos = Nanos::from_millis(5);

fn gather(
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
    let recorded = training.and_then(|training| seconds(training.recorded_at.as_ref()?, false));
    let now_s = wall_clock::unix_time().as_seconds();
    let runs = fs::read_to_string(config.record_folder.join(run_log::FILE)).unwrap_or_default();
    let parsed = runs.lines().filter_map(|line| serde_json::from_str(line).ok());
    let runs: Vec<Value> = parsed.collect();
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
        (line["run"] == run).then_some(seconds(line["time"].as_str()?, false)? - monotonic_s)
    };
    let now = wall_clock::unix_time().as_seconds() - clock::now().as_seconds();
    runs.iter().find_map(offset).map_or(0.0, |before| now - before)
}

/// Time for the last frames to arrive, s.
const LAST_FRAMES_S: f64 = 0.5;
/// Time without a camera angle after which the camera cannot limit the motion.
const BLIND: Nanos = Nanos::from_millis(1000);

pub const NOBODY: [&str; 2] =
    ["none: no operator to ask here", "run it at a terminal, or give permission by --enable"];
const UNCONFIRMED: [&str; 2] =
    ["none: not confirmed", "run it again, and type yes when the snake may move"];
pub const PAUSED: [&str; 2] =
    ["none: a client has paused the robot", "`i2ris command state resume`, then run it again"];
const AGAIN: &str = "fix what `i2ris status` shows (also computer load), then run it again";

/// Moves, if permitted and meaningful. An obstacle is a no-go; an interrupt is an error.
fn swing_if_permitted(
    client: &mut Client,
    mut options: PrepareOptions,
    measured: &Measured,
    interrupt: &Interrupt,
) -> Result<Swing, Failure> {
    let none = |[why, fix]: [&str; 2]| Ok(Swing::None([why.to_owned(), fix.to_owned()]));
    let mut person = Terminal::open(interrupt);
    if !measured.is_memory_known {
        return none(["none: the hysteresis memory of the model is unknown", CONDITION]);
    }
    if measured.camera.is_some_and(|camera| !camera.is_alive() || !camera.is_sharp()) {
        return none(["none: the camera is frozen or too noisy to limit the motion", PICTURE]);
    }
    // A script gives permission by `--enable` or `--home`.
    if !options.is_given() {
        let limit = |_| format!("if the camera sees it {FARTHEST_DEG} deg away, it stops");
        let stop = measured.camera.map_or("no camera limits it".to_owned(), limit);
        let question = format!(
            "The snake will swing by {SWING_DEG} deg to one side and back, in pitch, then in yaw, \
             for {LENGTH_S:.0} s; {stop}. The drives will be powered. Is one hand on the switch \
             of the motor supply, and the snake out of the eye?"
        );
        let Some(person) = &mut person else { return none(NOBODY) };
        if !is_yes(person, &question) {
            return none(UNCONFIRMED);
        }
        options = PrepareOptions::ENABLE;
    }
    // The permission is for an unused robot: it must not end a stream or a pause.
    let state = client.wait_for(FIRST_MESSAGE_TIMEOUT, |_| true)?;
    let holder = state.lease_client_id;
    if ![0, client.id()].contains(&holder) {
        let fix = "end that client (`i2ris status` names it), then run it again";
        return none([&format!("none: {}", StopReason::Lease(holder)), fix]);
    }
    if state.state == OperatingState::Paused.number() {
        return none(PAUSED);
    }
    let moved = swing(client, options, measured, interrupt);
    let state = client.operating_state().ok().flatten();
    let holder = state.map_or(0, |state| state.lease_client_id);
    let is_lost = ![0, client.id()].contains(&holder);
    let released = match moved {
        // Another client took the lease first.
        Err(_) if is_lost => Ok(()),
        Err(_) => client.state_command(StateCommand::Hold).map(drop),
        Ok(_) => client.state_command(StateCommand::Release).map(drop),
    };
    let observer = match moved {
        Err(failure) if interrupt.came() => return Err(failure),
        Err(failure) => return none([&failure.to_string(), AGAIN]),
        Ok(observer) => observer,
    };
    released?;
    match observer.finish() {
        _ if observer.is_too_far() => Ok(Swing::TooFar(observer.farthest)),
        None => none(["too few samples from the controller to judge it", AGAIN]),
        Some(motion) if motion.seen.is_some() || measured.camera.is_some() => {
            Ok(Swing::Done(motion))
        }
        Some(motion) => {
            let Some(person) = &mut person else {
                return none(["seen by neither operator nor camera", CAMERA]);
            };
            let question = "Did the tip swing in pitch only, then in yaw only, without a pause at \
                                            every turn, and is it back at the start?";
            Ok(Swing::ByEye(motion, is_yes(person, question)))
        }
    }
}

fn is_yes(person: &mut Terminal, question: &str) -> bool {
    person.answer(&format!("{question} Type yes.")).is_ok_and(|typed| typed == "yes")
}

fn swing(
    client: &mut Client,
    options: PrepareOptions,
    before: &Measured,
    interrupt: &Interrupt,
) -> Result<Observer, Failure> {
    let state = prepare(client, options, interrupt)?;
    let plan = Plan { start: Pair::from(present_pose(client)?) };
    let mut monitor = StreamMonitor::new(client.id(), &state, clock::now());
    let (watcher, mut commander) = (client.watcher(), client.commander());
    let (mut measured, mut motors) = (watcher.measured_js(), watcher.actuators());
    let (mut camera, mut goal) = (watcher.external(), Latest::new(watcher.goal_js()));
    let (mut observer, mut ages_ms) = (Observer::new(plan), Vec::new());
    let begin = clock::now();
    let mut shown = begin;
    let mut ticker = Ticker::new(begin, PERIOD, Nanos::ZERO);
    let time_s = |stamp: Nanos| (stamp.0 as f64 - begin.0 as f64) * 1e-9;
    let angles = |at: [f64; 3]| Pair::new(at[0].to_degrees(), at[1].to_degrees());
    while_working("the snake swings", || -> Result<(), Failure> {
        loop {
            let now_s = time_s(ticker.wait().started);
            measured.drain(|joint| {
                if joint.flags & JointState::VALID != 0 {
                    observer.see(Series::Estimate, time_s(joint.stamp()), angles(joint.position));
                }
            })?;
            motors.drain(|state| {
                let read = state.measured_stamp_ns.into_iter().filter(|it| *it > 0).min();
                let read = read.map_or(state.stamp(), Nanos);
                ages_ms.push(1e3 * state.stamp().duration_since(read).as_seconds());
                for (series, stamp, counts) in [
                    (Series::Setpoint, state.stamp(), state.setpoint_counts),
                    (Series::Encoder, read, state.measured_counts),
                ] {
                    observer.see(series, time_s(stamp), Pair::from(counts.map(f64::from)));
                }
            })?;
            camera.drain(|frame| {
                let is_angle = frame.flags & ExternalPosition::VALID != 0 && frame.count == 2;
                if is_angle && frame.stamp() > begin {
                    shown = clock::now();
                    observer.see(Series::Camera, time_s(frame.stamp()), angles(frame.position));
                }
            })?;
            if observer.is_too_far() || now_s > LENGTH_S + LAST_FRAMES_S {
                return Ok(());
            }
            if before.camera.is_some() && clock::now().duration_since(shown) > BLIND {
                bail!("the camera has shown no angle for 1 s and cannot limit the motion");
            }
            if interrupt.came() {
                bail!("interrupted; the snake stopped and holds");
            }
            commander.servo_jp(plan.goal(now_s).map(f64::to_radians).as_slice())?;
            if let Some(state) = client.operating_state()? {
                monitor.check(&state, clock::now())?;
            }
            if monitor.has_lost_setpoint() {
                bail!("commands came late, and the controller stopped the snake");
            }
            let short = JointState::CLIPPED | JointState::FIXTURE;
            let goal = goal.refresh()?.filter(|goal| goal.stamp() > begin);
            if goal.is_some_and(|goal| goal.flags & short != 0) {
                bail!("none: out of reach here; start nearer to the straight pose");
            }
        }
    })?;
    let age = mean(ages_ms).unwrap_or(0.0);
    let longest = before.lines.iter().map(|(_, [_, it])| 1e3 * it).fold(0.0, f64::max);
    if age > longest {
        bail!("positions were {age:.0} ms old in the motion; at most {longest:.0} expected");
    }
    Ok(observer)
}
