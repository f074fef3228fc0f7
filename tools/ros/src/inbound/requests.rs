//! Asks the controller, one request after the other, so that a stream of commands does not wait
//! behind a request.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::client::{ClientError, Latest, RequestForwarder, Watcher};
use i2ris::ipc::payload::{MoveRequest, OperatingStateMsg, StateCommandReply, StateCommandRequest};
use i2ris::robot::{OperatingState, Refusal, StateCommand};
use i2ris_gateway::Reason;
use i2ris_gateway::admission::{Pose, Topic};
use i2ris_gateway::refusals::Refused;
use i2ris_gateway::worker::{WAITING, Worker};

use crate::RosError;
use crate::event::{ClientNames, Event, Events};

#[derive(Debug, Clone, Copy)]
pub(super) struct Ask {
    pub client_id: u64,
    pub what: What,
}

#[derive(Debug, Clone, Copy)]
pub(super) enum What {
    State(StateCommand),
    Move(Topic, Pose),
}

/// Ends when dropped, once its last request is answered.
#[derive(Debug)]
pub(super) struct Requests {
    worker: Option<Worker<Ask>>,
    /// The client that wants to hold; 0: none. It overtakes everything that waits.
    hold: Arc<AtomicU64>,
}

impl Requests {
    pub fn start(domain: &Domain, events: &Events, names: &ClientNames) -> Result<Self, RosError> {
        let hold = Arc::new(AtomicU64::new(0));
        let mut asker = Asker {
            controller: RequestForwarder::new(domain),
            state: Latest::new(Watcher::new(domain).operating_state()),
            hold: Arc::clone(&hold),
            events: events.clone(),
            names: names.clone(),
        };
        let worker = Worker::start("requests", WAITING, move |ask| asker.take(ask));
        let worker = worker.map_err(RosError::thread)?;
        Ok(Self { worker: Some(worker), hold })
    }

    /// # Errors
    ///
    /// [`Reason::Waiting`].
    pub fn ask(&self, ask: Ask) -> Result<(), Reason> {
        let taken = self.worker.as_ref().is_some_and(|worker| worker.ask(ask));
        if taken { Ok(()) } else { Err(Reason::Waiting) }
    }

    /// Asks to hold. Never refused.
    pub fn hold(&self, client_id: u64) {
        self.hold.store(client_id, Ordering::Release);
        // Wakes the thread. If too much waits already, what waits makes it look.
        let what = What::State(StateCommand::Hold);
        let _ = self.ask(Ask { client_id, what });
    }
}

impl Drop for Requests {
    fn drop(&mut self) {
        if let Some(worker) = self.worker.take() {
            worker.finish();
        }
    }
}

struct Asker {
    controller: RequestForwarder,
    state: Latest<OperatingStateMsg>,
    hold: Arc<AtomicU64>,
    events: Events,
    names: ClientNames,
}

impl Asker {
    fn take(&mut self, ask: Ask) {
        let held = self.hold_if_wanted();
        let is_hold = matches!(ask.what, What::State(StateCommand::Hold));
        if !(held && is_hold) {
            self.carry_out(ask);
        }
    }

    fn hold_if_wanted(&mut self) -> bool {
        let client_id = self.hold.swap(0, Ordering::AcqRel);
        if client_id != 0 {
            self.change_state(client_id, StateCommand::Hold);
        }
        client_id != 0
    }

    fn carry_out(&mut self, ask: Ask) {
        match ask.what {
            What::State(StateCommand::Home) if self.is_homed() => {
                let name = self.name(ask.client_id);
                self.events.report(Event::Status(format!(
                    "{name}: home: homed already; `unhome` first to set a new zero"
                )));
            }
            What::State(command) => self.change_state(ask.client_id, command),
            What::Move(topic, pose) => self.move_to(ask.client_id, topic, &pose),
        }
    }

    fn change_state(&mut self, client_id: u64, command: StateCommand) {
        let reply = self.controller.state_command(StateCommandRequest {
            client_id,
            command: command.number(),
            reserved: 0,
        });
        let done = self.check(client_id, "state_command", command, reply);
        if let Some(state) = done {
            let name = self.name(client_id);
            let line = format!("{name}: {command}; the controller is {state}");
            self.events.report(Event::Status(line));
        }
    }

    fn move_to(&mut self, client_id: u64, topic: Topic, pose: &Pose) {
        self.events.report_move(Event::MoveAsked);
        let reply = self.controller.move_jp(MoveRequest {
            client_id,
            position: pose.position,
            count: pose.count,
            reserved: 0,
        });
        let answered = clock::now();
        let moves = self.check(client_id, topic.name(), StateCommand::Move, reply);
        let since = moves.map(|_| answered);
        self.events.report_move(Event::MoveAnswered(since));
    }

    /// The state after a command that was accepted. The reason for a refusal is in the controller's
    /// stream of warnings.
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

    fn is_homed(&mut self) -> bool {
        let state = self.state.refresh().ok().flatten();
        state.is_some_and(|state| state.flags & OperatingStateMsg::HOMED != 0)
    }

    fn name(&self, client_id: u64) -> String {
        self.names.of(client_id).unwrap_or_default()
    }
}
