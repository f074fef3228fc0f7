//! Sends requests to the controller one after the other, so that a stream of commands does not wait
//! for a request. Stops have a separate thread and wait for nothing.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread::{self, JoinHandle};

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::client::{ClientError, Latest, RequestForwarder, Watcher};
use i2ris::ipc::payload::{MoveRequest, OperatingStateMsg, StateCommandReply, StateCommandRequest};
use i2ris::robot::{OperatingState, Refusal, StateCommand};
use i2ris::units::Nanos;

use crate::RosError;
use crate::admission::{Pose, Topic};
use crate::event::{ClientNames, Event, Events, Reason, Refused};

/// State commands that only stop. They pass every check and overtake every queue.
pub(super) const STOPS: [StateCommand; 3] =
    [StateCommand::Disable, StateCommand::Pause, StateCommand::Hold];

#[derive(Debug, Clone, Copy)]
struct Ask {
    client_id: u64,
    what: What,
    stops: u64,
}

#[derive(Debug, Clone, Copy)]
pub(super) enum What {
    State(StateCommand),
    Move(Topic, Pose),
}

impl What {
    const fn topic(&self) -> &'static str {
        match self {
            Self::State(_) => Topic::StateCommand.name(),
            Self::Move(topic, _) => topic.name(),
        }
    }
}

/// Pending stops with their clients, for the thread that does nothing else.
#[derive(Debug, Default)]
struct Stops {
    /// The client that wants each of [`STOPS`]; 0: none.
    wanted: [AtomicU64; STOPS.len()],
    /// Number of stops: requests that waited when one arrived are not carried out.
    count: AtomicU64,
    /// Number of stops answered or timed out: later requests wait for this.
    done: AtomicU64,
}

/// Ends when dropped, once its last request is answered; stops come first.
#[derive(Debug)]
pub(super) struct Requests {
    stopper: Worker<()>,
    worker: Worker<Ask>,
    stops: Arc<Stops>,
}

impl Requests {
    pub fn start(domain: &Domain, events: &Events, names: &ClientNames) -> Result<Self, RosError> {
        let stops = Arc::<Stops>::default();
        let asker = || Asker {
            controller: RequestForwarder::new(domain),
            state: Latest::new(Watcher::new(domain).operating_state()),
            stops: Arc::clone(&stops),
            events: events.clone(),
            names: names.clone(),
        };
        let (mut asking, mut stopping) = (asker(), asker());
        let worker = Worker::start("requests", WAITING, move |ask| asking.take(ask))?;
        let stopper = Worker::start("stops", 1, move |()| stopping.stop_all())?;
        Ok(Self { stopper, worker, stops })
    }

    pub fn ask(&self, client_id: u64, what: What) -> Result<(), Reason> {
        let ask = Ask { client_id, what, stops: self.stops.count.load(Ordering::Acquire) };
        if self.worker.ask(ask) { Ok(()) } else { Err(Reason::Waiting) }
    }

    /// Requests one of [`STOPS`]. Never refused: pending requests are overtaken and dropped.
    pub fn stop(&self, client_id: u64, command: StateCommand) {
        let place = STOPS.iter().position(|stop| *stop == command);
        if let Some(wanted) = place.and_then(|place| self.stops.wanted.get(place)) {
            wanted.store(client_id, Ordering::Release);
        }
        self.stops.count.fetch_add(1, Ordering::AcqRel);
        // A thread that is awake, or about to wake, checks all of them.
        let _ = self.stopper.ask(());
    }
}

struct Asker {
    controller: RequestForwarder,
    state: Latest<OperatingStateMsg>,
    stops: Arc<Stops>,
    events: Events,
    names: ClientNames,
}

impl Asker {
    fn take(&mut self, ask: Ask) {
        // A pose right after a hold would find the robot not yet held.
        while self.stops.done.load(Ordering::Acquire) < ask.stops {
            clock::sleep(Nanos::from_millis(1));
        }
        if self.stops.count.load(Ordering::Acquire) == ask.stops {
            return self.carry_out(ask);
        }
        let (client, topic) = (self.name(ask.client_id), ask.what.topic());
        let refused = Refused { client, topic, reason: Reason::Overtaken, count: 1 };
        self.events.report(Event::Refused(refused));
    }

    fn stop_all(&mut self) {
        let stops = Arc::clone(&self.stops);
        let count = stops.count.load(Ordering::Acquire);
        for (wanted, command) in stops.wanted.iter().zip(STOPS) {
            let client_id = wanted.swap(0, Ordering::AcqRel);
            if client_id != 0 {
                self.change_state(client_id, command);
            }
        }
        stops.done.store(count, Ordering::Release);
    }

    fn carry_out(&mut self, ask: Ask) {
        match ask.what {
            What::State(command) if self.is_so_already(command) => {
                let name = self.name(ask.client_id);
                let more = match command {
                    StateCommand::Home => "; `unhome` first to set a new zero",
                    _ => "",
                };
                let line = format!("{name}: {command}: already in this state{more}");
                self.events.report(Event::Status(line));
                self.events.report(Event::StateRepeated);
            }
            What::State(command) => self.change_state(ask.client_id, command),
            What::Move(topic, pose) => self.move_to(ask.client_id, topic, &pose),
        }
    }

