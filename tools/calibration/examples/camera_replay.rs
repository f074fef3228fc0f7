//! Recordings beside the repository (`shared/data`) as streams of a camera, one frame late, through
//! model and adaptation in the cycle of the controller. Where the folder is absent it prints that.
//!
//! A row is a frame. The encoders follow the recorded counts; what the controller expects before it
//! has received the frame of a row is compared with the frame. Two poses are compared: the one that
//! is applied, which moves with the goal and no faster than its limit, and the estimate. The same
//! is shown with a larger budget: the wrist is wrong by more than the default one of a snake. Rows
//! without a time are given one.
//!
//! `cargo run --release -p i2ris-calibration --example camera_replay`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use i2ris::config::{AdaptationConfig, Config, PortConfig};
use i2ris::core::adaptation::{AdaptationReport, Drift};
use i2ris::core::{ExternalPose, ServoGoal};
use i2ris::model::Model;
use i2ris::robot::{OperatingState, StateCommand};
use i2ris::units::{MotorVec, Nanos, OutputVec};
use i2ris_calibration::drift::DriftEstimate;
use i2ris_calibration::fit::{Choice, Family, FitOptions, fit};
use i2ris_calibration::progress::Silent;
use i2ris_calibration::recording::{ColumnMap, Recording};
use i2ris_simulation::closed_loop::{
    ClosedLoop, Inputs, PlacedMotors, state_request, without_limits,
};

/// Ticks per second. Lines and drives are not part of it: a slower cycle shows the same.
const RATE_HZ: u32 = 200;

/// Time from row to row where the recording has none, and its bounds where it has, s. The ring of
/// the adaptation does not reach back further.
const ROW_S: f64 = 0.1;
const ROW_BOUNDS_S: [f64; 2] = [0.1, 0.6];

/// A row was measured at rest, so long before the next motion begins.
const REST: Nanos = Nanos::from_millis(25);

/// For an instrument whose error is larger than that of the snake.
fn wide() -> AdaptationConfig {
    AdaptationConfig {
        zero_budget_deg: 10.0,
        total_budget_deg: 20.0,
        slew_deg_s: 10.0,
        ..AdaptationConfig::default()
    }
}

/// The motors arrive after this share of a row. The frame of the row before comes then.
const MOTION_SHARE: f64 = 0.5;

/// Root mean squares are printed for so many parts of the rows.
const PARTS: usize = 4;

const FAMILIES: [Family; 2] = [Family::GmrPlay, Family::ForceBalance];

fn main() {
    if let (Some(first), Some(second)) =
        (read("tee_probe/motor1_first.csv"), read("tee_probe/motor1_second.csv"))
    {
        println!("tee_probe: the second sweep by models of the first");
        for family in FAMILIES {
            replay(family, &first, &second, 0);
        }
    }
    if let Some(wrist) = read("dvrk_wrist/random_first70.csv") {
        println!("dvrk_wrist: the last 30 % of the rows by models of the others");
        let rows = wrist.rows().len() * 7 / 10;
        for family in FAMILIES {
            replay(family, &wrist.first_rows(rows), &wrist, rows);
        }
    }
}

fn read(name: &str) -> Option<Recording> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let path: PathBuf = path.join(name);
    if !path.exists() {
        println!("skipped: {} is absent", path.display());
        return None;
    }
    let text = fs::read_to_string(&path).unwrap();
    if text.starts_with("t_s,") {
        return Some(Recording::read(&path, &ColumnMap::default()).unwrap().0);
    }
    let timed = text.lines().enumerate().map(|(line, text)| match line {
        0 => format!("t_s,{text}\n"),
        _ => format!("{:.3},{text}\n", ROW_S * line as f64),
    });
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("timed.csv");
    fs::write(&path, timed.collect::<String>()).unwrap();
    Some(Recording::read(&path, &ColumnMap::default()).unwrap().0)
}

