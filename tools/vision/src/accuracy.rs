//! Accuracy of readings, measured on synthetic scenes: errors, and confident wrong values.
//!
//! The experiment is repeatable: the same seed gives the same table.

use std::collections::BTreeMap;

use i2ris::clock;
use i2ris::units::Nanos;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use crate::fibre::{Background, DetectorSettings, EntrySide, QualityIssue, Reading, measure};
use crate::joint_angles::Stereo;
use crate::rest_pose::{RestPose, RestPoseError, RestPoseEstimator};
use crate::scene::{Brightness, JointPose, Optics, PinholeCamera, Rig, Scene, SnakeShape, random};
use crate::setup::{JointAxis, View, VisionSetup};
use crate::source::{FrameClock, FrameSource, FrameStream, SourceError};
use crate::view_detector::ViewDetector;

/// Largest bend in the experiments, deg.
pub const MAX_DEG: f64 = 45.0;

/// One row of the table: readings against truth.
#[derive(Debug, Clone, PartialEq)]
pub struct AccuracyRow {
    pub name: String,
    pub frames: usize,
    pub good: usize,
    /// Mean error of the angle, deg; the worst of five bands of the range.
    pub bias_deg: f64,
    /// Standard deviation of the error, deg.
    pub std_deg: f64,
    pub max_deg: f64,
    /// Standard deviation that the readings claim, root mean square, deg.
    pub claimed_deg: f64,
    /// Root mean square distance of the tip from the truth, micrometres.
    pub tip_um: f64,
}

struct ErrorSample {
    pub truth_deg: f64,
    pub error_deg: f64,
    pub claimed_deg: f64,
    pub tip_um: f64,
}

impl AccuracyRow {
    fn of(name: &str, outcomes: &[ErrorSample]) -> Self {
        let count = outcomes.len().max(1) as f64;
        let mean = |f: &dyn Fn(&ErrorSample) -> f64| outcomes.iter().map(f).sum::<f64>() / count;
        let error = mean(&|o| o.error_deg);
        Self {
            name: name.to_owned(),
            frames: outcomes.len(),
            good: outcomes.len(),
            bias_deg: worst_band(outcomes),
            std_deg: mean(&|o| (o.error_deg - error).powi(2)).sqrt(),
            max_deg: outcomes.iter().map(|o| o.error_deg.abs()).fold(0.0, f64::max),
            claimed_deg: mean(&|o| o.claimed_deg.powi(2)).sqrt(),
            tip_um: mean(&|o| o.tip_um.powi(2)).sqrt(),
        }
    }
}

/// The mean error of the worst fifth of the range.
fn worst_band(outcomes: &[ErrorSample]) -> f64 {
    let band = |o: &ErrorSample| ((o.truth_deg / MAX_DEG + 1.0) * 2.5).clamp(0.0, 4.0) as usize;
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

/// A reading whose angle is off by more than this is wrong, deg.
pub const WRONG_DEG: f64 = 1.0;
/// Part by which the fibre may seem shorter or longer than at rest.
pub const LENGTH_TOLERANCE: f64 = 0.03;

/// What stays the same within one row of the table.
#[derive(Debug, Clone, PartialEq)]
pub struct TestCondition {
    pub name: String,
    pub snake: SnakeShape,
    pub paint: Brightness,
    pub camera: PinholeCamera,
    pub optics: Optics,
}

/// What became of cluttered images.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ClutteredOutcome {
    pub frames: usize,
    pub good: usize,
    /// Good readings that are off by more than [`WRONG_DEG`]: number of the image, error in deg.
    pub wrong: Vec<(u64, f64)>,
    pub max_deg: f64,
    pub issues: BTreeMap<QualityIssue, usize>,
}

/// The conditions of the table: fibre and robot, dark and bright, light and strong blur and noise.
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

fn ground(paint: &Brightness) -> Background {
    if paint.ground > paint.fibre { Background::Bright } else { Background::Dark }
}

/// The generator of an image.
fn random_of(seed: u64, number: u64) -> Pcg64Mcg {
    Pcg64Mcg::seed_from_u64(seed ^ number.wrapping_mul(0x9E37_79B9_7F4A_7C15))
}

