//! Models of drawn snakes, fitted to recordings of them.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use i2ris::model::file::{OutputSpec, OutputUnit};
use i2ris::units::MAX_OUTPUTS;
use i2ris_calibration::fit::{Choice, FitOptions, fit};
use i2ris_calibration::progress::Silent;
use i2ris_calibration::recording::{ColumnMap, Recording, RecordingWriter, Row};
use i2ris_simulation::robot::TICK_S;

use super::*;

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/adaptation").join(name)
}

/// A model of the first snake, of the default family.
pub fn first_model() -> Arc<Model> {
    Arc::new(Model::load(&file("force-balance.json")).unwrap())
}

/// Model of the same snake, with plays.
pub fn model_of_plays() -> Arc<Model> {
    Arc::new(Model::load(&file("lugre-1.json")).unwrap())
}

/// The model equals the fit of its recording. `I2RIS_WRITE_MODEL` names a file to write the fit to.
#[test]
#[ignore = "the fit takes a minute: for .ci/nightly"]
fn the_first_model_is_the_fit_of_its_recording() {
    let models = [first_model(), model(SNAKES[0], Family::ForceBalance)];
    if let Some(path) = std::env::var_os("I2RIS_WRITE_MODEL") {
        models[1].file().write(Path::new(&path)).unwrap();
    }
    let mut memories = models.each_ref().map(|model| model.new_memory());
    for k in 0..2000 {
        let t = f64::from(k) * 0.01;
        let counts = [900.0 * t.sin() + 300.0 * (3.1 * t).sin(), 1100.0 * (0.7 * t).sin()];
        let [a, b] = [0, 1].map(|at: usize| {
            models[at].advance(&mut memories[at], &counts);
            models[at].predict(&counts, &memories[at]).mean
        });
        let apart = (a[0] - b[0]).hypot(a[1] - b[1]).to_degrees();
        assert!(apart < 0.01, "{apart} deg at {counts:?}");
    }
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

/// Records point-to-point motion with reversals everywhere.
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
            to = [0, 1].map(|_| random.within(-1600.0, 1600.0));
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
            writer.row(&Row::new(time_s, robot.encoders(), [f64::NAN; MAX_OUTPUTS])).unwrap();
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
