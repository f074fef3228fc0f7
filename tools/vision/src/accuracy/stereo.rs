//! Both views together: joint angles and tip over the whole plane of pitch and yaw.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

use super::table::{AccuracyRow, ErrorSample};
use crate::fibre::{Background, EntrySide, Reading, measure};
use crate::joint_angles::Stereo;
use crate::rest_pose::{RestPose, RestPoseError, RestPoseEstimator};
use crate::scene::{Brightness, JointPose, Optics, Rig};
use crate::setup::{JointAxis, View, VisionSetup};

/// Largest bend away from the plane of the view in the experiments that bend both ways, deg.
pub const AWAY_DEG: f64 = 40.0;
/// Images of the straight pose.
const REST_FRAMES: u64 = 8;

/// Rigs with their names: light and strong blur and noise, dark and bright, cameras turned and out
/// of square.
#[must_use]
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
#[must_use]
pub fn setup(rig: &Rig) -> VisionSetup {
    let view = |(number, camera): (usize, &crate::scene::PinholeCamera)| {
        let mut view = View {
            name: format!("view{number}"),
            axis: JointAxis::Pitch,
            reversed: false,
            turn_deg: 0.0,
            px_per_mm: camera.px_per_mm,
            distance_mm: Some(camera.distance_mm),
            ground: if rig.paint.ground > rig.paint.fibre {
                Background::Bright
            } else {
                Background::Dark
            },
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
///
/// # Errors
///
/// When the straight pose cannot be measured.
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
    let mut random = Pcg64Mcg::seed_from_u64(seed ^ number.wrapping_mul(0x9E37_79B9_7F4A_7C15));
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
