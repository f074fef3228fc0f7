//! A thousand faults with a port lost meanwhile, and a port that is gone for long while commands
//! go on.

use i2ris::drive::AxisPhase;
use i2ris::ipc::{OperatingState, Refusal, StateCommand};
use i2ris_testing::cycle::{Bench, Quirk};

/// What goes wrong in a round.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Failure {
    /// The port thread says that the line is lost.
    LineLost,
    /// A drive is at fault, and then the line of the other one is lost.
    DriveFaultAndLineLost,
    /// Positions stay away.
    Silence,
    /// A drive leaves its state by itself, and then the line of the other one is lost.
    DriveStateAndLineLost,
}

const FAILURES: [Failure; 4] = [
    Failure::LineLost,
    Failure::DriveFaultAndLineLost,
    Failure::Silence,
    Failure::DriveStateAndLineLost,
];

fn lose_line(bench: &mut Bench) {
    bench.drives[0].feedback.phase = AxisPhase::Lost;
    bench.quirk(0, Quirk::Silent);
}

fn fail(bench: &mut Bench, failure: Failure) {
    match failure {
        Failure::LineLost => lose_line(bench),
        Failure::DriveFaultAndLineLost => {
            bench.drives[1].feedback.phase = AxisPhase::Faulted;
            bench.run(3);
            lose_line(bench);
        }
        Failure::Silence => bench.quirk(0, Quirk::Silent),
        Failure::DriveStateAndLineLost => {
            bench.drives[1].feedback.phase = AxisPhase::QuickStopped;
            bench.run(3);
            lose_line(bench);
        }
    }
}

/// The line is back: the port thread configures the drive again and leaves it off. After mere
/// silence, the drive is as it was.
fn recover(bench: &mut Bench) {
    bench.quirk(0, Quirk::None);
    if bench.drives[0].feedback.phase == AxisPhase::Lost {
        bench.drives[0].feedback.phase = AxisPhase::Starting;
        bench.run(5);
        bench.drives[0].feedback.phase = AxisPhase::Disabled;
    }
}

fn positions(bench: &Bench) -> [i32; 2] {
    bench.drives.map(|drive| drive.feedback.position.0)
}

/// Commands that go on whatever happens, away from where the snake is.
fn command_on(bench: &mut Bench, ticks: i32, from: [i32; 2]) {
    for tick in 0..ticks {
        let away = (tick / 5).min(200);
        bench.actuator(from.map(|counts| counts + away));
    }
}

/// From FAULT to ENABLED, with nothing but what the operator asks for.
fn acknowledge_and_enable(bench: &mut Bench, held: [i32; 2]) {
    assert_eq!(bench.ask(StateCommand::Enable), Refusal::InFault);
    assert_eq!(bench.actuator(held), Refusal::InFault);
    assert_eq!(bench.ask(StateCommand::Acknowledge), Refusal::None);
    bench.idle();
    assert_eq!(bench.state(), OperatingState::Disabled);
    assert_eq!(bench.actuator(held), Refusal::NotEnabled);
    bench.enable();
    assert_eq!(bench.targets(), held, "enabled where it is");
    bench.run(20);
    assert_eq!((bench.targets(), positions(bench)), (held, held));
}

#[test]
fn a_thousand_faults_with_a_port_lost_meanwhile_end_enabled_where_the_robot_was() {
    let mut bench = Bench::enabled();
    for round in 0..1000 {
        let failure = FAILURES[round % FAILURES.len()];
        let side = if round % 2 == 0 { 1 } else { -1 };
        let start = bench.targets();
        for _ in 0..20 {
            let goal = start.map(|counts| counts + 30 * side);
            assert_eq!(bench.actuator(goal), Refusal::None, "round {round}");
        }
        assert_ne!(bench.targets(), start, "it moved");
        fail(&mut bench, failure);
        command_on(&mut bench, 270 + round as i32 % 30, start);
        assert_eq!(bench.state(), OperatingState::Fault, "{round}: {failure:?}");
        let persists = bench.ask(StateCommand::Acknowledge);
        assert_eq!(persists, Refusal::CausePersists, "{round}: {failure:?}");
        let held = positions(&bench);
        recover(&mut bench);
        command_on(&mut bench, 50, held);
        assert_eq!(bench.state(), OperatingState::Fault, "{round}: {failure:?}");
        assert_eq!(positions(&bench), held, "{round}: {failure:?}");
        acknowledge_and_enable(&mut bench, held);
    }
}

#[test]
fn a_port_that_is_gone_for_ten_seconds_while_commands_go_on_leads_to_no_jump() {
    for failure in FAILURES {
        let mut bench = Bench::moving();
        fail(&mut bench, failure);
        let start = positions(&bench);
        command_on(&mut bench, 10_000, start);
        let held = positions(&bench);
        recover(&mut bench);
        command_on(&mut bench, 1000, held);
        assert_eq!(bench.state(), OperatingState::Fault, "{failure:?}");
        assert_eq!(positions(&bench), held, "{failure:?}");
        acknowledge_and_enable(&mut bench, held);
        assert_eq!(bench.actuator(held.map(|it| it + 300)), Refusal::Step);
        assert_eq!(bench.actuator(held.map(|it| it + 10)), Refusal::None);
        bench.run(10);
        assert_ne!(positions(&bench), held, "the next command is followed");
    }
}
