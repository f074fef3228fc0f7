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
//! | file | contains |
//! |---|---|
//! | `urdf` | the same as a URDF |
//! | `tip_kinematics` | how the tip moves with the joints |

mod tip_kinematics;
mod urdf;

use i2ris::model::kinematic::{JOINT_PITCH_MM, JOINTS_PER_AXIS, ROLLING_RADIUS_MM};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

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

/// A joint, and the link that it carries.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Unique in the snake.
    pub name: String,
    /// Name of the link below.
    pub parent: String,
    /// Name of the link that it carries.
    pub child: String,
    /// Where it is along the z axis of the link below, m.
    pub along_m: f64,
    pub motion: Motion,
    /// Its angle per angle of the whole snake.
    pub share: f64,
    /// Length of the link that it carries, m, and where along its z axis the link begins. `None`:
    /// the link has no body.
    pub body: Option<[f64; 2]>,
}

impl Joint {
    /// The axis that it turns about, as the link below sees it.
    pub fn axis(&self) -> [f64; 3] {
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

/// Pose of a link in the frame of another link.
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
    /// Turn by the whole bend, and carry links without bodies outside the chain.
    masters: [Joint; 2],
    joints: Vec<Joint>,
}

impl Snake {
    /// The snake of the robot with this name, which all its links have as a prefix.
    pub fn new(name: &str) -> Self {
        let link = |what: &str| format!("{name}_{what}");
        let (mut joints, mut parent, mut end) = (Vec::new(), link("base"), 0.0);
        for place in 1..=JOINTS_PER_AXIS {
            for (axis, motion) in [("pitch", Motion::Pitch), ("yaw", Motion::Yaw)] {
                let (hinge, child) =
                    (link(&format!("{axis}_{place}_hinge")), link(&format!("{axis}_{place}")));
                joints.push(Joint {
                    name: format!("{axis}_{place}_lower"),
                    parent,
                    child: hinge.clone(),
                    along_m: end - RADIUS_M,
                    motion,
                    share: SHARE,
                    body: None,
                });
                joints.push(Joint {
                    name: format!("{axis}_{place}_upper"),
                    parent: hinge,
                    child: child.clone(),
                    along_m: 2.0 * RADIUS_M,
                    motion,
                    share: SHARE,
                    body: Some([LINK_M, -RADIUS_M]),
                });
                (parent, end) = (child, LINK_M - RADIUS_M);
            }
        }
        joints.push(Joint {
            name: "tip".to_owned(),
            parent,
            child: link("tip"),
            along_m: end,
            motion: Motion::Fixed,
            share: 0.0,
            body: None,
        });
        let masters =
            [("pitch", Motion::Pitch), ("yaw", Motion::Yaw)].map(|(axis, motion)| Joint {
                name: axis.to_owned(),
                parent: link("base"),
                child: link(axis),
                along_m: 0.0,
                motion,
                share: 1.0,
                body: None,
            });
        let name = name.to_owned();
        Self { name, masters, joints }
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// The link that does not move, where the first joint begins.
    pub fn base(&self) -> String {
        format!("{}_base", self.name)
    }

    /// The link without a body at the end of the snake.
    pub fn tip(&self) -> String {
        format!("{}_tip", self.name)
    }

    /// The joints `pitch` and `yaw`, which those of the chain follow.
    pub fn masters(&self) -> &[Joint] {
        &self.masters
    }

    /// The chain from base to tip.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
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
}

#[cfg(test)]
mod tests {
    use i2ris::model::kinematic::tip_position;

    use super::*;

    #[test]
    fn the_tip_is_where_the_kinematic_model_has_it() {
        let snake = Snake::new("i2ris");
        for [pitch, yaw] in [[0.0, 0.0], [0.2, 0.1], [0.0, -0.4], [-0.5, 0.6], [0.8, 0.8]] {
            let expected = Vector3::from(tip_position(pitch, yaw).position_m);
            let found = Vector3::from(snake.tip_pose(Bend { pitch, yaw }).position_m);
            assert!((found - expected).norm() < 1e-12, "{found} {expected}");
        }
    }

    #[test]
    fn the_tip_looks_along_the_bend() {
        let snake = Snake::new("i2ris");
        let towards = |bend| {
            let [x, y, z, w] = snake.tip_pose(bend).quaternion;
            UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z)) * Vector3::z()
        };
        let (pitch, yaw) = (0.4_f64, 0.3_f64);
        let pitched = towards(Bend { pitch, yaw: 0.0 });
        let yawed = towards(Bend { pitch: 0.0, yaw });
        let expected =
            [Vector3::new(0.0, pitch.sin(), pitch.cos()), Vector3::new(yaw.sin(), 0.0, yaw.cos())];
        assert!((pitched - expected[0]).norm() < 1e-12, "{pitched}");
        assert!((yawed - expected[1]).norm() < 1e-12, "{yawed}");
    }
}
