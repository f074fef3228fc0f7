//! The links and joints of the snake: where they are at a pitch and a yaw.
//!
//! The numbers are those of [`i2ris::model::kinematic`], and so are the axes: z is along the
//! straight snake, pitch bends it towards y, yaw towards x. Lengths are metres, angles rad.
//!
//! Two surfaces of radius `R` that roll on each other by `theta` are the same motion as two hinges
//! at the centres of the surfaces, `2 R` apart, which both turn by `theta / 2`. So a rolling joint
//! is two revolute joints here, and the twelve joints of the snake are twenty-four. They follow
//! pitch and yaw, which all joints of an axis share equally.
//!
//! `urdf` writes the same as a URDF.

mod urdf;

use i2ris::model::kinematic::{JOINT_PITCH_MM, JOINTS_PER_AXIS, ROLLING_RADIUS_MM};
use nalgebra::{Isometry3, SMatrix, Translation3, UnitQuaternion, Vector3};

const RADIUS_M: f64 = ROLLING_RADIUS_MM * 1e-3;
const LINK_M: f64 = JOINT_PITCH_MM * 1e-3;
/// Each of the two hinges of a rolling joint turns by this share of the whole bend.
const SHARE: f64 = 0.5 / JOINTS_PER_AXIS as f64;

/// The bend of the whole snake, rad.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Bend {
    pub pitch: f64,
    pub yaw: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Motion {
    Pitch,
    Yaw,
    Fixed,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Unique in the snake.
    pub name: String,
    /// Name of the link below.
    pub parent: String,
    pub child: String,
    /// Where it is along the z axis of the link below, m.
    pub along_m: f64,
    pub motion: Motion,
    /// Its angle per angle of the whole snake.
    pub share: f64,
    /// Length of the link, m, and where along its z axis it begins; `None`: without a body.
    pub body: Option<[f64; 2]>,
}

impl Joint {
    /// The axis that it turns about, as the link below sees it.
    fn axis(&self) -> [f64; 3] {
        match self.motion {
            Motion::Pitch => [-1.0, 0.0, 0.0],
            Motion::Yaw | Motion::Fixed => [0.0, 1.0, 0.0],
        }
    }

