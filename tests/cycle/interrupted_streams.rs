//! A stream that fell silent in motion is followed again only after a deliberate action.

use i2ris::model::kinematic::tip_position;

use super::*;

/// Goals of every kind that move slowly with time (s).
pub type Kind = fn(f64) -> ServoGoal;

pub const KINDS: [(&str, Kind); 6] = [
    ("angles", |t| ServoGoal::Joint(rad(6.0 * t, 0.0), 2)),
    ("interpolated", |t| ServoGoal::Interpolated(rad(6.0 * t, 0.0), 2)),
    ("rate", |_| ServoGoal::Rate(rad(6.0, 0.0), 2)),
    ("tip", |t| ServoGoal::Tip(tip_position(0.1 * t, 0.0).position_m, 3)),
    ("tip rate", |_| ServoGoal::TipRate([0.0, 2e-4, 0.0], 3)),
    ("counts", |t| ServoGoal::Actuator([Counts((200.0 * t) as i32), Counts(0)], 2)),
];

pub fn bench() -> Bench {
    Bench::enabled_with(with_jaw(strict_config("")), Some(model(OutputUnit::Deg)))
}

/// Streams at 100 Hz for a second; the next command would be the end of the path.
pub fn stream(bench: &mut Bench, goal: Kind) {
    for k in 0..100 {
        assert_eq!(bench.goal(goal(f64::from(k) * 0.01)), Refusal::None, "{k}");
        bench.run(9);
    }
}

/// One command where the snake is.
pub fn here(bench: &mut Bench) -> ServoCommand {
    bench.servo(ServoGoal::Joint(bench.joints().setpoint, 2))
}

pub fn is_followed(bench: &mut Bench) -> Refusal {
    let command = here(bench);
    bench.send(command)
}

#[test]
fn stream_interrupted_in_motion_does_not_resume_automatically() {
    for (name, goal) in KINDS {
        let mut bench = bench();
        stream(&mut bench, goal);
        bench.run(700);
        let (held, goal) = (bench.targets(), goal(0.99));
        for pause in [0, 10, 60_000] {
            bench.run(pause);
            let same = bench.servo(goal);
            for command in [same, here(&mut bench)] {
                assert_eq!(bench.send(command), Refusal::StreamInterrupted, "{name}, {pause}");
            }
        }
        // An action of another client does not count as one of this client.
        assert_eq!(bench.ask_as(CLIENT + 1, StateCommand::Enable).refusal, Refusal::None);
        assert_eq!(is_followed(&mut bench), Refusal::StreamInterrupted, "{name}");
        assert_eq!(bench.targets(), held, "{name}");
        assert_eq!(bench.ask(StateCommand::Enable), Refusal::None);
        assert_eq!(is_followed(&mut bench), Refusal::None, "{name}");
    }
}

#[test]
fn departed_second_client_does_not_let_stream_resume() {
    for (name, goal) in KINDS {
        let mut bench = bench();
        stream(&mut bench, goal);
        bench.run(2_000);
        for _ in 0..100 {
            let command = ServoCommand { client_id: CLIENT + 1, ..here(&mut bench) };
            assert_eq!(bench.send(command), Refusal::None, "{name}");
            assert_ne!(bench.goal(goal(1.0)), Refusal::None, "{name}");
            bench.run(8);
        }
        let held = bench.targets();
        for pause in [0, 300, 3_000] {
            bench.run(pause);
            assert_ne!(bench.goal(goal(1.0)), Refusal::None, "{name}, {pause}");
            assert_ne!(is_followed(&mut bench), Refusal::None, "{name}, {pause}");
        }
        assert_eq!(bench.targets(), held, "{name}");
        assert_eq!(bench.ask(StateCommand::Enable), Refusal::None);
        assert_eq!(is_followed(&mut bench), Refusal::None, "{name}");
    }
}

