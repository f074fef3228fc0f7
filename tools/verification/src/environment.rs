//! Clients, middleware, line and watchdog.

use i2ris::ipc::heartbeat::{ControllerAbsent, Heartbeat as ReadHeartbeat};
use i2ris::units::Nanos;
use i2ris::watchdog::{ControllerStatus, HeartbeatMonitor};

use super::controller::{NOW, ago};
use super::guard::{Guard, Guards};
use super::state::{
    Client, Command, Drive, FORGOTTEN, LOST, LastHeartbeat, MAX_NEWER, Process, SILENCE, SILENT,
    State, raise,
};

/// A client sends a command: at most one per step.
pub fn send(state: &mut State, client: Client) -> bool {
    let index = client as usize;
    let is_far = client == Client::Far;
    let packets = state.network.iter_mut().filter(|_| is_far);
    for command in packets.chain([&mut state.waiting[index]]).flatten() {
        raise(&mut command.newer, MAX_NEWER);
    }
    if let Some(accepted) = state.accepted.as_mut().filter(|it| it.client == client) {
        raise(&mut accepted.newer, MAX_NEWER);
    }
    if let Some(followed) = state.followed.as_mut().filter(|it| it.client == client) {
        raise(&mut followed.command.newer, MAX_NEWER);
    }
    if let Some(newest) = &mut state.truth.accepted[index] {
        raise(newest, MAX_NEWER);
    }
    let command = Command::new(0);
    if is_far {
        state.network = [state.network[1].or(state.network[0]), Some(command)];
    } else {
        state.waiting[index] = Some(command);
    }
    state.has_sent[index] = true;
    true
}

/// A packet arrives, with the age that it has; the middleware may keep a copy.
pub fn deliver(state: &mut State, index: usize, copy: bool) -> bool {
    let Some(command) = state.network[index] else {
        return false;
    };
    if !copy {
        state.network[index] = None;
        if index == 1 {
            state.network.swap(0, 1);
        }
    }
    state.waiting[Client::Far as usize] = Some(command);
    true
}

/// The watchdog looks once.
pub fn watch(state: &mut State, guards: Guards) {
    if !guards.has(Guard::Watchdog) {
        return;
    }
    let silence = if guards.has(Guard::Patience) { SILENCE } else { Nanos::ZERO };
    let mut monitor = remembered(state.last_heartbeat, silence);
    let word = state.heartbeat.map(|word| heartbeat_word(true, word.age, word.drives_off));
    let read = match state.process {
        // The watchdog looks a last time at the word that it has mapped.
        Process::Killed | Process::Dead => {
            let mapped = state.last_heartbeat.is_some_and(|last| last.is_current);
            Err(ControllerAbsent { last: word.filter(|_| mapped) })
        }
        _ => Ok(word),
    };
    let status = monitor.update(read, NOW);
    let is_stop = matches!(status, ControllerStatus::Died | ControllerStatus::Hangs);
    state.last_heartbeat = match (read, state.last_heartbeat) {
        (Err(_), _) => None,
        (Ok(None), last_heartbeat) => last_heartbeat.map(|last_heartbeat| LastHeartbeat {
            reported: last_heartbeat.reported || is_stop,
            ..last_heartbeat
        }),
        (Ok(Some(_)), last_heartbeat) => state.heartbeat.map(|heartbeat| LastHeartbeat {
            age: heartbeat.age,
            drives_off: heartbeat.drives_off,
            is_current: true,
            reported: is_stop
                || last_heartbeat.is_some_and(|last| {
                    last.reported && last.is_current && last.age == heartbeat.age
                }),
        }),
    };
    if is_stop {
        stop_drive(state);
    }
}

/// A monitor whose last heartbeat was this.
fn remembered(last_heartbeat: Option<LastHeartbeat>, silence: Nanos) -> HeartbeatMonitor {
    let mut monitor = HeartbeatMonitor::new(silence);
    if let Some(last_heartbeat) = last_heartbeat {
        let last = heartbeat_word(
            last_heartbeat.is_current,
            last_heartbeat.age,
            last_heartbeat.drives_off,
        );
        monitor.update(Ok(Some(last)), last.stamp);
        if last_heartbeat.reported {
            monitor.update(Ok(Some(last)), last.stamp + silence + Nanos(1));
        }
    }
    monitor
}

fn heartbeat_word(is_current: bool, age: u8, off: bool) -> ReadHeartbeat {
    let (boot_id, stamp) = (if is_current { 2 } else { 1 }, ago(age));
    ReadHeartbeat { boot_id, stamp, off, ..ReadHeartbeat::default() }
}

fn stop_drive(state: &mut State) {
    let is_live = state.process == Process::Runs && state.heartbeat.is_some_and(|it| it.age <= 1);
    state.truth.stopped_a_live_controller |= is_live;
    if state.drive != Drive::On {
        return;
    }
    if state.line_up {
        state.drive = Drive::QuickStopped;
    } else {
        state.truth.was_unreachable = true;
    }
}

/// One step later, for what is not inside the controller.
pub fn grow_older(state: &mut State) {
    raise(&mut state.position_age, LOST);
    if state.line_up {
        state.position_age = 0;
    }
    if let Some(heartbeat) = &mut state.heartbeat {
        raise(&mut heartbeat.age, SILENT);
    }
    if let Some(last_heartbeat) = &mut state.last_heartbeat {
        raise(&mut last_heartbeat.age, SILENT);
    }
    state.has_sent = [false; 2];
}

/// Forgets what is too old to matter, so that the number of states has an end.
pub fn forget_old(state: &mut State) {
    for waiting in state.waiting.iter_mut().chain(&mut state.network) {
        *waiting = waiting.filter(|command| command.age <= FORGOTTEN);
    }
    if state.network[0].is_none() {
        state.network.swap(0, 1);
    }
}
