//! The drive layer against drives, in real time: the same cases for every family and
//! topology.
//!
//! The emulator has its own frame codec and state machine, written from the same reference. For
//! real drives `i2ris commission` checks the behaviour.

mod bad_input;
mod cases;
mod device_files;
mod emulated;
mod matrix;
mod running_axis;
mod test_bench;
mod unknowns;

pub use running_axis::RunningAxis;
use test_bench::{PATIENCE, SERIAL_NUMBERS, Setup};
pub use test_bench::{SETUPS, TestBench};

use super::*;

/// A module of tests for a setup, with a test for each case. The first and the most different setup
/// run all cases, the others some; `matrix` runs all cases on all setups.
macro_rules! conformance {
    ($setup:ident = $index:literal, all) => {
        conformance!($setup = $index: identified, swapped, enabled, followed, limited, faulted,
            homed, homed_at_stop, quick_stopped, restarted, lost, hung_up, ended);
    };
    ($setup:ident = $index:literal) => {
        conformance!($setup = $index: identified, enabled, faulted, lost);
    };
    ($setup:ident = $index:literal: $($case:ident),*) => {
        mod $setup {
            use super::*;
            $(#[test]
            fn $case() {
                cases::$case(&TestBench::emulated(&SETUPS[$index]));
            })*
        }
    };
}

conformance!(epos4 = 0, all);
conformance!(epos4_profile = 1);
conformance!(epos4_gateway = 2);
conformance!(epos2_usb = 3);
conformance!(epos2_usb_gateway = 4, all);
conformance!(epos2_behind_epos4 = 5);
conformance!(third_on_a_line = 6, all);
