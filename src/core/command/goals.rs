//! Goals of commands and moves: a place or a velocity of the tip becomes angles or rates of the
//! joints, clutch and motion scaling couple a master device to the snake, and `move_jp` is planned
//! from the present setpoint, or from where a move can stop, to a pose.

use serde::{Deserialize, Serialize};

use crate::core::inputs::{ServoCommand, ServoGoal, StateRequest};
use crate::core::motion::axis_group::AxisGroup;
use crate::core::motion::joint_model::JointModel;
use crate::core::motion::joint_trajectory::{JointTrajectory, TrajectoryLimits};
use crate::core::motion::reach::{WHOLE, nearest};
use crate::core::motion::virtual_fixtures::VirtualFixtures;
use crate::core::vector::{distance, first_entries, is_finite, zip_map};
use crate::model::file::OutputUnit;
use crate::model::kinematic::{bend_rates, bend_to, tip_position};
use crate::robot::{Measurement, Quantity, Refusal};
use crate::units::{MAX_OUTPUTS, Nanos, OutputVec};

/// Distance at which a position counts as on the surface, m: a tenth of the snake's diameter.
pub(crate) const ON_SURFACE_M: f64 = 1e-4;

/// Entries of a place.
const ENTRIES: u32 = 3;

/// A goal in joints for one of the tip: two joints reach a surface, not a room, so the snake goes
/// where its tip is nearest. Others stay as they are, and so do those that are to be
/// refused: not finite, or for a model without pitch and yaw.
pub(crate) fn in_joints(goal: ServoGoal, joints: Option<&JointModel>) -> ServoGoal {
    let (ServoGoal::Tip(values, ENTRIES) | ServoGoal::TipRate(values, ENTRIES)) = goal else {
        return goal;
    };
    let is_bend = |it: &&JointModel| it.unit() == OutputUnit::Deg && it.outputs() == 2;
    let setpoint = joints.filter(is_bend).and_then(JointModel::setpoint);
    let Some([pitch, yaw, _]) = setpoint.filter(|_| is_finite(&values)) else { return goal };
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

/// The coupling of one client.
///
/// While a client uses neither clutch nor scaling, a command is a pose: the snake goes where
/// the master is. While the clutch is open (flag `CLUTCH` of `servo_jp`, for example a pedal), the
/// master moves freely and the snake holds. When it closes, the present poses of master and snake
/// become the references, so nothing jumps; from then on the snake moves by the displacement of the
/// master times the scale. The references are kept until the clutch opens again, another client
/// takes the lease or, with a scale other than 1, a stream begins: it is relative to its first
/// command. A rate needs no reference: it is scaled, and zero while the clutch is open.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Clutch {
    /// Displacement of the snake per displacement of the master.
    scale: f64,
    client_id: u64,
    coupling: Coupling,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
enum Coupling {
    /// The snake goes to the pose of the master.
    Absolute,
    /// The clutch is open, or the next command closes it.
    Open,
    /// The snake moves by the displacement of the master. Reference poses, rad.
    Relative { master: OutputVec, snake: OutputVec },
}

impl Clutch {
    /// With a scale other than 1, displacements need a reference: the first command couples.
    pub(crate) fn new(scale: f64) -> Self {
        Self { scale, client_id: 0, coupling: Self::first_coupling(scale) }
    }

    fn first_coupling(scale: f64) -> Coupling {
        if scale == 1.0 { Coupling::Absolute } else { Coupling::Open }
    }

    /// The goal of the snake for a pose of the master, from the poses at which both were coupled.
    fn scaled(&self, master: &OutputVec, coupled: &OutputVec, snake: &OutputVec) -> OutputVec {
        let displacement = zip_map(master, coupled, |now, from| self.scale * (now - from));
        zip_map(snake, &displacement, |snake, by| snake + by)
    }

    /// The goal of the snake for a command, and the clutch if the command is accepted. `snake`: the
    /// present setpoint. `is_first`: no goal in joint space is followed. Goals in counts are not
    /// coupled, those of the tip as the angles that they lead to.
    pub(crate) fn couple(
        &self,
        command: &ServoCommand,
        snake: Option<OutputVec>,
        is_first: bool,
    ) -> (ServoGoal, Self) {
        let mut next = *self;
        let (ServoGoal::Joint(master, entries)
        | ServoGoal::Interpolated(master, entries)
        | ServoGoal::Rate(master, entries)) = command.goal
        else {
            return (command.goal, next);
        };
        if command.client_id != self.client_id || is_first && self.scale != 1.0 {
            next.client_id = command.client_id;
            next.coupling = Self::first_coupling(self.scale);
        }
        let Some(snake) = snake else { return (command.goal, next) };
        if command.clutched {
            next.coupling = Coupling::Open;
            // A command that is not finite must be refused, so its goal is kept.
            let goal = if is_finite(&master) { snake } else { master };
            return (ServoGoal::Joint(goal, entries), next);
        }
        if let ServoGoal::Rate(..) = command.goal {
            let still = OutputVec::default();
            return (ServoGoal::Rate(self.scaled(&master, &still, &still), entries), next);
        }
        if next.coupling == Coupling::Open {
            next.coupling = Coupling::Relative { master, snake };
        }
        let goal = match &next.coupling {
            Coupling::Relative { master: reference, snake } => {
                self.scaled(&master, reference, snake)
            }
            Coupling::Absolute | Coupling::Open => master,
        };
        let coupled = match command.goal {
            ServoGoal::Interpolated(..) => ServoGoal::Interpolated(goal, entries),
            _ => ServoGoal::Joint(goal, entries),
        };
        (coupled, next)
    }
}

/// Maximum duration of a trajectory. It continues without its client, so it must end before the
/// operator has forgotten it.
const MAX_MOVE_TIME: Nanos = Nanos::from_millis(60_000);

pub(crate) struct MovePlanning<'a> {
    pub is_at_rest: bool,
    pub current: Option<&'a JointTrajectory>,
    pub joints: Option<&'a JointModel>,
    pub axes: &'a AxisGroup,
    pub fixtures: &'a VirtualFixtures,
    pub limits: &'a TrajectoryLimits,
    pub now: Nanos,
}

