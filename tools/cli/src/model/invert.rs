//! `i2ris model invert`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use i2ris::config::{AxisConfig, Config, JointLimitConfig, PortConfig};
use i2ris::core::ServoGoal;
use i2ris::ipc::Refusal;
use i2ris::model::Model;
use i2ris::model::file::OutputUnit;
use i2ris::units::{Counts, MotorVec, OutputVec};
use i2ris_calibration::recording::{ColumnMap, Row, TimeColumn, Wanted};
use i2ris_simulation::closed_loop::{
    ClosedLoop, IdealMotors, LoopError, start_position, without_limits,
};
use serde::Serialize;

use super::columns::{check_output, counts_columns, history, output_columns};
use crate::calibrate::ColumnArguments;
use crate::csv_table;
use i2ris_report::Failure;
use i2ris_report::statistics::distance;

/// Speed of the approach to the first pose, degrees (mm) per second.
const APPROACH: f64 = 10.0;

/// Ticks without motion after which the approach is at rest, and time limit for that, in ticks.
const REST_TICKS: u32 = 50;
const REST_TIMEOUT_TICKS: u32 = 10_000;

/// Arguments of `i2ris model invert`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris model invert steel.json desired.csv --output counts.csv
  i2ris model invert steel.json desired.csv --history before.csv --output counts.csv
  i2ris model invert steel.json desired.csv --config robot.toml --output counts.csv

The trajectory has the columns t_s, pitch_deg, yaw_deg (or those of the model), interpolated
linearly; the history has q0_counts, q1_counts. The output contains the setpoints that the control
loop would send, tick by tick. The snake first moves to the start of the trajectory, at 10 deg/s.")]
pub struct Arguments {
    /// The model
    model: PathBuf,
    /// The desired angles
    #[arg(value_name = "DESIRED.csv")]
    trajectory: PathBuf,
    /// Earlier path of the motors: sets the hysteresis memory at the start
    #[arg(long, value_name = "COUNTS.csv")]
    history: Option<PathBuf>,
    /// Output file: time, desired angles and counts
    #[arg(long, short, value_name = "COUNTS.csv")]
    output: PathBuf,
    /// Controller configuration: rate, limits, filters [default: those of a robot as
    /// delivered]
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Lift the limits on velocity, acceleration, steps and position, but not the calibrated hull
    #[arg(long)]
    no_limits: bool,
    /// Print the outcome as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    columns: ColumnArguments,
}

#[derive(Debug, Serialize)]
struct Outcome {
    ticks: usize,
    /// Ticks whose goal lay outside the hull, the position limits or the joint limits.
    clipped_ticks: usize,
    /// The largest distance of such a goal from the nearest one in reach, degrees (mm).
    clipped_farthest: f64,
    /// The memory was known when the trajectory began.
    memory_known: bool,
    /// Travel of every motor, counts.
    travel_counts: Vec<f64>,
}

