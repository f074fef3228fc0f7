//! The vocabulary of the robot: states, commands, refusals, faults, and the reasons shown to
//! people. Core, process, shared memory and clients use this module. It depends on none of them.

mod axis_phase;
mod drive_fingerprint;
mod masked_client_id;
mod measurement;
mod numbered_enum;
mod operating_state;
mod reason;
mod refusal;
mod requests;

pub use axis_phase::{AxisPhase, DrivePower, KnownPower};
pub use drive_fingerprint::DriveFingerprint;
pub use masked_client_id::MaskedClientId;
pub use measurement::{Measurement, Quantity};
pub use operating_state::{Clip, Fault, OperatingState, Stop};
pub use reason::{Cause, Reason};
pub use refusal::{REFUSED_CLIENTS, Refusal};
pub use requests::{FixtureAction, FixtureKind, ModelAction, ModelId, StateCommand};