impl MovePlanning<'_> {
    /// Plans the trajectory of a request. The newest request of the client that commands takes the
    /// place of its last one, which comes to rest first.
    pub(crate) fn plan(&self, request: &StateRequest) -> Result<JointTrajectory, Refusal> {
        let joints = self.joints.ok_or(Refusal::NoModel)?;
        let pose = self.pose(request, joints)?;
        if tip_away_m(request, &pose).is_some_and(|away_m| away_m > ON_SURFACE_M) {
            return Err(Refusal::OutOfReach);
        }
        let trajectory = match self.current {
            Some(current) => current.redirected_to(pose, self.limits, self.now),
            None if self.is_at_rest => {
                let from = joints.setpoint().ok_or(Refusal::DrivesNotReady)?;
                JointTrajectory::new(request.client_id, from, pose, self.limits, self.now)
            }
            None => return Err(Refusal::Busy),
        };
        let reached = nearest(joints, self.axes, &pose, (WHOLE, 0.0));
        if reached.map_err(|_| Refusal::BadModel)?.limit.is_some() {
            return Err(Refusal::OutOfReach);
        }
        if !self.fixtures.allows_line(trajectory.start(), &pose, &joints.goal_space()) {
            return Err(Refusal::Fixture);
        }
        if trajectory.end_time().duration_since(self.now) > MAX_MOVE_TIME {
            return Err(Refusal::Range);
        }
        Ok(trajectory)
    }

    fn pose(&self, request: &StateRequest, joints: &JointModel) -> Result<OutputVec, Refusal> {
        let goal = in_joints(request.pose.ok_or(Refusal::Malformed)?, Some(joints));
        if joints.unit() != OutputUnit::Deg {
            return Err(Refusal::Unsupported);
        }
        match goal {
            ServoGoal::Joint(pose, entries) if entries as usize == joints.outputs() => {
                let pose = first_entries::<MAX_OUTPUTS>(pose, entries);
                if is_finite(&pose) { Ok(pose) } else { Err(Refusal::NotFinite) }
            }
            ServoGoal::Tip(place, _) if !is_finite(&place) => Err(Refusal::NotFinite),
            _ => Err(Refusal::Malformed),
        }
    }

    /// How far the pose of a request is out of reach.
    pub(crate) fn measure_reach(&self, request: &StateRequest) -> Option<Measurement> {
        let joints = self.joints?;
        let pose = self.pose(request, joints).ok()?;
        let reached = nearest(joints, self.axes, &pose, (WHOLE, 0.0)).ok()?;
        if let Some(away_m) = tip_away_m(request, &reached.goal) {
            return Some(Measurement::new(Quantity::Millimetres, away_m * 1e3, None));
        }
        let away_deg = reached.limit.map_or(0.0, |(_, away)| away.to_degrees());
        Some(Measurement::new(Quantity::Degrees, away_deg, None))
    }
}

/// How far the tip is from the place that a request asks for, with these angles, m.
fn tip_away_m(request: &StateRequest, angles: &OutputVec) -> Option<f64> {
    Some(away_m(&place(&request.pose?)?, angles))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn command(client_id: u64, angle: f64, clutched: bool) -> ServoCommand {
        ServoCommand {
            client_id,
            sequence: 1,
            stamp: Nanos::ZERO,
            deadline: Nanos::ZERO,
            goal: ServoGoal::Joint([angle, 0.0, 0.0], 2),
            clutched,
            has_unknown_flags: false,
        }
    }

    #[test]
    fn the_snake_moves_by_the_scaled_displacement_from_its_reference() {
        let goal = Clutch::new(0.25).scaled(&[1.0, -2.0, 0.5], &[0.0, 2.0, 0.5], &[0.5, 0.0, -1.0]);
        assert_eq!(goal, [0.75, -1.0, -1.0]);
        let couplings = [0.25, 1.0].map(|scale| Clutch::new(scale).coupling);
        assert_eq!(couplings, [Coupling::Open, Coupling::Absolute]);
    }

    #[test]
    fn clutch_reference_is_kept_per_client() {
        let snake = Some([0.5, 0.0, 0.0]);
        let [mut clutch, mut scaled] = [1.0, 0.5].map(Clutch::new);
        for (client_id, angle, clutched, is_first, expected, expected_scaled) in [
            (7, 0.1, false, true, 0.1, 0.5),
            (7, 0.2, true, false, 0.5, 0.5),
            (7, 0.3, false, true, 0.5, 0.5),
            (7, 0.4, false, false, 0.6, 0.55),
            // Its next stream.
            (7, 0.9, false, true, 1.1, 0.5),
            (7, 1.0, false, false, 1.2, 0.55),
            // Another client has never opened the clutch.
            (8, 0.2, false, true, 0.2, 0.5),
            (7, 0.4, false, false, 0.4, 0.5),
        ] {
            for (clutch, expected) in [(&mut clutch, expected), (&mut scaled, expected_scaled)] {
                let command = command(client_id, angle, clutched);
                let (goal, next) = clutch.couple(&command, snake, is_first);
                let ServoGoal::Joint(goal, 2) = goal else { panic!("{goal:?}") };
                assert!((goal[0] - expected).abs() < 1e-12, "{command:?}: {goal:?}");
                *clutch = next;
            }
        }
    }
}
