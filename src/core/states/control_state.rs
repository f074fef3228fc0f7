//! The states of the cycle.
//!
//! Deciding and changing are apart: the transitions compute the next state and have no effects;
//! [`StateMachine`](super::state_machine::StateMachine) changes the state.
//!
//! # Diagram
//!
//! ```text
//!                            enable                   all drives enabled
//!             +--- DISABLED -------> DISABLED (enabling) ------------> ENABLED <---------+
//!        home |     ^    ^                   | disable                 |    | pause      | resume
//!             v     |    |                   v                 disable |    v            |
//!   DISABLED (homing)    +------ DISABLED (powering off) <--+          |  PAUSED --------+
//!                                            ^              |          v    | disable
//!                                acknowledge |              +-- DISABLED (stopping, settling)
//!                                          FAULT <--- any state, when a fault is detected
//! ```
//!
//! A state in parentheses is reported as DISABLED and busy. ENABLED is reported only while every
//! drive is on and none has the demand to switch off.
//!
//! # Commands
//!
//! | command | DISABLED | DISABLED, busy | ENABLED | PAUSED | FAULT | FAULT, busy |
//! |---|---|---|---|---|---|---|
//! | `enable` | enabling (1) | Busy (9) | no change | State | State | State |
//! | `disable` | no change | powering off (2) | stopping | stopping | drives off | no change |
//! | `pause` | State | Busy | PAUSED | no change | State | State |
//! | `resume` | State | Busy | no change | ENABLED, holding | State | State |
//! | `home` | homing (3) | Busy | State | State | State | State |
//! | `unhome` | zero invalid | Busy | State | State | State | State |
//! | `condition` | State | Busy | conditioning cycle, busy (6) | State | State | State |
//! | `acknowledge` | State | State | State | State | (4) | Busy |
//! | `hold` | State | powering off (2) | holding (10) | no change (10) | State | State |
//! | `move` | State | Busy | trajectory, busy (7) | State | State | State |
//! | `release` | (5) | (5) | (5), holding | (5) | (5) | (5) |
//! | `fixture` | (8) | (8) | (8) | (8) | (8) | (8) |
//!
//! Busy and other words with a capital are [`Refusal`](crate::robot::Refusal)s. State is one of
//! NotEnabled, Paused, InFault, NotDisabled and NoFault: each has its own way out. A client id of 0
//! is refused as Malformed. During shutdown, commands that would start something are refused with
//! WrongState. Who may give a command while another client commands or holds is in
//! `command/authority.rs`: Lease and StreamInterrupted come after the others. `disable` from a
//! client with an id is never refused, in any state, and may be repeated; the same applies to
//! `pause` and `hold` of a robot that is on.
//!
//! 1. DrivesNotReady unless every drive is in phase Disabled with a fresh position. NotHomed unless
//!    every axis has a valid zero: without it, position limits mean nothing, here and in the drive.
//!    Range if a motor is outside its position limits, because a drive clamps its target to them.
//! 2. No change from stopping, settling and powering off: it is in progress. FAULT stays until it
//!    is acknowledged, and the reply says FAULT.
//! 3. DrivesNotReady as for `enable`. The drive does the homing itself: a counter is raised, and
//!    the drive answers with it. Fixture if a drive would search for a hard stop while fixtures
//!    count.
//! 4. InFault if it was sent before the fault: its client cannot have seen it. CausePersists unless
//!    every drive reports a fresh position and is off, at fault or in quick stop, and the model
//!    gives finite values. If a drive is at fault, its reset counter is raised and FAULT stays,
//!    busy, until the drive has left its fault. After 1 s the fault is latched again. Then
//!    DISABLED, powering off.
//! 5. The lease becomes free and the client's activity ends: the robot holds, or ends the homing.
//! 6. Conditioning during a cycle, Busy during a trajectory; NotHomed and DrivesNotReady as for
//!    servo commands; Range if the position limits leave less room than the model needs to forget,
//!    or the joint limits less than it crosses. The robot stops following the present command.
//!    Servo commands are refused with Conditioning until the cycle has ended, where it began, and
//!    the robot holds. `pause`, `disable`, a fault, positions that are not fresh and a lost zero
//!    end it at once, and so do new fixtures. Setpoints stuck at a limit for a second also end it,
//!    as they end a stream.
//! 7. By the request `move_jp`. Refused in this order: Conditioning, NotHomed and DrivesNotReady as
//!    for (6), Lease and StreamInterrupted, Malformed without a pose, NoModel, Malformed with a
//!    wrong number of entries, Unsupported for a model of the tip position, NotFinite, Busy while a
//!    setpoint moves, OutOfReach for a pose outside the hull, the position limits or the joint
//!    limits, Fixture, Range. A second move of the same client replaces the first, which comes to
//!    rest before. Otherwise as (6): servo commands are refused with Busy during the move, and the
//!    same events end it, new fixtures if they are in its way. A timeout is not needed: the
//!    trajectory ends at rest after a time known at its start, at most `MAX_MOVE_TIME` (Range for
//!    a longer one), and a client that dies after its request has nothing left to confirm. `hold`,
//!    `pause` and `disable` of any client end it.
//! 8. By the request `virtual_fixture`. Malformed without a change. Switching on and adding is
//!    allowed at any time: it makes motion less. Switching off and removing: Busy while a goal in
//!    joint space is followed. Range when there is no place for one more. While fixtures count,
//!    servo commands in counts and `condition` are refused with Fixture, and `move` if its line
//!    meets one.
//! 9. While the drives are powering off, `enable` is executed as soon as they are off, under the
//!    same conditions. `disable` cancels it.
//! 10. It ends every activity of every client and the lease of other clients. Their requests are
//!     then refused with StreamInterrupted until they have been silent for a second.
//!
//! Servo commands need a session, which begins by something deliberate and ends whenever the robot
//! leaves ENABLED or is held: `command/sessions.rs`. A request that may move or power is refused
//! with Stale when it is older than its client waits for the reply.