/// Runs the inversion.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Arguments { trajectory, output, .. } = arguments;
    check_output(output, &[&arguments.model, trajectory])?;
    let model = Arc::new(Model::load(&arguments.model)?);
    let config = config(arguments, &model)?;
    let columns: Vec<String> =
        std::iter::once("t_s".to_owned()).chain(output_columns(&model)).collect();
    let map = arguments.columns.map();
    let table = csv_table::read(trajectory, &map, &Wanted::trajectory(&model.file().outputs))?.rows;
    let unit = model.file().outputs.first().map_or(OutputUnit::Deg, |output| output.unit);
    let desired = DesiredTrajectory { rows: &table, si: unit.si(), outputs: model.outputs() };
    // The rehearsal runs tick by tick and ignores the times.
    let untimed = ColumnMap { time: TimeColumn::Ignored, ..map };
    let past = history(arguments.history.as_ref(), &untimed, &model)?;
    let mut past: Vec<MotorVec> = past.iter().map(|row| row.counts).collect();
    if past.is_empty() {
        past.push(start_position(&model, &desired.at(desired.start_s())));
    }
    let mut rehearsal = ClosedLoop::after(&config, &model, &past).map_err(|error| match error {
        LoopError::Command(_, refusal) => {
            format!("the robot cannot be enabled at the end of the history: {refusal}")
        }
        other => other.to_string(),
    })?;
    approach(&mut rehearsal, &desired, arguments.no_limits)
        .map_err(|error| explained(error, trajectory, desired.start_s(), &config, unit))?;
    let known = rehearsal.report().joint.is_some_and(|joint| joint.memory_known);
    let mut outcome = Outcome {
        ticks: 0,
        clipped_ticks: 0,
        clipped_farthest: 0.0,
        memory_known: known,
        travel_counts: vec![0.0; model.motors()],
    };
    let rows = play(&mut rehearsal, &desired, &mut outcome)
        .map_err(|(error, t)| explained(error, trajectory, t, &config, unit))?;
    let header: Vec<String> = columns.into_iter().chain(counts_columns(&model)).collect();
    csv_table::write(output, &header, &rows)?;
    print(&outcome, output, unit, arguments.json)
}

fn print(outcome: &Outcome, output: &Path, unit: OutputUnit, json: bool) -> Result<(), Failure> {
    if !outcome.memory_known {
        eprintln!(
            "warning: the memory is unknown at the start of the trajectory, so the counts may be \
             off by the width of the hysteresis loop; give the earlier path of the motors with \
             --history"
        );
    }
    if json {
        println!("{}", serde_json::to_string_pretty(outcome)?);
        return Ok(());
    }
    println!("wrote {} ticks to {}", outcome.ticks, output.display());
    if outcome.clipped_ticks > 0 {
        println!(
            "{} of them are out of reach, by {:.2} {unit} at most: replaced by the nearest pose",
            outcome.clipped_ticks, outcome.clipped_farthest
        );
    }
    Ok(())
}

struct DesiredTrajectory<'a> {
    rows: &'a [Row],
    si: f64,
    outputs: usize,
}

impl DesiredTrajectory<'_> {
    fn start_s(&self) -> f64 {
        self.rows.first().and_then(|row| row.time_s).unwrap_or_default()
    }

    fn end_s(&self) -> f64 {
        self.rows.last().and_then(|row| row.time_s).unwrap_or_default()
    }

    /// Desired outputs, rad (m), interpolated linearly.
    fn at(&self, time_s: f64) -> OutputVec {
        csv_table::at(self.rows, time_s).map(|value| value * self.si)
    }

    fn goal(&self, angles: OutputVec) -> ServoGoal {
        ServoGoal::Joint(angles, self.outputs as u32)
    }
}

/// Moves to the first pose, straight in the outputs, and waits until the motors are at rest.
fn approach(
    rehearsal: &mut ClosedLoop<IdealMotors>,
    desired: &DesiredTrajectory,
    at_once: bool,
) -> Result<(), LoopError> {
    let to = desired.at(desired.start_s());
    let from = rehearsal.report().joint.map_or(to, |joint| joint.setpoint);
    let distance = from.iter().zip(&to).map(|(from, to)| (to - from).powi(2)).sum::<f64>().sqrt();
    let ticks = if at_once {
        1.0
    } else {
        (distance / (APPROACH * desired.si * rehearsal.period().as_seconds())).ceil()
    };
    for tick in 1..=ticks as u64 {
        let share = tick as f64 / ticks;
        let here = std::array::from_fn(|output| from[output] + share * (to[output] - from[output]));
        rehearsal.follow(desired.goal(here))?;
    }
    let (mut before, mut rested) = (rehearsal.report().setpoints, 0);
    for _ in 0..REST_TIMEOUT_TICKS {
        let now = rehearsal.follow(desired.goal(to))?.setpoints;
        rested = if now == before { rested + 1 } else { 0 };
        before = now;
        if rested >= REST_TICKS {
            break;
        }
    }
    Ok(())
}

