//! Every state command in every state: the table documented in `core/states/control_state.rs`.

use i2ris::core::CycleReport;

use super::*;

/// Set-up of a state, and the replies to all commands in the order of `StateCommand::ALL`:
/// enable, disable, pause, resume, home, unhome, condition, acknowledge, release, hold, move. A
/// state means that the command is accepted and leads to it; a refusal leaves the state unchanged.
pub type Row = (&'static str, fn() -> Bench, [Answer; 11]);

#[derive(Clone, Copy)]
pub enum Answer {
    To(OperatingState),
    No(Refusal),
}

const D: Answer = Answer::To(OperatingState::Disabled);
const E: Answer = Answer::To(OperatingState::Enabled);
const P: Answer = Answer::To(OperatingState::Paused);
const F: Answer = Answer::To(OperatingState::Fault);
const OFF: Answer = Answer::No(Refusal::NotEnabled);
const ON: Answer = Answer::No(Refusal::NotDisabled);
const HELD: Answer = Answer::No(Refusal::Paused);
const FAULT: Answer = Answer::No(Refusal::InFault);
const NONE: Answer = Answer::No(Refusal::NoFault);
const BUSY: Answer = Answer::No(Refusal::Busy);
const CONDITIONING: Answer = Answer::No(Refusal::Conditioning);
const PERSISTS: Answer = Answer::No(Refusal::CausePersists);

const CHANGING: [Answer; 11] = [BUSY, D, BUSY, BUSY, BUSY, BUSY, BUSY, NONE, D, D, BUSY];
/// The drives are being disabled; `enable` waits for the end.
const GOING_OFF: [Answer; 11] = [D, D, BUSY, BUSY, BUSY, BUSY, BUSY, NONE, D, D, BUSY];
const OCCUPIED: [Answer; 11] = [E, D, P, E, ON, ON, BUSY, NONE, E, E, E];

pub const TABLE: &[Row] = &[
    ("idle", Bench::homed, [D, D, OFF, OFF, D, D, OFF, NONE, D, OFF, OFF]),
    ("enabling", enabling, CHANGING),
    ("homing", homing, CHANGING),
    ("stopping", stopping, GOING_OFF),
    ("settling", settling, GOING_OFF),
    ("powering off", powering_off, GOING_OFF),
    ("holding", Bench::enabled, [E, D, P, E, ON, ON, E, NONE, E, E, E]),
    // A trajectory starts at rest.
    ("following", Bench::moving, [E, D, P, E, ON, ON, E, NONE, E, E, BUSY]),
    ("moving", moving_to_pose, OCCUPIED),
    ("conditioning", conditioning, [E, D, P, E, ON, ON, CONDITIONING, NONE, E, E, CONDITIONING]),
    ("paused", Bench::paused, [HELD, D, P, E, ON, ON, HELD, NONE, P, P, HELD]),
    ("drive fault", Bench::faulted, in_fault(F)),
    ("fault that is over", fault_over, in_fault(D)),
    ("fault that persists", fault_persists, in_fault(PERSISTS)),
    ("resetting", resetting, in_fault(BUSY)),
];

const fn in_fault(acknowledged: Answer) -> [Answer; 11] {
    [FAULT, F, FAULT, FAULT, FAULT, FAULT, FAULT, acknowledged, F, FAULT, FAULT]
}

fn slow(mut bench: Bench) -> Bench {
    for drive in &mut bench.drives {
        drive.delay = 500;
    }
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

fn moving_to_pose() -> Bench {
    let mut bench = Bench::enabled();
    assert_eq!(bench.go(5.0, 0.0), Refusal::None);
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

/// The last refusal is the only trace of a refused command.
fn without_refusal(report: &CycleReport) -> CycleReport {
    CycleReport { last_refusal: Refusal::None, ..*report }
}

#[test]
fn every_command_in_every_state_follows_the_table() {
    for (name, build, row) in TABLE {
        for (command, answer) in StateCommand::ALL.iter().zip(row) {
            let case = format!("{command} when {name}");
            let (mut bench, mut twin) = (build(), build());
            bench.pose = (*command == StateCommand::Move).then(|| (rad(1.0, 0.0), 2));
            let reply = bench.ask_as(CLIENT, *command);
            twin.tick();
            let (refusal, state) = match answer {
                Answer::To(state) => (Refusal::None, *state),
                Answer::No(refusal) => (*refusal, twin.state()),
            };
            assert_eq!((reply.refusal, reply.state), (refusal, state), "{case}");
            if refusal != Refusal::None {
                let (found, expected) = (bench.report(), twin.report());
                assert_eq!(bench.out.requests, twin.out.requests, "{case}");
                assert_eq!(without_refusal(found), without_refusal(expected), "{case}");
                // A refusal is reported, and changes nothing.
                let is_told =
                    |it: &CycleEventKind| matches!(it, CycleEventKind::RequestRefused { .. });
                bench.events.retain(|event| !is_told(event));
                assert_eq!(bench.events, twin.events, "{case}");
            }
        }
    }
}

#[test]
fn a_command_without_client_is_malformed_in_every_state() {
    for (name, build, _) in TABLE {
        for command in StateCommand::ALL {
            let reply = build().ask_as(0, *command);
            assert_eq!(reply.refusal, Refusal::Malformed, "{command} when {name}");
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
