//! Request and feedback of one axis: all that the control loop and a port thread exchange.

use serde::{Deserialize, Serialize};

use crate::drive::cia402::{DriveState, Statusword};
use crate::drive::link::LinkCounters;
use crate::robot::{AxisPhase, DrivePower};
use crate::units::{Counts, Nanos};

/// Request of the control loop to one drive. The newest request replaces earlier ones; there is no
/// queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct AxisRequest {
    /// Increases by one every tick.
    pub sequence: u64,
    /// The state that the drive is brought to and kept in.
    pub demand: Demand,
    /// The setpoint. Written only in [`Demand::Enabled`], after the drive was enabled at its own
    /// position.
    pub target: Counts,
    /// Increases by one for every fault reset that the operator acknowledged.
    pub fault_resets: u32,
    /// Increases by one for every homing that the operator requested.
    pub homings: u32,
    /// The operator has declared the zero invalid (`unhome`): no position is saved for the next
    /// start, which would trust it.
    pub zero_invalid: bool,
    /// Stamp of the command that set the target, to measure latency. Zero: none.
    pub command_stamp: Nanos,
    /// Sequence number of the command that set the target. Zero: none.
    pub command_sequence: u64,
}

/// The state that a drive is brought to. The safe default is [`Demand::Disabled`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Demand {
    /// Power stage off: operation disabled with a ramp, then shut down.
    #[default]
    Disabled,
    /// Operation enabled; the drive follows the target.
    Enabled,
    /// Quick-stop ramp, then powered and holding.
    QuickStop,
}

/// State of one drive according to the newest replies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct AxisFeedback {
    /// Increases by one with every position that was read.
    pub sequence: u64,
    /// When the reply with `position` arrived. Zero: never.
    pub stamp: Nanos,
    /// Encoder position (0x6064).
    pub position: Counts,
    pub phase: AxisPhase,
    /// The position refers to the home position (statusword bit 15), and is trusted.
    pub homed: bool,
    /// The last setpoint that was written and acknowledged.
    pub written: Option<WrittenTarget>,
    /// Statusword (0x6041) as read.
    pub statusword: u16,
    /// Error code (0x603F; EPOS2 0x1003:01, in a fault only) as read; 0 = none.
    pub error_code: u16,
    /// Motor current (0x30D1:02; EPOS2 0x6078), mA.
    pub current_ma: i32,
    /// When the reply with `current_ma` arrived. Zero: never.
    pub current_stamp: Nanos,
    /// The last fault reset that was carried out, as counted in [`AxisRequest::fault_resets`].
    pub fault_resets: u32,
    /// The last homing that ended, successful or not, as counted in [`AxisRequest::homings`].
    pub homings: u32,
    /// Lifetime counters of the line.
    pub counters: LinkCounters,
}

impl AxisFeedback {
    /// Known power of the drive. A drive that has not replied since `oldest` may have power.
    pub fn power(&self, oldest: Nanos) -> DrivePower {
        match self.phase.power() {
            _ if self.stamp < oldest => DrivePower::NotKnown,
            // It may still ramp down.
            DrivePower::Off if self.phase == AxisPhase::Faulted && !self.is_at_fault() => {
                DrivePower::On
            }
            power => power,
        }
    }

    fn is_at_fault(&self) -> bool {
        Statusword(self.statusword).state() == Some(DriveState::Fault)
    }
}

/// A setpoint that reached the drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct WrittenTarget {
    /// The setpoint.
    pub target: Counts,
    /// When the last byte of the request was handed to the operating system.
    pub stamp: Nanos,
    /// [`AxisRequest::sequence`] of the request that was written.
    pub sequence: u64,
    /// [`AxisRequest::command_stamp`] of that request.
    pub command_stamp: Nanos,
    /// [`AxisRequest::command_sequence`] of that request.
    pub command_sequence: u64,
}
