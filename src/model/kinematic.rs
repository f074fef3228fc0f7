//! Where the tip of a bent snake is, and which bend brings the tip to a place.
//!
//! The snake has twelve rolling joints, six per axis, which share the bend equally. Pitch joints
//! and yaw joints alternate along the snake, beginning with a pitch joint. When a joint turns by
//! `theta`, the point of contact moves with the upper surface. The path to its new position is: `R`
//! back to the lower centre of curvature, a turn by half the angle, `2 R` forward, a turn by half
//! the angle, and `R` back. With `u(a) = (sin a, cos a)` in the plane of the joint, its new
//! position is `R (2 u(theta / 2) - u(theta) - u(0))`, and the direction of the snake turns by
//! `theta`.
//!
//! Axes at the base: z is along the straight snake, yaw bends the snake towards x, pitch towards y.

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::model::estimate::OutputUnit;

/// Number of pitch joints, and of yaw joints (the robot's drawing).
pub const JOINTS_PER_AXIS: usize = 6;

/// Radius of the rolling surfaces, mm (the robot's drawing).
pub const ROLLING_RADIUS_MM: f64 = 0.75;

/// Stop angle of a joint, rad (8.75 deg by the robot's drawing).
pub const STOP_RAD: f64 = 8.75 * std::f64::consts::PI / 180.0;

/// Tip position of a bent snake.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipPosition {
    /// x, y and z at the base, m: z along the straight snake, yaw bends towards x, pitch towards y.
    pub position_m: [f64; 3],
    /// The derivative of the position with respect to pitch, and to yaw, m per rad.
    pub slope_m_per_rad: [[f64; 3]; 2],
}

/// The tip of a snake that bends by a pitch and a yaw in total, rad, shared equally by its joints.
#[must_use]
pub fn tip_position(pitch: f64, yaw: f64) -> TipPosition {
    let joints = JOINTS_PER_AXIS as f64;
    let tip = tip(pitch / joints, yaw / joints);
    let metres = OutputUnit::Mm.si();
    let column = |axis: usize| (tip.slope.column(axis) * (metres / joints)).into();
    TipPosition {
        position_m: (tip.position_mm * metres).into(),
        slope_m_per_rad: [column(0), column(1)],
    }
}

/// Distance of neighbouring joints when straight, mm (the robot's drawing).
pub const JOINT_PITCH_MM: f64 = 0.1495;

/// The position of the tip, mm, and its derivative with respect to pitch and yaw of a single joint,
/// mm per rad.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Tip {
    pub position_mm: Vector3<f64>,
    /// Column 0: pitch, column 1: yaw.
    pub slope: SMatrix<f64, 3, 2>,
}

/// The tip of a snake whose joints of an axis all turn by the same angle, rad.
fn tip(pitch: f64, yaw: f64) -> Tip {
    let joints = [Joint::new(pitch, Vector3::y()), Joint::new(yaw, Vector3::x())];
    let mut frame = Frame::default();
    for _ in 0..JOINTS_PER_AXIS {
        for (axis, joint) in joints.iter().enumerate() {
            frame.cross(axis, joint);
        }
    }
    Tip { position_mm: frame.at, slope: SMatrix::from_columns(&frame.at_slopes) }
}

