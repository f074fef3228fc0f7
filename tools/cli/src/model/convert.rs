//! `i2ris model invert` and `i2ris model predict`: angles to counts, and back.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use i2ris::config::{AxisConfig, Config, JointLimitConfig, PortConfig};
use i2ris::model::{Memory, Model, file::OutputUnit};
use i2ris::units::{Counts, MotorVec, OutputVec};
use i2ris::{core::ServoGoal, ipc::Refusal};
use i2ris_calibration::recording::{ColumnMap, Row, TimeColumn, Wanted};
use i2ris_report::Failure;
use i2ris_report::statistics::{distance, interpolate};
use i2ris_simulation::closed_loop::{ClosedLoop, IdealMotors, LoopError};
use i2ris_simulation::closed_loop::{start_position, without_limits};
use serde::Serialize;

use super::{check_output, counts_columns, history, output_columns, si};
use crate::calibrate::{ColumnArguments, PathColumns};
use crate::csv_table;

/// Speed of the approach to the first pose, degrees (mm) per second.
const APPROACH: f64 = 10.0;
/// Ticks without motion after which the approach is at rest, and time limit for that, in ticks.
const REST_TICKS: u32 = 50;
const REST_TIMEOUT_TICKS: u32 = 10_000;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris model invert steel.json desired.csv --output counts.csv
  i2ris model invert steel.json desired.csv --history before.csv --output counts.csv
  i2ris model invert steel.json desired.csv --config robot.toml --output counts.csv

The trajectory has the columns t_s, pitch_deg, yaw_deg (or those of the model), interpolated
linearly; the history has q0_counts, q1_counts. The output contains the setpoints that the control
loop would send, tick by tick. The snake first moves to the start of the trajectory, at 10 deg/s.")]
pub struct InvertArguments {
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
    memory_known: bool,
    travel_counts: Vec<f64>,
}

pub fn invert(arguments: &InvertArguments) -> Result<(), Failure> {
    let InvertArguments { trajectory, output, .. } = arguments;
    check_output(output, &[&arguments.model, trajectory])?;
    let model = Arc::new(Model::load(&arguments.model)?);
    let config = config(arguments, &model)?;
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
    let memory_known = rehearsal.report().joint.is_some_and(|joint| joint.memory_known);
    let travel_counts = vec![0.0; model.motors()];
    let (ticks, clipped_ticks, clipped_farthest) = (0, 0, 0.0);
    let mut outcome =
        Outcome { ticks, clipped_ticks, clipped_farthest, memory_known, travel_counts };
    let rows = play(&mut rehearsal, &desired, &mut outcome)
        .map_err(|(error, t)| explained(error, trajectory, t, &config, unit))?;
    let time = std::iter::once("t_s".to_owned());
    let columns = time.chain(output_columns(&model)).chain(counts_columns(&model));
    let header: Vec<String> = columns.collect();
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
    let Outcome { clipped_ticks, clipped_farthest, .. } = outcome;
    if *clipped_ticks > 0 {
        println!(
            "{clipped_ticks} of them are out of reach, by {clipped_farthest:.2} {unit} at most: \
             replaced by the nearest pose"
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
    let distance = distance(&from, &to);
    let step = APPROACH * desired.si * rehearsal.period().as_seconds();
    let ticks = if at_once { 1.0 } else { (distance / step).ceil() };
    for tick in 1..=ticks as u64 {
        let share = tick as f64 / ticks;
        rehearsal.follow(desired.goal(interpolate(&from, &to, share)))?;
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
            format!("; more than {step} in a tick: smooth it, or lift the limits with --no-limits")
        }
        _ => String::new(),
    };
    format!("{} at t_s = {time_s:.3}: {error}{remedy}", file.display()).into()
}

fn config(arguments: &InvertArguments, model: &Model) -> Result<Config, Failure> {
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
        let low = Counts::from_f64(low.floor()).unwrap_or(Counts(i32::MIN));
        let high = Counts::from_f64(high.ceil()).unwrap_or(Counts(i32::MAX));
        AxisConfig::new(motor, 0, [low, high])
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

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris model predict steel.json path.csv --history before.csv --output angles.csv

The files are read like a recording by `i2ris calibrate fit`. A time column is copied to the output;
rows with an empty cell are skipped and counted.")]
pub struct PredictArguments {
    /// The model
    model: PathBuf,
    /// The path of the motors
    #[arg(id = "path", value_name = "COUNTS.csv")]
    counts: PathBuf,
    /// Earlier path of the motors: sets the hysteresis memory at the start
    #[arg(long, value_name = "COUNTS.csv")]
    history: Option<PathBuf>,
    /// Output file: angles, counts, and the time if the path has one
    #[arg(long, short, value_name = "ANGLES.csv")]
    output: PathBuf,
    #[command(flatten)]
    columns: PathColumns,
}

pub fn predict(arguments: &PredictArguments) -> Result<(), Failure> {
    let PredictArguments { counts, output, .. } = arguments;
    check_output(output, &[&arguments.model, counts])?;
    let model = Model::load(&arguments.model)?;
    let columns = arguments.columns.map();
    let table = csv_table::read(counts, &columns, &Wanted::path_of(model.motors()))?.rows;
    let mut memory = model.new_memory();
    let past = history(arguments.history.as_ref(), &columns, &model)?;
    follow(&model, &mut memory, &past, |_, _| ());
    let (si, mut unknown) = (si(&model), 0_usize);
    let mut rows = Vec::with_capacity(table.len());
    follow(&model, &mut memory, &table, |row, memory| {
        unknown += usize::from(!model.is_memory_known(memory));
        let angles = model.predict(&row.counts, memory).mean;
        let angles = angles.iter().take(model.outputs()).map(|angle| angle / si);
        let counts = row.counts.into_iter().take(model.motors());
        rows.push(row.time_s.into_iter().chain(angles).chain(counts).collect());
    });
    let time = table.first().and_then(|row| row.time_s).map(|_| "t_s".to_owned());
    let columns = time.into_iter().chain(output_columns(&model)).chain(counts_columns(&model));
    let header: Vec<String> = columns.collect();
    csv_table::write(output, &header, &rows)?;
    println!("wrote {} rows to {}", rows.len(), output.display());
    if model.creeps() && past.iter().chain(&table).any(|row| row.time_s.is_none()) {
        eprintln!(
            "warning: this snake creeps, but the path has no times, so the angles are those of an \
             instantaneous motion; give the counts with times"
        );
    }
    if unknown > 0 {
        eprintln!(
            "warning: in the first {unknown} row(s) the memory is unknown, so their angles may \
             be off by the width of the hysteresis loop; give the earlier path of the motors \
             with --history"
        );
    }
    Ok(())
}

/// Advances a memory along a path, using its times if present.
fn follow(model: &Model, memory: &mut Memory, path: &[Row], mut at: impl FnMut(&Row, &Memory)) {
    let mut before = path.first().and_then(|row| row.time_s);
    for row in path {
        let time_s = row.time_s.zip(before).map_or(0.0, |(time, before)| time - before);
        model.advance_over(memory, &row.counts, time_s);
        before = row.time_s;
        at(row, memory);
    }
}
