//! Recordings beside the repository (`shared/data`) as streams of a camera, one frame late, through
//! model and adaptation in the cycle of the controller. Where the folder is absent it prints that.
//!
//! A row is a frame. The encoders follow the recorded counts; the pose that the controller reports
//! before it has seen the frame is compared with the frame. Recordings without time get a frame
//! every [`ROW_S`].
//!
//! `cargo run --release -p i2ris-calibration --example camera_replay`

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::path::{Path, PathBuf};
use std::sync::Arc;

use i2ris::config::{Config, PortConfig};
use i2ris::core::cycle::ControlCycle;
use i2ris::core::rehearsal::without_limits;
use i2ris::core::{CycleInputs, CycleReport, ExternalPose, ServoCommand, ServoGoal, StateRequest};
use i2ris::drive::{AxisFeedback, AxisPhase};
use i2ris::model::Model;
use i2ris::robot::{OperatingState, StateCommand};
use i2ris::units::{Counts, MAX_MOTORS, MotorVec, Nanos, OutputVec};
use i2ris_calibration::drift::DriftEstimate;
use i2ris_calibration::fit::{Choice, Family, FitOptions, fit};
use i2ris_calibration::progress::Silent;
use i2ris_calibration::recording::{ColumnMap, Recording};

/// Time from row to row, s, and ticks in it.
const ROW_S: f64 = 0.1;
const TICKS: u32 = 20;

const CLIENT: u64 = 1;

