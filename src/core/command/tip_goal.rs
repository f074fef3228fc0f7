//! Tip goals: a place or a velocity of the tip becomes angles or rates of the joints.
//!
//! Two joints reach a surface, not a room: the snake goes where its tip is nearest. Every stage
//! after this one sees joints only.

use crate::core::inputs::ServoGoal;
use crate::core::motion::joint_model::JointModel;
use crate::core::vector::{distance, first_entries, is_finite};
use crate::model::file::OutputUnit;
use crate::model::kinematic::{bend_rates, bend_to, tip_position};
use crate::units::OutputVec;

/// Distance at which a position counts as on the surface, m: a tenth of the snake's diameter.
pub(crate) const ON_SURFACE_M: f64 = 1e-4;

/// Entries of a place.
const ENTRIES: u32 = 3;

/// A goal in joints for one of the tip. Others stay as they are, and so do those that are to be
/// refused: not finite, or for a model without pitch and yaw.
pub(crate) fn in_joints(goal: ServoGoal, joints: Option<&JointModel>) -> ServoGoal {
    let (ServoGoal::Tip(values, ENTRIES) | ServoGoal::TipRate(values, ENTRIES)) = goal else {
        return goal;
    };
    let is_bend = |it: &&JointModel| it.unit() == OutputUnit::Deg && it.outputs() == 2;
    let setpoint = joints.filter(is_bend).and_then(JointModel::setpoint);
    let Some([pitch, yaw, _]) = setpoint.filter(|_| is_finite(&values)) else {
        return goal;
    };
    match goal {
        ServoGoal::Tip(..) => {
            let ([pitch, yaw], _) = bend_to(values, [pitch, yaw]);
            ServoGoal::Joint([pitch, yaw, 0.0], 2)
        }
        _ => {
            let [pitch, yaw] = bend_rates(values, [pitch, yaw]);
            ServoGoal::Rate([pitch, yaw, 0.0], 2)
        }
    }
}

/// The place of the tip that a goal asks for.
pub(crate) fn place(goal: &ServoGoal) -> Option<OutputVec> {
    match *goal {
        ServoGoal::Tip(place, entries) => Some(first_entries(place, entries)),
        _ => None,
    }
}

/// How far the tip is from a place with these angles, m.
pub(crate) fn away_m(place: &OutputVec, [pitch, yaw, _]: &OutputVec) -> f64 {
    distance(place, &tip_position(*pitch, *yaw).position_m)
}
