//! The laboratory's microscopes around one snake.

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use super::brightness::Brightness;
use super::camera::PinholeCamera;
use super::optics::Optics;
use super::snake_shape::{JointPose, SnakeShape};
use super::synthetic_scene::Scene;
use crate::image::GreyImage;

/// A snake and the cameras that look at it at the same instant.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    /// Shape of the snake.
    pub snake: SnakeShape,
    /// How bright things are.
    pub paint: Brightness,
    /// Blur, light and noise of every camera.
    pub optics: Optics,
    /// The cameras.
    pub cameras: Vec<PinholeCamera>,
    /// Determines the noise.
    pub seed: u64,
}

impl Rig {
    /// Two microscopes at right angles, one for pitch and one for yaw, in front of the robot with a
    /// fibre sticking out.
    #[must_use]
    pub fn laboratory(width: usize, height: usize, px_per_mm: f64) -> Self {
        let pitch = PinholeCamera::microscope(width, height, px_per_mm);
        let yaw = PinholeCamera { plane_rad: std::f64::consts::FRAC_PI_2, ..pitch };
        Self {
            snake: SnakeShape::robot(),
            paint: Brightness::dark(),
            optics: Optics::light(),
            cameras: vec![pitch, yaw],
            seed: 1,
        }
    }

    /// What a camera sees of a pose, as a scene.
    #[must_use]
    pub fn scene(&self, camera: &PinholeCamera, pose: JointPose) -> Scene {
        let Self { snake, paint, optics, .. } = *self;
        Scene { snake, pose, camera: *camera, paint, clutter: Vec::new(), optics }
    }

    /// One image per camera. Equal seeds and numbers make equal noise; the noise of cameras and
    /// numbers differs.
    #[must_use]
    pub fn render_views(&self, pose: JointPose, number: u64) -> Vec<GreyImage> {
        let noise = |view: usize| {
            let stream = number.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (view as u64) << 56;
            Pcg64Mcg::seed_from_u64(self.seed.wrapping_add(stream))
        };
        self.cameras
            .iter()
            .enumerate()
            .map(|(view, camera)| self.scene(camera, pose).render(&mut noise(view)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_of_one_instant_and_of_one_pose_all_differ_in_noise() {
        let rig = Rig::laboratory(160, 120, 25.0);
        let (first, again, next) = (
            rig.render_views(JointPose::default(), 1),
            rig.render_views(JointPose::default(), 1),
            rig.render_views(JointPose::default(), 2),
        );
        assert_eq!(first, again);
        assert!(first[0] != first[1] && first[0] != next[0] && first[1] != next[1]);
    }
}