    /// The link that it carries, as the link below sees it.
    fn at(&self, bend: &Bend) -> Isometry3<f64> {
        let whole = match self.motion {
            Motion::Pitch => bend.pitch,
            Motion::Yaw => bend.yaw,
            Motion::Fixed => 0.0,
        };
        let turn = Vector3::from(self.axis()) * (whole * self.share);
        Isometry3::from_parts(
            Translation3::new(0.0, 0.0, self.along_m),
            UnitQuaternion::from_scaled_axis(turn),
        )
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkPose {
    pub position_m: [f64; 3],
    /// Orientation: x, y, z, w.
    pub quaternion: [f64; 4],
}

impl From<Isometry3<f64>> for LinkPose {
    fn from(pose: Isometry3<f64>) -> Self {
        let turn = pose.rotation.quaternion();
        Self {
            position_m: pose.translation.vector.into(),
            quaternion: [turn.i, turn.j, turn.k, turn.w],
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct Snake {
    name: String,
    /// `pitch` and `yaw`, which those of the chain follow. They turn by the whole bend, and carry
    /// links without bodies outside the chain.
    masters: [Joint; 2],
    /// The chain from base to tip.
    joints: Vec<Joint>,
}

impl Snake {
    /// The snake of the robot with this name, which all its links have as a prefix.
    pub fn new(name: &str) -> Self {
        let link = |what: &str| format!("{name}_{what}");
        let (mut joints, mut parent, mut end) = (Vec::new(), link("base"), 0.0);
        for place in 1..=JOINTS_PER_AXIS {
            for (axis, motion) in [("pitch", Motion::Pitch), ("yaw", Motion::Yaw)] {
                for (part, carried, along_m, body) in [
                    ("lower", "_hinge", end - RADIUS_M, None),
                    ("upper", "", 2.0 * RADIUS_M, Some([LINK_M, -RADIUS_M])),
                ] {
                    let name = format!("{axis}_{place}_{part}");
                    let child = link(&format!("{axis}_{place}{carried}"));
                    let parent = std::mem::replace(&mut parent, child.clone());
                    joints.push(Joint { name, parent, child, along_m, motion, share: SHARE, body });
                }
                end = LINK_M - RADIUS_M;
            }
        }
        let free = |name: &str, parent, along_m, motion, share| {
            let (name, child) = (name.to_owned(), link(name));
            Joint { name, parent, child, along_m, motion, share, body: None }
        };
        joints.push(free("tip", parent, end, Motion::Fixed, 0.0));
        let masters = [("pitch", Motion::Pitch), ("yaw", Motion::Yaw)]
            .map(|(axis, motion)| free(axis, link("base"), 0.0, motion, 1.0));
        let name = name.to_owned();
        Self { name, masters, joints }
    }

    /// The link that does not move, where the first joint begins.
    pub fn base(&self) -> String {
        format!("{}_base", self.name)
    }

    /// Where the link of every joint is, as the link below sees it.
    pub fn link_poses(&self, bend: Bend) -> impl Iterator<Item = (&Joint, LinkPose)> {
        let joints = self.masters.iter().chain(&self.joints);
        joints.map(move |joint| (joint, joint.at(&bend).into()))
    }

    /// Where the tip is, as the base sees it.
    pub fn tip_pose(&self, bend: Bend) -> LinkPose {
        let joints = self.joints.iter();
        joints.fold(Isometry3::identity(), |pose, joint| pose * joint.at(&bend)).into()
    }

    /// Linear (m) and angular (rad) velocity of the tip, by the velocities of pitch and yaw.
    pub fn jacobian(&self, bend: Bend) -> [[f64; 2]; 6] {
        let tip = Vector3::from(self.tip_pose(bend).position_m);
        let (mut jacobian, mut pose) = (SMatrix::<f64, 6, 2>::zeros(), Isometry3::identity());
        for joint in &self.joints {
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
        jacobian.transpose().into()
    }
}

#[cfg(test)]
mod tests {
    use i2ris::model::kinematic::tip_position;
    use nalgebra::Quaternion;

    use super::*;

    fn tip(pitch: f64, yaw: f64) -> (Vector3<f64>, UnitQuaternion<f64>) {
        let LinkPose { position_m, quaternion: [x, y, z, w] } =
            Snake::new("i2ris").tip_pose(Bend { pitch, yaw });
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        (position_m.into(), turn)
    }

    #[test]
    fn the_tip_is_where_the_kinematic_model_has_it() {
        for [pitch, yaw] in [[0.0, 0.0], [0.2, 0.1], [0.0, -0.4], [-0.5, 0.6], [0.8, 0.8]] {
            let expected = Vector3::from(tip_position(pitch, yaw).position_m);
            let (found, _) = tip(pitch, yaw);
            assert!((found - expected).norm() < 1e-12, "{found} {expected}");
        }
    }

    #[test]
    fn the_tip_looks_along_the_bend() {
        let (pitch, yaw) = (0.4_f64, 0.3_f64);
        let [pitched, yawed] = [tip(pitch, 0.0), tip(0.0, yaw)].map(|(_, it)| it * Vector3::z());
        let expected =
            [Vector3::new(0.0, pitch.sin(), pitch.cos()), Vector3::new(yaw.sin(), 0.0, yaw.cos())];
        assert!((pitched - expected[0]).norm() < 1e-12, "{pitched}");
        assert!((yawed - expected[1]).norm() < 1e-12, "{yawed}");
    }

    #[test]
    fn the_jacobian_is_the_change_of_the_pose() {
        let bends = [[0.0, 0.0], [0.6, 0.0], [0.0, -0.5], [-0.4, 0.7], [0.8, 0.8], [-0.7, -0.2]];
        for [pitch, yaw] in bends {
            let jacobian = Snake::new("i2ris").jacobian(Bend { pitch, yaw });
            for (column, [by_pitch, by_yaw]) in [[1e-6, 0.0], [0.0, 1e-6]].into_iter().enumerate() {
                let (before, turn_before) = tip(pitch - by_pitch, yaw - by_yaw);
                let (after, turn_after) = tip(pitch + by_pitch, yaw + by_yaw);
                let linear = (after - before) / 2e-6;
                let angular = (turn_after * turn_before.inverse()).scaled_axis() / 2e-6;
                let [x, y, z, a, b, c] = jacobian.map(|row| row[column]);
                assert!((Vector3::new(x, y, z) - linear).norm() < 1e-9, "{jacobian:?} {linear}");
                assert!((Vector3::new(a, b, c) - angular).norm() < 1e-7, "{jacobian:?} {angular}");
            }
        }
    }
}
