//! Shared by all snakes: the configuration of the controller, fits, ageing, and calibration
//! recordings in simulated time, like those of `i2ris calibrate collect`.

use std::collections::VecDeque;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use i2ris::config::Config;
use i2ris::model::file::{OutputSpec, OutputUnit};
use i2ris::units::MAX_OUTPUTS;
use i2ris_calibration::fit::{Choice, FitOptions, FitOutcome, fit};
use i2ris_calibration::progress::Silent;
use i2ris_calibration::recording::{ColumnMap, Recording, RecordingWriter, Row};
use i2ris_report::Failure;
use i2ris_simulation::SnakeSource;
use i2ris_simulation::ageing::{Change, Course, Parameter};
use i2ris_simulation::motion::paced_motion::Playback;
use i2ris_simulation::motion::protocol::{MotionRequest, Protocol, Region};
use i2ris_simulation::robot::{Robot, TICK_S};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// The default radius of `i2ris calibrate collect` with `config/emulator.toml`, counts.
const RADIUS_COUNTS: f64 = 1800.0;
/// Its usual speed, counts per second.
const SPEED_COUNTS_S: f64 = 450.0;
/// Ticks between two positions of the encoders: what the serial lines carry.
const POSITION_TICKS: u64 = 5;
const FRAMES_PER_S: f64 = 30.0;

#[derive(Debug, Clone, Copy)]
pub struct RecordingPlan {
    pub protocol: Protocol,
    pub duration_s: f64,
    /// Deviation of the angles, deg.
    pub noise_deg: f64,
    /// Latency of the camera's time stamps, ms.
    pub latency_ms: u64,
    pub seed: u64,
}

impl RecordingPlan {
    /// Records a robot that has been conditioned, as always before a calibration.
    pub fn record(&self, robot: &mut Robot, file: &Path) -> Result<(), Failure> {
        condition(robot);
        let request = MotionRequest {
            protocol: self.protocol,
            region: Region { centre: [0.0; 2], radius: RADIUS_COUNTS, motors: 2 },
            speed_counts_s: SPEED_COUNTS_S,
            duration_s: Some(self.duration_s),
            seed: self.seed,
        };
        let mut playback = Playback::new(request.motion([0.0; 2]));
        let writer = BufWriter::new(File::create(file)?);
        let mut writer = RecordingWriter::new(writer, true, 2, &outputs())?;
        let mut camera = Camera {
            noise_deg: self.noise_deg,
            random: Pcg64Mcg::seed_from_u64(self.seed + 999),
            latency_ticks: self.latency_ms,
            frames: 0,
            pending: VecDeque::new(),
        };
        let mut tick = 0;
        while !playback.is_finished(false) {
            robot.tick(playback.advance(TICK_S, false).map(f64::round));
            let time_s = Some(tick as f64 * TICK_S);
            if let Some(angles) = camera.frame(tick, robot) {
                writer.row(&Row::new(time_s, robot.encoders(), angles))?;
            } else if tick % POSITION_TICKS == 0 {
                let nothing = [f64::NAN; MAX_OUTPUTS];
                writer.row(&Row::new(time_s, robot.encoders(), nothing))?;
            }
            tick += 1;
        }
        writer.finish()?;
        Ok(())
    }
}

struct Camera {
    noise_deg: f64,
    random: Pcg64Mcg,
    latency_ticks: u64,
    frames: u64,
    pending: VecDeque<(u64, [f64; 2])>,
}

impl Camera {
    /// The angles that are stamped with this tick, if any.
    fn frame(&mut self, tick: u64, robot: &Robot) -> Option<[f64; MAX_OUTPUTS]> {
        if tick as f64 * TICK_S >= self.frames as f64 / FRAMES_PER_S {
            self.frames += 1;
            let stamp = tick + self.latency_ticks;
            self.pending.push_back((stamp, robot.angles_deg()));
        }
        let (_, [pitch, yaw]) = *self.pending.front().filter(|(stamp, _)| *stamp == tick)?;
        self.pending.pop_front();
        let mut noise = || self.noise_deg * normal(&mut self.random);
        Some([pitch + noise(), yaw + noise(), 0.0])
    }
}