fn main() {
    let families = [Family::GmrPlay, Family::GmrPrandtlIshlinskii];
    if let (Some(first), Some(second)) = (
        read("tee_probe/motor1_first.csv"),
        read("tee_probe/motor1_second.csv"),
    ) {
        println!("tee_probe: the second sweep by models of the first");
        for family in families {
            replay(family, &first, &second, 0);
        }
    }
    if let Some(wrist) = read("dvrk_wrist/random_first70.csv") {
        println!("dvrk_wrist: the last 30 % of the rows by models of the others");
        let rows = wrist.rows().len() * 7 / 10;
        for family in families {
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
    Some(Recording::read(&path, &ColumnMap::default()).unwrap().0)
}

/// Errors from row `from` on, as calibrated, adapted, and with the drift of all rows taken out.
fn replay(family: Family, training: &Recording, tested: &Recording, from: usize) {
    let options = FitOptions {
        choice: Choice::One(family),
        ..FitOptions::default()
    };
    let model = fit(training, &options, &Silent).unwrap().model;
    let before: &[_] = if from == 0 { training.path() } else { &[] };
    let mut errors = [Vec::new(), Vec::new()];
    for (is_adapted, errors) in [false, true].into_iter().zip(&mut errors) {
        let mut robot = Robot::new(&model, is_adapted);
        for position in before {
            robot.at = position.counts;
            robot.tick(None, None, None);
        }
        robot.enable();
        for (index, row) in tested.rows().iter().enumerate() {
            let frame = (index > 0).then(|| tested.rows()[index - 1].outputs);
            let pose = robot.row(row.counts, frame);
            if index >= from {
                let error = |output: usize| row.outputs[output] - pose[output].to_degrees();
                errors.push([error(0), if model.outputs() > 1 { error(1) } else { 0.0 }]);
            }
        }
        if let Some(report) = robot.report.adaptation {
            println!("  {family}: {:?}", report.estimate);
            println!("    frames {:?}, pauses {:?}", report.frames, report.pauses);
        }
    }
    let rms = |errors: &[[f64; 2]], output: usize| {
        let squares: f64 = errors.iter().map(|error| error[output].powi(2)).sum();
        (squares / errors.len() as f64).sqrt()
    };
    let [calibrated, adapted] = &errors;
    let show = |errors| format!("{:.3}/{:.3}", rms(errors, 0), rms(errors, 1));
    let batch = DriftEstimate::new(&model, tested).unwrap();
    println!(
        "  {family}: as calibrated {} deg, adapted {} deg; drift of all rows taken out at once: \
         {:.3} -> {:.3} deg",
        show(calibrated),
        show(adapted),
        batch.rms[0],
        batch.rms[1],
    );
    println!(
        "    rest: {:.0} % along {:+.2?}, autocorrelation {:.2?}",
        100.0 * batch.rest.share,
        batch.rest.direction,
        batch.rest.autocorrelation
    );
}

/// The cycle in front of encoders that follow a recording.
struct Robot {
    cycle: ControlCycle,
    model: Arc<Model>,
    now: Nanos,
    at: MotorVec,
    sequence: u64,
    report: CycleReport,
    /// When the last row was read.
    row_stamp: Nanos,
}

impl Robot {
    fn new(model: &Arc<Model>, is_adapted: bool) -> Self {
        let mut config = without_limits(&config(model));
        config.adaptation.enabled = is_adapted;
        let mut cycle = ControlCycle::new(&config, Some(Arc::clone(model)));
        let now = Nanos::from_millis(1000);
        let report = cycle.step(now, &CycleInputs::default()).report;
        Self {
            cycle,
            model: Arc::clone(model),
            now,
            at: model.hull().centre(),
            sequence: 0,
            report,
            row_stamp: now,
        }
    }

    fn enable(&mut self) {
        let request = StateRequest {
            id: 0,
            client_id: CLIENT,
            command: StateCommand::Enable,
            pose: None,
        };
        self.tick(None, None, Some(request));
        for _ in 0..100 {
            self.tick(None, None, None);
        }
        assert_eq!(self.report.state, OperatingState::Enabled);
    }

    /// Goes to a row; the pose there before its frame is seen, rad.
    fn row(&mut self, counts: MotorVec, frame: Option<[f64; 3]>) -> OutputVec {
        let unit = self.model.file().outputs[0].unit.si();
        let from = self.at;
        let frame_stamp = self.row_stamp;
        for tick in 1..=TICKS {
            let share = (f64::from(tick) / f64::from(TICKS / 2)).min(1.0);
            self.at =
                [0, 1].map(|motor: usize| from[motor] + share * (counts[motor] - from[motor]));
            // The frame of the row before arrives with the first tick of this one.
            let frame = frame.filter(|_| tick == 1).map(|outputs| ExternalPose {
                stamp: frame_stamp,
                position: outputs.map(|value| value * unit),
                outputs: self.model.outputs() as u32,
                quality: 1.0,
            });
            let goal = self.report.joint.map_or([0.0; 3], |joint| joint.measured);
            self.tick(Some(goal), frame, None);
        }
        self.row_stamp = self.now;
        self.report
            .joint
            .map_or([f64::NAN; 3], |joint| joint.measured)
    }

    fn tick(
        &mut self,
        goal: Option<OutputVec>,
        external: Option<ExternalPose>,
        request: Option<StateRequest>,
    ) {
        self.now = self.now + Nanos((ROW_S / f64::from(TICKS) * 1e9) as u64);
        self.sequence += 1;
        let enabled = self.report.state == OperatingState::Enabled || request.is_some();
        let axis = |counts: f64| AxisFeedback {
            phase: if enabled {
                AxisPhase::Enabled
            } else {
                AxisPhase::Disabled
            },
            homed: true,
            position: Counts::from_f64(counts).unwrap(),
            stamp: self.now,
            sequence: self.sequence,
            ..AxisFeedback::default()
        };
        let mut feedback = [AxisFeedback::default(); MAX_MOTORS];
        for (feedback, counts) in feedback.iter_mut().zip(self.at).take(self.model.motors()) {
            *feedback = axis(counts);
        }
        let servo = goal.map(|goal| ServoCommand {
            client_id: CLIENT,
            sequence: self.sequence,
            stamp: self.now,
            deadline: Nanos::ZERO,
            goal: ServoGoal::Joint(goal, self.model.outputs() as u32),
            clutched: false,
            has_unknown_flags: false,
        });
        let inputs = CycleInputs {
            servo,
            request,
            external,
            feedback,
            ..CycleInputs::default()
        };
        self.report = self.cycle.step(self.now, &inputs).report;
    }
}

/// As many motors as the model has.
fn config(model: &Model) -> Config {
    let text = include_str!("../../../config/emulator.toml");
    let mut config = Config::parse(text, Path::new("config/emulator.toml")).unwrap();
    config.robot_id = model.file().robot_id.clone();
    config.control.rate_hz = (f64::from(TICKS) / ROW_S) as u32;
    let axes = config.ports.iter().flat_map(|port| port.axes.clone());
    let axes: Vec<_> = axes.take(model.motors()).collect();
    config.ports = vec![PortConfig::new(PathBuf::new(), axes)];
    config
}
