//! The drive layer against drives, in real time: the same cases for every family, framing and
//! topology.
//!
//! The emulator has its own frame codec and state machine, written from the same reference. With a
//! configuration of real drives named in `I2RIS_HARDWARE`, the cases that a real drive tolerates
//! run there too: the motors move by a few counts.

mod bad_input;
mod cases;
mod emulated;
mod hardware;
mod matrix;
mod running_axis;
mod test_bench;

use test_bench::{SETUPS, TestBench};

/// A module of tests for every setup, with a test for every case.
macro_rules! conformance {
    ($($setup:ident = $index:literal),* $(,)?) => {$(
        mod $setup {
            use super::*;
            conformance!(@cases $index: identified, swapped, enabled, followed, limited, faulted,
                homed, homed_at_stop, quick_stopped, restarted, lost, hung_up, ended);
        }
    )*};
    (@cases $index:literal: $($case:ident),*) => {$(
        #[test]
        fn $case() {
            cases::$case(&TestBench::emulated(&SETUPS[$index]));
        }
    )*};
}

conformance! {
    epos4 = 0,
    epos4_profile = 1,
    epos4_gateway = 2,
    epos2_usb = 3,
    epos2_rs232 = 4,
    epos2_usb_gateway = 5,
    epos2_rs232_gateway = 6,
    epos2_behind_epos4 = 7,
}