/// A normally distributed number (Box and Muller).
fn normal(random: &mut Pcg64Mcg) -> f64 {
    let (a, b): (f64, f64) = (random.random(), random.random());
    (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}

/// Four decaying turns: the controller's conditioning without a model.
pub fn condition(robot: &mut Robot) {
    const TURNS: f64 = 4.0;
    const SIZE_COUNTS: f64 = 500.0;
    const TICKS: u32 = 12_000;
    for tick in 0..TICKS {
        let share = f64::from(tick) / f64::from(TICKS);
        let (sin, cos) = (std::f64::consts::TAU * TURNS * share).sin_cos();
        let size = SIZE_COUNTS * (1.0 - share) * (8.0 * share).min(1.0);
        robot.tick([size * sin, size * cos]);
    }
    for _ in 0..500 {
        robot.tick([0.0; 2]);
    }
}

fn outputs() -> [OutputSpec; 2] {
    ["pitch", "yaw"].map(|name| OutputSpec { name: name.to_owned(), unit: OutputUnit::Deg })
}

/// The configuration for the emulator, with the limits of a robot as delivered.
const CONFIG: &str = include_str!("../../../../config/emulator.toml");
/// A tick and the lag of the emulated motors at 60 Hz: lines are not simulated.
const MOTOR_LAG_MS: f64 = 6.0;

/// Wear of a used snake: growth of gaps and friction, loss of preload.
const WORN: [(Parameter, f64); 3] =
    [(Parameter::Gap, 0.4), (Parameter::Preload, -0.3), (Parameter::Friction, 0.25)];

pub fn config() -> Result<Config, Failure> {
    let mut config = Config::parse(CONFIG, "config/emulator.toml".as_ref())?;
    config.compensation.lead_ms = MOTOR_LAG_MS;
    Ok(config)
}

pub fn read(file: &Path) -> Result<Recording, Failure> {
    let read = Recording::read(file, &ColumnMap::default());
    Ok(read.map_err(|error| format!("cannot read the recording: {error}"))?.0)
}

pub fn fitted(
    recording: &Recording,
    choice: Choice,
    robot_id: &str,
) -> Result<FitOutcome, Failure> {
    let options = FitOptions { robot_id: robot_id.to_owned(), choice, ..FitOptions::default() };
    fit(recording, &options, &Silent).map_err(|error| format!("cannot fit: {error}").into())
}

/// A snake as calibrated, or aged since then.
pub fn robot(snake: &SnakeSource, is_aged: bool) -> Robot {
    let mut robot = Robot::new(snake.build(1));
    if is_aged {
        for (parameter, by) in WORN {
            let (start_s, course) = (0.0, Course::Step {});
            robot.age(Change { parameter, by, start_s, motor: None, direction: None, course });
        }
        // Sudden changes happen before anything moves.
        robot.rest(1.0);
    }
    robot
}

#[cfg(test)]
mod tests {
    use i2ris_simulation::physics::{DrawnSnake, Physics};

    use super::*;

    /// Every protocol on three snakes, by cameras with and without noise.
    #[test]
    #[ignore = "a minute of fits: for .ci/nightly"]
    fn sound_recordings_of_36_kinds_are_read_without_a_note() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("rows.csv");
        let protocols =
            [Protocol::Reversals, Protocol::Cycles, Protocol::DecayingSine, Protocol::Axes];
        for physics in [Physics::PrandtlIshlinskii, Physics::Gear, Physics::LuGre] {
            for protocol in protocols {
                for noise_deg in [0.0, 0.02, 0.1] {
                    let snake = DrawnSnake { physics, seed: 7 };
                    let duration_s = if protocol == Protocol::Axes { 200.0 } else { 60.0 };
                    let (latency_ms, seed) = (0, 7);
                    let plan = RecordingPlan { protocol, duration_s, noise_deg, latency_ms, seed };
                    plan.record(&mut robot(&snake.into(), false), &file).unwrap();
                    let (_, read) = Recording::read(&file, &ColumnMap::default()).unwrap();
                    assert!(read.notes.is_empty(), "{snake} {plan:?}: {:?}", read.notes);
                }
            }
        }
    }
}
