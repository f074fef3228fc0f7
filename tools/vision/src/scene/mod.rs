//! Synthetic microscope images at known angles, for tests and for the emulator.
//!
//! The images are made like those of a camera: a curve in space is projected through a pinhole,
//! painted with its shading and the clutter in front of it, blurred by the optics, lit unevenly,
//! and sampled with noise. The detector uses nothing of this module.
//!
//! Axes of space: `z` along the straight base towards the tip, `x` towards positive pitch, `y`
//! towards positive yaw, origin at the start of the bending section. Lengths in mm.

mod raster;

use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::image::GreyImage;
use raster::{Raster, Rod};

pub use raster::{Brightness, Clutter, Optics, cover};

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

    /// The bending angle in the plane of the view, rad; positive to the camera's positive side.
    pub fn angle_rad(&self) -> f64 {
        self.pose.view_angle_rad(self.camera.plane_rad)
    }

    pub fn tip_px(&self) -> [f64; 2] {
        self.camera.project(self.snake.tip(&self.pose)).0
    }
}

/// A snake and the cameras that look at it at the same instant.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    pub snake: SnakeShape,
    pub paint: Brightness,
    pub optics: Optics,
    pub cameras: Vec<PinholeCamera>,
    pub seed: u64,
}

impl Rig {
    /// Two microscopes for pitch and yaw in front of the robot with a fibre sticking out.
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

    /// One image per camera. Equal seeds and numbers make equal noise.
    pub fn render_views(&self, pose: JointPose, number: u64) -> Vec<GreyImage> {
        let noise = |view: usize| {
            let stream = number.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (view as u64) << 56;
            Pcg64Mcg::seed_from_u64(self.seed.wrapping_add(stream))
        };
        let cameras = self.cameras.iter().enumerate();
        cameras.map(|(view, it)| self.scene(it, pose).render(&mut noise(view))).collect()
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PinholeCamera {
    pub width: usize,
    pub height: usize,
    /// Scale at the base, px/mm.
    pub px_per_mm: f64,
    /// Distance from the base to the pinhole, mm. A hundredth nearer is 1 % larger.
    pub distance_mm: f64,
    /// Start of the bending section in the image, px.
    pub origin_px: [f64; 2],
    /// Direction that the view calls positive, turned from x (pitch) towards y (yaw).
    pub plane_rad: f64,
    /// Turn of the image, counter-clockwise.
    pub roll_rad: f64,
}

impl PinholeCamera {
    /// A microscope straight at the plane of pitch, 85 mm away, base from the left at half height.
    pub fn microscope(width: usize, height: usize, px_per_mm: f64) -> Self {
        Self {
            width,
            height,
            px_per_mm,
            distance_mm: 85.0,
            origin_px: [0.3 * width as f64, 0.5 * height as f64],
            plane_rad: 0.0,
            roll_rad: 0.0,
        }
    }

    /// A point in the frame of the view, mm: along the base, across it, towards the camera.
    pub fn in_view(&self, [x, y, z]: [f64; 3]) -> (f64, f64, f64) {
        let (sin, cos) = self.plane_rad.sin_cos();
        (z, cos * x + sin * y, -sin * x + cos * y)
    }

    /// A point in the image, px, and its scale relative to `px_per_mm`.
    pub fn project(&self, point: [f64; 3]) -> ([f64; 2], f64) {
        let (along, across, near) = self.in_view(point);
        let scale = self.distance_mm / (self.distance_mm - near);
        let (sin, cos) = self.roll_rad.sin_cos();
        let k = self.px_per_mm;
        let [ox, oy] = self.origin_px;
        let (x, y) = (ox + k * (cos * along - sin * across), oy - k * (sin * along + cos * across));
        // The camera looks through the middle of the image: things grow away from there.
        let [cx, cy] = [self.width, self.height].map(|size| 0.5 * (size as f64 - 1.0));
        ([cx + scale * (x - cx), cy + scale * (y - cy)], scale)
    }
}

/// Length of the straight pieces that replace the arc, px. The sagitta of a piece on the tightest
/// arc (radius 400 px) is 10^2 / (8 * 400) = 0.03 px.
const PIECE_PX: f64 = 10.0;

/// Shape of the snake and of the fibre that sticks out of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SnakeShape {
    /// Straight base in front of the bending section; longer than the image shows.
    pub base_mm: f64,
    /// Length of the bending section along its middle.
    pub arc_mm: f64,
    /// Straight fibre beyond the bending section.
    pub tip_mm: f64,
    /// Thickness of base and bending section.
    pub body_width_mm: f64,
    pub fibre_width_mm: f64,
}

impl SnakeShape {
    pub const fn fibre(width_mm: f64) -> Self {
        Self {
            base_mm: 8.0,
            arc_mm: 2.0,
            tip_mm: 1.2,
            body_width_mm: width_mm,
            fibre_width_mm: width_mm,
        }
    }

    /// The body of 0.9 mm with a fibre of 0.25 mm sticking out.
    pub const fn robot() -> Self {
        Self { base_mm: 8.0, arc_mm: 2.4, tip_mm: 1.4, body_width_mm: 0.9, fibre_width_mm: 0.25 }
    }

