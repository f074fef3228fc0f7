//! How exact readings are, and how often they are wrong without saying so: measured on synthetic
//! scenes.
//!
//! A repeatable experiment, not a test of one picture: the same seed gives the same table.

mod speed;
mod stereo;

use std::collections::BTreeMap;

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use crate::fibre::{Doubt, Ground, Settings, Side, measure};
use crate::scene::{Camera, Optics, Paint, Scene, Snake, random};

pub use speed::speed;
pub use stereo::{rigs, setup, stereo};

/// A reading whose angle is off by more than this is wrong, deg.
pub const WRONG_DEG: f64 = 1.0;
/// Largest bend in the experiments, deg.
pub const MAX_DEG: f64 = 45.0;
/// Largest bend away from the plane of the view in the experiments that bend both ways, deg.
pub const AWAY_DEG: f64 = 40.0;
/// Part by which the fibre may seem shorter or longer than at rest.
pub const LENGTH_TOLERANCE: f64 = 0.03;

/// What stays the same within one row of the table.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    /// Its name in the table.
    pub name: String,
    /// Shape of the snake.
    pub snake: Snake,
    /// Brightness.
    pub paint: Paint,
    /// Camera.
    pub camera: Camera,
    /// Blur, light and noise.
    pub optics: Optics,
}

/// One row of the table: readings against truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Name of the condition.
    pub name: String,
    /// Pictures.
    pub frames: usize,
    /// Pictures with a good reading.
    pub good: usize,
    /// Mean error of the angle, deg; the worst of five bands of the range.
    pub bias_deg: f64,
    /// Standard deviation of the error, deg.
    pub std_deg: f64,
    /// Largest error, deg.
    pub max_deg: f64,
    /// Standard deviation that the readings claim, root mean square, deg.
    pub claimed_deg: f64,
    /// Root mean square distance of the tip from the truth, micrometres.
    pub tip_um: f64,
}

/// What became of cluttered pictures.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cluttered {
    /// Pictures.
    pub frames: usize,
    /// Good readings.
    pub good: usize,
    /// Good readings that are off by more than [`WRONG_DEG`]: number of the picture, error in deg.
    pub wrong: Vec<(u64, f64)>,
    /// Largest error of a good reading, deg.
    pub max_deg: f64,
    /// Why the others are not good.
    pub doubts: BTreeMap<Doubt, usize>,
}

/// One picture's outcome.
struct Outcome {
    truth_deg: f64,
    error_deg: f64,
    claimed_deg: f64,
    tip_um: f64,
}

/// The conditions of the table: fibre and robot, dark and bright, light and strong blur and noise.
#[must_use]
pub fn conditions() -> Vec<Condition> {
    let camera = Camera::microscope(1280, 960, 200.0);
    let glint = Paint {
        glint: 90.0,
        ..Paint::dark()
    };
    let perspective = Camera {
        distance_mm: 60.0,
        tilt_rad: 0.03,
        ..camera
    };
    let of = |name: &str, snake, paint, camera, optics| Condition {
        name: name.into(),
        snake,
        paint,
        camera,
        optics,
    };
    vec![
        of(
            "fibre, dark, light blur and noise",
            Snake::fibre(0.125),
            Paint::dark(),
            camera,
            Optics::light(),
        ),
        of(
            "fibre, bright, light blur and noise",
            Snake::fibre(0.125),
            Paint::bright(),
            camera,
            Optics::light(),
        ),
        of(
            "fibre, glint, light blur and noise",
            Snake::fibre(0.125),
            glint,
            camera,
            Optics::light(),
        ),
        of(
            "fibre, tilted 1.7 deg, light blur and noise",
            Snake::fibre(0.125),
            Paint::dark(),
            perspective,
            Optics::light(),
        ),
        of(
            "robot, dark, light blur and noise",
            Snake::robot(),
            Paint::dark(),
            camera,
            Optics::light(),
        ),
        of(
            "robot, glint, light blur and noise",
            Snake::robot(),
            glint,
            camera,
            Optics::light(),
        ),
        of(
            "fibre, dark, strong blur and noise",
            Snake::fibre(0.125),
            Paint::dark(),
            camera,
            Optics::strong(),
        ),
        of(
            "fibre, bright, strong blur and noise",
            Snake::fibre(0.125),
            Paint::bright(),
            camera,
            Optics::strong(),
        ),
        of(
            "robot, dark, strong blur and noise",
            Snake::robot(),
            Paint::dark(),
            camera,
            Optics::strong(),
        ),
    ]
}

/// What the detector is told about scenes of a condition.
#[must_use]
pub fn settings(scene: &Scene) -> Settings {
    let k = scene.camera.px_per_mm;
    Settings {
        ground: if scene.paint.ground > scene.paint.fibre {
            Ground::Bright
        } else {
            Ground::Dark
        },
        side: Side::Left,
        near: None,
        body_width: k * scene.snake.body_width_mm,
        fibre_width: k * scene.snake.fibre_width_mm,
        base_length: 0.9 * 0.3 * scene.camera.width as f64,
        arc_length: k * scene.snake.arc_mm,
        tip_length: k * scene.snake.tip_mm,
    }
}

/// Measures `frames` clear pictures of a condition.
#[must_use]
pub fn clear(condition: &Condition, frames: u64, seed: u64) -> Row {
    let outcomes: Vec<Outcome> = (0..frames)
        .into_par_iter()
        .filter_map(|number| clear_picture(condition, seed, number))
        .collect();
    Row {
        frames: frames as usize,
        ..Row::of(&condition.name, &outcomes)
    }
}

