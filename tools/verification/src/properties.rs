//! Properties that must hold in every state, and events that must happen in some, to show that the
//! former do not hold only because nothing moves.

use stateright::{Model, Property};

use super::controller::holder;
use super::state::{Client, DEADLINE, Drive, Followed, Process, Robot, SILENT, State};

pub fn properties<M: Model<State = State>>() -> Vec<Property<M>> {
    let mut properties = vec![
        Property::always("never two leaders", |_, state: &State| !state.truth.had_two_leaders),
        Property::always("silence leads to hold", |_, state: &State| {
            moves(state).is_none_or(|motion| motion.accepted_age < DEADLINE)
        }),
        Property::always("no command is followed after its deadline", |_, state: &State| {
            moves(state).is_none_or(|motion| motion.command.age < DEADLINE)
        }),
        Property::always("no command is accepted twice", |_, state: &State| {
            !state.truth.accepted_twice
        }),
        Property::always(
            "after a fault nothing moves before it is acknowledged",
            |_, state: &State| moves(state).is_none() || !state.truth.has_open_fault,
        ),
        Property::always(
            "a restarted controller moves nothing until it is enabled",
            |_, state: &State| moves(state).is_none() || state.truth.was_enabled,
        ),
        Property::always(
            "the watchdog stops the drive of a silent controller",
            |_, state: &State| state.truth.silent < SILENT || state.truth.was_unreachable,
        ),
        Property::always("the watchdog leaves a live controller alone", |_, state: &State| {
            !state.truth.stopped_a_live_controller
        }),
        Property::always("only the holder of the lease moves the robot", |_, state: &State| {
            moves(state).is_none_or(|motion| holder(state) == motion.client.id())
        }),
        Property::always("without fresh positions nothing moves", |_, state: &State| {
            moves(state).is_none() || state.position_age == 0
        }),
        Property::always("nothing moves unless the robot is ENABLED", |_, state: &State| {
            moves(state).is_none() || state.robot == Robot::Enabled
        }),
        Property::always("no setpoint beyond a limit reaches the drive", |_, state: &State| {
            !state.truth.broke_limit
        }),
    ];
    properties.extend(reachable());
    properties
}

fn reachable<M: Model<State = State>>() -> [Property<M>; 6] {
    [
        Property::sometimes("the near client moves the robot", |_, state: &State| {
            moves(state).is_some_and(|motion| motion.client == Client::Near)
        }),
        Property::sometimes("the far client moves the robot", |_, state: &State| {
            moves(state).is_some_and(|motion| motion.client == Client::Far)
        }),
        Property::sometimes("a late command moves the robot", |_, state: &State| {
            moves(state).is_some_and(|motion| motion.accepted_age == 0 && motion.command.age > 0)
        }),
        Property::sometimes("after a fault the robot moves again", |_, state: &State| {
            moves(state).is_some() && state.truth.has_recovered
        }),
        Property::sometimes("the watchdog stops a drive", |_, state: &State| {
            state.process != Process::Runs && state.drive == Drive::QuickStopped
        }),
        Property::sometimes("the other client has the lease", |_, state: &State| {
            state.truth.accepted.iter().all(Option::is_some)
        }),
    ]
}

/// The command along which the setpoint moved in the tick that has just ended.
fn moves(state: &State) -> Option<&Followed> {
    state.motion.as_ref()
}
