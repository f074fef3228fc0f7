//! Tip position from joint angles.
//!
//! Pitch joints and yaw joints alternate along the snake, beginning with a pitch joint. When a
//! joint turns by `theta`, the point of contact moves with the upper surface. The path to its new
//! position is: `R` back to the lower centre of curvature, a turn by half the angle, `2 R` forward,
//! a turn by half the angle, and `R` back. With `u(a) = (sin a, cos a)` in the plane of the joint,
//! its new position is `R (2 u(theta / 2) - u(theta) - u(0))`, and the direction of the snake turns
//! by `theta`.
//!
//! Axes at the base: z is along the straight snake, yaw bends the snake towards x, pitch towards y.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::{JOINTS_PER_AXIS, ROLLING_RADIUS_MM};

/// Distance of neighbouring joints when straight, mm (the robot's drawing).
pub const JOINT_PITCH_MM: f64 = 0.1495;

/// The position of the tip, mm, and its derivative with respect to pitch and yaw of a single joint,
/// mm per rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::model) struct Tip {
    pub position_mm: Vector3<f64>,
    /// Column 0: pitch, column 1: yaw.
    pub slope: SMatrix<f64, 3, 2>,
}

/// The tip of a snake whose joints of an axis all turn by the same angle, rad.
pub(in crate::model) fn tip(pitch: f64, yaw: f64) -> Tip {
    let joints = [Joint::new(pitch, Vector3::y()), Joint::new(yaw, Vector3::x())];
    let mut frame = Frame::default();
    for _ in 0..JOINTS_PER_AXIS {
        for (axis, joint) in joints.iter().enumerate() {
            frame.cross(axis, joint);
        }
    }
    Tip { position_mm: frame.at, slope: SMatrix::from_columns(&frame.at_slopes) }
}

/// The positions of base, joints and tip of a snake that bends by these angles in all, mm.
pub(in crate::model) fn shape(pitch: f64, yaw: f64) -> [[f64; 3]; 2 * JOINTS_PER_AXIS + 1] {
    let joints = [
        Joint::new(pitch / JOINTS_PER_AXIS as f64, Vector3::y()),
        Joint::new(yaw / JOINTS_PER_AXIS as f64, Vector3::x()),
    ];
    let mut frame = Frame::default();
    let mut positions = [[0.0; 3]; 2 * JOINTS_PER_AXIS + 1];
    let crossings = joints.iter().enumerate().cycle();
    for (position, (axis, joint)) in positions.iter_mut().skip(1).zip(crossings) {
        frame.cross(axis, joint);
        *position = frame.at.into();
    }
    positions
}

/// The motion of a joint relative to the frame before it, and its derivatives.
struct Joint {
    shift: Vector3<f64>,
    shift_slope: Vector3<f64>,
    turn: Matrix3<f64>,
    turn_slope: Matrix3<f64>,
}

impl Joint {
    /// A joint that bends by an angle towards an axis perpendicular to z.
    fn new(angle: f64, towards: Vector3<f64>) -> Self {
        let z = Vector3::z();
        let along = |a: f64| towards * a.sin() + z * a.cos();
        let across = |a: f64| towards * a.cos() - z * a.sin();
        let bend_axis = towards.cross(&z);
        // Columns: the images of the axes that the joint bends from, bends towards, and bends
        // about.
        let rotated = |along: Vector3<f64>, across: Vector3<f64>, bend_axis: Vector3<f64>| {
            along * z.transpose() + across * towards.transpose() + bend_axis * bend_axis.transpose()
        };
        Self {
            shift: (along(0.5 * angle) * 2.0 - along(angle) - z) * ROLLING_RADIUS_MM,
            shift_slope: (across(0.5 * angle) - across(angle)) * ROLLING_RADIUS_MM,
            turn: rotated(along(angle), across(angle), bend_axis),
            turn_slope: rotated(across(angle), -along(angle), Vector3::zeros()),
        }
    }
}

/// The frame of a link, and its derivatives with respect to pitch and yaw.
struct Frame {
    at: Vector3<f64>,
    axes: Matrix3<f64>,
    at_slopes: [Vector3<f64>; 2],
    axes_slopes: [Matrix3<f64>; 2],
}

