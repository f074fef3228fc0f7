//! H14: motion on the release of a stop.

use i2ris::ipc::{OperatingState, Refusal, StateCommand};

use crate::bench::Bench;

/// A client that continues to send while paused moves its goal away: the goal has to return to the
/// pose of the snake.
#[test]
fn h14_resume_does_not_move_and_a_goal_that_moved_away_is_refused() {
    let mut bench = Bench::moving();
    assert_eq!(bench.ask(StateCommand::Pause), Refusal::None);
    bench.idle();
    let before = bench.targets();
    for k in 0..50 {
        assert_eq!(bench.actuator([before[0] + 5 * k, 0]), Refusal::NotEnabled);
    }
    assert_eq!(bench.ask(StateCommand::Resume), Refusal::None);
    bench.run(500);
    assert_eq!(bench.targets(), before, "nothing moves by itself");
    assert_eq!(bench.actuator([before[0] + 300, 0]), Refusal::Step);
    bench.run(100);
    assert_eq!(bench.targets(), before);
    assert_eq!(bench.actuator([before[0] + 10, before[1]]), Refusal::None);
}

#[test]
fn h14_after_a_fault_the_operator_acknowledges_enables_and_commands_before_anything_moves() {
    let mut bench = Bench::faulted();
    bench.run(100);
    assert_eq!(bench.ask(StateCommand::Enable), Refusal::State);
    assert_eq!(bench.actuator([0, 0]), Refusal::NotEnabled);
    assert_eq!(bench.ask(StateCommand::Acknowledge), Refusal::None);
    bench.idle();
    assert_eq!(bench.state(), OperatingState::Disabled);
    let before = bench.targets();
    bench.enable();
    bench.run(500);
    assert_eq!(bench.targets(), before);
    assert_eq!(bench.joints().goal, bench.joints().setpoint);
}
