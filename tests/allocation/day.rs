//! A day of use in simulated time: nothing trips, nothing drifts, and memory stays as it is.

use std::fs;
use std::time::Instant;

use i2ris::core::ModelChange;
use i2ris::drive::AxisPhase;
use i2ris::ipc::{OperatingState, Refusal, StateCommand};
use i2ris::model::file::OutputUnit;
use i2ris_testing::cycle::{Bench, config, model, standard_model};

use crate::calls;

const MINUTES_PER_HOUR: u32 = 60;
/// Ticks between two commands.
const SEND_TICKS: usize = 5;
const TICKS_PER_MINUTE: usize = 60_000;

/// Resident memory, kB.
fn resident() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
    line.and_then(|line| line.split_whitespace().next())
        .and_then(|number| number.parse().ok())
        .unwrap()
}

/// One minute of commands, with a pause of the operator in it.
fn follow_for_a_minute(bench: &mut Bench, minute: u32) {
    let slow = 0.2 + 0.05 * f64::from(minute % 7);
    for number in 0..TICKS_PER_MINUTE / SEND_TICKS {
        let t = (number * SEND_TICKS) as f64 / 1000.0;
        // Begins and ends at rest, at zero.
        let fade = (t / 5.0).min((60.0 - t) / 5.0).min(1.0);
        let turn = std::f64::consts::TAU * slow * t;
        let refusal = bench.joint(6.0 * fade * turn.sin(), 5.0 * fade * (0.7 * turn).sin());
        assert_eq!(refusal, Refusal::None, "minute {minute}, {t} s");
        bench.run(SEND_TICKS - 1);
    }
    bench.run(600);
    assert!(bench.report().holding, "a silent client");
    for command in [StateCommand::Pause, StateCommand::Resume] {
        assert_eq!(bench.ask(command), Refusal::None);
        bench.run(100);
    }
}

/// Once per hour: a fault and its end, conditioning, and another model.
fn hourly(bench: &mut Bench, hour: u32) {
    let axis = (hour % 2) as usize;
    bench.drives[axis].feedback.phase = AxisPhase::Faulted;
    bench.run(300);
    assert_eq!(bench.state(), OperatingState::Fault);
    assert_eq!(bench.ask(StateCommand::Acknowledge), Refusal::None);
    bench.idle();
    bench.enable();
    assert_eq!(bench.ask(StateCommand::Condition), Refusal::None);
    bench.idle();
    let before = bench.probed;
    assert_eq!(bench.change_model(ModelChange::Rollback, true), Refusal::None);
    assert_eq!(bench.probed, before);
    bench.run(1000);
}

#[test]
#[ignore = "a day of simulated time takes minutes; I2RIS_SOAK_HOURS for less"]
fn a_day_of_use_in_simulated_time_trips_nothing_and_takes_no_memory() {
    let hours = std::env::var("I2RIS_SOAK_HOURS");
    let hours: u32 = hours.map_or(24, |hours| hours.parse().unwrap());
    let mut bench = Bench::enabled_with(config(""), Some(standard_model()));
    let other = model(OutputUnit::Deg);
    assert_eq!(bench.swap(&other), Refusal::None);
    bench.probe = calls;
    let (start, begin) = (Instant::now(), bench.now);
    let mut after_an_hour = 0;
    for hour in 0..hours {
        for minute in 0..MINUTES_PER_HOUR {
            follow_for_a_minute(&mut bench, minute);
        }
        hourly(&mut bench, hour);
        if hour == 0 {
            after_an_hour = resident();
        }
        println!("hour {}: {} kB resident", hour + 1, resident());
    }
    let report = bench.report();
    let seconds = bench.now.duration_since(begin).0 / 1_000_000_000;
    println!(
        "{seconds} s simulated in {:.0} s, {} commands, {} refused, {} stops by late commands",
        start.elapsed().as_secs_f64(),
        report.accepted,
        report.refused,
        report.stale_stops
    );
    assert_eq!(report.refused, 0);
    assert_eq!(bench.probed, 0, "calls of the allocator in the cycle");
    assert!(resident() <= after_an_hour + 256, "memory grows");
}
