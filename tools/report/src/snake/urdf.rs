//! The snake as a URDF.
//!
//! The revolute joints mimic two joints `pitch` and `yaw`, whose names are those in `measured_js`.
//! These two carry links without bodies outside the chain, so that nothing else turns with them.

use i2ris::model::kinematic::{JOINTS_PER_AXIS, STOP_RAD};

use super::{Joint, Motion, Snake};

/// Diameter of the snake, m (the robot's drawing).
const DIAMETER_M: f64 = 0.9e-3;

/// Length of the straight base that is drawn, m. The robot's is longer.
const BASE_M: f64 = 4e-3;

impl Snake {
    pub fn urdf(&self) -> String {
        let Self { name, masters, joints } = self;
        let base = link(&self.base(), Some([BASE_M, -BASE_M]));
        let masters = masters.iter().map(|it| link(&it.child, it.body) + &joint(it, None));
        let joints = joints.iter().map(|it| {
            let master = match it.motion {
                Motion::Pitch => Some("pitch"),
                Motion::Yaw => Some("yaw"),
                Motion::Fixed => None,
            };
            link(&it.child, it.body) + &joint(it, master)
        });
        let links: String = masters.chain(joints).collect();
        format!(
            r#"<?xml version="1.0"?>
<robot name="{name}">
  <material name="steel">
    <color rgba="0.72 0.74 0.78 1"/>
  </material>
{base}{links}</robot>
"#
        )
    }
}

fn link(name: &str, body: Option<[f64; 2]>) -> String {
    let Some([length, begin]) = body else {
        return format!("  <link name=\"{name}\"/>\n");
    };
    let (middle, radius) = (begin + 0.5 * length, 0.5 * DIAMETER_M);
    format!(
        r#"  <link name="{name}">
    <visual>
      <origin xyz="0 0 {middle:.8}"/>
      <geometry><cylinder radius="{radius:.8}" length="{length:.8}"/></geometry>
      <material name="steel"/>
    </visual>
  </link>
"#
    )
}

/// `master`: the joint that it follows. Without one it turns by the whole bend.
fn joint(joint: &Joint, master: Option<&str>) -> String {
    let Joint { name, parent, child, along_m, share, .. } = joint;
    let (kind, turns) = if joint.motion == Motion::Fixed {
        ("fixed", String::new())
    } else {
        let ([x, y, z], limit) = (joint.axis(), JOINTS_PER_AXIS as f64 * STOP_RAD * share);
        // URDF demands effort and velocity; no tool uses them for a picture.
        let turns = format!(
            r#"    <axis xyz="{x} {y} {z}"/>
    <limit lower="{:.8}" upper="{limit:.8}" effort="1" velocity="10"/>
"#,
            -limit
        );
        ("revolute", turns)
    };
    let mimic = master.map_or_else(String::new, |master| {
        format!("    <mimic joint=\"{master}\" multiplier=\"{share:.15}\" offset=\"0\"/>\n")
    });
    format!(
        r#"  <joint name="{name}" type="{kind}">
    <parent link="{parent}"/>
    <child link="{child}"/>
    <origin xyz="0 0 {along_m:.8}"/>
{turns}{mimic}  </joint>
"#
    )
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
    use roxmltree::{Document, Node};

    use super::super::Bend;
    use super::*;

    fn attribute<'a>(node: Node<'a, '_>, child: &str, name: &str) -> Option<&'a str> {
        let child = node.children().find(|it| it.has_tag_name(child))?;
        child.attribute(name)
    }

    fn vector(text: &str) -> Vector3<f64> {
        let numbers = text.split(' ').map(|number| number.parse().unwrap());
        Vector3::from_iterator(numbers)
    }

    /// Where the tip is at a bend, by nothing but the text: joints named `pitch` and `yaw` are set,
    /// others follow them.
    fn tip(document: &Document<'_>, bend: Bend) -> Isometry3<f64> {
        let joints = document.descendants().filter(|it| it.has_tag_name("joint"));
        let by_child: BTreeMap<&str, Node<'_, '_>> =
            joints.map(|joint| (attribute(joint, "child", "link").unwrap(), joint)).collect();
        let (mut pose, mut link) = (Isometry3::identity(), "eye_tip");
        while let Some(joint) = by_child.get(link) {
            let master = attribute(*joint, "mimic", "joint").or(joint.attribute("name"));
            let whole = match master {
                Some("pitch") => bend.pitch,
                Some("yaw") => bend.yaw,
                _ => 0.0,
            };
            let share =
                attribute(*joint, "mimic", "multiplier").map_or(1.0, |it| it.parse().unwrap());
            let axis = attribute(*joint, "axis", "xyz").map_or_else(Vector3::zeros, vector);
            let origin = vector(attribute(*joint, "origin", "xyz").unwrap());
            let turn = UnitQuaternion::from_scaled_axis(axis * (whole * share));
            pose = Isometry3::from_parts(Translation3::from(origin), turn) * pose;
            link = attribute(*joint, "parent", "link").unwrap();
        }
        assert_eq!(link, "eye_base", "the chain of the tip starts at the base");
        pose
    }

    #[test]
    fn the_urdf_has_the_tip_pose_of_the_snake() {
        let snake = Snake::new("eye");
        let text = snake.urdf();
        let document = Document::parse(&text).unwrap();
        for (pitch, yaw) in [(0.0, 0.0), (0.7, 0.0), (0.0, -0.5), (-0.4, 0.6)] {
            let bend = Bend { pitch, yaw };
            let (found, expected) = (tip(&document, bend), snake.tip_pose(bend));
            let position = Vector3::from(expected.position_m);
            // The text has lengths to ten nanometres, twenty-five times.
            assert!((found.translation.vector - position).norm() < 3e-7);
            let [x, y, z, w] = expected.quaternion;
            let expected = nalgebra::Quaternion::new(w, x, y, z);
            assert!(found.rotation.angle_to(&UnitQuaternion::from_quaternion(expected)) < 1e-9);
        }
    }

    #[test]
    fn every_link_has_one_joint_and_every_joint_valid_limits() {
        let text = Snake::new("eye").urdf();
        let document = Document::parse(&text).unwrap();
        let robot = document.root_element();
        let named = |tag: &'static str| robot.children().filter(move |it| it.has_tag_name(tag));
        let links: Vec<_> = named("link").filter_map(|it| it.attribute("name")).collect();
        let children: Vec<_> =
            named("joint").filter_map(|it| attribute(it, "child", "link")).collect();
        assert_eq!(links.len(), 1 + 2 + 24 + 1);
        assert_eq!(children.len(), links.len() - 1, "all but the base");
        for (place, child) in children.iter().enumerate() {
            assert!(links.contains(child), "{child}");
            assert!(!children[..place].contains(child), "{child} has two parents");
        }
        let limit = |name: &str| -> f64 {
            let joint = named("joint").find(|it| it.attribute("name") == Some(name));
            let limit = attribute(joint.unwrap(), "limit", "upper");
            limit.unwrap().parse().unwrap()
        };
        let share: f64 = limit("yaw_6_upper") / limit("yaw");
        assert!((share - 1.0 / 12.0).abs() < 1e-6, "{share}");
        assert!((limit("pitch").to_degrees() - 52.5).abs() < 1e-5);
    }
}
