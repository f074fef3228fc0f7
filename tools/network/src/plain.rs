//! Payloads as bytes.

use std::mem::{MaybeUninit, size_of};
use std::slice;

use i2ris::ipc::payload::{
    ActuatorState, BlackBoxReply, BlackBoxRequest, ExternalPosition, JointState, ModelReply,
    ModelRequest, MoveRequest, OperatingStateMsg, PeriodStatistics, ServoActuator, ServoJp,
    StateCommandReply, StateCommandRequest, Version,
};

/// A payload that is nothing but its bytes.
///
/// # Safety
///
/// The type is `repr(C)`, without hidden padding, of numbers and arrays of numbers only, so that
/// all its bytes are initialised and any bytes of its size are a value. That is the rule of
/// `i2ris::ipc::payload`.
pub(crate) unsafe trait Plain: Copy {
    /// The bytes.
    fn bytes(&self) -> &[u8] {
        // SAFETY: every byte of `self` is initialised, by the promise of the trait, and lives as
        // long as `self`.
        unsafe { slice::from_raw_parts(std::ptr::from_ref(self).cast(), size_of::<Self>()) }
    }

    /// The value of exactly these bytes.
    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        if bytes.len() != size_of::<Self>() {
            return None;
        }
        let mut value = MaybeUninit::<Self>::uninit();
        // SAFETY: source and target have this many bytes and do not overlap; any bytes are a value,
        // by the promise of the trait.
        unsafe {
            std::ptr::copy_nonoverlapping(bytes.as_ptr(), value.as_mut_ptr().cast(), bytes.len());
            Some(value.assume_init())
        }
    }
}

macro_rules! plain {
    ($($name:ident),*) => {
        $(
            // SAFETY: a payload; see there.
            unsafe impl Plain for $name {}
        )*
    };
}

plain!(
    ActuatorState,
    BlackBoxReply,
    BlackBoxRequest,
    ExternalPosition,
    JointState,
    ModelReply,
    ModelRequest,
    MoveRequest,
    OperatingStateMsg,
    PeriodStatistics,
    ServoActuator,
    ServoJp,
    StateCommandReply,
    StateCommandRequest,
    Version
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_become_the_same_value_again() {
        let command = ServoJp {
            sequence: 1,
            position: [0.5, -0.25, 0.0],
            count: 2,
            ..ServoJp::default()
        };
        assert_eq!(ServoJp::from_bytes(command.bytes()), Some(command));
        assert_eq!(ServoJp::from_bytes(&command.bytes()[1..]), None);
    }
}
