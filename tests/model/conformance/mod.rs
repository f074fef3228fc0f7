//! Promises of every model, whatever its family: the same cases for every row of the list in
//! `i2ris_testing::families`. Where families differ, their [`Promise`] says how.
//!
//! [`Promise`]: i2ris_testing::families::Promise

mod cases;
mod memories;
mod refusals;
mod situation;

use super::*;

/// A module of tests for a row, with a test for each case.
macro_rules! conformance {
    ($($row:ident = $family:ident;)*) => {
        $(mod $row {
            use super::*;

            #[test]
            fn is_a_row_of_its_family() {
                let sample = families::$row();
                assert!(matches!(sample.file.family, FamilyParameters::$family { .. }));
                let model = sample.model();
                assert_eq!((model.motors(), model.outputs()), (2, 2));
            }

            tests! { $row, cases: slopes, rises, inverse, stays, any_goal, beyond, compensation,
                shared_work, covariances, not_a_number }
            tests! { $row, memories: the_past, forgets, bounded, same_bits, tick, still, steps,
                recall, gap_scale }
            tests! { $row, refusals: numbers, parameters }
        })*
    };
}

macro_rules! tests {
    ($row:ident, $of:ident: $($case:ident),*) => {
        $(#[test]
        fn $case() {
            $of::$case(&families::$row());
        })*
    };
}

i2ris_testing::for_each_family!(conformance);
