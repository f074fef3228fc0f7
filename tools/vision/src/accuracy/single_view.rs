//! Accuracy with one view: clear images, and cluttered images.

use std::collections::BTreeMap;

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use super::table::{AccuracyRow, ErrorSample, MAX_DEG};
use crate::fibre::{Background, DetectorSettings, EntrySide, QualityIssue, measure};
use crate::scene::{Brightness, Optics, PinholeCamera, Scene, SnakeShape, random};

/// A reading whose angle is off by more than this is wrong, deg.
pub const WRONG_DEG: f64 = 1.0;
/// Part by which the fibre may seem shorter or longer than at rest.
pub const LENGTH_TOLERANCE: f64 = 0.03;

/// What stays the same within one row of the table.
#[derive(Debug, Clone, PartialEq)]
pub struct TestCondition {
    /// Its name in the table.
    pub name: String,
    /// Shape of the snake.
    pub snake: SnakeShape,
    /// Brightness.
    pub paint: Brightness,
    /// Camera.
    pub camera: PinholeCamera,
    /// Blur, light and noise.
    pub optics: Optics,
}

/// What became of cluttered images.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ClutteredOutcome {
    /// Images.
    pub frames: usize,
    /// Good readings.
    pub good: usize,
    /// Good readings that are off by more than [`WRONG_DEG`]: number of the image, error in deg.
    pub wrong: Vec<(u64, f64)>,
    /// Largest error of a good reading, deg.
    pub max_deg: f64,
    /// Why the others are not good.
    pub issues: BTreeMap<QualityIssue, usize>,
}

/// The conditions of the table: fibre and robot, dark and bright, light and strong blur and noise.
#[must_use]
pub fn conditions() -> Vec<TestCondition> {
    let camera = PinholeCamera::microscope(1280, 960, 200.0);
    let (fibre, robot) = (SnakeShape::fibre(0.125), SnakeShape::robot());
    let (dark, bright) = (Brightness::dark(), Brightness::bright());
    let glint = dark.with_glint(90.0);
    let tilted = PinholeCamera { distance_mm: 60.0, tilt_rad: 0.03, ..camera };
    let cases = [
        ("fibre, dark, light", fibre, dark, camera),
        ("fibre, bright, light", fibre, bright, camera),
        ("fibre, glint, light", fibre, glint, camera),
        ("fibre, tilted 1.7 deg, light", fibre, dark, tilted),
        ("robot, dark, light", robot, dark, camera),
        ("robot, glint, light", robot, glint, camera),
        ("fibre, dark, strong", fibre, dark, camera),
        ("fibre, bright, strong", fibre, bright, camera),
        ("robot, dark, strong", robot, dark, camera),
    ];
    let condition = |(name, snake, paint, camera): (&str, _, _, _)| TestCondition {
        name: format!("{name} blur and noise"),
        snake,
        paint,
        camera,
        optics: if name.ends_with("strong") { Optics::strong() } else { Optics::light() },
    };
    cases.map(condition).into()
}

/// Parameters of the detector for a scene.
#[must_use]
pub fn settings(scene: &Scene) -> DetectorSettings {
    let k = scene.camera.px_per_mm;
    DetectorSettings {
        ground: if scene.paint.ground > scene.paint.fibre {
            Background::Bright
        } else {
            Background::Dark
        },
        side: EntrySide::Left,
        near: None,
        body_width: k * scene.snake.body_width_mm,
        fibre_width: k * scene.snake.fibre_width_mm,
        base_length: 0.9 * 0.3 * scene.camera.width as f64,
        arc_length: k * scene.snake.arc_mm,
        tip_length: k * scene.snake.tip_mm,
    }
}

/// Measures `frames` clear images of a condition.
#[must_use]
pub fn clear(condition: &TestCondition, frames: u64, seed: u64) -> AccuracyRow {
    let outcomes: Vec<ErrorSample> = (0..frames)
        .into_par_iter()
        .filter_map(|number| clear_image(condition, seed, number))
        .collect();
    AccuracyRow { frames: frames as usize, ..AccuracyRow::of(&condition.name, &outcomes) }
}

