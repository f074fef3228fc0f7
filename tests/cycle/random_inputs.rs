//! For random clients, drives and clocks, the invariants hold in every tick, and the robot can be
//! enabled again afterwards.

use i2ris::core::{ServoCommand, ServoGoal};
use i2ris::drive::AxisPhase;
use i2ris::ipc::{OperatingState, Refusal, StateCommand};
use i2ris::units::{Counts, Nanos};
use i2ris_testing::cycle::{Bench, Quirk, config, rad, standard_model};
use proptest::prelude::*;

#[derive(Debug, Clone)]
enum Act {
    Run(usize),
    Skip(u64),
    Ask(u64, StateCommand),
    /// Client, change of the sequence, age in ms (negative: future), deadline in ms, goal.
    Servo(u64, i64, i64, u64, ServoGoal),
    /// A stream of small steps, as a working client sends them: motors, steps, ticks between them.
    Stream([i32; 2], usize, usize),
    Phase(usize, AxisPhase),
    Position(usize, i32),
    Homed(usize, bool),
    Quirk(usize, Quirk),
    Slot(usize, u64),
    /// Drives work again, and the operator tries to go on.
    Recover,
}

const PHASES: [AxisPhase; 9] = [
    AxisPhase::Starting,
    AxisPhase::Disabled,
    AxisPhase::Enabling,
    AxisPhase::Enabled,
    AxisPhase::Homing,
    AxisPhase::QuickStopped,
    AxisPhase::Disabling,
    AxisPhase::Faulted,
    AxisPhase::Lost,
];

const QUIRKS: [Quirk; 7] = [
    Quirk::None,
    Quirk::None,
    Quirk::Silent,
    Quirk::Deaf,
    Quirk::Blocked,
    Quirk::Homeless,
    Quirk::Broken,
];

fn angle() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => -0.6..0.6_f64,
        6 => -0.05..0.05_f64,
        1 => prop::sample::select(vec![f64::NAN, f64::INFINITY, 1e300, -1e300, f64::MIN_POSITIVE]),
    ]
}

fn goal() -> impl Strategy<Value = ServoGoal> {
    let entries = prop_oneof![9 => Just(2_u32), 1 => 0..5_u32];
    prop_oneof![
        (prop::array::uniform3(angle()), entries.clone())
            .prop_map(|(angles, entries)| ServoGoal::Joint(angles, entries)),
        (prop::array::uniform3(angle()), entries.clone(), 0..4_u8).prop_map(
            |(it, entries, kind)| {
                match kind {
                    0 => ServoGoal::Rate(it, entries),
                    1 => ServoGoal::Interpolated(it, entries),
                    2 => ServoGoal::Tip(it.map(|it| 0.02 * it), entries + 1),
                    _ => ServoGoal::TipRate(it.map(|it| 0.02 * it), entries + 1),
                }
            }
        ),
        (prop::array::uniform2(prop_oneof![9 => -1100..1100_i32, 1 => any::<i32>()]), entries)
            .prop_map(|(counts, entries)| ServoGoal::Actuator(counts.map(Counts), entries)),
    ]
}

fn act() -> impl Strategy<Value = Act> {
    let axis = 0..2_usize;
    prop_oneof![
        6 => (1..80_usize).prop_map(Act::Run),
        1 => (1..400_u64).prop_map(Act::Skip),
        8 => (1..4_u64, prop::sample::select(StateCommand::ALL))
            .prop_map(|(client, command)| Act::Ask(client, command)),
        6 => (0..4_u64, -1..3_i64, -5..80_i64, prop_oneof![Just(0_u64), 1..1200_u64], goal())
            .prop_map(|(client, sequence, age, deadline, goal)| {
                Act::Servo(client, sequence, age, deadline, goal)
            }),
        8 => (prop::array::uniform2(-9..10_i32), 1..30_usize, 1..12_usize)
            .prop_map(|(step, steps, ticks)| Act::Stream(step, steps, ticks)),
        2 => (axis.clone(), prop::sample::select(PHASES.as_slice()))
            .prop_map(|(axis, phase)| Act::Phase(axis, phase)),
        1 => (axis.clone(), -690..990_i32)
            .prop_map(|(axis, position)| Act::Position(axis, position)),
        1 => (axis.clone(), any::<bool>()).prop_map(|(axis, homed)| Act::Homed(axis, homed)),
        1 => (axis.clone(), prop::sample::select(QUIRKS.as_slice()))
            .prop_map(|(axis, quirk)| Act::Quirk(axis, quirk)),
        1 => (axis, 1..20_u64).prop_map(|(axis, slot)| Act::Slot(axis, slot)),
        3 => Just(Act::Recover),
    ]
}

