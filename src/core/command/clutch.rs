//! Clutch and motion scaling: couples a master device to the snake.
//!
//! As long as a client uses neither clutch nor scaling, a command is a pose: the snake goes where
//! the master is. While the clutch is open (flag `CLUTCH` of `servo_jp`, for example a pedal), the
//! master moves freely and the snake holds. When it closes, the present poses of master and snake
//! become the references, so nothing jumps; from then on the snake moves by the displacement of the
//! master times the scale. The references are kept until the clutch opens again or another client
//! takes the lease. A rate needs no reference: it is scaled, and zero while the clutch is open.

use serde::{Deserialize, Serialize};

use crate::core::inputs::{ServoCommand, ServoGoal};
use crate::core::vector::{is_finite, zip_map};
use crate::units::OutputVec;

/// The coupling of one client.
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
    /// present setpoint. Goals in counts are not coupled, those of the tip as the angles that they
    /// lead to.
    pub(crate) fn couple(
        &self,
        command: &ServoCommand,
        snake: Option<OutputVec>,
    ) -> (ServoGoal, Self) {
        let mut next = *self;
        let (ServoGoal::Joint(master, entries)
        | ServoGoal::Interpolated(master, entries)
        | ServoGoal::Rate(master, entries)) = command.goal
        else {
            return (command.goal, next);
        };
        if command.client_id != self.client_id {
            next.client_id = command.client_id;
            next.coupling = Self::first_coupling(self.scale);
        }
        let Some(snake) = snake else {
            return (command.goal, next);
        };
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Nanos;

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
        let mut clutch = Clutch::new(1.0);
        for (client_id, angle, clutched, expected) in [
            (7, 0.1, false, 0.1),
            (7, 0.2, true, 0.5),
            (7, 0.3, false, 0.5),
            (7, 0.4, false, 0.6),
            // Another client has never opened the clutch.
            (8, 0.2, false, 0.2),
            (7, 0.4, false, 0.4),
        ] {
            let (goal, next) = clutch.couple(&command(client_id, angle, clutched), snake);
            let ServoGoal::Joint(goal, 2) = goal else {
                panic!("{goal:?}");
            };
            assert!((goal[0] - expected).abs() < 1e-12, "{client_id}: {goal:?}");
            clutch = next;
        }
    }
}
