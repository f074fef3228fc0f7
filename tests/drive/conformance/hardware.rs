//! Real drives: with a configuration named in `I2RIS_HARDWARE`, the motors move by 20 counts.

use std::env;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use i2ris::config::Config;
use i2ris::drive::{AxisPhase, Port, PortEventKind};
use i2ris::robot::DrivePower;

use super::cases::ALL;
use super::test_bench::{SETUPS, Setup, TestBench};

/// How far the motor moves, counts: a twentieth of a degree of the snake.
const DISTANCE: i32 = 20;

#[test]
fn real_drives_conform() {
    let Some(file) = env::var_os("I2RIS_HARDWARE") else {
        println!("no real drives: name a configuration in I2RIS_HARDWARE");
        return;
    };
    let bench = TestBench::real(Config::load(Path::new(&file)).unwrap());
    println!("identified: {:?}", bench.bring_up().unwrap().axes());
    let wrong = bench.port_with(|axis| axis.serial_number = axis.serial_number.wrapping_add(1));
    let refused = Port::open(&wrong).unwrap().bring_up().unwrap_err();
    println!("swap refused: {refused}");

    let mut axis = bench.run();
    assert_eq!(axis.feedback().phase, AxisPhase::Disabled, "clear the fault first");
    axis.enable();
    let start = axis.feedback().position.0;
    axis.move_to(start + DISTANCE);
    axis.move_to(start);
    println!("moved by {DISTANCE} counts and back");
    axis.quick_stop();
    axis.enable();
    println!("quick stop and back");
    assert_eq!(axis.stop().last(), Some(&PortEventKind::Ended { power: DrivePower::Off }));
    println!("ended in order");
}

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
    ALL.iter()
        .map(|(_, case)| {
            catch_unwind(AssertUnwindSafe(|| case(&TestBench::emulated(setup)))).is_ok()
        })
        .collect()
}