/// One row per tick: time, desired outputs, and counts.
fn play(
    rehearsal: &mut ClosedLoop<IdealMotors>,
    desired: &DesiredTrajectory,
    outcome: &mut Outcome,
) -> Result<Vec<Vec<f64>>, (LoopError, f64)> {
    let (start, period) = (desired.start_s(), rehearsal.period().as_seconds());
    let ticks = ((desired.end_s() - start) / period + 1e-9) as u64;
    let mut before = rehearsal.report().setpoints;
    let mut rows = Vec::new();
    for tick in 0..=ticks {
        let time_s = start + tick as f64 * period;
        let angles = desired.at(time_s);
        let report = rehearsal.follow(desired.goal(angles)).map_err(|error| (error, time_s))?;
        outcome.ticks += 1;
        if let Some(joint) = report.joint.filter(|_| report.clipped) {
            let away = distance(&joint.goal, &angles) / desired.si;
            outcome.clipped_ticks += 1;
            outcome.clipped_farthest = outcome.clipped_farthest.max(away);
        }
        let counts = report.setpoints;
        for ((travel, counts), before) in outcome.travel_counts.iter_mut().zip(counts).zip(before) {
            *travel += (counts.as_f64() - before.as_f64()).abs();
        }
        before = counts;
        let angles = angles.into_iter().take(desired.outputs).map(|angle| angle / desired.si);
        let counts = counts.iter().take(outcome.travel_counts.len()).map(|counts| counts.as_f64());
        rows.push(std::iter::once(time_s).chain(angles).chain(counts).collect());
    }
    Ok(rows)
}

fn explained(
    error: LoopError,
    file: &Path,
    time_s: f64,
    config: &Config,
    unit: OutputUnit,
) -> Failure {
    let remedy = match error {
        LoopError::Goal(Refusal::StepTooLarge) => {
            let step = match unit {
                OutputUnit::Deg => format!("{} deg", config.command.max_step_deg),
                OutputUnit::Mm => format!("{} counts", config.command.max_step_counts),
            };
            format!(
                "; more than {step} in one tick: smooth it, or lift the limits with --no-limits"
            )
        }
        _ => String::new(),
    };
    format!("{} at t_s = {time_s:.3}: {error}{remedy}", file.display()).into()
}

fn config(arguments: &Arguments, model: &Model) -> Result<Config, Failure> {
    let config = match &arguments.config {
        Some(file) => {
            let config = Config::load(file)?;
            model.check_robot(&config.robot_id, config.motors())?;
            config
        }
        None => standard(model)?,
    };
    Ok(if arguments.no_limits { without_limits(&config) } else { config })
}

/// A robot for a model, with the limits as delivered, and position limits around the calibrated
/// hull. Its motors are ideal: no line delays, so goals are not led.
fn standard(model: &Model) -> Result<Config, Failure> {
    let corners: Vec<MotorVec> = model.hull().corners().collect();
    let axis = |motor: usize| {
        let values = corners.iter().map(|corner| corner[motor]);
        let (low, high) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let limits = [
            Counts::from_f64(low.floor()).unwrap_or(Counts(i32::MIN)),
            Counts::from_f64(high.ceil()).unwrap_or(Counts(i32::MAX)),
        ];
        AxisConfig::new(motor, 0, limits)
    };
    let axes = (0..model.motors()).map(axis).collect();
    let mut config: Config = toml::from_str("robot_id = \"\"\nports = []")?;
    config.robot_id.clone_from(&model.file().robot_id);
    config.ports = vec![PortConfig::new(PathBuf::new(), axes)];
    config.compensation.lead_ms = 0.0;
    if model.file().outputs.iter().any(|output| output.unit != OutputUnit::Deg) {
        config.joint_limits = JointLimitConfig::OFF;
    }
    Ok(config)
}
