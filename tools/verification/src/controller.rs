//! The controller: admission, lease and deadline as in the program, the states as a model.

use i2ris::config::CommandConfig;
use i2ris::core::{
    AdmissionContext, CommandAdmission, EventList, ServoCommand, ServoGoal, StreamOf, stale_age,
};
use i2ris::robot::OperatingState;
use i2ris::units::{MAX_MOTORS, Nanos};

use super::guard::{Guard, Guards};
use super::state::{
    Accepted, Client, Command, DEADLINE, Drive, FORGOTTEN, Followed, Heartbeat, LEASE, LOST, Robot,
    STEP, State, raise,
};

/// The present. Everything else has an age.
pub const NOW: Nanos = Nanos::from_millis(1_000_000);

/// Sequence of a command that is the newest of its client.
const NEWEST: u64 = 1000;

pub fn ago(steps: u8) -> Nanos {
    NOW - Nanos(STEP.0 * u64::from(steps))
}

/// Deadline and lease in steps of the model.
pub fn config() -> CommandConfig {
    CommandConfig {
        deadline_ms: u64::from(DEADLINE) * STEP.0 / 1_000_000,
        lease_timeout_ms: u64::from(LEASE) * STEP.0 / 1_000_000,
        ..CommandConfig::default()
    }
}

/// The admission of the controller in this state, after it has looked at the lease.
fn admission(state: &State) -> CommandAdmission {
    let mut admission = CommandAdmission::new(&config());
    let mut events = EventList::new(NOW);
    let Some(accepted) = state.accepted else {
        return admission;
    };
    let others = Client::ALL.into_iter().filter(|it| *it != accepted.client);
    for other in others {
        if let Some(newer) = state.truth.accepted[other as usize] {
            accept_command(&mut admission, other, newer, NOW, &mut events);
            give_back(&mut admission, other);
        }
    }
    let (client, at) = (accepted.client, ago(accepted.age));
    accept_command(&mut admission, client, accepted.newer, at, &mut events);
    if accepted.is_released {
        give_back(&mut admission, accepted.client);
    }
    admission.expire_lease(false, NOW, &mut events);
    admission
}

/// As old as it can be: time stamps that decrease are not modelled, and restrict nothing here.
fn accept_command(
    admission: &mut CommandAdmission,
    client: Client,
    newer: u8,
    at: Nanos,
    events: &mut EventList,
) {
    let command = Command { stamp_age: FORGOTTEN + 1, ..Command::new(newer) };
    let command = servo_command(client, command);
    admission.accept(StreamOf::Joints, &command, &[0.0; MAX_MOTORS], at, events);
}

fn give_back(admission: &mut CommandAdmission, client: Client) {
    admission.release_lease(client.id(), &mut EventList::new(NOW));
}

fn servo_command(client: Client, command: Command) -> ServoCommand {
    ServoCommand {
        client_id: client.id(),
        sequence: NEWEST - u64::from(command.newer),
        stamp: ago(command.stamp_age),
        deadline: Nanos::ZERO,
        goal: ServoGoal::Actuator(Default::default(), MAX_MOTORS as u32),
        clutched: false,
        has_unknown_flags: false,
    }
}

/// One run of the loop, which takes a command of one client. `pushed`: the setpoint that it comes to
/// breaks a limit.
pub fn tick(state: &mut State, guards: Guards, take: Option<Client>, pushed: bool) {
    update_robot(state, guards);
    if let Some(client) = take
        && let Some(command) = state.waiting[client as usize].take()
    {
        admit(state, guards, client, command);
    }
    stop_if_stale(state, guards);
    move_setpoints(state, guards, pushed);
    state.heartbeat = Some(Heartbeat {
        age: 0,
        drives_off: state.robot == Robot::Disabled && state.drive == Drive::Off,
    });
}

/// Faults, and commanded drive states.
fn update_robot(state: &mut State, guards: Guards) {
    let is_reached = state.line_up;
    let is_lost = state.position_age >= LOST;
    let has_fault = is_lost
        || is_reached && state.drive == Drive::Faulted
        || is_reached && state.robot == Robot::Enabled && state.drive != Drive::On;
    if has_fault && state.robot != Robot::Fault {
        state.robot = Robot::Fault;
        state.followed = None;
        state.truth.has_open_fault = true;
    }
    if guards.has(Guard::Freshness) && state.position_age > 0 {
        state.followed = None;
    }
    if !is_reached {
        return;
    }
    match (state.robot, state.drive) {
        (Robot::Disabled, Drive::On | Drive::QuickStopped) => state.drive = Drive::Off,
        (Robot::Enabling, _) => state.robot = Robot::PoweringOn,
        (Robot::PoweringOn, Drive::Off) => state.drive = Drive::On,
        (Robot::PoweringOn, Drive::On) => state.robot = Robot::Enabled,
        (Robot::Fault, Drive::On) => state.drive = Drive::QuickStopped,
        (Robot::Fault, _) if !guards.has(Guard::Acknowledge) => clear_fault(state),
        _ => {}
    }
}

fn clear_fault(state: &mut State) {
    state.robot = Robot::Disabled;
    if state.drive == Drive::Faulted {
        state.drive = Drive::Off;
    }
}

