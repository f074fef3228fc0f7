//! The snake as a curve in space: straight base, circular arc, straight tip.

use super::camera::PinholeCamera;
use super::optics::Brightness;
use super::raster::Rod;

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
    /// A bare fibre of one thickness.
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

    /// The point at `length_mm` along the middle from the start of the bending section; negative on
    /// the base.
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
    pub(super) fn rods(
        &self,
        pose: &JointPose,
        camera: &PinholeCamera,
        paint: &Brightness,
    ) -> Vec<Rod> {
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
        let rod = |lengths: Vec<f64>, width_mm: f64, brightness: f32| Rod {
            points: lengths
                .into_iter()
                .map(|length| {
                    let ([x, y], scale) = camera.project(self.at(pose, length));
                    [x, y, 0.5 * width_mm * camera.px_per_mm * scale]
                })
                .collect(),
            brightness,
            rim: paint.rim,
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
    fn the_straight_snake_lies_on_the_axis() {
        let snake = SnakeShape::robot();
        assert_eq!(snake.tip(&JointPose::default()), [0.0, 0.0, 2.4 + 1.4]);
    }

    #[test]
    fn tip_points_in_the_direction_of_pitch_and_yaw() {
        let (snake, pose) = (SnakeShape::robot(), JointPose { pitch_rad: 0.4, yaw_rad: -0.2 });
        let (end, before) = (snake.tip(&pose), snake.at(&pose, snake.arc_mm + snake.tip_mm - 0.1));
        let d: Vec<f64> = end.iter().zip(before).map(|(a, b)| a - b).collect();
        assert!((d[0].atan2(d[2]) - 0.4).abs() < 1e-9);
        assert!((d[1].atan2(d[2]) + 0.2).abs() < 1e-9);
    }

    #[test]
    fn curve_has_the_length_of_its_parameter() {
        let (snake, pose) = (SnakeShape::fibre(0.1), JointPose { pitch_rad: 0.5, yaw_rad: 0.5 });
        let points: Vec<_> = (0..=1000).map(|i| snake.at(&pose, f64::from(i) * 0.003)).collect();
        let length: f64 = points
            .windows(2)
            .map(|w| w[0].iter().zip(w[1]).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt())
            .sum();
        assert!((length - 3.0).abs() < 1e-5, "{length}");
    }
}
