//! Sessions: which client may move the snake after a stop, and the maximum age of a request.

use super::interrupted_streams::{KINDS, bench, here, is_followed, stream};
use super::*;

const OTHER: u64 = CLIENT + 1;

/// A stop of the robot and the commands that enable motion again.
type Stopping = (&'static str, fn(&mut Bench), &'static [StateCommand]);

const STOPS: [Stopping; 4] = [
    ("disable", |bench| give(bench, OTHER, StateCommand::Disable), &[StateCommand::Enable]),
    ("pause", |bench| give(bench, OTHER, StateCommand::Pause), &[StateCommand::Resume]),
    ("hold", |bench| give(bench, OTHER, StateCommand::Hold), &[]),
    (
        "fault",
        |bench| {
            bench.drives[1].fail(0x8611);
            bench.tick();
            bench.quirk(1, Quirk::None);
        },
        &[StateCommand::Acknowledge, StateCommand::Enable],
    ),
];

fn give(bench: &mut Bench, client: u64, command: StateCommand) {
    assert_eq!(bench.ask_as(client, command).refusal, Refusal::None, "{command}");
}

/// Sends the present pose every 10 ms. Returns whether a command was followed.
fn go_on(bench: &mut Bench, ticks: usize) -> bool {
    let accepted = bench.report().accepted;
    for _ in 0..ticks / 10 {
        is_followed(bench);
        bench.run(9);
    }
    bench.report().accepted > accepted
}

#[test]
fn client_that_keeps_sending_moves_nothing_after_stop() {
    for (stop, act, start) in STOPS {
        for (name, goal) in KINDS {
            let what = format!("{name}, {stop}");
            let mut bench = bench();
            stream(&mut bench, goal);
            act(&mut bench);
            assert!(!go_on(&mut bench, 500), "{what}");
            for command in start {
                bench.until("its turn", |bench| !bench.report().busy);
                give(&mut bench, OTHER, *command);
                assert!(!go_on(&mut bench, 1000), "{what}, {command}");
            }
            assert_eq!(bench.state(), OperatingState::Enabled, "{what}");
            let held = bench.targets();
            assert!(!go_on(&mut bench, 5000), "{what}");
            bench.run(5000);
            assert_eq!(bench.goal(goal(1.0)), Refusal::StreamInterrupted, "{what}");
            assert_eq!(bench.targets(), held, "{what}");
            bench.run(1000);
            give(&mut bench, CLIENT, StateCommand::Resume);
            assert_eq!(is_followed(&mut bench), Refusal::None, "{what}");
        }
    }
}

#[test]
fn new_client_may_start_but_one_refused_earlier_may_not() {
    let mut bench = bench();
    stream(&mut bench, KINDS[0].1);
    give(&mut bench, OTHER, StateCommand::Pause);
    let early = ServoCommand { client_id: CLIENT + 2, ..here(&mut bench) };
    assert_eq!(bench.send(early), Refusal::Paused);
    give(&mut bench, OTHER, StateCommand::Resume);
    bench.run(600);
    for client_id in [CLIENT + 2, CLIENT] {
        let goes_on = ServoCommand { client_id, sequence: 9999, ..here(&mut bench) };
        assert_eq!(bench.send(goes_on), Refusal::StreamInterrupted, "{client_id}");
    }
    let started = ServoCommand { client_id: CLIENT + 3, ..here(&mut bench) };
    assert_eq!(bench.send(started), Refusal::None);
}

#[test]
fn hold_stops_the_stream_of_its_own_client() {
    let mut bench = bench();
    stream(&mut bench, KINDS[0].1);
    give(&mut bench, CLIENT, StateCommand::Hold);
    assert!(!go_on(&mut bench, 3000));
    give(&mut bench, CLIENT, StateCommand::Hold);
    assert!(!go_on(&mut bench, 1000));
    bench.run(1000);
    give(&mut bench, CLIENT, StateCommand::Hold);
    assert!(go_on(&mut bench, 100));
}

#[test]
fn no_loop_of_requests_undoes_a_stop() {
    for (stop, again) in [
        (StateCommand::Disable, StateCommand::Enable),
        (StateCommand::Pause, StateCommand::Resume),
        (StateCommand::Pause, StateCommand::Move),
        (StateCommand::Disable, StateCommand::Move),
    ] {
        let mut bench = Bench::enabled_with(config(""), Some(standard_model()));
        let ask = |bench: &mut Bench, ticks: usize| {
            for k in 0..ticks / 300 {
                bench.pose = (again == StateCommand::Move).then_some((rad((k % 2) as f64, 0.0), 2));
                bench.ask_as(CLIENT, again);
                bench.run(299);
            }
        };
        ask(&mut bench, 3000);
        give(&mut bench, OTHER, stop);
        ask(&mut bench, 3000);
        assert_ne!(bench.state(), OperatingState::Enabled, "{again} undid {stop}");
        // Another client may, and the loop still moves nothing.
        let is_pause = stop == StateCommand::Pause;
        let start = if is_pause { StateCommand::Resume } else { StateCommand::Enable };
        give(&mut bench, OTHER, start);
        bench.until("ENABLED", |bench| bench.state() == OperatingState::Enabled);
        let held = bench.targets();
        ask(&mut bench, 3000);
        assert_eq!(bench.targets(), held, "{again} after {start}");
    }
}

#[test]
fn request_older_than_client_timeout_is_refused_unless_it_stops() {
    use StateCommand::{Acknowledge, Condition, Enable, Home, Move, Release, Resume, Unhome};
    let late = Nanos::from_millis(1000);
    for command in [Enable, Home, Unhome, Acknowledge, Condition, Move, Resume, Release] {
        for robot in [Bench::homed, Bench::enabled, Bench::faulted] {
            let mut bench = robot();
            let before = (bench.state(), bench.report().busy, bench.targets());
            bench.request_age = late;
            bench.pose = (command == Move).then_some((rad(5.0, 0.0), 2));
            assert_eq!(bench.ask(command), Refusal::Stale, "{command}");
            bench.run(500);
            assert_eq!((bench.state(), bench.report().busy, bench.targets()), before, "{command}");
        }
    }
    for stop in [StateCommand::Hold, StateCommand::Pause, StateCommand::Disable] {
        let mut bench = Bench::enabled();
        assert_eq!(bench.actuator([20, 0]), Refusal::None);
        bench.request_age = Nanos::from_millis(100_000);
        assert_eq!(bench.ask(stop), Refusal::None, "{stop}");
    }
}

#[test]
fn client_beyond_session_capacity_stays_interrupted_after_pause() {
    let mut bench = bench();
    give(&mut bench, OTHER, StateCommand::Pause);
    let send = |bench: &mut Bench, client_id: u64| {
        let command = ServoCommand { client_id, ..here(bench) };
        bench.send(command)
    };
    for k in 0..400 {
        assert_eq!(send(&mut bench, 1000 + k % 20), Refusal::Paused);
    }
    give(&mut bench, OTHER, StateCommand::Resume);
    for k in 0..4000 {
        assert_eq!(send(&mut bench, 1000 + k.min(19)), Refusal::StreamInterrupted, "{k}");
    }
    bench.run(1000);
    assert_eq!(send(&mut bench, 99), Refusal::None, "a program that was just started");
}
