//! The snake as a URDF.
//!
//! The revolute joints mimic two joints `pitch` and `yaw`, whose names are those in `measured_js`.
//! These two carry links without bodies outside the chain, so that nothing else turns with them.

use std::fmt::Write as _;

use i2ris::model::kinematic::{JOINTS_PER_AXIS, STOP_RAD};

use super::{Joint, Motion, Snake};

/// Diameter of the snake, m (the robot's drawing).
const DIAMETER_M: f64 = 0.9e-3;

/// Length of the straight base that is drawn, m. The robot's is longer.
const BASE_M: f64 = 4e-3;

/// Limits that a revolute joint must have; no tool uses them for a picture.
const EFFORT_AND_VELOCITY: &str = r#"effort="1" velocity="10""#;

impl Snake {
    pub fn urdf(&self) -> String {
        let mut text = String::from("<?xml version=\"1.0\"?>\n");
        // Writing into a String cannot fail.
        let _ = self.write(&mut text);
        text
    }

    fn write(&self, out: &mut String) -> std::fmt::Result {
        let base = self.base();
        writeln!(out, "<robot name=\"{}\">", self.name())?;
        writeln!(out, "  <material name=\"steel\">")?;
        writeln!(out, "    <color rgba=\"0.72 0.74 0.78 1\"/>")?;
        writeln!(out, "  </material>")?;
        write_link(out, &base, Some([BASE_M, -BASE_M]))?;
        for joint in self.masters() {
            write_link(out, &joint.child, joint.body)?;
            write_joint(out, joint, None)?;
        }
        for joint in self.joints() {
            write_link(out, &joint.child, joint.body)?;
            let master = match joint.motion {
                Motion::Pitch => Some("pitch"),
                Motion::Yaw => Some("yaw"),
                Motion::Fixed => None,
            };
            write_joint(out, joint, master)?;
        }
        writeln!(out, "</robot>")
    }
}

fn write_link(out: &mut String, name: &str, body: Option<[f64; 2]>) -> std::fmt::Result {
    let Some([length, begin]) = body else {
        return writeln!(out, "  <link name=\"{name}\"/>");
    };
    let (middle, radius) = (begin + 0.5 * length, 0.5 * DIAMETER_M);
    writeln!(out, "  <link name=\"{name}\">")?;
    writeln!(out, "    <visual>")?;
    writeln!(out, "      <origin xyz=\"0 0 {middle:.8}\"/>")?;
    writeln!(
        out,
        "      <geometry><cylinder radius=\"{radius:.8}\" length=\"{length:.8}\"/></geometry>"
    )?;
    writeln!(out, "      <material name=\"steel\"/>")?;
    writeln!(out, "    </visual>")?;
    writeln!(out, "  </link>")
}

/// Writes a joint; `master`: the joint that it follows. Without one it turns by the whole bend.
fn write_joint(out: &mut String, joint: &Joint, master: Option<&str>) -> std::fmt::Result {
    let fixed = joint.motion == Motion::Fixed;
    let kind = if fixed { "fixed" } else { "revolute" };
    writeln!(out, "  <joint name=\"{}\" type=\"{kind}\">", joint.name)?;
    writeln!(out, "    <parent link=\"{}\"/>", joint.parent)?;
    writeln!(out, "    <child link=\"{}\"/>", joint.child)?;
    writeln!(out, "    <origin xyz=\"0 0 {:.8}\"/>", joint.along_m)?;
    if !fixed {
        let [x, y, z] = joint.axis();
        let whole = JOINTS_PER_AXIS as f64 * STOP_RAD;
        let limit = whole * joint.share;
        writeln!(out, "    <axis xyz=\"{x} {y} {z}\"/>")?;
        writeln!(
            out,
            "    <limit lower=\"{:.8}\" upper=\"{limit:.8}\" {EFFORT_AND_VELOCITY}/>",
            -limit
        )?;
    }
    if let Some(master) = master {
        writeln!(
            out,
            "    <mimic joint=\"{master}\" multiplier=\"{:.15}\" offset=\"0\"/>",
            joint.share
        )?;
    }
    writeln!(out, "  </joint>")
}

#[cfg(test)]
mod tests;
