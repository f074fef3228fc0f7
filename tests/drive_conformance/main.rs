//! The drive layer against drives, in real time: the same cases for every family, framing and
//! topology.
//!
//! The emulator has a frame codec and a state machine of its own, written from the same reference.
//! With a configuration of real drives named in `I2RIS_HARDWARE`, the cases that a real drive bears
//! run there too: the motors move by a few counts.
//!
//! The table: `cargo test --test drive_conformance -- --ignored --nocapture table`.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test may")]

mod bad_input;
mod bench;
mod cases;
mod emulated;
mod hardware;
mod running;
mod table;

use bench::{Bench, SETUPS};

/// A module of tests for every setup, with a test for every case.
macro_rules! conformance {
    ($($setup:ident = $place:literal),* $(,)?) => {$(
        mod $setup {
            use super::*;
            conformance!(@cases $place: identified, swapped, enabled, followed, limited, faulted, homed, homed_at_stop, quick_stopped,
                restarted, lost, hung_up, ended);
        }
    )*};
    (@cases $place:literal: $($case:ident),*) => {$(
        #[test]
        fn $case() {
            cases::$case(&Bench::emulated(&SETUPS[$place]));
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
