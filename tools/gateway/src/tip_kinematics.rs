//! How the tip moves with the joints, and which bend brings it to a place.

use i2ris::model::kinematic::{JOINTS_PER_AXIS, STOP_RAD};
use nalgebra::{Isometry3, Matrix2, SMatrix, Vector2, Vector3};

use crate::snake::Motion;
use crate::{Bend, Snake};

/// The stops of the joints hold the whole bend within this, rad.
const LARGEST_RAD: f64 = JOINTS_PER_AXIS as f64 * STOP_RAD;

/// Damping of the steps towards a place, m^2: little against the squares of the snake's lengths.
const DAMPING_M2: f64 = 1e-11;

/// A snake of a few joints needs a tenth of these steps.
const STEPS: usize = 100;

/// A step below this is the last one, rad.
const DONE_RAD: f64 = 1e-12;

impl Snake {
    /// Linear (m) and angular (rad) velocity of the tip in the base, six rows, by the velocities of
    /// pitch and yaw.
    #[must_use]
    pub fn jacobian(&self, bend: Bend) -> [[f64; 2]; 6] {
        self.jacobian_matrix(bend).transpose().into()
    }

    fn jacobian_matrix(&self, bend: Bend) -> SMatrix<f64, 6, 2> {
        let tip = Vector3::from(self.tip_pose(bend).position_m);
        let (mut jacobian, mut pose) = (SMatrix::<f64, 6, 2>::zeros(), Isometry3::identity());
        for joint in self.joints() {
            pose *= joint.at(&bend);
            let axis = pose.rotation * Vector3::from(joint.axis()) * joint.share;
            let column = match joint.motion {
                Motion::Pitch => 0,
                Motion::Yaw => 1,
                Motion::Fixed => continue,
            };
            let lever = tip - pose.translation.vector;
            let mut column = jacobian.column_mut(column);
            let (mut linear, mut angular) = column.rows_range_pair_mut(0..3, 3..6);
            linear += axis.cross(&lever);
            angular += axis;
        }
        jacobian
    }

    /// The bend with which the tip is nearest to a place, and how near that is, m. The search
    /// begins at a bend, by damped Gauss-Newton steps (K. Levenberg, 1944).
    #[must_use]
    pub fn bend_to(&self, position_m: [f64; 3], from: Bend) -> (Bend, f64) {
        let wanted = Vector3::from(position_m);
        let left = |bend| wanted - Vector3::from(self.tip_pose(bend).position_m);
        let mut bend = from;
        for _ in 0..STEPS {
            let linear = self.jacobian_matrix(bend).fixed_rows::<3>(0).into_owned();
            let normal = linear.transpose() * linear + Matrix2::identity() * DAMPING_M2;
            let Some(inverse) = normal.try_inverse() else {
                break;
            };
            let step: Vector2<f64> = inverse * (linear.transpose() * left(bend));
            let next = Bend { pitch: within(bend.pitch + step.x), yaw: within(bend.yaw + step.y) };
            let moved = (next.pitch - bend.pitch).abs().max((next.yaw - bend.yaw).abs());
            bend = next;
            if moved < DONE_RAD {
                break;
            }
        }
        (bend, left(bend).norm())
    }
}

fn within(angle: f64) -> f64 {
    angle.clamp(-LARGEST_RAD, LARGEST_RAD)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Quaternion, UnitQuaternion};

    use super::*;

    const BENDS: [(f64, f64); 6] =
        [(0.0, 0.0), (0.6, 0.0), (0.0, -0.5), (-0.4, 0.7), (0.8, 0.8), (-0.7, -0.2)];

    #[test]
    fn the_jacobian_is_the_change_of_the_pose() {
        let snake = Snake::new("eye");
        let pose = |pitch, yaw| {
            let pose = snake.tip_pose(Bend { pitch, yaw });
            let [x, y, z, w] = pose.quaternion;
            let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
            (Vector3::from(pose.position_m), turn)
        };
        for (pitch, yaw) in BENDS {
            let jacobian = snake.jacobian_matrix(Bend { pitch, yaw });
            for (column, [by_pitch, by_yaw]) in [[1e-6, 0.0], [0.0, 1e-6]].into_iter().enumerate() {
                let (before, turn_before) = pose(pitch - by_pitch, yaw - by_yaw);
                let (after, turn_after) = pose(pitch + by_pitch, yaw + by_yaw);
                let linear = (after - before) / 2e-6;
                let angular = (turn_after * turn_before.inverse()).scaled_axis() / 2e-6;
                let found = jacobian.column(column);
                assert!((found.fixed_rows::<3>(0) - linear).norm() < 1e-9, "{found} {linear}");
                assert!((found.fixed_rows::<3>(3) - angular).norm() < 1e-7, "{found} {angular}");
            }
        }
    }

    #[test]
    fn the_bend_to_a_place_is_found_from_anywhere_and_the_nearest_one_is_told() {
        let snake = Snake::new("eye");
        for (pitch, yaw) in BENDS {
            let place = snake.tip_pose(Bend { pitch, yaw }).position_m;
            for (from_pitch, from_yaw) in BENDS {
                let from = Bend { pitch: from_pitch, yaw: from_yaw };
                let (bend, away_m) = snake.bend_to(place, from);
                assert!(away_m < 1e-9, "{away_m}");
                assert!((bend.pitch - pitch).abs() < 1e-6 && (bend.yaw - yaw).abs() < 1e-6);
            }
        }
        let [x, y, z] = snake.tip_pose(Bend::default()).position_m;
        let (bend, away_m) = snake.bend_to([x, y, z + 1e-3], Bend { pitch: 0.3, yaw: 0.2 });
        assert!((away_m - 1e-3).abs() < 1e-6, "straight is nearest: {away_m}");
        assert!(bend.pitch.abs() < 1e-3 && bend.yaw.abs() < 1e-3, "{bend:?}");
        let (_, away_m) = snake.bend_to([1.0, f64::NAN, 0.0], Bend::default());
        assert!(away_m.is_nan(), "nowhere");
    }
}
