//! The operating states and the one function that changes them.
//!
//! The states and the answer to every command in each of them stand in the table of [`crate::core`].
//! Deciding and changing are apart: `table` and `progress` say what comes next and have no effects,
//! [`Machine::change`] does it.

use serde::{Deserialize, Serialize};

use crate::core::EventKind;
use crate::core::command::goal_extrapolation::Trend;
use crate::core::event::Events;
use crate::core::motion::conditioning::Stroke;
use crate::core::motion::joint_trajectory::Profile;
use crate::core::states::drive_status::Expected;
use crate::drive::Demand;
use crate::robot::{Fault, OperatingState, StateCommand};
use crate::units::{MAX_MOTORS, MAX_OUTPUTS, Nanos, OutputVec};

/// What the robot is doing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "no heap in the control loop")]
pub(crate) enum State {
    /// Drives are off, or on the way from off or to off. Servo commands are refused.
    Disabled(Inactive),
    /// Drives are on. Servo commands are followed.
    Enabled(Motion),
    /// Drives are on and hold. Servo commands are refused.
    Paused,
    /// Something failed.
    Fault(Failure),
}

/// What goes on in DISABLED.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) enum Inactive {
    /// Nothing: drives are off, starting or lost.
    Idle,
    /// Drives are being enabled, each on its own position.
    Enabling {
        /// Since when.
        since: Nanos,
    },
    /// Drives are looking for their zero.
    Homing {
        /// Since when.
        since: Nanos,
    },
    /// The set-points slow down, because the robot shall be off.
    Stopping {
        /// Since when.
        since: Nanos,
    },
    /// The set-points stand; the motors come to rest before the power goes.
    Settling {
        /// Since when.
        since: Nanos,
    },
    /// Drives are being switched off.
    PoweringOff {
        /// Since when.
        since: Nanos,
    },
}

/// What goes on in ENABLED.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) enum Motion {
    /// The set-points slow down and stand: no fresh command.
    Holding,
    /// The set-points follow a commander.
    Following(Follow),
    /// The set-points go through a decaying stroke. Servo commands are refused.
    Conditioning(Stroke),
    /// The set-points go to a pose. Servo commands are refused.
    Moving(Way),
}

/// The command that is being followed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Follow {
    /// Who sent it.
    pub client_id: u64,
    /// Its number.
    pub sequence: u64,
    /// When it was sent.
    pub stamp: Nanos,
    /// The age at which it is stale.
    pub deadline: Nanos,
    /// What it asks, and where that is heading.
    pub course: Course,
}

/// A way from rest to rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Way {
    /// Where it begins, rad.
    pub from: OutputVec,
    /// Where it ends, rad.
    pub to: OutputVec,
    /// The pose that was asked for could not be reached, so it ends where the motors do.
    pub clipped: bool,
    /// How it goes.
    pub profile: Profile,
    /// When it began.
    pub begun: Nanos,
}

impl Way {
    /// Where it has come to, rad.
    pub fn at(&self, now: Nanos) -> OutputVec {
        let share = self.profile.share(now.since(self.begun).as_seconds());
        let mut place = self.from;
        place.iter_mut().zip(self.to).for_each(|(place, to)| {
            *place = if share >= 1.0 {
                to
            } else {
                *place + share * (to - *place)
            }
        });
        place
    }

    /// It has ended.
    pub fn is_over(&self, now: Nanos) -> bool {
        now.since(self.begun).as_seconds() >= self.profile.duration_s()
    }
}

/// What a commander asks, and where that is heading.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) enum Course {
    /// Angles, rad.
    Joint(Trend<MAX_OUTPUTS>),
    /// Encoder positions, counts.
    Actuator(Trend<MAX_MOTORS>),
}

impl Course {
    /// It is given in joint space.
    pub fn is_joint(&self) -> bool {
        matches!(self, Self::Joint(_))
    }
}

/// What failed and what is done about it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Failure {
    /// The first thing that failed.
    pub cause: Fault,
    /// What is done about it.
    pub stage: Stage,
}

/// How far a fault has come.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) enum Stage {
    /// Waiting for the operator.
    Latched {
        /// Since when.
        since: Nanos,
        /// What every drive shall do meanwhile.
        demands: [Demand; MAX_MOTORS],
    },
    /// The operator has seen it; drives are being reset.
    Resetting {
        /// Since when.
        since: Nanos,
    },
}

impl State {
    /// The state as the world knows it.
    pub fn operating(&self) -> OperatingState {
        match self {
            Self::Disabled(_) => OperatingState::Disabled,
            Self::Enabled(_) => OperatingState::Enabled,
            Self::Paused => OperatingState::Paused,
            Self::Fault(_) => OperatingState::Fault,
        }
    }

