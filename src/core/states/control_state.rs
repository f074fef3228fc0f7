//! The states of the cycle.
//!
//! Deciding and changing are apart: the transitions compute the next state and have no effects;
//! [`StateMachine`](super::state_machine::StateMachine) changes the state.

use serde::{Deserialize, Serialize};

use crate::core::command::followed_command::FollowedCommand;
use crate::core::drive_status::ExpectedPower;
use crate::core::motion::conditioning::ConditioningCycle;
use crate::core::motion::joint_trajectory::JointTrajectory;
use crate::drive::Demand;
use crate::robot::{Fault, OperatingState, Refusal};
use crate::units::{MAX_MOTORS, Nanos};

/// ENABLED, and nothing is followed.
pub(crate) const HOLDING: ControlState = ControlState::Enabled(EnabledActivity::Holding);

/// Demands that switch every drive off.
pub(crate) const ALL_OFF: [Demand; MAX_MOTORS] = [Demand::Disabled; MAX_MOTORS];

/// State of the cycle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "no heap in the control loop")]
pub(crate) enum ControlState {
    /// Drives are off, or changing from or to off. Servo commands are refused.
    Disabled(DisabledActivity),
    /// Drives are on. Servo commands are followed.
    Enabled(EnabledActivity),
    /// Drives are on and hold. Servo commands are refused.
    Paused,
    /// A fault has occurred.
    Fault(FaultState),
}

/// Activity in DISABLED. `since`: when it began.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) enum DisabledActivity {
    /// None: drives are off, starting or lost.
    Idle,
    /// Drives are being enabled, each at its own position.
    Enabling { since: Nanos },
    /// Drives search for their zero.
    Homing { since: Nanos },
    /// The setpoints slow down before power goes off.
    Stopping { since: Nanos },
    /// The setpoints are at rest; the motors come to rest before power goes off.
    Settling { since: Nanos },
    /// Drives are being switched off.
    PoweringOff { since: Nanos },
}

/// Activity in ENABLED.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) enum EnabledActivity {
    /// The setpoints slow down and stay: there is no fresh command.
    Holding,
    /// The setpoints follow the commands of a client.
    Following(FollowedCommand),
    /// The setpoints run a conditioning cycle. Servo commands are refused.
    Conditioning(ConditioningCycle),
    /// The setpoints move to a pose. Servo commands are refused.
    Moving(JointTrajectory),
}

/// A fault and the reaction to it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct FaultState {
    /// The first fault.
    pub cause: Fault,
    pub stage: FaultStage,
}

/// Progress of the reaction to a fault. `since`: when the stage began.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) enum FaultStage {
    /// Waits for the operator. `demands`: to the drives meanwhile.
    Latched { since: Nanos, demands: [Demand; MAX_MOTORS] },
    /// The operator has acknowledged the fault; drives are being reset.
    Resetting { since: Nanos },
}

impl ControlState {
    pub fn operating_state(&self) -> OperatingState {
        match self {
            Self::Disabled(_) => OperatingState::Disabled,
            Self::Enabled(_) => OperatingState::Enabled,
            Self::Paused => OperatingState::Paused,
            Self::Fault(_) => OperatingState::Fault,
        }
    }

    pub fn expected_power(&self) -> ExpectedPower {
        use DisabledActivity::{Enabling, Homing, Idle, PoweringOff, Settling, Stopping};
        match self {
            Self::Disabled(Idle | PoweringOff { .. }) | Self::Fault(_) => ExpectedPower::Off,
            Self::Disabled(Enabling { .. } | Homing { .. }) => ExpectedPower::Changing,
            Self::Disabled(Stopping { .. } | Settling { .. }) | Self::Enabled(_) | Self::Paused => {
                ExpectedPower::On
            }
        }
    }

    /// Demands to the drives.
    pub fn demands(&self) -> [Demand; MAX_MOTORS] {
        use DisabledActivity::{Enabling, Homing, Idle, PoweringOff, Settling, Stopping};
        match self {
            Self::Disabled(Idle | Homing { .. } | PoweringOff { .. }) => ALL_OFF,
            Self::Disabled(Enabling { .. } | Stopping { .. } | Settling { .. })
            | Self::Enabled(_)
            | Self::Paused => [Demand::Enabled; MAX_MOTORS],
            Self::Fault(fault) => match fault.stage {
                FaultStage::Latched { demands, .. } => demands,
                FaultStage::Resetting { .. } => ALL_OFF,
            },
        }
    }

    /// A change of state, a conditioning cycle or a trajectory is in progress.
    pub fn is_busy(&self, is_at_rest: bool) -> bool {
        match self {
            Self::Disabled(activity) => *activity != DisabledActivity::Idle,
            Self::Enabled(_) => self.is_occupied(),
            Self::Paused => !is_at_rest,
            Self::Fault(fault) => matches!(fault.stage, FaultStage::Resetting { .. }),
        }
    }

    /// Drives are on and nothing is followed.
    pub fn is_holding(&self) -> bool {
        matches!(self, Self::Enabled(EnabledActivity::Holding) | Self::Paused)
    }

    pub fn followed_command(&self) -> Option<&FollowedCommand> {
        match self {
            Self::Enabled(EnabledActivity::Following(command)) => Some(command),
            Self::Disabled(_) | Self::Enabled(_) | Self::Paused | Self::Fault(_) => None,
        }
    }

    pub fn is_homing(&self) -> bool {
        matches!(self, Self::Disabled(DisabledActivity::Homing { .. }))
    }

    pub fn is_conditioning(&self) -> bool {
        matches!(self, Self::Enabled(EnabledActivity::Conditioning(_)))
    }

    fn is_moving(&self) -> bool {
        matches!(self, Self::Enabled(EnabledActivity::Moving(_)))
    }

    /// A conditioning cycle or a trajectory is in progress.
    pub fn is_occupied(&self) -> bool {
        self.is_conditioning() || self.is_moving()
    }

    /// Refuses while a conditioning cycle or a trajectory is in progress.
    pub fn require_unoccupied(&self) -> Result<(), Refusal> {
        match self {
            Self::Enabled(EnabledActivity::Conditioning(_)) => Err(Refusal::Conditioning),
            _ if self.is_moving() => Err(Refusal::Busy),
            _ => Ok(()),
        }
    }

    /// A goal in joint space is followed.
    pub fn is_following_joints(&self) -> bool {
        let followed = self.followed_command();
        self.is_moving() || followed.is_some_and(|command| command.goal.is_joint())
    }

    /// Allows what starts from DISABLED with no activity.
    pub fn require_idle(&self) -> Result<(), Refusal> {
        match self {
            Self::Disabled(DisabledActivity::Idle) => Ok(()),
            Self::Disabled(_) => Err(Refusal::Busy),
            Self::Enabled(_) | Self::Paused | Self::Fault(_) => Err(Refusal::State),
        }
    }
}