fn perform(bench: &mut Bench, act: Act, sequence: &mut i64) {
    match act {
        Act::Run(ticks) => bench.run(ticks),
        Act::Skip(milliseconds) => bench.skip(Nanos::from_millis(milliseconds)),
        Act::Ask(client, command) => {
            bench.pose = (command == StateCommand::Move).then(|| (rad(3.0, -2.0), 2));
            let _ = bench.ask_as(client, command);
        }
        Act::Servo(client_id, rise, age_ms, deadline_ms, goal) => {
            *sequence += rise;
            let stamp = Nanos((bench.now.0 as i64 - age_ms * 1_000_000) as u64);
            let deadline = Nanos::from_millis(deadline_ms);
            let (sequence, clutched) = (sequence.unsigned_abs(), age_ms % 5 == 3);
            let _ = bench.send(ServoCommand {
                client_id,
                sequence,
                stamp,
                deadline,
                goal,
                clutched,
                has_unknown_flags: rise == 0,
            });
        }
        Act::Stream(step, steps, ticks) => {
            let mut goal = bench.targets();
            for _ in 0..steps {
                goal = [goal[0] + step[0], goal[1] + step[1]];
                let _ = bench.actuator(goal);
                bench.run(ticks - 1);
            }
        }
        Act::Phase(axis, phase) => bench.drives[axis].feedback.phase = phase,
        Act::Position(axis, position) => bench.drives[axis].feedback.position = Counts(position),
        Act::Homed(axis, homed) => bench.drives[axis].feedback.homed = homed,
        Act::Quirk(axis, quirk) => bench.drives[axis].quirk = quirk,
        Act::Slot(axis, slot) => bench.drives[axis].slot = slot,
        Act::Recover => {
            heal(bench);
            for command in [
                StateCommand::Acknowledge,
                StateCommand::Home,
                StateCommand::Enable,
                StateCommand::Resume,
            ] {
                bench.run(300);
                let _ = bench.ask(command);
            }
            bench.run(20);
        }
    }
}

fn heal(bench: &mut Bench) {
    for drive in &mut bench.drives {
        drive.quirk = Quirk::None;
        if matches!(drive.feedback.phase, AxisPhase::Lost | AxisPhase::Starting) {
            drive.feedback.phase = AxisPhase::Disabled;
        }
    }
}

/// Heals the drives and does what an operator would do.
fn bring_back(bench: &mut Bench) {
    heal(bench);
    // At slow limits a conditioning cycle takes minutes. Refused where nothing moves.
    let _ = bench.ask(StateCommand::Pause);
    // Longer than any timeout but that of homing.
    bench.run((4_000_000_000 / bench.config.control.period().0) as usize);
    bench.idle();
    if bench.state() == OperatingState::Fault {
        assert_eq!(bench.ask(StateCommand::Acknowledge), Refusal::None, "{:?}", bench.report());
    }
    assert_eq!(bench.ask(StateCommand::Disable), Refusal::None);
    bench.idle();
    assert_eq!(bench.state(), OperatingState::Disabled, "{:?}", bench.report());
    bench.home();
    bench.enable();
    assert_eq!(bench.actuator([100, 100]), Refusal::None);
}

fn survive(mut bench: Bench, acts: Vec<Act>) {
    let mut sequence = 0;
    for act in acts {
        perform(&mut bench, act, &mut sequence);
    }
    bring_back(&mut bench);
}

proptest! {
    #![proptest_config(i2ris_testing::cases(64))]

    #[test]
    fn invariants_hold_for_random_inputs(acts in prop::collection::vec(act(), 1..60)) {
        survive(Bench::enabled(), acts);
    }

    #[test]
    fn invariants_hold_for_random_inputs_and_limits(
        rate_hz in 100..4000_u32, velocity in 50.0..20_000.0_f64,
        acceleration in 500.0..1e6_f64, ratio in 1.0..20.0_f64, window in 1..=32_u32,
        acts in prop::collection::vec(act(), 1..40)
    ) {
        let deceleration = (acceleration * ratio).max(20.0 * velocity);
        let jerk = 2.0 * deceleration * f64::from(rate_hz) / (f64::from(window) - 0.5);
        let tables = format!(
            "[control]\nrate_hz = {rate_hz}\n[limits]\nvelocity_counts_s = {velocity}\n\
             acceleration_counts_s2 = {acceleration}\n\
             stop_deceleration_counts_s2 = {deceleration}\njerk_counts_s3 = {jerk}"
        );
        let bench = Bench::enabled_with(config(&tables), Some(standard_model()));
        survive(bench, acts);
    }
}
