//! How the tip moves with the joints.

use nalgebra::{Isometry3, SMatrix, Vector3};

use super::{Bend, Motion, Snake};

impl Snake {
    /// Linear (m) and angular (rad) velocity of the tip in the base, six rows, by the velocities of
    /// pitch and yaw.
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
}
