//! The table of setups and cases.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::thread;

use super::bench::{Bench, SETUPS, Setup};
use super::cases::ALL;

/// Runs every case on every setup, and prints how it went. The setups run side by side.
#[test]
#[ignore = "prints the table; the single tests say more"]
fn table() {
    let columns: Vec<Vec<bool>> = thread::scope(|scope| {
        let threads: Vec<_> = SETUPS
            .iter()
            .map(|setup| scope.spawn(|| column(setup)))
            .collect();
        threads
            .into_iter()
            .map(|thread| thread.join().unwrap())
            .collect()
    });
    let names: Vec<&str> = SETUPS.iter().map(|setup| setup.name).collect();
    println!("| | {} |", names.join(" | "));
    println!("|---|{}", "---|".repeat(SETUPS.len()));
    for (row, (name, _)) in ALL.iter().enumerate() {
        let cells: Vec<&str> = columns
            .iter()
            .map(|column| if column[row] { "yes" } else { "NO" })
            .collect();
        println!("| {name} | {} |", cells.join(" | "));
    }
    assert!(
        columns.iter().flatten().all(|passed| *passed),
        "see the table"
    );
}

fn column(setup: &Setup) -> Vec<bool> {
    ALL.iter()
        .map(|(_, case)| catch_unwind(AssertUnwindSafe(|| case(&Bench::emulated(setup)))).is_ok())
        .collect()
}