fn clear_image(condition: &TestCondition, seed: u64, number: u64) -> Option<ErrorSample> {
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ number.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let TestCondition { camera, snake, paint, optics, .. } = condition.clone();
    let scene =
        random::clear(&mut random, camera, snake, paint, optics, [MAX_DEG.to_radians(), 0.0]);
    let reading =
        measure(&scene.render(&mut random), &settings(&scene)).ok().filter(|r| r.is_good())?;
    let truth = scene.truth();
    let [dx, dy] = [reading.tip_px[0] - truth.tip_px[0], reading.tip_px[1] - truth.tip_px[1]];
    Some(ErrorSample {
        truth_deg: truth.angle_rad.to_degrees(),
        error_deg: (reading.angle_rad - truth.angle_rad).to_degrees(),
        claimed_deg: reading.std_rad.to_degrees(),
        tip_um: dx.hypot(dy) / scene.camera.px_per_mm * 1000.0,
    })
}

/// The scene of one cluttered image, for measuring and for looking at.
#[must_use]
pub fn cluttered_scene(seed: u64, number: u64) -> (Scene, Pcg64Mcg) {
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ number.wrapping_mul(0x9E37_79B9_7F4A_7C15));
    let camera = PinholeCamera::microscope(640, 480, 100.0);
    let (snake, paint) = match number % 4 {
        0 => (SnakeShape::fibre(0.125), Brightness::dark()),
        1 => (SnakeShape::fibre(0.125), Brightness::bright()),
        2 => (SnakeShape::fibre(0.2), Brightness { glint: 60.0, ..Brightness::dark() }),
        _ => (SnakeShape::robot(), Brightness::dark()),
    };
    let optics = if number.is_multiple_of(3) {
        Optics { blur_px: 1.8, noise: 8.0, ..Optics::light() }
    } else {
        Optics::light()
    };
    let scene =
        random::clear(&mut random, camera, snake, paint, optics, [MAX_DEG.to_radians(), 0.0]);
    let scene = random::clutter(&mut random, scene);
    (scene, random)
}

/// Measures `frames` cluttered images.
#[must_use]
pub fn cluttered(frames: u64, seed: u64) -> ClutteredOutcome {
    (0..frames)
        .into_par_iter()
        .map(|number| cluttered_image(seed, number))
        .reduce(ClutteredOutcome::default, ClutteredOutcome::and)
}

fn cluttered_image(seed: u64, number: u64) -> ClutteredOutcome {
    let (scene, mut random) = cluttered_scene(seed, number);
    let mut outcome = ClutteredOutcome { frames: 1, ..ClutteredOutcome::default() };
    let mut issue = None;
    match measure(&scene.render(&mut random), &settings(&scene)) {
        Err(reason) => issue = Some(reason),
        Ok(mut reading) => {
            let length = length_at_rest(&scene);
            reading.limit_quality(
                QualityIssue::Length,
                (reading.length_px / length - 1.0).abs(),
                LENGTH_TOLERANCE,
            );
            if reading.is_good() {
                let error = (reading.angle_rad - scene.truth().angle_rad).to_degrees();
                outcome.good = 1;
                outcome.max_deg = error.abs();
                outcome.wrong.extend((error.abs() > WRONG_DEG).then_some((number, error)));
            } else {
                issue = reading.issue;
            }
        }
    }
    outcome.issues.extend(issue.map(|issue| (issue, 1)));
    outcome
}

/// What the length of the fibre in the image would be at rest.
fn length_at_rest(scene: &Scene) -> f64 {
    scene.camera.origin_px[0] / scene.camera.roll_rad.cos()
        + scene.camera.px_per_mm * (scene.snake.arc_mm + scene.snake.tip_mm)
}

impl ClutteredOutcome {
    fn and(mut self, other: Self) -> Self {
        self.frames += other.frames;
        self.good += other.good;
        self.wrong.extend(other.wrong);
        self.max_deg = self.max_deg.max(other.max_deg);
        for (issue, count) in other.issues {
            *self.issues.entry(issue).or_default() += count;
        }
        self
    }
}