/// Parameters of the detector for a scene.
pub fn settings(scene: &Scene) -> DetectorSettings {
    let k = scene.camera.px_per_mm;
    DetectorSettings {
        ground: ground(&scene.paint),
        side: EntrySide::Left,
        near: None,
        body_width: k * scene.snake.body_width_mm,
        fibre_width: k * scene.snake.fibre_width_mm,
        base_length: 0.9 * 0.3 * scene.camera.width as f64,
        arc_length: k * scene.snake.arc_mm,
        tip_length: k * scene.snake.tip_mm,
    }
}

pub fn clear(condition: &TestCondition, frames: u64, seed: u64) -> AccuracyRow {
    let outcomes: Vec<ErrorSample> = (0..frames)
        .into_par_iter()
        .filter_map(|number| clear_image(condition, seed, number))
        .collect();
    AccuracyRow { frames: frames as usize, ..AccuracyRow::of(&condition.name, &outcomes) }
}

fn clear_image(condition: &TestCondition, seed: u64, number: u64) -> Option<ErrorSample> {
    let mut random = random_of(seed, number);
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
pub fn cluttered_scene(seed: u64, number: u64) -> (Scene, Pcg64Mcg) {
    let mut random = random_of(seed, number);
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

/// Largest bend away from the plane of the view in the experiments that bend both ways, deg.
pub const AWAY_DEG: f64 = 40.0;
const REST_FRAMES: u64 = 8;

/// Rigs with their names: light and strong blur and noise, dark and bright, cameras turned and out
/// of square.
pub fn rigs() -> Vec<(String, Rig)> {
    let light = Rig::laboratory(1280, 960, 200.0);
    let strong = Rig { optics: Optics::strong(), ..light.clone() };
    let bright = Rig { paint: Brightness::bright(), ..light.clone() };
    let mut turned = light.clone();
    turned.cameras[0].plane_rad = 0.2;
    turned.cameras[1].plane_rad -= 0.15;
    turned.cameras[1].roll_rad = 0.04;
    [
        ("light", light),
        ("bright, light", bright),
        ("cameras turned, light", turned),
        ("strong", strong),
    ]
    .into_iter()
    .map(|(name, rig)| (format!("robot, both axes, two views, {name} blur and noise"), rig))
    .collect()
}

/// What a person who built the rig would write into its setup.
pub fn setup(rig: &Rig) -> VisionSetup {
    let view = |(number, camera): (usize, &PinholeCamera)| {
        let mut view = View {
            name: format!("view{number}"),
            axis: JointAxis::Pitch,
            reversed: false,
            turn_deg: 0.0,
            px_per_mm: camera.px_per_mm,
            distance_mm: Some(camera.distance_mm),
            ground: ground(&rig.paint),
            side: EntrySide::Left,
            near_px: None,
            body_width_mm: rig.snake.body_width_mm,
            fibre_width_mm: rig.snake.fibre_width_mm,
            base_length_mm: 0.9 * camera.origin_px[0] / camera.px_per_mm,
            arc_length_mm: rig.snake.arc_mm,
            tip_length_mm: rig.snake.tip_mm,
            rest: None,
        };
        view.set_plane(camera.plane_rad);
        view
    };
    VisionSetup { pair_within_ms: 12.0, views: rig.cameras.iter().enumerate().map(view).collect() }
}

/// Measures `frames` poses of a rig after a few at rest. Every pose counts twice, once per axis.
pub fn stereo(name: &str, rig: &Rig, frames: u64, seed: u64) -> Result<AccuracyRow, RestPoseError> {
    let setup = setup(rig);
    let rests = rests(rig, &setup)?;
    let stereo = Stereo::new(&setup, &rests);
    let outcomes: Vec<ErrorSample> = (0..frames)
        .into_par_iter()
        .filter_map(|number| pose(rig, &setup, &stereo, seed, number))
        .flatten()
        .collect();
    Ok(AccuracyRow {
        frames: frames as usize,
        good: outcomes.len() / 2,
        ..AccuracyRow::of(name, &outcomes)
    })
}

fn rests(rig: &Rig, setup: &VisionSetup) -> Result<Vec<RestPose>, RestPoseError> {
    let mut estimator = vec![RestPoseEstimator::default(); setup.views.len()];
    for number in 0..REST_FRAMES {
        for (reading, estimator) in
            readings(rig, setup, JointPose::default(), u64::MAX - number).iter().zip(&mut estimator)
        {
            estimator.add(reading.as_ref());
        }
    }
    estimator
        .iter()
        .zip(&setup.views)
        .map(|(estimator, view)| estimator.finish(&view.name))
        .collect()
}

fn readings(rig: &Rig, setup: &VisionSetup, pose: JointPose, number: u64) -> Vec<Option<Reading>> {
    let images = rig.render_views(pose, number);
    images
        .iter()
        .zip(&setup.views)
        .map(|(image, view)| measure(image, &view.settings()).ok())
        .collect()
}

fn pose(
    rig: &Rig,
    setup: &VisionSetup,
    stereo: &Stereo,
    seed: u64,
    number: u64,
) -> Option<[ErrorSample; 2]> {
    let mut random = random_of(seed, number);
    let most = AWAY_DEG.to_radians();
    let pose = JointPose {
        pitch_rad: random.random_range(-most..=most),
        yaw_rad: random.random_range(-most..=most),
    };
    let readings: Option<Vec<Reading>> = readings(rig, setup, pose, number)
        .into_iter()
        .map(|r| r.filter(Reading::is_good))
        .collect();
    let readings = readings?;
    let sized: Vec<_> = readings
        .iter()
        .zip(&rig.cameras)
        .map(|(reading, camera)| (reading, [camera.width, camera.height]))
        .collect();
    let angles = stereo.solve(&sized).ok()?;
    let [tip, rest] = [pose, JointPose::default()].map(|pose| rig.snake.tip(&pose));
    let truth = [tip[2] - rest[2], tip[0], tip[1]];
    let off = angles
        .tip_mm
        .iter()
        .zip(truth)
        .map(|(seen, truth)| (seen.unwrap_or(f64::NAN) - truth).powi(2));
    let tip_um = off.sum::<f64>().sqrt() * 1000.0;
    let outcome = |axis: usize, truth: f64| {
        Some(ErrorSample {
            truth_deg: truth.to_degrees(),
            error_deg: (angles.angle_rad[axis]? - truth).to_degrees(),
            claimed_deg: angles.std_rad[axis]?.to_degrees(),
            tip_um,
        })
    };
    Some([outcome(0, pose.pitch_rad)?, outcome(1, pose.yaw_rad)?])
}

/// Poses of the experiment: enough to be typical, few enough to keep their frames in memory.
const POSES: u64 = 32;
/// Times that the frames are measured; the median counts, for other programs take the processor
/// now and then.
const ROUNDS: usize = 5;

/// Frames of 1280x960 that one view measures per second in one thread: the stream is read, every
/// frame is checked against the one before, and measured.
pub fn speed(seed: u64) -> Result<f64, SourceError> {
    let rig = Rig { seed, ..Rig::laboratory(1280, 960, 200.0) };
    let settings = setup(&rig).views.first().map(View::settings);
    let Some(settings) = settings else {
        return Ok(f64::NAN);
    };
    let stream = stream(&rig);
    let mut rates = Vec::new();
    for _ in 0..ROUNDS {
        let mut source = FrameStream::y4m(stream.as_slice(), FrameClock::Rate(30.0))?;
        let mut detector = ViewDetector::new(settings.clone());
        let (start, mut measured) = (clock::now(), 0);
        while let Some(item) = source.next()? {
            measured += u64::from(detector.detect(item).good().is_ok());
        }
        let Nanos(elapsed) = clock::now().since(start);
        rates.push(measured as f64 / (elapsed.max(1) as f64 * 1e-9));
    }
    rates.sort_by(f64::total_cmp);
    Ok(rates[ROUNDS / 2])
}

/// A stream of the first view over the plane of angles.
fn stream(rig: &Rig) -> Vec<u8> {
    let mut bytes = Vec::new();
    for number in 0..POSES {
        let turn = number as f64 * 2.4;
        let bend = 0.7 * ((number as f64 + 0.5) / POSES as f64).sqrt();
        let pose = JointPose { pitch_rad: bend * turn.cos(), yaw_rad: bend * turn.sin() };
        let Some(image) = rig.render_views(pose, number).into_iter().next() else {
            continue;
        };
        if bytes.is_empty() {
            bytes.extend(
                format!("YUV4MPEG2 W{} H{} F30:1 Cmono\n", image.width(), image.height()).bytes(),
            );
        }
        bytes.extend(b"FRAME\n");
        bytes.extend(image.data());
    }
    bytes
}
