//! Requests and replies, except those about models.

use iceoryx2::prelude::ZeroCopySend;

use super::definition::{Payload, payload, unpadded_text};
use super::reason;
use crate::robot::{Measurement, OperatingState, Refusal, StateCommand};
use crate::units::{MAX_MOTORS, MAX_OUTPUTS, Nanos};

payload! {
    /// `state_command`, request.
    StateCommandRequest "I2risStateCommandV2": dated {
        /// [`crate::robot::StateCommand`].
        pub command: u32,
        /// 0.
        pub reserved: u32,
    }

    /// `state_command`, reply, within a few ticks. Longer operations continue after it: see
    /// [`BUSY`](super::OperatingStateMsg::BUSY).
    StateCommandReply "I2risStateCommandReplyV2" {
        /// [`crate::robot::Refusal`]; 0: accepted.
        pub refusal: u32,
        /// [`crate::robot::OperatingState`] after the command.
        pub state: u32,
        /// Measured value at the refusal, see [`ReasonMsg`](super::ReasonMsg).
        pub measured: f64,
        /// The limit that it broke.
        pub limit: f64,
        /// [`crate::robot::Quantity`] of `measured` and `limit`.
        pub quantity: u32,
        /// Index of the motor.
        pub motor: u32,
        /// Flags of [`ReasonMsg`](super::ReasonMsg).
        pub flags: u32,
        /// 0.
        pub reserved: u32,
    }

    /// `move_jp`, and `move_cp` by its flag, request: go to a pose, from rest to rest with limited
    /// jerk. The reply is [`StateCommandReply`].
    MoveRequest "I2risMoveRequestV2": dated {
        /// Desired pitch and yaw, rad; a place of the tip, m, with [`MoveRequest::TIP`].
        pub position: [f64; MAX_OUTPUTS],
        /// Number of valid entries in `position`.
        pub count: u32,
        /// 0 or [`MoveRequest::TIP`].
        pub flags: u32,
    }

    /// `version`, request.
    VersionRequest "I2risVersionRequestV1" {
        /// 0.
        pub reserved: u64,
    }

    /// `version`, reply: identity of this domain's controller.
    Version "I2risVersionV2" {
        /// Identifies this start of the controller.
        pub boot_id: u64,
        /// Process id of the controller.
        pub pid: u32,
        /// Version of the payloads: `INTERFACE_VERSION`.
        pub interface: u32,
        /// Version of the software: major, minor, patch.
        pub software: [u16; 3],
        /// Motors and outputs (0 without a model).
        pub shape: [u8; 2],
        /// SHA-256 of the loaded model; all 0: none.
        pub model_id: [u8; 32],
        /// Names of the outputs, UTF-8, padded with 0.
        pub output_names: [[u8; 16]; MAX_OUTPUTS],
        /// Velocity limit of the motors, counts per second.
        pub velocity_counts_s: f64,
        /// Acceleration limit of the motors, counts per second squared.
        pub acceleration_counts_s2: f64,
        /// Lowest positions of the motors, counts.
        pub position_min_counts: [i32; MAX_MOTORS],
        /// Highest positions of the motors, counts.
        pub position_max_counts: [i32; MAX_MOTORS],
        /// `robot_id` of the configuration, UTF-8, padded with 0.
        pub robot_id: [u8; 64],
    }

    /// `black_box`, request: write a file with every tick of the last seconds.
    BlackBoxRequest "I2risBlackBoxRequestV1" {
        /// Identity of the client. Not 0.
        pub client_id: u64,
    }

    /// `black_box`, reply, once the file is written.
    BlackBoxReply "I2risBlackBoxReplyV1" {
        /// Number of ticks in the file; 0: no file was written.
        pub ticks: u64,
        /// Path of the file, or the reason of the failure; UTF-8, padded with 0.
        pub text: [u8; 1024],
    }
}

/// A request, with the time of its sending where it has one.
pub(in crate::ipc) trait Dated: Payload {
    /// Sets time of sending and validity where the sender has not.
    fn set_validity(&mut self, _now: Nanos, _span: Nanos) {}

    /// A place is kept for it.
    fn only_stops(&self) -> bool {
        false
    }
}

macro_rules! dated {
    ($($name:ident $($only_stops:ident)?),*) => {$(
        impl Dated for $name {
            fn set_validity(&mut self, now: Nanos, span: Nanos) {
                if self.stamp_ns == 0 {
                    (self.stamp_ns, self.valid_ns) = (now.0, span.0);
                }
            }

            $(fn only_stops(&self) -> bool {
                StateCommand::from_number(self.command).is_some_and(StateCommand::$only_stops)
            })?
        }
    )*};
}

dated! { StateCommandRequest only_stops, MoveRequest, VirtualFixtureRequest, ModelRequest }

impl Dated for BlackBoxRequest {}
impl Dated for VersionRequest {}

impl MoveRequest {
    /// Flag: `move_cp`: `position` is a tip position in the base frame of the snake. Refused if the
    /// tip cannot come within 0.1 mm of this position.
    pub const TIP: u32 = 1;
}

