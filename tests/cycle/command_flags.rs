//! The refusals that depend on more than the state: the notes below the table of commands in the
//! documentation of `i2ris::core`, in every combination of their conditions. The printed table
//! itself must equal the one that `command_table` tests.

use super::command_table::{Answer, TABLE};
use super::*;

/// A second client.
const OTHER: u64 = 8;

/// Older than `limits.feedback_stale_ms`, younger than three times that.
const STALE: Nanos = Nanos::from_millis(60);

/// All combinations of some flags.
fn combinations<const N: usize>() -> impl Iterator<Item = [bool; N]> {
    (0..1_usize << N).map(|bits| std::array::from_fn(|flag| bits >> flag & 1 == 1))
}

fn make_stale(bench: &mut Bench) {
    bench.quirk(1, Quirk::Silent);
    bench.skip(STALE);
}

/// The first reason that applies, in the order of the notes.
fn first(reasons: &[(bool, Refusal)]) -> Refusal {
    let present = reasons.iter().find(|(is_present, _)| *is_present);
    present.map_or(Refusal::None, |(_, refusal)| *refusal)
}

#[test]
fn enable_and_home_check_freshness_zero_and_range() {
    use StateCommand::{Enable, Home};
    for [is_homed, is_fresh, is_in_range, is_shutdown] in combinations() {
        for command in [Enable, Home] {
            let mut bench = Bench::homed();
            bench.drives[1].feedback.homed = is_homed;
            if !is_in_range {
                bench.drives[1].feedback.position = Counts(1500);
            }
            bench.tick();
            if !is_fresh {
                make_stale(&mut bench);
            }
            bench.shutdown = is_shutdown;
            let expected = first(&[
                (is_shutdown, Refusal::WrongState),
                (!is_fresh, Refusal::DrivesNotReady),
                (command == Enable && !is_homed, Refusal::NotHomed),
                (command == Enable && !is_in_range, Refusal::Range),
            ]);
            let flags = [is_homed, is_fresh, is_in_range, is_shutdown];
            assert_eq!(bench.ask(command), expected, "{command} {flags:?}");
        }
    }
}

#[test]
fn motion_needs_zero_fresh_positions_and_lease() {
    use StateCommand::{Condition, Move};
    for [is_homed, is_fresh, is_leased, has_pose] in combinations() {
        for command in [Condition, Move] {
            let mut bench = Bench::enabled();
            if is_leased {
                let mut other = bench.servo(ServoGoal::Actuator(bench.targets().map(Counts), 2));
                other.client_id = OTHER;
                assert_eq!(bench.send(other), Refusal::None);
            }
            bench.drives[0].feedback.homed = is_homed;
            bench.tick();
            if !is_fresh {
                make_stale(&mut bench);
            }
            bench.pose = has_pose.then(|| (rad(1.0, 0.0), 2));
            let expected = first(&[
                (!is_homed, Refusal::NotHomed),
                (!is_fresh, Refusal::DrivesNotReady),
                (is_leased, Refusal::Lease),
                (command == Move && !has_pose, Refusal::Malformed),
            ]);
            let flags = [is_homed, is_fresh, is_leased, has_pose];
            assert_eq!(bench.ask(command), expected, "{command} {flags:?}");
        }
    }
}

#[test]
fn fault_is_acknowledged_only_after_every_drive_has_settled() {
    use AxisPhase::*;
    let phases =
        [Starting, Disabled, Enabling, Enabled, Homing, QuickStopped, Disabling, Faulted, Lost];
    for phase in phases {
        for [is_fresh] in combinations() {
            let mut bench = Bench::enabled();
            bench.fault(0);
            bench.quirk(1, Quirk::Deaf);
            bench.drives[1].feedback.phase = phase;
            bench.tick();
            if !is_fresh {
                make_stale(&mut bench);
            }
            let has_settled = matches!(phase, Disabled | QuickStopped | Faulted);
            let expected = first(&[(!is_fresh || !has_settled, Refusal::CausePersists)]);
            let refusal = bench.ask(StateCommand::Acknowledge);
            assert_eq!(refusal, expected, "{phase:?}, fresh: {is_fresh}");
            assert_eq!(bench.state(), OperatingState::Fault, "drive 0 is reset first");
        }
    }
}

