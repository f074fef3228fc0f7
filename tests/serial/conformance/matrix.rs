//! Every case on every setup, one after the other.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::cases::ALL;
use super::*;

/// Runs every case on every setup, one after the other, and prints the results.
#[test]
#[ignore = "minutes: for .ci/nightly"]
fn matrix() {
    let columns: Vec<Vec<bool>> = SETUPS.iter().map(column).collect();
    let names: Vec<&str> = SETUPS.iter().map(|setup| setup.name).collect();
    println!("| | {} |", names.join(" | "));
    println!("|---|{}", "---|".repeat(SETUPS.len()));
    for (row, (name, _)) in ALL.iter().enumerate() {
        let cells: Vec<&str> =
            columns.iter().map(|column| if column[row] { "yes" } else { "NO" }).collect();
        println!("| {name} | {} |", cells.join(" | "));
    }
    assert!(columns.iter().flatten().all(|passed| *passed), "see the matrix");
}

fn column(setup: &Setup) -> Vec<bool> {
    let passes = |case: fn(&TestBench)| {
        catch_unwind(AssertUnwindSafe(|| case(&TestBench::emulated(setup)))).is_ok()
    };
    ALL.iter().map(|(_, case)| passes(*case)).collect()
}
