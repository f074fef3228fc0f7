//! The matrix of setups and cases.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::thread;

use super::cases::ALL;
use super::test_bench::{SETUPS, Setup, TestBench};

/// Runs every case on every setup and prints the results. The setups run in parallel.
#[test]
#[ignore = "prints the matrix; the single tests report more"]
fn matrix() {
    let columns: Vec<Vec<bool>> = thread::scope(|scope| {
        let threads: Vec<_> = SETUPS.iter().map(|setup| scope.spawn(|| column(setup))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
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
    ALL.iter()
        .map(|(_, case)| {
            catch_unwind(AssertUnwindSafe(|| case(&TestBench::emulated(setup)))).is_ok()
        })
        .collect()
}