#[test]
fn only_lease_holder_can_release_in_any_state() {
    for (name, build, _) in TABLE {
        let mut bench = build();
        let holder = bench.report().lease_client_id;
        let reply = bench.ask_as(OTHER, StateCommand::Release).refusal;
        assert_eq!(reply, first(&[(holder == CLIENT, Refusal::Lease)]), "{name}");
        assert_eq!(bench.ask(StateCommand::Release), Refusal::None, "{name}");
        assert_eq!(bench.report().lease_client_id, 0, "{name}");
    }
}

#[test]
fn shutdown_refuses_starts_and_accepts_stops_in_every_state() {
    use StateCommand::{Condition, Disable, Enable, Home, Move, Release, Resume, Unhome};
    for (name, build, _) in TABLE {
        for command in StateCommand::ALL {
            let mut bench = build();
            bench.shutdown = true;
            bench.tick();
            bench.pose = (*command == Move).then(|| (rad(1.0, 0.0), 2));
            let refusal = bench.ask(*command);
            match command {
                Enable | Resume | Home | Unhome | Condition | Move => {
                    assert_eq!(refusal, Refusal::WrongState, "{command} when {name}");
                }
                Disable | Release => assert_eq!(refusal, Refusal::None, "{command} when {name}"),
                _ => {}
            }
            assert!(
                matches!(bench.state(), OperatingState::Disabled | OperatingState::Fault),
                "{command} when {name}"
            );
        }
    }
}

/// The column of the printed table for a state of [`TABLE`].
fn column(state: &str) -> usize {
    match state {
        "idle" => 0,
        "enabling" | "homing" | "stopping" | "settling" | "powering off" => 1,
        "holding" | "following" | "moving" | "conditioning" => 2,
        "paused" => 3,
        "drive fault" | "fault that is over" | "fault that persists" => 4,
        "resetting" => 5,
        other => panic!("{other} is in no column"),
    }
}

/// Whether a reply matches a printed cell. The tests above cover what its notes require.
fn agrees(cell: &str, column: usize, answer: Answer) -> bool {
    use OperatingState::{Disabled, Enabled, Fault, Paused};
    let stays = [Disabled, Disabled, Enabled, Paused, Fault, Fault][column];
    match (cell, answer) {
        ("Busy", Answer::No(refusal)) => refusal == Refusal::Busy,
        ("State", Answer::No(refusal)) => {
            use Refusal::{InFault, NoFault, NotDisabled, NotEnabled};
            [NotEnabled, Refusal::Paused, InFault, NotDisabled, NoFault].contains(&refusal)
        }
        ("PAUSED", Answer::To(state)) => state == Paused,
        ("ENABLED, holding", Answer::To(state)) => state == Enabled,
        ("stopping", Answer::To(state)) => state == Disabled,
        ("Busy (9)", Answer::To(state)) => state == Disabled,
        ("Busy (9)", Answer::No(refusal)) => refusal == Refusal::Busy,
        ("(4)", Answer::To(state)) => [Disabled, Fault].contains(&state),
        ("(4)", Answer::No(refusal)) => refusal == Refusal::CausePersists,
        ("conditioning cycle, busy (6)" | "trajectory, busy (7)", Answer::No(refusal)) => {
            [Refusal::Busy, Refusal::Conditioning].contains(&refusal)
        }
        ("Busy" | "State", Answer::To(_)) | (_, Answer::No(_)) => false,
        (_, Answer::To(state)) => state == stays,
    }
}

#[test]
fn the_printed_table_is_the_tested_one() {
    let text = include_str!("../../src/core/states/control_state.rs");
    let lines = text.lines().filter_map(|line| line.strip_prefix("//! | `"));
    let tables: Vec<Vec<&str>> =
        lines.map(|line| line.trim_end_matches('|').split('|').map(str::trim).collect()).collect();
    // A command and six states.
    let printed: Vec<&Vec<&str>> = tables.iter().filter(|row| row.len() == 7).collect();
    assert_eq!(printed.len(), StateCommand::ALL.len());
    for (name, _, answers) in TABLE {
        for (command, answer) in StateCommand::ALL.iter().zip(answers) {
            let spelled = format!("{command}`");
            let row = printed.iter().find(|row| row[0] == spelled);
            let row = row.unwrap_or_else(|| panic!("{command} is not in the table"));
            let (column, cell) = (column(name), row[column(name) + 1]);
            assert!(agrees(cell, column, *answer), "{command} when {name}: {cell}");
        }
    }
}