/// Errors from row `from` on: as calibrated, as applied, and of the estimate.
fn replay(family: Family, training: &Recording, tested: &Recording, from: usize) {
    let options = FitOptions { choice: Choice::One(family), ..FitOptions::default() };
    let model = fit(training, &options, &Silent).unwrap().model;
    println!("  {family}, slow error {:.3?}", model.file().slow_error);
    let is_other_recording = from == 0;
    let mut zero = [0.0; 3];
    let budgets = [
        ("none", None),
        ("the default", Some(AdaptationConfig::default())),
        ("a wide", Some(wide())),
    ];
    for (name, adaptation) in budgets {
        let is_adapted = adaptation.is_some();
        let mut robot = Robot::new(&model, adaptation);
        if is_other_recording {
            robot.follow_by_hand(training);
        }
        robot.enable();
        let mut errors = [Vec::new(), Vec::new()];
        let mut before: Option<(f64, OutputVec)> = None;
        for (index, row) in tested.rows().iter().enumerate() {
            let interval_s = match (before, row.time_s) {
                (Some((then, _)), Some(now)) => now - then,
                _ => ROW_S,
            };
            let [least, most] = ROW_BOUNDS_S;
            let frame = before.filter(|_| index > from).map(|(_, outputs)| outputs);
            let seen: OutputVec = std::array::from_fn(|i| row.outputs[i] - zero[i]);
            robot.go(row.counts, seen, interval_s.clamp(least, most), frame);
            before = Some((row.time_s.unwrap_or_default(), seen));
            if index < from {
                continue;
            }
            let poses = [robot.applied(), robot.expected(&model)];
            for (errors, pose) in errors.iter_mut().zip(poses) {
                errors.push([0, 1].map(|i: usize| seen[i] - pose[i].to_degrees()));
            }
        }
        if is_other_recording && !is_adapted {
            // The angles count from the first row of their own recording: the mean is taken off.
            let rows = &errors[0];
            for (output, zero) in zero.iter_mut().enumerate().take(model.outputs()) {
                *zero = rows.iter().map(|row| row[output]).sum::<f64>() / rows.len() as f64;
            }
            for row in errors.iter_mut().flatten() {
                *row = [row[0] - zero[0], row[1] - zero[1]];
            }
        }
        let [applied, expected] = &errors;
        if let Some(report) = robot.adaptation() {
            println!("    with {name} budget");
            println!("    applied       {}", shown(applied, model.outputs()));
            println!("    estimate      {}", shown(expected, model.outputs()));
            println!("    estimate {:.3?}", report.estimate);
            println!("    applied  {:.3?}\n    {:?}", report.applied, report.frames);
            let pauses: Vec<_> = report.pauses.iter().collect();
            println!("    pauses {pauses:?}, taken back {}", report.taken_back);
        } else {
            println!("    as calibrated {}", shown(applied, model.outputs()));
        }
    }
    let batch = DriftEstimate::new(&model, tested).unwrap();
    println!(
        "    drift of all rows taken out at once: {:.3} -> {:.3} deg; rest: {:.0} % along {:+.2?}, \
         autocorrelation {:.2?}",
        batch.rms[0],
        batch.rms[1],
        100.0 * batch.rest.share,
        batch.rest.direction,
        batch.rest.autocorrelation
    );
}

/// Root mean squares of all rows, and of each part.
fn shown(errors: &[[f64; 2]], outputs: usize) -> String {
    let rms = |errors: &[[f64; 2]], output: usize| {
        let squares: f64 = errors.iter().map(|error| error[output].powi(2)).sum();
        (squares / errors.len() as f64).sqrt()
    };
    let of = |errors: &[[f64; 2]]| {
        let each = (0..outputs).map(|output| format!("{:.3}", rms(errors, output)));
        each.collect::<Vec<_>>().join("/")
    };
    let parts: Vec<_> = errors.chunks(errors.len().div_ceil(PARTS)).map(of).collect();
    format!("{} deg; in parts {}", of(errors), parts.join("  "))
}

/// The cycle in front of encoders that follow a recording.
struct Robot {
    control: ClosedLoop<PlacedMotors>,
    /// rad.
    goal: OutputVec,
    outputs: u32,
    unit: f64,
    /// When the motors were at rest at the last row.
    row_stamp: Nanos,
}

impl Robot {
    /// `adaptation`: `None` for none.
    fn new(model: &Arc<Model>, adaptation: Option<AdaptationConfig>) -> Self {
        let mut config = without_limits(&config(model));
        config.adaptation =
            AdaptationConfig { enabled: adaptation.is_some(), ..adaptation.unwrap_or_default() };
        // What a recording shows against its model is judged here; it is no fault.
        config.plausibility.distance_deg = 0.0;
        let control = ClosedLoop::new(&config, model, PlacedMotors(model.hull().centre()));
        Self {
            row_stamp: control.now(),
            control,
            goal: [0.0; 3],
            outputs: model.outputs() as u32,
            unit: model.file().outputs[0].unit.si(),
        }
    }

