//! Synthetic microscope images at known angles, for tests and for the emulator.
//!
//! The images are made like those of a camera: a curve in space is projected through a pinhole,
//! painted with its shading and the clutter in front of it, blurred by the optics, lit unevenly,
//! and sampled with noise. The detector uses nothing of this module.
//!
//! Axes of space: `z` along the straight base towards the tip, `x` in the direction of positive
//! pitch, `y` in the direction of positive yaw, origin at the start of the bending section. Lengths
//! in millimetres.
//!
//! This file has a scene with its image and its true values, and the cameras around one snake.
//!
//! | file | content |
//! |---|---|
//! | `snake_shape` | the curve in space: straight base, arc, straight tip |
//! | `camera` | position of the camera; projection to pixels |
//! | `raster` | anti-aliased rods and ellipses; instruments and specks in front |
//! | `optics` | grey levels, blur, uneven light, noise |

mod camera;
mod optics;
mod raster;
mod snake_shape;

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::image::GreyImage;
use raster::Raster;

pub use camera::PinholeCamera;
pub use optics::{Brightness, Optics};
pub use raster::{Clutter, cover};
pub use snake_shape::{JointPose, SnakeShape};

#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    pub snake: SnakeShape,
    pub pose: JointPose,
    pub camera: PinholeCamera,
    pub paint: Brightness,
    /// Objects in front of the snake, the nearest last.
    pub clutter: Vec<Clutter>,
    pub optics: Optics,
}

/// Result of a perfect measurement of a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// Bending angle in the plane of the view, rad; positive towards the camera's positive side.
    pub angle_rad: f64,
    pub tip_px: [f64; 2],
}

impl Scene {
    /// Draws it. The generator makes the noise: equal states, equal images.
    pub fn render(&self, noise: &mut impl Rng) -> GreyImage {
        let mut canvas = Raster::new(self.camera.width, self.camera.height, self.paint.ground);
        for rod in self.snake.rods(&self.pose, &self.camera, &self.paint) {
            canvas.rod(&rod);
        }
        for thing in &self.clutter {
            thing.paint(&mut canvas);
        }
        self.optics.expose(canvas, noise)
    }

    pub fn truth(&self) -> Truth {
        let tip = self.snake.tip(&self.pose);
        Truth {
            angle_rad: self.pose.view_angle_rad(self.camera.plane_rad),
            tip_px: self.camera.project(tip).0,
        }
    }
}

/// A snake and the cameras that look at it at the same instant.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    pub snake: SnakeShape,
    pub paint: Brightness,
    /// Blur, light and noise of every camera.
    pub optics: Optics,
    pub cameras: Vec<PinholeCamera>,
    /// Determines the noise.
    pub seed: u64,
}

impl Rig {
    /// Two microscopes at right angles, one for pitch and one for yaw, in front of the robot with a
    /// fibre sticking out.
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

    pub fn scene(&self, camera: &PinholeCamera, pose: JointPose) -> Scene {
        let Self { snake, paint, optics, .. } = *self;
        Scene { snake, pose, camera: *camera, paint, clutter: Vec::new(), optics }
    }

    /// One image per camera. Equal seeds and numbers make equal noise; the noise of cameras and
    /// numbers differs.
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
    fn images_of_one_instant_or_pose_differ_in_noise() {
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
