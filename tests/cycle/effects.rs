//! Done means that the effect is confirmed: every command against every kind of interruption,
//! judged as clients judge it, by the operating state after the command was accepted.

use i2ris::ipc::client::Progress;
use i2ris::process::operating_state;
use i2ris::realtime::Granted;

use super::*;

type Event = fn(&mut Bench);
type MakeBench = fn() -> Bench;

/// Events shortly after the command.
const EVENTS: [(&str, Event); 9] = [
    ("nothing", |_| ()),
    ("stop", |bench| {
        bench.quirk(1, Quirk::Silent);
        bench.run(100);
        bench.quirk(1, Quirk::None);
    }),
    ("fault", |bench| {
        bench.drives[1].fail(0x8611);
        bench.tick();
    }),
    ("hold", |bench| _ = bench.ask_as(8, StateCommand::Hold)),
    ("pause", |bench| _ = bench.ask_as(8, StateCommand::Pause)),
    ("disable", |bench| _ = bench.ask_as(8, StateCommand::Disable)),
    ("camera", |bench| bench.camera = Some([0.5, 0.0])),
    ("fixture", |bench| {
        // Outside the path of a move, inside that of a conditioning cycle.
        let ball = add_ball(rad(-9.0, -9.0), 1.0_f64.to_radians());
        assert_eq!(bench.change_fixtures(8, ball), Refusal::None);
    }),
    ("end", |bench| bench.shutdown = true),
];

fn slow(mut bench: Bench) -> Bench {
    for drive in &mut bench.drives {
        drive.delay = 60;
    }
    bench
}

fn compared() -> Bench {
    let mut config = config("");
    config.limits.plausibility_deg = 5.0;
    let mut bench = Bench::enabled_with(config, Some(model(OutputUnit::Deg)));
    bench.camera = Some([0.0; 2]);
    bench
}

fn follows() -> Bench {
    let mut bench = compared();
    for _ in 0..7 {
        bench.run(9);
        assert_eq!(bench.actuator([250, 250]), Refusal::None);
    }
    bench
}

/// Each command, the robot that receives it, and its outcome after each of the events.
const TABLE: &[(StateCommand, MakeBench, &str)] = &[
    (
        StateCommand::Enable,
        || slow(Bench::homed()),
        "done done fault1 stop4 done stop4 done done stop4",
    ),
    (
        StateCommand::Home,
        || slow(Bench::standard()),
        "done done fault1 stop4 done stop4 done done stop4",
    ),
    (StateCommand::Condition, compared, "done stop2 fault1 stop4 stop4 stop4 fault9 stop5 stop4"),
    (StateCommand::Move, compared, "done stop2 fault1 stop4 stop4 stop4 fault9 done stop4"),
    (StateCommand::Hold, follows, "done done fault1 done done stateDISABLED done done done"),
    (StateCommand::Pause, follows, "done done fault1 done done stateDISABLED done done done"),
    (StateCommand::Disable, follows, "done done ended done done done done done done"),
    (StateCommand::Acknowledge, Bench::faulted, "done done fault1 done done done done done done"),
];

fn judge(bench: &Bench, command: StateCommand) -> Progress {
    operating_state(bench.report(), &Granted::default()).progress(command, CLIENT)
}

fn outcome(command: StateCommand, bench: &mut Bench, event: Event) -> String {
    bench.pose = (command == StateCommand::Move).then_some((rad(5.0, 0.0), 2));
    assert_eq!(bench.ask(command), Refusal::None, "{command}");
    let first = judge(bench, command);
    bench.run(2);
    event(bench);
    let mut last = judge(bench, command);
    // Longer than any command; a command that ended may still show its effect.
    for _ in 0..30_000 {
        if !matches!(last, Progress::Busy | Progress::Ended) {
            break;
        }
        bench.tick();
        last = judge(bench, command);
    }
    // A client that reads the state only afterwards gets the same result.
    bench.run(10);
    assert!(first == Progress::Busy || first == last, "{command}: {first:?}");
    match last {
        Progress::Busy => "busy".to_owned(),
        Progress::Ended => "ended".to_owned(),
        Progress::Done => "done".to_owned(),
        Progress::Interrupted(Cause::State(state)) => format!("state{state}"),
        Progress::Interrupted(cause) => cause.to_string().replace(' ', ""),
    }
}

#[test]
fn every_command_reports_its_effect_or_what_prevented_it() {
    let mut wrong = Vec::new();
    for (command, robot, expected) in TABLE {
        let found = EVENTS.map(|(_, event)| outcome(*command, &mut robot(), event));
        let expected: Vec<&str> = expected.split(' ').collect();
        for (((event, _), found), expected) in EVENTS.iter().zip(found).zip(expected) {
            if found != expected {
                wrong.push(format!("{command} and {event}: {found}, not {expected}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// A completed cycle does not always make the memory known: the gaps may be wider than its turns.
#[test]
fn conditioning_is_not_done_while_memory_is_unknown() {
    let mut bench = Bench::enabled_with(config(""), Some(standard_model()));
    assert_eq!(bench.ask(StateCommand::Condition), Refusal::None);
    bench.until("its end", |bench| !bench.report().busy);
    assert_eq!(judge(&bench, StateCommand::Condition), Progress::Done);
    let mut message = operating_state(bench.report(), &Granted::default());
    message.flags &= !i2ris::ipc::payload::OperatingStateMsg::MEMORY_KNOWN;
    assert_eq!(message.progress(StateCommand::Condition, CLIENT), Progress::Ended);
    message.state = OperatingState::Paused.number();
    assert_eq!(
        message.progress(StateCommand::Condition, CLIENT),
        Progress::Interrupted(Cause::State(OperatingState::Paused))
    );
}