    fn change_state(&mut self, client_id: u64, command: StateCommand) {
        let again = self.is_so_already(command);
        let reply = self.controller.state_command(StateCommandRequest {
            client_id,
            command: command.number(),
            ..StateCommandRequest::default()
        });
        let done = self.check(client_id, "state_command", command, reply);
        if let Some(state) = done {
            let name = self.name(client_id);
            let line = format!("{name}: {command}; the controller is {state}");
            self.events.report(Event::Status(line));
            if again {
                self.events.report(Event::StateRepeated);
            }
        }
    }

    fn move_to(&mut self, client_id: u64, topic: Topic, pose: &Pose) {
        self.events.report_move(Event::MoveRequested);
        let reply = self.controller.move_jp(MoveRequest {
            client_id,
            position: pose.position,
            count: pose.count,
            flags: if topic == Topic::MoveCp { MoveRequest::TIP } else { 0 },
            ..MoveRequest::default()
        });
        let answered = clock::now();
        let moves = self.check(client_id, topic.name(), StateCommand::Move, reply);
        let since = moves.map(|_| answered);
        self.events.report_move(Event::MoveAnswered(since));
    }

    /// The state after an accepted command. The stream of warnings has the reason for a refusal.
    fn check(
        &mut self,
        client_id: u64,
        topic: &'static str,
        command: StateCommand,
        reply: Result<StateCommandReply, ClientError>,
    ) -> Option<OperatingState> {
        let client = self.name(client_id);
        match reply {
            Ok(reply) => {
                let state = OperatingState::from_number(reply.state);
                if reply.refusal == Refusal::None.number() {
                    return state;
                }
                let state = state.map_or("unknown", OperatingState::text);
                let line = format!("{client}: {topic}: {command} refused in state {state}");
                self.events.report(Event::Status(line));
            }
            Err(error) => {
                let reason = Reason::Failed(format!("{command} failed: {error}"));
                self.events.report(Event::Refused(Refused { client, topic, reason, count: 1 }));
            }
        }
        None
    }

    /// Whether a command requests the present state. CRTK's clients wait for a state message.
    fn is_so_already(&mut self, command: StateCommand) -> bool {
        let Some(state) = self.state.refresh().ok().flatten() else { return false };
        let is_in = |wanted: OperatingState| state.state == wanted.number();
        let is_homed = state.flags & OperatingStateMsg::HOMED != 0;
        match command {
            StateCommand::Enable | StateCommand::Resume => is_in(OperatingState::Enabled),
            StateCommand::Disable => is_in(OperatingState::Disabled),
            StateCommand::Pause => is_in(OperatingState::Paused),
            StateCommand::Home => is_homed,
            StateCommand::Unhome => !is_homed,
            _ => false,
        }
    }

    fn name(&self, client_id: u64) -> String {
        self.names.of(client_id).unwrap_or_default()
    }
}

const WAITING: usize = 16;

/// A thread that does one task after the other, so that nothing else waits for a controller that
/// hangs. Ends when it is dropped, once its last task is done.
#[derive(Debug)]
struct Worker<T> {
    tasks: Option<SyncSender<T>>,
    thread: Option<JoinHandle<()>>,
}

impl<T: Send + 'static> Worker<T> {
    fn start(
        name: &str,
        waiting: usize,
        mut work: impl FnMut(T) + Send + 'static,
    ) -> Result<Self, RosError> {
        let (tasks, to_do) = sync_channel(waiting);
        let run = move || to_do.into_iter().for_each(&mut work);
        let thread = thread::Builder::new().name(name.to_owned()).spawn(run);
        let thread = thread.map_err(RosError::thread)?;
        Ok(Self { tasks: Some(tasks), thread: Some(thread) })
    }

    /// `false`: too many tasks wait already.
    fn ask(&self, task: T) -> bool {
        self.tasks.as_ref().is_some_and(|tasks| tasks.try_send(task).is_ok())
    }
}

impl<T> Drop for Worker<T> {
    fn drop(&mut self) {
        self.tasks = None;
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event;

    #[test]
    fn requests_before_a_stop_are_dropped() {
        let (events, reported) = event::channel();
        let domain = Domain::new(&format!("t{:016x}", i2ris::ipc::random_id())).unwrap();
        let requests = Requests::start(&domain, &events, &ClientNames::default()).unwrap();
        let mut asker = Asker {
            controller: RequestForwarder::new(&domain),
            state: Latest::new(Watcher::new(&domain).operating_state()),
            stops: Arc::clone(&requests.stops),
            events,
            names: ClientNames::default(),
        };
        let before = Ask { client_id: 7, what: What::State(StateCommand::Enable), stops: 0 };
        for _ in 0..100 {
            // Never refused, for any number of pending requests.
            requests.stop(7, StateCommand::Disable);
        }
        asker.take(before);
        drop(requests);
        let reason = |event| match event {
            Event::Refused(refused) => Some(refused.reason.to_string()),
            _ => None,
        };
        let reasons: Vec<String> = reported.try_iter().filter_map(reason).collect();
        assert!(reasons.iter().any(|reason| *reason == Reason::Overtaken.to_string()));
        assert!(reasons.iter().any(|reason| reason.contains("disable failed")), "{reasons:?}");
        assert!(!reasons.iter().any(|reason| reason.contains("enable failed")), "{reasons:?}");
    }
}