#[test]
fn single_command_stopped_in_motion_counts_as_interrupted() {
    let mut bench = Bench::enabled_with(config(""), Some(model(OutputUnit::Deg)));
    assert_eq!(bench.joint(4.0, 0.0), Refusal::None);
    bench.run(700);
    assert_eq!(is_followed(&mut bench), Refusal::StreamInterrupted);
}

#[test]
fn short_gap_or_stream_at_rest_does_not_interrupt() {
    let mut bench = bench();
    stream(&mut bench, KINDS[0].1);
    bench.run(400);
    assert_eq!(is_followed(&mut bench), Refusal::None, "a gap");
    for _ in 0..40 {
        assert_eq!(is_followed(&mut bench), Refusal::None);
        bench.run(9);
    }
    bench.run(60_000);
    assert_eq!(is_followed(&mut bench), Refusal::None, "it stood still");
    // A rate of zero is rest, and a stream that a hand ends with an open clutch has ended.
    for k in 0..80 {
        let rate = if k < 40 { 6.0 } else { 0.0 };
        assert_eq!(bench.goal(ServoGoal::Rate(rad(-rate, 0.0), 2)), Refusal::None);
        bench.run(9);
    }
    bench.run(2000);
    assert_eq!(is_followed(&mut bench), Refusal::None);
}

#[test]
fn own_state_command_or_open_clutch_lets_stream_restart() {
    type Act = fn(&mut Bench) -> Refusal;
    let acts: [(&str, Act); 5] = [
        ("hold", |bench| {
            bench.run(1000);
            bench.ask(StateCommand::Hold)
        }),
        ("release", |bench| bench.ask(StateCommand::Release)),
        ("move", |bench| {
            bench.pose = Some((rad(1.0, 1.0), 2));
            let refusal = bench.ask(StateCommand::Move);
            bench.idle();
            refusal
        }),
        ("pause", |bench| match bench.ask(StateCommand::Pause) {
            Refusal::None => bench.ask(StateCommand::Resume),
            refusal => refusal,
        }),
        ("clutch", |bench| {
            let open = ServoCommand { clutched: true, ..here(bench) };
            bench.send(open)
        }),
    ];
    for (name, act) in acts {
        let mut bench = bench();
        stream(&mut bench, KINDS[0].1);
        bench.run(700);
        assert_eq!(is_followed(&mut bench), Refusal::StreamInterrupted, "{name}");
        assert_eq!(act(&mut bench), Refusal::None, "{name}");
        assert_eq!(is_followed(&mut bench), Refusal::None, "{name}");
    }
}

/// A command that arrives stale does not count as activity.
#[test]
fn stale_commands_do_not_let_stream_resume() {
    let mut bench = bench();
    stream(&mut bench, KINDS[0].1);
    for _ in 0..100 {
        let late = ServoCommand { stamp: bench.now - Nanos::from_millis(100), ..here(&mut bench) };
        assert_eq!(bench.send(late), Refusal::Stale);
        bench.run(9);
    }
    assert_eq!(is_followed(&mut bench), Refusal::StreamInterrupted);
}

#[test]
fn interrupted_jaw_stream_does_not_block_joints() {
    let mut bench = bench();
    let turn = |bench: &mut Bench, angle_deg: f64| {
        let command = bench.servo(ServoGoal::Joint([angle_deg.to_radians(), 0.0, 0.0], 1));
        bench.send_jaw(command)
    };
    for k in 0..100 {
        assert_eq!(turn(&mut bench, f64::from(k) * 0.1), Refusal::None, "{k}");
        bench.run(9);
    }
    bench.run(700);
    let held = bench.jaw.feedback.position;
    for _ in 0..10 {
        assert_eq!(turn(&mut bench, 9.9), Refusal::StreamInterrupted);
    }
    assert_eq!(bench.jaw.feedback.position, held);
    assert_eq!(is_followed(&mut bench), Refusal::None);
    assert_eq!(bench.ask(StateCommand::Enable), Refusal::None);
    assert_eq!(turn(&mut bench, 9.9), Refusal::None);
}
