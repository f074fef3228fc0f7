//! Synthetic microscope pictures at known angles, for tests, for the accuracy table and for the
//! emulator.
//!
//! The pictures are made the way a camera makes them, not the way the detector takes them apart: a
//! curve in space is projected through a pinhole, painted with its shading and whatever lies in
//! front of it, blurred by the optics, lit unevenly, and sampled with noise. Nothing here is used
//! by the detector.
//!
//! Axes of space: `z` along the straight base towards the tip, `x` the way of positive pitch, `y`
//! the way of positive yaw, origin where the bending section begins. Lengths in millimetres.
//!
//! | file | holds |
//! |---|---|
//! | `snake` | the curve in space: straight base, arc, straight tip |
//! | `camera` | where the camera stands; projection to pixels |
//! | `canvas` | painting of rods and blobs with soft edges |
//! | `clutter` | what lies in front: instruments, specks, hairs |
//! | `optics` | blur, uneven light, noise |
//! | `rig` | the cameras around one snake |
//! | `random` | scenes drawn by chance from a seed |

mod camera;
mod canvas;
mod clutter;
mod optics;
pub mod random;
mod rig;
mod snake;

use rand::Rng;

use crate::image::Grey;

pub use camera::Camera;
pub use clutter::{Clutter, cover};
pub use optics::Optics;
pub use rig::Rig;
pub use snake::{Pose, Snake};

/// Brightness of everything, in grey levels before uneven light: 0 black, 255 white.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Paint {
    /// The ground behind.
    pub ground: f32,
    /// The snake's body, in the middle of it.
    pub body: f32,
    /// The fibre at its tip.
    pub fibre: f32,
    /// How much darker (or, negative, brighter) the rims of body and fibre are than their middle:
    /// round things shade.
    pub rim: f32,
    /// Brightness that a glint along the body adds. 0: none.
    pub glint: f32,
}

impl Paint {
    /// A dark fibre on bright ground, lit from behind.
    #[must_use]
    pub const fn dark() -> Self {
        Self {
            ground: 190.0,
            body: 55.0,
            fibre: 55.0,
            rim: 12.0,
            glint: 0.0,
        }
    }

    /// A bright fibre on dark ground, lit from the side.
    #[must_use]
    pub const fn bright() -> Self {
        Self {
            ground: 40.0,
            body: 185.0,
            fibre: 185.0,
            rim: 15.0,
            glint: 0.0,
        }
    }
}

/// Everything that makes one picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Shape of the snake.
    pub snake: Snake,
    /// How it is bent.
    pub pose: Pose,
    /// Where the camera stands.
    pub camera: Camera,
    /// How bright things are.
    pub paint: Paint,
    /// What lies in front of it, the nearest last.
    pub clutter: Vec<Clutter>,
    /// Blur, light and noise.
    pub optics: Optics,
}

/// What a perfect measurement of a scene would say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// Bending angle in the plane of the view, rad; positive towards the camera's positive side.
    pub angle_rad: f64,
    /// Tip in the plane of the view: along the base, and across it, from where the bending section
    /// begins, mm.
    pub tip_mm: [f64; 2],
    /// Tip in the picture, px.
    pub tip_px: [f64; 2],
}

impl Scene {
    /// Draws it. The generator makes the noise: equal states, equal pictures.
    #[must_use]
    pub fn render(&self, noise: &mut impl Rng) -> Grey {
        let mut canvas =
            canvas::Canvas::new(self.camera.width, self.camera.height, self.paint.ground);
        for rod in self.snake.rods(&self.pose, &self.camera, &self.paint) {
            canvas.rod(&rod);
        }
        for thing in &self.clutter {
            thing.paint(&mut canvas);
        }
        self.optics.expose(canvas, noise)
    }

    /// What a perfect measurement would say.
    #[must_use]
    pub fn truth(&self) -> Truth {
        let tip = self.snake.tip(&self.pose);
        let (along, across, _) = self.camera.in_view(tip);
        Truth {
            angle_rad: self.pose.view_angle_rad(self.camera.plane_rad),
            tip_mm: [along, across],
            tip_px: self.camera.project(tip).0,
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    use super::*;

    fn scene() -> Scene {
        Scene {
            snake: Snake::fibre(0.125),
            pose: Pose {
                pitch_rad: 0.3,
                yaw_rad: 0.0,
            },
            camera: Camera::microscope(640, 480, 100.0),
            paint: Paint::dark(),
            clutter: Vec::new(),
            optics: Optics::clean(),
        }
    }

    fn brightness(picture: &Grey, [x, y]: [f64; 2]) -> f32 {
        picture.sample(x, y).unwrap()
    }

    #[test]
    fn the_tip_is_painted_where_the_truth_says() {
        let scene = scene();
        let picture = scene.render(&mut Pcg64Mcg::seed_from_u64(1));
        let Truth {
            tip_px: [x, y],
            angle_rad,
            ..
        } = scene.truth();
        let ahead = |distance: f64| {
            [
                x + distance * angle_rad.cos(),
                y - distance * angle_rad.sin(),
            ]
        };
        assert!(brightness(&picture, ahead(-3.0)) < 80.0);
        assert!(brightness(&picture, ahead(3.0)) > 180.0);
        assert!(
            (brightness(&picture, ahead(0.0)) - 122.0).abs() < 25.0,
            "half covered at the very end"
        );
    }

    #[test]
    fn a_positive_angle_bends_upwards_and_in_the_view_of_its_own_axis_only() {
        let mut scene = scene();
        let straight_y = scene.camera.project([0.0, 0.0, 0.0]).0[1];
        assert!(scene.truth().tip_px[1] < straight_y - 30.0);
        scene.camera.plane_rad = std::f64::consts::FRAC_PI_2;
        assert!(scene.truth().angle_rad.abs() < 1e-12);
        assert!((scene.truth().tip_px[1] - straight_y).abs() < 1.0);
    }

    #[test]
    fn equal_seeds_make_equal_pictures_and_noise_differs_from_frame_to_frame() {
        let mut scene = scene();
        scene.optics = Optics::light();
        let mut noise = Pcg64Mcg::seed_from_u64(7);
        let first = scene.render(&mut noise);
        assert_ne!(first, scene.render(&mut noise));
        assert_eq!(first, scene.render(&mut Pcg64Mcg::seed_from_u64(7)));
    }
}