/// Base, twelve joints and tip of a snake that bends by `pitch` and `yaw` in all, rad: thirteen
/// positions, mm.
#[must_use]
pub fn shape_mm(pitch: f64, yaw: f64) -> [[f64; 3]; 2 * JOINTS_PER_AXIS + 1] {
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

/// The stops of the joints hold the whole bend within this, rad.
const MAX_BEND_RAD: f64 = JOINTS_PER_AXIS as f64 * STOP_RAD;

/// Damping of the steps towards a place, m^2: little against the squares of the snake's lengths.
const DAMPING_M2: f64 = 1e-11;

/// A place that can be reached needs a tenth of these steps, one far from all others the most.
const STEPS: usize = 40;

/// A step below this is the last one, rad: a thousandth of an atom's diameter at the tip.
const DONE_RAD: f64 = 1e-10;

/// Pitch and yaw, rad, that bring the tip nearest to a place (m, base frame), and the remaining
/// distance, m; NaN for a place that is not finite. The search begins at a bend, by damped
/// Gauss-Newton steps (K. Levenberg, 1944).
#[must_use]
pub fn bend_to(place: [f64; 3], from: [f64; 2]) -> ([f64; 2], f64) {
    let mut bend = from;
    for _ in 0..STEPS {
        let tip = tip_position(bend[0], bend[1]);
        let step = rates(&tip, left(place, &tip));
        let next = [0, 1].map(|at: usize| (bend[at] + step[at]).clamp(-MAX_BEND_RAD, MAX_BEND_RAD));
        let moved = (next[0] - bend[0]).abs().max((next[1] - bend[1]).abs());
        bend = next;
        if moved.is_nan() || moved < DONE_RAD {
            break;
        }
    }
    let [x, y, z] = left(place, &tip_position(bend[0], bend[1]));
    (bend, (x * x + y * y + z * z).sqrt())
}

/// The rates of pitch and yaw, rad/s, at a bend, with which the tip moves nearest to a velocity,
/// m/s.
pub(crate) fn bend_rates(velocity_m_s: [f64; 3], at: [f64; 2]) -> [f64; 2] {
    rates(&tip_position(at[0], at[1]), velocity_m_s)
}

fn left(place: [f64; 3], tip: &TipPosition) -> [f64; 3] {
    [0, 1, 2].map(|at: usize| place[at] - tip.position_m[at])
}

/// The damped least-squares solution of `slope rates = wanted`.
fn rates(tip: &TipPosition, wanted: [f64; 3]) -> [f64; 2] {
    let [pitch, yaw] = &tip.slope_m_per_rad;
    let dot = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (a, b, d) = (dot(pitch, pitch) + DAMPING_M2, dot(pitch, yaw), dot(yaw, yaw) + DAMPING_M2);
    let (right_pitch, right_yaw) = (dot(pitch, &wanted), dot(yaw, &wanted));
    // At least the square of the damping.
    let determinant = a * d - b * b;
    [
        (d * right_pitch - b * right_yaw) / determinant,
        (a * right_yaw - b * right_pitch) / determinant,
    ]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn shape_ends_at_the_tip_with_constant_link_lengths() {
        let (pitch, yaw) = (0.7, -0.4);
        let shape = shape_mm(pitch, yaw);
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

    const BENDS: [[f64; 2]; 6] =
        [[0.0, 0.0], [0.6, 0.0], [0.0, -0.5], [-0.4, 0.7], [0.8, 0.8], [-0.7, -0.2]];

    #[test]
    fn bend_search_finds_the_nearest_bend_from_any_start() {
        for bend in BENDS {
            let place = tip_position(bend[0], bend[1]).position_m;
            for from in BENDS {
                let (found, away_m) = bend_to(place, from);
                assert!(away_m < 1e-9, "{away_m}");
                let apart = [0, 1].map(|at: usize| (found[at] - bend[at]).abs());
                assert!(apart[0] < 1e-6 && apart[1] < 1e-6, "{found:?} {bend:?}");
            }
        }
        let [x, y, z] = tip_position(0.0, 0.0).position_m;
        let (bend, away_m) = bend_to([x, y, z + 1e-3], [0.3, 0.2]);
        assert!((away_m - 1e-3).abs() < 1e-6, "straight is nearest: {away_m}");
        assert!(bend.iter().all(|angle| angle.abs() < 1e-3), "{bend:?}");
        let (_, away_m) = bend_to([1.0, f64::NAN, 0.0], [0.0; 2]);
        assert!(away_m.is_nan(), "nowhere");
    }

    #[test]
    fn tip_moves_as_requested_except_along_itself() {
        for bend in BENDS {
            let [pitch, yaw] = tip_position(bend[0], bend[1]).slope_m_per_rad;
            let along = [0, 1, 2].map(|at: usize| 0.3 * pitch[at] - 0.2 * yaw[at]);
            let [first, second] = bend_rates(along, bend);
            assert!((first - 0.3).abs() < 1e-4 && (second + 0.2).abs() < 1e-4, "{first} {second}");
        }
        let [first, second] = bend_rates([0.0, 0.0, 1e-3], [0.0; 2]);
        assert!(first.abs() < 1e-9 && second.abs() < 1e-9, "{first} {second}");
    }
}