    /// What the drives ought to be doing.
    pub fn expected(&self) -> Expected {
        match self {
            Self::Disabled(Inactive::Idle | Inactive::PoweringOff { .. }) | Self::Fault(_) => {
                Expected::Off
            }
            Self::Disabled(Inactive::Enabling { .. } | Inactive::Homing { .. }) => {
                Expected::Changing
            }
            Self::Disabled(Inactive::Stopping { .. } | Inactive::Settling { .. })
            | Self::Enabled(_)
            | Self::Paused => Expected::On,
        }
    }

    /// What the drives are told.
    pub fn demands(&self) -> [Demand; MAX_MOTORS] {
        match self {
            Self::Disabled(
                Inactive::Idle | Inactive::Homing { .. } | Inactive::PoweringOff { .. },
            ) => [Demand::Disabled; MAX_MOTORS],
            Self::Disabled(
                Inactive::Enabling { .. } | Inactive::Stopping { .. } | Inactive::Settling { .. },
            )
            | Self::Enabled(_)
            | Self::Paused => [Demand::Enabled; MAX_MOTORS],
            Self::Fault(Failure {
                stage: Stage::Latched { demands, .. },
                ..
            }) => *demands,
            Self::Fault(Failure {
                stage: Stage::Resetting { .. },
                ..
            }) => [Demand::Disabled; MAX_MOTORS],
        }
    }

    /// A change is under way.
    pub fn busy(&self, at_rest: bool) -> bool {
        match self {
            Self::Disabled(Inactive::Idle)
            | Self::Enabled(Motion::Holding | Motion::Following(_)) => false,
            Self::Enabled(Motion::Conditioning(_) | Motion::Moving(_)) => true,
            Self::Paused => !at_rest,
            Self::Disabled(_) => true,
            Self::Fault(failure) => matches!(failure.stage, Stage::Resetting { .. }),
        }
    }

    /// Drives are on and nothing is followed.
    pub fn holding(&self) -> bool {
        matches!(self, Self::Enabled(Motion::Holding) | Self::Paused)
    }

    /// The command that is being followed.
    pub fn following(&self) -> Option<&Follow> {
        match self {
            Self::Enabled(Motion::Following(follow)) => Some(follow),
            Self::Disabled(_) | Self::Enabled(_) | Self::Paused | Self::Fault(_) => None,
        }
    }

    /// A stroke is under way.
    pub fn conditioning(&self) -> bool {
        matches!(self, Self::Enabled(Motion::Conditioning(_)))
    }

    /// The robot moves by itself: a stroke, or a way to a pose.
    pub fn occupied(&self) -> bool {
        matches!(
            self,
            Self::Enabled(Motion::Conditioning(_) | Motion::Moving(_))
        )
    }

    /// Angles are led somewhere.
    pub fn in_joint_space(&self) -> bool {
        matches!(self, Self::Enabled(Motion::Moving(_)))
            || self
                .following()
                .is_some_and(|follow| follow.course.is_joint())
    }
}

/// Why the state changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Cause {
    /// A command was accepted.
    Command(StateCommand),
    /// What a command began goes on or has ended.
    Progress(Option<StateCommand>),
    /// Something failed.
    Fault(Fault),
    /// The process has been asked to end.
    Shutdown,
}

impl Cause {
    fn command(self) -> Option<StateCommand> {
        match self {
            Self::Command(command) => Some(command),
            Self::Progress(command) => command,
            Self::Fault(_) | Self::Shutdown => None,
        }
    }
}

/// The state, since when, and the last fault.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Machine {
    state: State,
    since: Nanos,
    fault: Fault,
}

impl Machine {
    /// DISABLED. What the drives do, whoever left them so, shows when they report.
    pub fn new() -> Self {
        Self {
            state: State::Disabled(Inactive::Idle),
            since: Nanos::ZERO,
            fault: Fault::None,
        }
    }

    /// The first tick.
    pub fn begin(&mut self, now: Nanos) {
        self.since = now;
    }

    /// The state.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// When the present operating state began.
    pub fn since(&self) -> Nanos {
        self.since
    }

    /// The present fault, or the last one.
    pub fn fault(&self) -> Fault {
        self.fault
    }

    /// The one place where the state changes. Every change that the world can see, every command
    /// that began something and every fault is an event; steps in between are not.
    pub fn change(&mut self, to: State, cause: Cause, now: Nanos, events: &mut Events) {
        let (before, after) = (self.state.operating(), to.operating());
        let fault = if let Cause::Fault(fault) = cause {
            fault
        } else {
            Fault::None
        };
        if before != after {
            self.since = now;
        }
        if fault != Fault::None {
            self.fault = fault;
        }
        if before != after || matches!(cause, Cause::Command(_) | Cause::Fault(_)) {
            events.push(EventKind::State {
                from: before,
                to: after,
                command: cause.command(),
                fault,
            });
        }
        self.state = to;
    }
}
