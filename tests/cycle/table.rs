//! Every state command in every state: the table in the documentation of `i2ris::core`.

use i2ris::core::CycleReport;
use i2ris::drive::AxisPhase;
use i2ris::ipc::{OperatingState, Refusal, StateCommand};

use crate::bench::{Bench, CLIENT, rad};
use crate::drive::Quirk;

use OperatingState::{Disabled as D, Enabled as E, Fault as F, Paused as P};

/// Accepted, with the state after it.
const fn to(state: OperatingState) -> (Refusal, OperatingState) {
    (Refusal::None, state)
}

/// Refused, with the state after it.
const fn no(refusal: Refusal, state: OperatingState) -> (Refusal, OperatingState) {
    (refusal, state)
}

/// How a state is reached, and what is answered to every command, in the order of
/// `StateCommand::ALL`: enable, disable, pause, resume, home, unhome, condition, acknowledge,
/// release, hold, move.
type Row = (&'static str, fn() -> Bench, [(Refusal, OperatingState); 11]);

const BUSY: [(Refusal, OperatingState); 11] = [
    no(Refusal::Busy, D),
    to(D),
    no(Refusal::Busy, D),
    no(Refusal::Busy, D),
    no(Refusal::Busy, D),
    no(Refusal::Busy, D),
    no(Refusal::Busy, D),
    no(Refusal::State, D),
    to(D),
    no(Refusal::Busy, D),
    no(Refusal::Busy, D),
];

const ENABLED: [(Refusal, OperatingState); 11] = [
    no(Refusal::State, E),
    to(D),
    to(P),
    no(Refusal::State, E),
    no(Refusal::State, E),
    no(Refusal::State, E),
    to(E),
    no(Refusal::State, E),
    to(E),
    to(E),
    to(E),
];

const CONDITIONING: [(Refusal, OperatingState); 11] = {
    let mut row = ENABLED;
    row[6] = no(Refusal::Busy, E);
    row[10] = no(Refusal::Busy, E);
    row
};

/// A way begins at rest.
const FOLLOWING: [(Refusal, OperatingState); 11] = {
    let mut row = ENABLED;
    row[10] = no(Refusal::Busy, E);
    row
};

const TABLE: &[Row] = &[
    (
        "idle",
        Bench::homed,
        [
            to(D),
            to(D),
            no(Refusal::State, D),
            no(Refusal::State, D),
            to(D),
            to(D),
            no(Refusal::State, D),
            no(Refusal::State, D),
            to(D),
            no(Refusal::State, D),
            no(Refusal::State, D),
        ],
    ),
    ("enabling", enabling, BUSY),
    ("homing", homing, BUSY),
    ("stopping", stopping, BUSY),
    ("settling", settling, BUSY),
    ("powering off", powering_off, BUSY),
    ("holding", Bench::enabled, ENABLED),
    ("following", Bench::moving, FOLLOWING),
    ("on its way", on_its_way, CONDITIONING),
    ("conditioning", conditioning, CONDITIONING),
    (
        "paused",
        Bench::paused,
        [
            no(Refusal::State, P),
            to(D),
            to(P),
            to(E),
            no(Refusal::State, P),
            no(Refusal::State, P),
            no(Refusal::State, P),
            no(Refusal::State, P),
            to(P),
            to(P),
            no(Refusal::State, P),
        ],
    ),
    (
        "fault of a drive",
        Bench::faulted,
        [
            no(Refusal::State, F),
            to(F),
            no(Refusal::State, F),
            no(Refusal::State, F),
            no(Refusal::State, F),
            no(Refusal::State, F),
            no(Refusal::State, F),
            to(F),
            to(F),
            no(Refusal::State, F),
            no(Refusal::State, F),
        ],
    ),
    (
        "fault that is over",
        fault_over,
        [
            no(Refusal::State, F),
            to(F),
            no(Refusal::State, F),
            no(Refusal::State, F),
            no(Refusal::State, F),
            no(Refusal::State, F),
            no(Refusal::State, F),
            to(D),
            to(F),
            no(Refusal::State, F),
            no(Refusal::State, F),
        ],
    ),
    (
        "fault with its cause",
        fault_persists,
        [
            no(Refusal::State, F),
            to(F),
            no(Refusal::State, F),
            no(Refusal::State, F),
            no(Refusal::State, F),
            no(Refusal::State, F),
            no(Refusal::State, F),
            no(Refusal::CausePersists, F),
            to(F),
            no(Refusal::State, F),
            no(Refusal::State, F),
        ],
    ),
    (
        "resetting",
        resetting,
        [
            no(Refusal::State, F),
            to(F),
            no(Refusal::State, F),
            no(Refusal::State, F),
            no(Refusal::State, F),
            no(Refusal::State, F),
            no(Refusal::State, F),
            no(Refusal::Busy, F),
            to(F),
            no(Refusal::State, F),
            no(Refusal::State, F),
        ],
    ),
];

fn slow(mut bench: Bench) -> Bench {
    bench.drives.iter_mut().for_each(|drive| drive.delay = 500);
    bench
}

fn enabling() -> Bench {
    let mut bench = slow(Bench::homed());
    bench.ask(StateCommand::Enable);
    bench
}

fn homing() -> Bench {
    let mut bench = slow(Bench::standard());
    bench.ask(StateCommand::Home);
    bench
}

fn stopping() -> Bench {
    let mut bench = Bench::moving();
    bench.ask(StateCommand::Disable);
    bench
}

fn conditioning() -> Bench {
    let mut bench = Bench::enabled();
    assert_eq!(bench.ask(StateCommand::Condition), Refusal::None);
    bench.run(100);
    bench
}

fn on_its_way() -> Bench {
    let mut bench = Bench::enabled();
    bench.pose = Some((rad(5.0, 0.0), 2));
    assert_eq!(bench.ask(StateCommand::Move), Refusal::None);
    bench.run(50);
    bench
}

fn settling() -> Bench {
    let mut bench = stopping();
    bench.run(10);
    assert_eq!(bench.phases(), [AxisPhase::Enabled; 2]);
    bench
}

fn powering_off() -> Bench {
    let mut bench = slow(stopping());
    bench.run(70);
    assert_eq!(bench.phases(), [AxisPhase::Disabling; 2]);
    bench
}

fn fault_over() -> Bench {
    let mut bench = Bench::enabled();
    bench.drives[1].feedback.phase = AxisPhase::QuickStopped;
    bench.run(5);
    assert_eq!(bench.state(), OperatingState::Fault);
    bench
}

fn fault_persists() -> Bench {
    let mut bench = Bench::enabled();
    bench.drives[1].feedback.phase = AxisPhase::Lost;
    bench.run(5);
    bench
}

fn resetting() -> Bench {
    let mut bench = Bench::faulted();
    bench.quirk(0, Quirk::Broken);
    assert_eq!(bench.ask(StateCommand::Acknowledge), Refusal::None);
    bench
}

/// What a refused command may leave behind.
fn without_refusal(report: &CycleReport) -> CycleReport {
    CycleReport {
        last_refusal: Refusal::None,
        ..*report
    }
}

#[test]
fn every_command_in_every_state_does_what_the_table_says() {
    for (name, build, row) in TABLE {
        for (command, (refusal, state)) in StateCommand::ALL.iter().zip(row) {
            let (mut bench, mut twin) = (build(), build());
            bench.pose = (*command == StateCommand::Move).then(|| (rad(1.0, 0.0), 2));
            let reply = bench.ask_as(CLIENT, *command);
            assert_eq!(
                (reply.refusal, reply.state),
                (*refusal, *state),
                "{command} when {name}"
            );
            twin.tick();
            if *refusal != Refusal::None {
                assert_eq!(
                    bench.out.requests, twin.out.requests,
                    "{command} when {name} is refused and does something"
                );
                assert_eq!(
                    without_refusal(bench.report()),
                    without_refusal(twin.report()),
                    "{command} when {name}"
                );
                assert_eq!(bench.events, twin.events, "{command} when {name}");
            }
        }
    }
}

#[test]
fn a_command_of_nobody_is_malformed_in_every_state() {
    for (name, build, _) in TABLE {
        for command in StateCommand::ALL {
            assert_eq!(
                build().ask_as(0, *command).refusal,
                Refusal::Malformed,
                "{command} when {name}"
            );
        }
    }
}

#[test]
fn from_every_state_disable_ends_with_drives_off() {
    for (name, build, _) in TABLE {
        let mut bench = build();
        if bench.phases().contains(&AxisPhase::Lost) {
            continue;
        }
        assert_eq!(bench.ask(StateCommand::Disable), Refusal::None, "{name}");
        bench.run(4000);
        assert!(!bench.report().busy, "{name}");
        for phase in bench.phases() {
            assert!(
                matches!(phase, AxisPhase::Disabled | AxisPhase::Faulted),
                "{phase:?} after {name}"
            );
        }
    }
}