fn admit(state: &mut State, guards: Guards, client: Client, command: Command) {
    let mut known = state.clone();
    if !guards.has(Guard::Lease)
        && let Some(accepted) = &mut known.accepted
    {
        accepted.is_released = true;
    }
    if !guards.has(Guard::Sequence) {
        known.accepted = known.accepted.filter(|accepted| accepted.client != client);
        known.truth.accepted[client as usize] = None;
    }
    let mut command = command;
    if !guards.has(Guard::Age) {
        command.stamp_age = 0;
    }
    let is_enabled = state.robot == Robot::Enabled || !guards.has(Guard::Enabled);
    let context = AdmissionContext {
        now: NOW,
        state: if is_enabled { OperatingState::Enabled } else { OperatingState::Disabled },
        unoccupied: Ok(()),
        owner: state.followed.filter(|_| guards.has(Guard::Lease)).map(|it| it.client.id()),
        is_homed: true,
        is_fresh: state.position_age == 0 || !guards.has(Guard::Freshness),
    };
    let servo = servo_command(client, command);
    let checked = admission(&known).check(StreamOf::Joints, &servo, &context);
    if checked.is_ok() {
        accept(state, client, command);
    }
}

fn accept(state: &mut State, client: Client, command: Command) {
    let truth = &mut state.truth;
    let leads = |it: Accepted| it.client != client && it.age < LEASE && !it.is_released;
    truth.had_two_leaders |= state.accepted.is_some_and(leads);
    let newest = &mut truth.accepted[client as usize];
    truth.accepted_twice |= newest.is_some_and(|newest| command.newer >= newest);
    *newest = Some(newest.map_or(command.newer, |newest| newest.min(command.newer)));
    state.accepted = Some(Accepted { client, newer: command.newer, age: 0, is_released: false });
    state.followed = Some(Followed { client, command, accepted_age: 0 });
}

fn stop_if_stale(state: &mut State, guards: Guards) {
    let deadline = Nanos::from_millis(config().deadline_ms);
    let is_stale = |followed: &Followed| {
        stale_age(ago(followed.command.stamp_age), deadline, NOW).is_some()
            && guards.has(Guard::Deadline)
    };
    state.followed = state.followed.filter(|followed| !is_stale(followed));
}

/// Models the gate as the last stage, which holds a setpoint that breaks a limit. Unlike the
/// admission it is not the gate of the controller: that gate judges real numbers of axes and a
/// model with memory, and a search over states ends only if there are few. It is one bit here, a
/// stage that pushed. The search shows that no order of commands, silences and restarts bypasses
/// it. The type `Gated` shows that nothing else makes one; `cycle::pairs` shows that the real gate
/// keeps every limit.
fn move_setpoints(state: &mut State, guards: Guards, pushed: bool) {
    state.motion = state.followed.filter(|_| !pushed || !guards.has(Guard::Gate));
    state.truth.broke_limit |= pushed && state.motion.is_some();
}

/// The command `enable`.
pub fn enable(state: &mut State) -> bool {
    let is_ready = state.drive == Drive::Off && state.line_up && state.position_age == 0;
    let is_accepted = state.robot == Robot::Disabled && is_ready;
    if is_accepted {
        state.robot = Robot::Enabling;
        state.truth.was_enabled = true;
    }
    is_accepted
}

/// The command `disable`.
pub fn disable(state: &mut State) -> bool {
    let is_on = matches!(state.robot, Robot::Enabling | Robot::PoweringOn | Robot::Enabled);
    if is_on {
        state.robot = Robot::Disabled;
        state.followed = None;
    }
    is_on
}

/// The command `acknowledge`.
pub fn acknowledge(state: &mut State) -> bool {
    let can_clear = state.line_up && state.position_age == 0 && state.drive != Drive::On;
    let is_accepted = state.robot == Robot::Fault && can_clear;
    if is_accepted {
        clear_fault(state);
        state.truth.has_open_fault = false;
        state.truth.has_recovered = true;
    }
    is_accepted
}

/// The command `release`.
pub fn release(state: &mut State, guards: Guards, client: Client) -> bool {
    if holder(state) != client.id() {
        return false;
    }
    if let Some(accepted) = &mut state.accepted {
        accepted.is_released = true;
    }
    if guards.has(Guard::Release) {
        let is_other = |followed: &Followed| followed.client != client;
        state.followed = state.followed.filter(is_other);
    }
    true
}

/// Everything that the process knows is gone.
pub fn forget(state: &mut State, guards: Guards) {
    state.waiting = [None; 2];
    state.heartbeat = None;
    state.truth.accepted = [None; 2];
    state.truth.has_open_fault = false;
    state.truth.was_enabled = false;
    if guards.has(Guard::Restart) {
        state.robot = Robot::Disabled;
        state.accepted = None;
        state.followed = None;
    }
}

/// One step later.
pub fn grow_older(state: &mut State) {
    if let Some(accepted) = &mut state.accepted {
        raise(&mut accepted.age, LEASE);
    }
    if let Some(followed) = &mut state.followed {
        raise(&mut followed.accepted_age, LEASE);
        grow_command(&mut followed.command);
    }
    for command in state.waiting.iter_mut().chain(&mut state.network).flatten() {
        grow_command(command);
    }
}

fn grow_command(command: &mut Command) {
    raise(&mut command.age, FORGOTTEN + 1);
    raise(&mut command.stamp_age, FORGOTTEN + 1);
}

/// Who holds the lease, as the controller sees it.
pub fn holder(state: &State) -> u64 {
    admission(state).commander(None)
}