impl Row {
    fn of(name: &str, outcomes: &[Outcome]) -> Self {
        let count = outcomes.len().max(1) as f64;
        let mean = |f: &dyn Fn(&Outcome) -> f64| outcomes.iter().map(f).sum::<f64>() / count;
        let error = mean(&|o| o.error_deg);
        Self {
            name: name.to_owned(),
            frames: outcomes.len(),
            good: outcomes.len(),
            bias_deg: worst_band(outcomes),
            std_deg: mean(&|o| (o.error_deg - error).powi(2)).sqrt(),
            max_deg: outcomes
                .iter()
                .map(|o| o.error_deg.abs())
                .fold(0.0, f64::max),
            claimed_deg: mean(&|o| o.claimed_deg.powi(2)).sqrt(),
            tip_um: mean(&|o| o.tip_um.powi(2)).sqrt(),
        }
    }
}

fn clear_picture(condition: &Condition, seed: u64, number: u64) -> Option<Outcome> {
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ number.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let Condition {
        camera,
        snake,
        paint,
        optics,
        ..
    } = condition.clone();
    let scene = random::clear(
        &mut random,
        camera,
        snake,
        paint,
        optics,
        [MAX_DEG.to_radians(), 0.0],
    );
    let reading = measure(&scene.render(&mut random), &settings(&scene))
        .ok()
        .filter(|r| r.is_good())?;
    let truth = scene.truth();
    let [dx, dy] = [
        reading.tip_px[0] - truth.tip_px[0],
        reading.tip_px[1] - truth.tip_px[1],
    ];
    Some(Outcome {
        truth_deg: truth.angle_rad.to_degrees(),
        error_deg: (reading.angle_rad - truth.angle_rad).to_degrees(),
        claimed_deg: reading.std_rad.to_degrees(),
        tip_um: dx.hypot(dy) / scene.camera.px_per_mm * 1000.0,
    })
}

/// The mean error of the worst fifth of the range.
fn worst_band(outcomes: &[Outcome]) -> f64 {
    let band = |o: &Outcome| ((o.truth_deg / MAX_DEG + 1.0) * 2.5).clamp(0.0, 4.0) as usize;
    let mut sums = [(0.0, 0.0); 5];
    for outcome in outcomes {
        let (sum, count) = &mut sums[band(outcome)];
        *sum += outcome.error_deg;
        *count += 1.0;
    }
    sums.iter()
        .filter(|(_, n)| *n > 0.0)
        .map(|(sum, n)| sum / n)
        .fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a })
}

/// The scene of one cluttered picture, for measuring and for looking at.
#[must_use]
pub fn cluttered_scene(seed: u64, number: u64) -> (Scene, Pcg64Mcg) {
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ number.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let camera = Camera::microscope(640, 480, 100.0);
    let (snake, paint) = match number % 4 {
        0 => (Snake::fibre(0.125), Paint::dark()),
        1 => (Snake::fibre(0.125), Paint::bright()),
        2 => (
            Snake::fibre(0.2),
            Paint {
                glint: 60.0,
                ..Paint::dark()
            },
        ),
        _ => (Snake::robot(), Paint::dark()),
    };
    let optics = if number.is_multiple_of(3) {
        Optics {
            blur_px: 1.8,
            noise: 8.0,
            ..Optics::light()
        }
    } else {
        Optics::light()
    };
    let scene = random::clear(
        &mut random,
        camera,
        snake,
        paint,
        optics,
        [MAX_DEG.to_radians(), 0.0],
    );
    let scene = random::clutter(&mut random, scene);
    (scene, random)
}

/// Measures `frames` cluttered pictures.
#[must_use]
pub fn cluttered(frames: u64, seed: u64) -> Cluttered {
    (0..frames)
        .into_par_iter()
        .map(|number| cluttered_picture(seed, number))
        .reduce(Cluttered::default, Cluttered::and)
}

fn cluttered_picture(seed: u64, number: u64) -> Cluttered {
    let (scene, mut random) = cluttered_scene(seed, number);
    let mut outcome = Cluttered {
        frames: 1,
        ..Cluttered::default()
    };
    let mut doubt = None;
    match measure(&scene.render(&mut random), &settings(&scene)) {
        Err(reason) => doubt = Some(reason),
        Ok(mut reading) => {
            let length = length_at_rest(&scene);
            reading.doubt_if(
                Doubt::Length,
                (reading.length_px / length - 1.0).abs(),
                LENGTH_TOLERANCE,
            );
            if reading.is_good() {
                let error = (reading.angle_rad - scene.truth().angle_rad).to_degrees();
                outcome.good = 1;
                outcome.max_deg = error.abs();
                outcome
                    .wrong
                    .extend((error.abs() > WRONG_DEG).then_some((number, error)));
            } else {
                doubt = reading.doubt;
            }
        }
    }
    outcome.doubts.extend(doubt.map(|doubt| (doubt, 1)));
    outcome
}

/// What the length of the fibre in the picture would be at rest.
fn length_at_rest(scene: &Scene) -> f64 {
    scene.camera.origin_px[0] / scene.camera.roll_rad.cos()
        + scene.camera.px_per_mm * (scene.snake.arc_mm + scene.snake.tip_mm)
}

impl Cluttered {
    fn and(mut self, other: Self) -> Self {
        self.frames += other.frames;
        self.good += other.good;
        self.wrong.extend(other.wrong);
        self.max_deg = self.max_deg.max(other.max_deg);
        for (doubt, count) in other.doubts {
            *self.doubts.entry(doubt).or_default() += count;
        }
        self
    }
}
