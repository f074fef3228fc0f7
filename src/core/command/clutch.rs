//! Clutch and motion scaling: how a master device leads the snake.
//!
//! As long as nobody uses either, a command is a pose: where the master is, the snake goes. With
//! the clutch open (flag `CLUTCH` of `servo_jp`, a pedal say) the master moves freely and the snake
//! holds. When it closes, **the master is taken to be where the snake is**, so nothing jumps; from
//! then on the snake moves by what the master moves, times the scale. The place where they were
//! coupled is kept until the clutch opens again or someone else takes the lease.

use serde::{Deserialize, Serialize};

use crate::core::{Goal, ServoCommand};
use crate::units::OutputVec;

/// How master and snake are coupled.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Clutch {
    scale: f64,
    client_id: u64,
    coupling: Coupling,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
enum Coupling {
    /// Where the master is, the snake goes.
    Pose,
    /// The clutch is open, or the next command couples.
    Open,
    /// Coupled at a place of either, rad.
    At { master: OutputVec, snake: OutputVec },
}

impl Clutch {
    /// A scale other than 1 needs a place to scale from: the first command couples.
    pub fn new(scale: f64) -> Self {
        Self {
            scale,
            client_id: 0,
            coupling: Self::first(scale),
        }
    }

    fn first(scale: f64) -> Coupling {
        if scale == 1.0 {
            Coupling::Pose
        } else {
            Coupling::Open
        }
    }

    /// What a command asks of the snake, which is at `snake`, and the coupling if the command is
    /// accepted. Goals in counts have no master.
    pub fn lead(&self, command: &ServoCommand, snake: Option<OutputVec>) -> (Goal, Self) {
        let mut next = *self;
        let Goal::Joint(master, entries) = command.goal else {
            return (command.goal, next);
        };
        if command.client_id != self.client_id {
            (next.client_id, next.coupling) = (command.client_id, Self::first(self.scale));
        }
        let Some(here) = snake else {
            return (command.goal, next);
        };
        if command.clutched {
            next.coupling = Coupling::Open;
            return (Goal::Joint(held(&master, here), entries), next);
        }
        if next.coupling == Coupling::Open {
            next.coupling = Coupling::At {
                master,
                snake: here,
            };
        }
        let goal = match next.coupling {
            Coupling::At {
                master: from,
                snake,
            } => moved(&master, &from, snake, self.scale),
            Coupling::Pose | Coupling::Open => master,
        };
        (Goal::Joint(goal, entries), next)
    }
}

/// The place of the snake, unless the command is nonsense: that has to show.
fn held(master: &OutputVec, snake: OutputVec) -> OutputVec {
    if master.iter().all(|value| value.is_finite()) {
        snake
    } else {
        *master
    }
}

fn moved(master: &OutputVec, from: &OutputVec, mut snake: OutputVec, scale: f64) -> OutputVec {
    snake
        .iter_mut()
        .zip(master)
        .zip(from)
        .for_each(|((snake, master), from)| *snake += scale * (master - from));
    snake
}