impl Default for Frame {
    fn default() -> Self {
        Self {
            at: Vector3::zeros(),
            axes: Matrix3::identity(),
            at_slopes: [Vector3::zeros(); 2],
            axes_slopes: [Matrix3::zeros(); 2],
        }
    }
}

impl Frame {
    /// Moves the frame over a joint of an axis to the end of the next link.
    fn cross(&mut self, axis: usize, joint: &Joint) {
        let link = Vector3::z() * JOINT_PITCH_MM;
        for (slope_of, (at, axes)) in
            self.at_slopes.iter_mut().zip(&mut self.axes_slopes).enumerate()
        {
            *at += *axes * joint.shift;
            *axes *= joint.turn;
            if slope_of == axis {
                *at += self.axes * joint.shift_slope;
                *axes += self.axes * joint.turn_slope;
            }
            *at += *axes * link;
        }
        self.at += self.axes * joint.shift;
        self.axes *= joint.turn;
        self.at += self.axes * link;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn shape_ends_at_the_tip_with_constant_link_lengths() {
        let (pitch, yaw) = (0.7, -0.4);
        let shape = shape(pitch, yaw);
        let [.., last] = shape;
        let tip = tip(pitch / 6.0, yaw / 6.0).position_mm;
        assert!((Vector3::from(last) - tip).norm() < 1e-12);
        for pair in shape.windows(2) {
            let link = (Vector3::from(pair[1]) - Vector3::from(pair[0])).norm();
            assert!((link - JOINT_PITCH_MM).abs() < 0.01, "{link}");
        }
        // Pitch bends towards y, yaw towards x.
        assert!(last[1] > 0.5 && last[0] < -0.3, "{last:?}");
    }

    #[test]
    fn a_straight_snake_has_the_length_of_its_links() {
        let straight = tip(0.0, 0.0);
        assert!(
            (straight.position_mm - Vector3::new(0.0, 0.0, 12.0 * JOINT_PITCH_MM)).norm() < 1e-12
        );
    }

    #[test]
    fn pitch_bends_towards_y_and_yaw_towards_x() {
        let (pitched, yawed) = (tip(0.1, 0.0).position_mm, tip(0.0, -0.1).position_mm);
        assert!(pitched.x.abs() < 1e-12 && pitched.y > 0.4, "{pitched}");
        assert!(yawed.y.abs() < 1e-12 && yawed.x < -0.4, "{yawed}");
    }

    /// In one plane every joint turns the remaining snake.
    #[test]
    fn a_planar_bend_is_the_sum_of_the_rotated_links() {
        let theta = 0.12_f64;
        let unit = |a: f64| [a.sin(), a.cos()];
        let mut sum = [0.0; 2];
        for joint in 0..6 {
            let before = f64::from(joint) * theta;
            let (half, whole, start) =
                (unit(before + 0.5 * theta), unit(before + theta), unit(before));
            for (i, sum) in sum.iter_mut().enumerate() {
                let rolled = 2.0 * half[i] - whole[i] - start[i];
                *sum += ROLLING_RADIUS_MM * rolled + 2.0 * JOINT_PITCH_MM * whole[i];
            }
        }
        let found = tip(theta, 0.0).position_mm;
        assert!(
            (found.y - sum[0]).abs() < 1e-12 && (found.z - sum[1]).abs() < 1e-12,
            "{found} is not {sum:?}"
        );
    }

    proptest! {
        #[test]
        fn tip_stays_in_its_sphere_and_slope_matches_the_derivative(
            pitch in -0.16..0.16_f64,
            yaw in -0.16..0.16_f64,
        ) {
            const STEP: f64 = 1e-6;
            let Tip { position_mm, slope } = tip(pitch, yaw);
            prop_assert!(position_mm.norm() <= 12.0 * JOINT_PITCH_MM + 1e-9);
            let ahead = [tip(pitch + STEP, yaw), tip(pitch, yaw + STEP)];
            let back = [tip(pitch - STEP, yaw), tip(pitch, yaw - STEP)];
            for axis in 0..2 {
                let difference =
                    (ahead[axis].position_mm - back[axis].position_mm) / (2.0 * STEP);
                prop_assert!((slope.column(axis) - difference).norm() < 1e-7);
            }
        }
    }
}