use serde::{Deserialize, Serialize};

use crate::core::command::client_stream::FollowedCommand;
use crate::core::drive_status::{DriveSummary, ExpectedPower};
use crate::core::motion::conditioning::ConditioningCycle;
use crate::core::motion::joint_trajectory::JointTrajectory;
use crate::drive::{AxisPhase, Demand};
use crate::robot::{Fault, OperatingState, Refusal, StateCommand};
use crate::units::{MAX_AXES, Nanos};

pub(crate) const HOLDING: ControlState = ControlState::Enabled(EnabledActivity::Holding);

pub(crate) const ALL_OFF: [Demand; MAX_AXES] = [Demand::Disabled; MAX_AXES];

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "no heap in the control loop")]
pub(crate) enum ControlState {
    /// Drives are off, or changing from or to off. Servo commands are refused.
    Disabled(DisabledActivity),
    /// Drives are on. Servo commands are followed.
    Enabled(EnabledActivity),
    /// Drives are on and hold. Servo commands are refused.
    Paused,
    Fault(FaultState),
}

/// Activity in DISABLED. `since`: when it began. `then_enable`: `enable` was requested in between
/// and is executed when the drives are off.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) enum DisabledActivity {
    /// None: drives are off, starting or lost.
    Idle,
    /// Drives are being enabled, each at its own position.
    Enabling { since: Nanos },
    /// Drives search for their zero.
    Homing { since: Nanos, client_id: u64 },
    /// The setpoints slow down before power goes off.
    Stopping { since: Nanos, then_enable: bool },
    /// The setpoints are at rest; the motors come to rest before power goes off.
    Settling { since: Nanos, then_enable: bool },
    /// Drives are being switched off.
    PoweringOff { since: Nanos, then_enable: bool },
}

impl DisabledActivity {
    pub(crate) fn powering_off(since: Nanos) -> Self {
        Self::PoweringOff { since, then_enable: false }
    }

    /// The same activity with a new `then_enable`; `None` unless the drives are powering off.
    pub(crate) fn then(mut self, enable: bool) -> Option<Self> {
        match &mut self {
            Self::Stopping { then_enable, .. }
            | Self::Settling { then_enable, .. }
            | Self::PoweringOff { then_enable, .. } => *then_enable = enable,
            Self::Idle | Self::Enabling { .. } | Self::Homing { .. } => return None,
        }
        Some(self)
    }
}

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
    /// Waits for the operator. `demands`: demands to the drives while waiting.
    Latched { since: Nanos, demands: [Demand; MAX_AXES] },
    /// The operator has acknowledged the fault; drives are being reset.
    Resetting { since: Nanos },
}

impl ControlState {
    pub(crate) fn operating_state(&self) -> OperatingState {
        match self {
            Self::Disabled(_) => OperatingState::Disabled,
            Self::Enabled(_) => OperatingState::Enabled,
            Self::Paused => OperatingState::Paused,
            Self::Fault(_) => OperatingState::Fault,
        }
    }

    pub(crate) fn expected_power(&self) -> ExpectedPower {
        use DisabledActivity::{Enabling, Homing, Idle, PoweringOff, Settling, Stopping};
        match self {
            Self::Disabled(Idle | PoweringOff { .. }) | Self::Fault(_) => ExpectedPower::Off,
            Self::Disabled(Enabling { .. } | Homing { .. }) => ExpectedPower::Changing,
            Self::Disabled(Stopping { .. } | Settling { .. }) | Self::Enabled(_) | Self::Paused => {
                ExpectedPower::On
            }
        }
    }