    /// The motors go along a recording with the drives off: the memory becomes known.
    fn follow_by_hand(&mut self, recording: &Recording) {
        for position in recording.path() {
            self.control.motors.0 = position.counts;
            self.tick(Inputs::default());
        }
    }

    fn enable(&mut self) {
        self.tick(Inputs {
            request: Some(state_request(StateCommand::Enable)),
            ..Inputs::default()
        });
        for _ in 0..100 {
            self.tick(Inputs::default());
        }
        assert_eq!(self.control.report().state, OperatingState::Enabled);
    }

    /// Goes to a row. The frame of the row before arrives during the motion.
    /// The goal, by which the correction moves, goes from angle to angle of the recording.
    fn go(
        &mut self,
        counts: MotorVec,
        outputs: OutputVec,
        interval_s: f64,
        frame: Option<OutputVec>,
    ) {
        let (from, goal_from) = (self.control.motors.0, self.goal);
        let goal_to = outputs.map(|value| value * self.unit);
        let stamp = self.row_stamp;
        let ticks = (interval_s * f64::from(RATE_HZ)).round() as u32;
        let moving = ((MOTION_SHARE * f64::from(ticks)) as u32).max(1);
        for tick in 1..=ticks {
            let share = (f64::from(tick) / f64::from(moving)).min(1.0);
            self.control.motors.0 =
                [0, 1].map(|motor: usize| from[motor] + share * (counts[motor] - from[motor]));
            let arrived = frame.filter(|_| tick == moving);
            self.goal = std::array::from_fn(|i| goal_from[i] + share * (goal_to[i] - goal_from[i]));
            let goal = ServoGoal::Joint(self.goal, self.outputs);
            let servo = Some(self.control.servo_command(goal));
            self.tick(Inputs {
                servo,
                external: arrived.map(|outputs| ExternalPose {
                    stamp,
                    position: outputs.map(|value| value * self.unit),
                    outputs: self.outputs,
                    quality: 1.0,
                }),
                ..Inputs::default()
            });
            let report = self.control.report();
            let (state, fault) = (report.state, report.fault);
            assert_eq!(state, OperatingState::Enabled, "{fault}");
        }
        self.row_stamp = self.control.now() - REST;
    }

    fn tick(&mut self, inputs: Inputs) {
        self.control.tick(inputs);
    }

    fn adaptation(&self) -> Option<AdaptationReport> {
        self.control.report().adaptation
    }

    /// The pose that the controller reports, rad.
    fn applied(&self) -> OutputVec {
        let joint = self.control.report().joint;
        joint.map_or([0.0; 3], |joint| joint.measured)
    }

    /// The same with the estimate instead of what is applied of it, rad. The growth of the gaps is
    /// that in use.
    fn expected(&self, model: &Model) -> OutputVec {
        let applied = self.applied();
        let Some(report) = self.adaptation() else {
            return applied;
        };
        let [pitch, yaw] = with(&report.estimate, model, without(&report.applied, applied));
        [pitch, yaw, 0.0]
    }
}

/// The pose before a correction.
fn without(applied: &Drift, pose: OutputVec) -> [f64; 2] {
    let [[a, b], [c, d]] = applied.gain;
    let determinant = (1.0 + a) * (1.0 + d) - b * c;
    let [x, y] = [pose[0] - applied.zero[0], pose[1] - applied.zero[1]];
    [((1.0 + d) * x - b * y) / determinant, ((1.0 + a) * y - c * x) / determinant]
}

fn with(drift: &Drift, model: &Model, pose: [f64; 2]) -> [f64; 2] {
    let slow = model.file().slow_error.map_or([0.0; 2], |slow| slow.direction);
    [0, 1].map(|output| {
        let [a, b] = drift.gain[output];
        let zero = drift.zero[output] + slow[output] * drift.slow;
        pose[output] + zero + a * pose[0] + b * pose[1]
    })
}

/// As many motors as the model has.
fn config(model: &Model) -> Config {
    let text = include_str!("../../../config/emulator.toml");
    let mut config = Config::parse(text, Path::new("config/emulator.toml")).unwrap();
    config.robot_id = model.file().robot_id.clone();
    config.control.rate_hz = RATE_HZ;
    let axes = config.ports.iter().flat_map(|port| port.axes.clone());
    let axes: Vec<_> = axes.take(model.motors()).collect();
    config.ports = vec![PortConfig::new(PathBuf::new(), axes)];
    config
}
