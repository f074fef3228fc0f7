//! The laboratory's microscopes around one snake.

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use super::{Camera, Optics, Paint, Pose, Scene, Snake};
use crate::image::Grey;

/// A snake and the cameras that look at it at the same instant.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    /// Shape of the snake.
    pub snake: Snake,
    /// How bright things are.
    pub paint: Paint,
    /// Blur, light and noise of every camera.
    pub optics: Optics,
    /// The cameras.
    pub cameras: Vec<Camera>,
    /// Determines the noise.
    pub seed: u64,
}

impl Rig {
    /// Two microscopes at right angles, one for pitch and one for yaw, in front of the robot with a
    /// fibre sticking out.
    #[must_use]
    pub fn laboratory(width: usize, height: usize, px_per_mm: f64) -> Self {
        let pitch = Camera::microscope(width, height, px_per_mm);
        let yaw = Camera {
            plane_rad: std::f64::consts::FRAC_PI_2,
            ..pitch
        };
        Self {
            snake: Snake::robot(),
            paint: Paint::dark(),
            optics: Optics::light(),
            cameras: vec![pitch, yaw],
            seed: 1,
        }
    }

    /// What a camera sees of a pose, as a scene.
    #[must_use]
    pub fn scene(&self, camera: &Camera, pose: Pose) -> Scene {
        let Self {
            snake,
            paint,
            optics,
            ..
        } = *self;
        Scene {
            snake,
            pose,
            camera: *camera,
            paint,
            clutter: Vec::new(),
            optics,
        }
    }

    /// One picture per camera. Equal seeds and numbers make equal noise; the noise of cameras and
    /// numbers differs.
    #[must_use]
    pub fn shoot(&self, pose: Pose, number: u64) -> Vec<Grey> {
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
    fn pictures_of_one_instant_and_of_one_pose_all_differ_in_noise() {
        let rig = Rig::laboratory(160, 120, 25.0);
        let (first, again, next) = (
            rig.shoot(Pose::default(), 1),
            rig.shoot(Pose::default(), 1),
            rig.shoot(Pose::default(), 2),
        );
        assert_eq!(first, again);
        assert!(first[0] != first[1] && first[0] != next[0] && first[1] != next[1]);
    }
}
