//! A scene, its image and its true values.

use rand::Rng;

use super::brightness::Brightness;
use super::camera::PinholeCamera;
use super::clutter::Clutter;
use super::optics::Optics;
use super::raster::Raster;
use super::snake_shape::{JointPose, SnakeShape};
use crate::image::GreyImage;

/// Everything that makes one image.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Shape of the snake.
    pub snake: SnakeShape,
    /// How it is bent.
    pub pose: JointPose,
    /// Where the camera is.
    pub camera: PinholeCamera,
    /// How bright things are.
    pub paint: Brightness,
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
    /// Tip in the image, px.
    pub tip_px: [f64; 2],
}

impl Scene {
    /// Draws it. The generator makes the noise: equal states, equal images.
    #[must_use]
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
            snake: SnakeShape::fibre(0.125),
            pose: JointPose { pitch_rad: 0.3, yaw_rad: 0.0 },
            camera: PinholeCamera::microscope(640, 480, 100.0),
            paint: Brightness::dark(),
            clutter: Vec::new(),
            optics: Optics::clean(),
        }
    }

    fn brightness(image: &GreyImage, [x, y]: [f64; 2]) -> f32 {
        image.sample(x, y).unwrap()
    }

    #[test]
    fn the_tip_is_painted_where_the_truth_says() {
        let scene = scene();
        let image = scene.render(&mut Pcg64Mcg::seed_from_u64(1));
        let Truth { tip_px: [x, y], angle_rad, .. } = scene.truth();
        let ahead =
            |distance: f64| [x + distance * angle_rad.cos(), y - distance * angle_rad.sin()];
        assert!(brightness(&image, ahead(-3.0)) < 80.0);
        assert!(brightness(&image, ahead(3.0)) > 180.0);
        assert!(
            (brightness(&image, ahead(0.0)) - 122.0).abs() < 25.0,
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
    fn equal_seeds_make_equal_images_and_noise_differs_from_frame_to_frame() {
        let mut scene = scene();
        scene.optics = Optics::light();
        let mut noise = Pcg64Mcg::seed_from_u64(7);
        let first = scene.render(&mut noise);
        assert_ne!(first, scene.render(&mut noise));
        assert_eq!(first, scene.render(&mut Pcg64Mcg::seed_from_u64(7)));
    }
}