impl StateCommandReply {
    /// The reply to a command. `measurement`: what was measured, if it was refused.
    #[must_use]
    pub fn new(refusal: Refusal, state: OperatingState, measurement: Option<Measurement>) -> Self {
        let ([measured, limit], [quantity, motor, flags]) = reason::fields(measurement);
        let (refusal, state, reserved) = (refusal.number(), state.number(), 0);
        Self { refusal, state, measured, limit, quantity, motor, flags, reserved }
    }

    /// Measured value at the refusal, if known.
    #[must_use]
    pub fn measurement(&self) -> Option<Measurement> {
        let numbers = [self.quantity, self.motor, self.flags];
        reason::measurement([self.measured, self.limit], numbers)
    }
}

impl Version {
    /// How the robot of the controller differs from the one of a configuration, as a sentence;
    /// `None`: it does not. Only robot and limits of `named` count.
    #[must_use]
    pub fn robot_difference(&self, named: &Self) -> Option<String> {
        let (here, there) = (unpadded_text(&self.robot_id), unpadded_text(&named.robot_id));
        if here != there {
            return Some(format!("the controller moves robot `{here}`, not `{there}`"));
        }
        let positions = |of: &Self| (of.position_min_counts, of.position_max_counts);
        if positions(self) != positions(named) {
            return Some(format!(
                "the position limits of the controller are {:?} to {:?} counts, \
                 and not {:?} to {:?}",
                self.position_min_counts,
                self.position_max_counts,
                named.position_min_counts,
                named.position_max_counts
            ));
        }
        let rates = |of: &Self| (of.velocity_counts_s, of.acceleration_counts_s2);
        (rates(self) != rates(named)).then(|| {
            format!(
                "the controller allows {} counts/s and {} counts/s^2, not {} and {}",
                self.velocity_counts_s,
                self.acceleration_counts_s2,
                named.velocity_counts_s,
                named.acceleration_counts_s2
            )
        })
    }
}

payload! {
    /// `virtual_fixture`, request. The reply is [`super::StateCommandReply`].
    VirtualFixtureRequest "I2risVirtualFixtureRequestV2": dated {
        /// [`crate::robot::FixtureAction`].
        pub action: u32,
        /// [`crate::robot::FixtureKind`] of the region to add; otherwise 0.
        pub kind: u32,
        /// The values of the region to add, rad or m; otherwise 0.
        pub values: [f64; 4],
    }
}

payload! {
    /// `model`, request. The reply takes one or two ticks; for `stage` it can take seconds.
    ModelRequest "I2risModelRequestV2": dated {
        /// [`crate::robot::ModelAction`].
        pub action: u32,
        /// Sum of [`ModelRequest::FORCE`] and [`ModelRequest::OTHER_DRIVE`].
        pub flags: u32,
        /// `activate`: SHA-256 of the staged model.
        pub model_id: [u8; 32],
        /// `stage`: absolute path of the model file as the controller sees it, padded with 0.
        pub path: [u8; 1024],
    }

    /// A loaded model.
    ModelSlot "I2risModelSlotV1" {
        /// Root mean square error on the training data, per output, in degrees (millimetres).
        pub training_rms: [f64; MAX_OUTPUTS],
        /// The same on held-out data; 0 without held-out data.
        pub held_out_rms: [f64; MAX_OUTPUTS],
        /// SHA-256 of the model; all 0: the slot is empty.
        pub model_id: [u8; 32],
        /// Its family, UTF-8, padded with 0.
        pub family: [u8; 32],
        /// Last part of its file path, UTF-8, padded with 0.
        pub file: [u8; 120],
        /// Number of outputs.
        pub outputs: u32,
        /// Sum of [`ModelSlot::PRESENT`] and [`ModelSlot::MEMORY_KNOWN`].
        pub flags: u32,
    }

    /// Difference between the staged model and the model in use.
    ModelDifference "I2risModelDifferenceV1" {
        /// Motor motion that keeps the angles at the estimate of the model in use, here, counts.
        pub present_counts: [f64; MAX_MOTORS],
        /// The largest such motion over the hull, counts.
        pub largest_counts: [f64; MAX_MOTORS],
        /// Motor position of that maximum, counts.
        pub largest_at_counts: [f64; MAX_MOTORS],
        /// Share of the active model's hull that the staged model cannot reach, 0 to 1.
        pub unreached: f64,
        /// 1: valid; 0: no model in use, or the outputs differ.
        pub valid: u32,
        /// 0.
        pub reserved: u32,
    }

    /// `model`, reply.
    ModelReply "I2risModelReplyV1" {
        /// [`crate::robot::Refusal`]; 0: accepted.
        pub refusal: u32,
        /// 0.
        pub reserved: u32,
        /// The models in use, staged and previously in use, after the request.
        pub slots: [ModelSlot; 3],
        /// `stage`: how the staged model differs from the one in use.
        pub difference: ModelDifference,
        /// Reason in words, if the number is not enough; UTF-8, padded with 0.
        pub message: [u8; 512],
    }
}

impl ModelRequest {
    /// Flag: proceed although the hysteresis memory of the model is unknown.
    pub const FORCE: u32 = 1;
    /// Flag: stage although the model was calibrated with other settings of the drives.
    pub const OTHER_DRIVE: u32 = 2;
}

impl ModelSlot {
    /// Flag: the slot holds a model.
    pub const PRESENT: u32 = 1;
    /// Flag: the hysteresis memory of the model is known.
    pub const MEMORY_KNOWN: u32 = 2;
}
