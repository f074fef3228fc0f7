//! The model: possible actions and their effects.

use stateright::{Model, Property};

use super::controller::{self, acknowledge, disable, enable, forget, release, tick};
use super::environment::{self, deliver, forget_old, send, watch};
use super::guard::Guards;
use super::properties::properties;
use super::state::{Client, Drive, Process, Robot, SILENT, State, Truth, raise};

#[derive(Debug, Clone, Copy, Default)]
pub struct System {
    pub guards: Guards,
}

/// A possible action.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Time passes: the watchdog looks, then the loop runs and takes a command of one client. A
    /// stage after the limits may push the setpoint beyond one.
    Step {
        take: Option<Client>,
        pushed: bool,
    },
    Send(Client),
    /// A packet arrives. The middleware may keep a copy.
    Deliver {
        index: usize,
        copy: bool,
    },
    Enable,
    Disable,
    Acknowledge,
    Release(Client),
    /// The drive reports a fault and switches itself off.
    DriveFault,
    LineDown,
    LineUp,
    Kill,
    /// The loop hangs.
    Hang,
    Continue,
    /// The controller is started again. That takes longer than the watchdog needs to see the end,
    /// and does not succeed before every drive answers and is off.
    Restart,
}

impl Model for System {
    type State = State;
    type Action = Action;

    fn init_states(&self) -> Vec<State> {
        vec![State {
            process: Process::Runs,
            robot: Robot::Disabled,
            drive: Drive::Off,
            line_up: true,
            position_age: 0,
            accepted: None,
            followed: None,
            waiting: [None; 2],
            network: [None; 2],
            has_sent: [false; 2],
            heartbeat: None,
            last_heartbeat: None,
            motion: None,
            truth: Truth::default(),
        }]
    }

    fn actions(&self, state: &State, actions: &mut Vec<Action>) {
        actions.push(Action::Step { take: None, pushed: false });
        if state.followed.is_some() {
            actions.push(Action::Step { take: None, pushed: true });
        }
        for client in Client::ALL {
            if state.process == Process::Runs && state.waiting[client as usize].is_some() {
                actions.extend(
                    [false, true].map(|pushed| Action::Step { take: Some(client), pushed }),
                );
            }
            if !state.has_sent[client as usize] {
                actions.push(Action::Send(client));
            }
            actions.push(Action::Release(client));
        }
        for index in 0..state.network.iter().flatten().count() {
            actions.extend([false, true].map(|copy| Action::Deliver { index, copy }));
        }
        actions.extend([
            Action::Enable,
            Action::Disable,
            Action::Acknowledge,
            Action::DriveFault,
            Action::LineDown,
            Action::LineUp,
            Action::Kill,
            Action::Hang,
            Action::Continue,
            Action::Restart,
        ]);
    }

    fn next_state(&self, last: &State, action: Action) -> Option<State> {
        let mut state = last.clone();
        state.motion = None;
        let runs = state.process == Process::Runs;
        let happens = match action {
            Action::Step { take, pushed } => self.step(&mut state, take, pushed),
            Action::Send(client) => send(&mut state, client),
            Action::Deliver { index, copy } => deliver(&mut state, index, copy),
            Action::Enable => runs && enable(&mut state),
            Action::Disable => runs && disable(&mut state),
            Action::Acknowledge => runs && acknowledge(&mut state),
            Action::Release(client) => runs && release(&mut state, self.guards, client),
            Action::DriveFault => set(&mut state.drive, Drive::On, Drive::Faulted),
            Action::LineDown => set(&mut state.line_up, true, false),
            Action::LineUp => set(&mut state.line_up, false, true),
            Action::Kill => kill(&mut state, self.guards),
            Action::Hang => set(&mut state.process, Process::Runs, Process::Hangs),
            Action::Continue => set(&mut state.process, Process::Hangs, Process::Runs),
            Action::Restart => restart(&mut state),
        };
        happens.then_some(state)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        properties()
    }
}

impl System {
    fn step(&self, state: &mut State, take: Option<Client>, pushed: bool) -> bool {
        environment::grow_older(state);
        watch(state, self.guards);
        match state.process {
            Process::Runs => tick(state, self.guards, take, pushed),
            Process::Killed => state.process = Process::Dead,
            Process::Dead | Process::Hangs => {}
        }
        controller::grow_older(state);
        forget_old(state);
        let is_silent = state.process != Process::Runs && state.drive == Drive::On;
        let truth = &mut state.truth;
        raise(&mut truth.silent, SILENT);
        if !is_silent {
            truth.silent = 0;
        }
        truth.was_unreachable &= is_silent;
        true
    }
}

fn set<T: PartialEq>(value: &mut T, from: T, to: T) -> bool {
    let happens = *value == from;
    if happens {
        *value = to;
    }
    happens
}

fn kill(state: &mut State, guards: Guards) -> bool {
    if matches!(state.process, Process::Killed | Process::Dead) {
        return false;
    }
    state.process = Process::Killed;
    forget(state, guards);
    if let Some(last_heartbeat) = &mut state.last_heartbeat {
        last_heartbeat.is_current = false;
    }
    true
}

fn restart(state: &mut State) -> bool {
    if !state.line_up || !set(&mut state.process, Process::Dead, Process::Runs) {
        return false;
    }
    if state.drive != Drive::Faulted {
        state.drive = Drive::Off;
    }
    true
}
