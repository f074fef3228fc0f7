//! Models of drawn snakes, fitted to recordings of them.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

use i2ris::model::Model;
use i2ris::model::file::{OutputSpec, OutputUnit};
use i2ris::units::{MAX_OUTPUTS, MotorVec};
use i2ris_calibration::fit::{Choice, Family, FitOptions, fit};
use i2ris_calibration::progress::Silent;
use i2ris_calibration::recording::{ColumnMap, Recording, RecordingWriter, Row};
use i2ris_simulation::physics::DrawnSnake;
use i2ris_simulation::robot::{Robot, TICK_S};

use super::random::Random;

fn first_model_file() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/adaptation/lugre-1.json")
}

/// A model of the first snake with plays, of a family that files may still have.
pub fn first_model() -> Arc<Model> {
    Arc::new(Model::load(&first_model_file()).unwrap())
}

/// A model of a snake, from a recording of two minutes and a half.
pub fn model(snake: DrawnSnake, family: Family) -> Arc<Model> {
    let file = tempfile::NamedTempFile::new().unwrap();
    record(snake, file.reopen().unwrap());
    let (recording, _) = Recording::read(file.path(), &ColumnMap::default()).unwrap();
    let options = FitOptions {
        robot_id: "i2ris-emulated".to_owned(),
        choice: Choice::One(family),
        ..FitOptions::default()
    };
    fit(&recording, &options, &Silent).unwrap().model
}

/// From point to point, with reversals everywhere.
fn record(snake: DrawnSnake, file: File) {
    const SPEED_COUNTS_S: f64 = 450.0;
    const TICKS: u32 = 150_000;
    let mut robot = Robot::new(snake.build());
    condition(&mut robot);
    let mut random = Random::new(77 + snake.seed);
    let outputs =
        ["pitch", "yaw"].map(|name| OutputSpec { name: name.to_owned(), unit: OutputUnit::Deg });
    let mut writer = RecordingWriter::new(BufWriter::new(file), true, 2, &outputs).unwrap();
    let (mut at, mut to) = ([0.0; 2], [0.0; 2]);
    for tick in 0..TICKS {
        let away: MotorVec = [to[0] - at[0], to[1] - at[1]];
        let distance = away[0].hypot(away[1]);
        let step = SPEED_COUNTS_S * TICK_S;
        if distance <= step {
            to = [0, 1].map(|_| random.within(1600.0));
        } else {
            at = [0, 1].map(|i| at[i] + step / distance * away[i]);
        }
        robot.tick(at.map(f64::round));
        let time_s = Some(f64::from(tick) * TICK_S);
        if tick % 33 == 0 {
            let mut noise = || 0.07 * random.normal();
            let [pitch, yaw] = robot.angles_deg();
            let angles = [pitch + noise(), yaw + noise(), 0.0];
            writer.row(&Row::new(time_s, robot.encoders(), angles)).unwrap();
        } else if tick % 5 == 0 {
            let nothing = [f64::NAN; MAX_OUTPUTS];
            writer.row(&Row::new(time_s, robot.encoders(), nothing)).unwrap();
        }
    }
    writer.finish().unwrap();
}

/// Decaying turns.
fn condition(robot: &mut Robot) {
    for tick in 0..12_000 {
        let share = f64::from(tick) / 12_000.0;
        let (sin, cos) = (std::f64::consts::TAU * 4.0 * share).sin_cos();
        let size = 800.0 * (1.0 - share) * (8.0 * share).min(1.0);
        robot.tick([size * sin, size * cos]);
    }
}