    pub fn tip(&self, pose: &JointPose) -> [f64; 3] {
        self.at(pose, self.arc_mm + self.tip_mm)
    }

    /// The point `length_mm` from the start of the bending section; negative on the base.
    pub fn at(&self, pose: &JointPose, length_mm: f64) -> [f64; 3] {
        let (bend, [cx, cy]) = pose.bend();
        let arc = length_mm.clamp(0.0, self.arc_mm);
        let (along, across) = arc_point(bend, arc, self.arc_mm);
        let beyond = length_mm - self.arc_mm;
        let straight = if beyond > 0.0 { beyond } else { 0.0 };
        let across = across + straight * bend.sin();
        [across * cx, across * cy, length_mm.min(0.0) + along + straight * bend.cos()]
    }

    /// The rods to paint, the farthest first: the fibre, then the body over its root.
    fn rods(&self, pose: &JointPose, camera: &PinholeCamera, paint: &Brightness) -> Vec<Rod> {
        let pieces = (self.arc_mm * camera.px_per_mm / PIECE_PX).ceil().max(1.0) as usize;
        let on_arc = |i: usize| self.arc_mm * i as f64 / pieces as f64;
        let one_thickness = self.body_width_mm == self.fibre_width_mm;
        let mut body: Vec<f64> = vec![-self.base_mm];
        body.extend((0..=pieces).map(on_arc));
        let mut fibre = vec![self.arc_mm, self.arc_mm + self.tip_mm];
        if one_thickness {
            body.push(self.arc_mm + self.tip_mm);
            fibre.clear();
        }
        let rod = |lengths: Vec<f64>, width_mm: f64, brightness: f32| {
            let point = |length| {
                let ([x, y], scale) = camera.project(self.at(pose, length));
                [x, y, 0.5 * width_mm * camera.px_per_mm * scale]
            };
            Rod { points: lengths.into_iter().map(point).collect(), brightness, rim: paint.rim }
        };
        let mut rods = Vec::with_capacity(2);
        if !fibre.is_empty() {
            rods.push(rod(fibre, self.fibre_width_mm, paint.fibre));
        }
        rods.push(rod(body, self.body_width_mm, paint.body));
        rods
    }
}

/// Along and across the base after `arc` of `total` of an arc that bends by `bend` in all.
fn arc_point(bend: f64, arc: f64, total: f64) -> (f64, f64) {
    let angle = bend * arc / total;
    if angle.abs() < 1e-6 {
        return (arc, 0.5 * angle * arc);
    }
    let radius = arc / angle;
    (radius * angle.sin(), radius * (1.0 - angle.cos()))
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JointPose {
    /// Angle of the tip in the plane of x and z: its tangent is x over z of the tip's direction.
    pub pitch_rad: f64,
    /// Angle of the tip in the plane of y and z.
    pub yaw_rad: f64,
}

impl JointPose {
    /// The angle in a camera whose positive side is turned by `plane_rad` from x towards y.
    pub fn view_angle_rad(&self, plane_rad: f64) -> f64 {
        (self.pitch_rad.tan() * plane_rad.cos() + self.yaw_rad.tan() * plane_rad.sin()).atan()
    }

    /// The whole bend, and the direction across the base that it goes.
    fn bend(&self) -> (f64, [f64; 2]) {
        let (x, y) = (self.pitch_rad.tan(), self.yaw_rad.tan());
        let length = x.hypot(y);
        if length == 0.0 { (0.0, [1.0, 0.0]) } else { (length.atan(), [x / length, y / length]) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_of_one_instant_or_pose_differ_in_noise() {
        let rig = Rig::laboratory(160, 120, 25.0);
        let [first, again, next] =
            [1, 1, 2].map(|number| rig.render_views(JointPose::default(), number));
        assert_eq!(first, again);
        assert!(first[0] != first[1] && first[0] != next[0] && first[1] != next[1]);
    }

    #[test]
    fn tip_points_in_the_direction_of_pitch_and_yaw() {
        let (snake, pose) = (SnakeShape::robot(), JointPose { pitch_rad: 0.4, yaw_rad: -0.2 });
        let (end, before) = (snake.tip(&pose), snake.at(&pose, snake.arc_mm + snake.tip_mm - 0.1));
        let d: Vec<f64> = end.iter().zip(before).map(|(a, b)| a - b).collect();
        assert!((d[0].atan2(d[2]) - 0.4).abs() < 1e-9);
        assert!((d[1].atan2(d[2]) + 0.2).abs() < 1e-9);
        assert_eq!(snake.tip(&JointPose::default()), [0.0, 0.0, 2.4 + 1.4]);
    }

    #[test]
    fn curve_has_the_length_of_its_parameter() {
        let (snake, pose) = (SnakeShape::fibre(0.1), JointPose { pitch_rad: 0.5, yaw_rad: 0.5 });
        let points: Vec<_> = (0..=1000).map(|i| snake.at(&pose, f64::from(i) * 0.003)).collect();
        let distance = |w: &[[f64; 3]]| -> f64 {
            w[0].iter().zip(w[1]).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
        };
        let length: f64 = points.windows(2).map(distance).sum();
        assert!((length - 3.0).abs() < 1e-5, "{length}");
    }
}