    /// A drive is homed under the demand to be off, so only a quick stop ends a homing that is
    /// not, or no longer, requested.
    pub(crate) fn demands(&self, summary: &DriveSummary) -> [Demand; MAX_AXES] {
        use DisabledActivity::{Enabling, Homing, Idle, PoweringOff, Settling, Stopping};
        let mut demands = match self {
            Self::Disabled(Idle | Homing { .. } | PoweringOff { .. }) => ALL_OFF,
            Self::Disabled(Enabling { .. } | Stopping { .. } | Settling { .. })
            | Self::Enabled(_)
            | Self::Paused => [Demand::Enabled; MAX_AXES],
            Self::Fault(fault) => match fault.stage {
                FaultStage::Latched { demands, .. } => demands,
                FaultStage::Resetting { .. } => ALL_OFF,
            },
        };
        for (demand, drive) in demands.iter_mut().zip(&summary.axes) {
            if !self.is_homing() && drive.is_some_and(|it| it.phase == AxisPhase::Homing) {
                *demand = Demand::QuickStop;
            }
        }
        demands
    }

    /// A change of state, a conditioning cycle or a trajectory is in progress.
    pub(crate) fn is_busy(&self, is_at_rest: bool) -> bool {
        match self {
            Self::Disabled(activity) => *activity != DisabledActivity::Idle,
            Self::Enabled(_) => self.is_occupied(),
            Self::Paused => !is_at_rest,
            Self::Fault(fault) => matches!(fault.stage, FaultStage::Resetting { .. }),
        }
    }

    /// The command whose interruptible activity is in progress.
    pub(crate) fn activity(&self) -> Option<StateCommand> {
        match self {
            Self::Disabled(DisabledActivity::Enabling { .. }) => Some(StateCommand::Enable),
            Self::Disabled(DisabledActivity::Homing { .. }) => Some(StateCommand::Home),
            Self::Enabled(EnabledActivity::Conditioning(_)) => Some(StateCommand::Condition),
            Self::Enabled(EnabledActivity::Moving(_)) => Some(StateCommand::Move),
            Self::Disabled(_) | Self::Enabled(_) | Self::Paused | Self::Fault(_) => None,
        }
    }

    /// Drives are on and nothing is followed.
    pub(crate) fn is_holding(&self) -> bool {
        matches!(self, Self::Enabled(EnabledActivity::Holding) | Self::Paused)
    }

    pub(crate) fn followed_command(&self) -> Option<&FollowedCommand> {
        match self {
            Self::Enabled(EnabledActivity::Following(command)) => Some(command),
            Self::Disabled(_) | Self::Enabled(_) | Self::Paused | Self::Fault(_) => None,
        }
    }

    pub(crate) fn is_homing(&self) -> bool {
        matches!(self, Self::Disabled(DisabledActivity::Homing { .. }))
    }

    pub(crate) fn is_conditioning(&self) -> bool {
        matches!(self, Self::Enabled(EnabledActivity::Conditioning(_)))
    }

    /// The client that is followed, or whose activity is in progress.
    pub(crate) fn owner(&self) -> Option<u64> {
        match self {
            Self::Disabled(DisabledActivity::Homing { client_id, .. }) => Some(*client_id),
            Self::Enabled(EnabledActivity::Following(command)) => Some(command.client_id),
            Self::Enabled(EnabledActivity::Conditioning(cycle)) => Some(cycle.client_id),
            Self::Enabled(EnabledActivity::Moving(trajectory)) => Some(trajectory.client_id),
            Self::Enabled(EnabledActivity::Holding)
            | Self::Disabled(_)
            | Self::Paused
            | Self::Fault(_) => None,
        }
    }

    pub(crate) fn trajectory(&self) -> Option<&JointTrajectory> {
        match self {
            Self::Enabled(EnabledActivity::Moving(trajectory)) => Some(trajectory),
            Self::Disabled(_) | Self::Enabled(_) | Self::Paused | Self::Fault(_) => None,
        }
    }

    fn is_moving(&self) -> bool {
        self.trajectory().is_some()
    }

    /// A conditioning cycle or a trajectory is in progress.
    pub(crate) fn is_occupied(&self) -> bool {
        self.is_conditioning() || self.is_moving()
    }

    /// Refuses while a conditioning cycle or a trajectory is in progress.
    pub(crate) fn require_unoccupied(&self) -> Result<(), Refusal> {
        match self {
            Self::Enabled(EnabledActivity::Conditioning(_)) => Err(Refusal::Conditioning),
            _ if self.is_moving() => Err(Refusal::Busy),
            _ => Ok(()),
        }
    }

    /// A goal in joint space is followed.
    pub(crate) fn is_following_joints(&self) -> bool {
        self.is_moving() || self.followed_command().is_some_and(|command| command.goal.is_joint())
    }

    /// Allows what starts from DISABLED with no activity.
    pub(crate) fn require_idle(&self) -> Result<(), Refusal> {
        match self {
            Self::Disabled(DisabledActivity::Idle) => Ok(()),
            Self::Disabled(_) => Err(Refusal::Busy),
            Self::Enabled(_) | Self::Paused => Err(Refusal::NotDisabled),
            Self::Fault(_) => Err(Refusal::InFault),
        }
    }
}
