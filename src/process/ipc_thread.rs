//! The thread of shared memory: clients on one side, the loop on the other.
//!
//! It takes newest commands and requests to the loop and publishes every tick that the loop
//! reports. Calls into shared memory may take a hundred microseconds when a client comes or goes;
//! that is why they are here and not in the loop.

use std::sync::mpsc::{Receiver, Sender};

use crate::core::{ServoCommand, StateReply, StateRequest};
use crate::ipc::Server;
use crate::ipc::payload::{BlackBoxReply, StateCommandReply, StateCommandRequest, padded_text};
use crate::model::{Model, ModelId};
use crate::process::black_box::{Wish, Written};
use crate::process::channels::{Record, RelayEnds};
use crate::process::loop_history::SharedChronicle;
use crate::process::model_manager::{Answer, Question};
use crate::process::payload_conversion::{self, Identity};
use crate::realtime::{Granted, LoopStatistics};
use crate::robot::{OperatingState, Refusal, StateCommand};
use crate::units::{MAX_OUTPUTS, Nanos};

/// Length of a window of the loop's statistics.
const STATISTICS_WINDOW: Nanos = Nanos::from_millis(1000);

/// In the token of a `move_jp`; tokens count up from 1.
const MOVE: u64 = 1 << 63;

/// What the relay keeps between two passes.
pub struct Relay {
    server: Server,
    ends: RelayEnds,
    identity: Identity,
    granted: Granted,
    statistics: LoopStatistics,
    chronicle: SharedChronicle,
    desk: Desk,
    model: Option<ModelId>,
    lease_client_id: u64,
    state: OperatingState,
}

/// The way to the threads that take long, and back.
pub struct Desk {
    /// To it.
    pub questions: Sender<Question>,
    /// From it.
    pub answers: Receiver<Answer>,
    /// To the thread of the black box.
    pub wishes: Sender<Wish>,
    /// From it.
    pub written: Receiver<Written>,
}

impl Relay {
    /// A relay over a running server. `granted` is what the loop was granted, as read back by the
    /// loop.
    #[must_use]
    pub fn new(
        server: Server,
        ends: RelayEnds,
        identity: Identity,
        chronicle: SharedChronicle,
        desk: Desk,
        granted: Granted,
        period: Nanos,
    ) -> Self {
        let model = chronicle.lock().slots.active;
        let mut relay = Self {
            server,
            ends,
            identity,
            statistics: LoopStatistics::new(period, STATISTICS_WINDOW, granted.clone()),
            granted,
            chronicle,
            desk,
            model: None,
            lease_client_id: 0,
            state: OperatingState::Disabled,
        };
        relay.describe(model);
        relay
    }

    /// One pass: commands in, answers and ticks out, housekeeping.
    pub fn pass(&mut self, now: Nanos) {
        self.take_servo();
        self.take_external();
        self.take_requests(now);
        self.take_moves(now);
        self.take_models(now);
        self.take_black_boxes(now);
        while let Ok(reply) = self.ends.replies.pop() {
            self.answer(reply);
        }
        while let Ok(record) = self.ends.records.pop() {
            self.publish(&record);
        }
        if let Some(statistics) = self.statistics.take(now) {
            self.server.publish_period_statistics(statistics);
        }
        self.server.maintain(now);
    }

    fn take_servo(&mut self) {
        let joint = self
            .server
            .poll_servo(self.lease_client_id)
            .as_ref()
            .map(ServoCommand::from);
        let actuator = self
            .server
            .poll_actuator(self.lease_client_id)
            .as_ref()
            .map(ServoCommand::from);
        // A client that mixes both kinds gets the one that it sent last.
        if let Some(command) = [joint, actuator]
            .into_iter()
            .flatten()
            .max_by_key(|command| command.stamp)
        {
            self.ends.servo.write(Some(command));
        }
    }

    fn take_external(&mut self) {
        if let Some(seen) = self
            .server
            .poll_external()
            .as_ref()
            .and_then(payload_conversion::external)
        {
            self.ends.external.write(Some(seen));
        }
    }

    fn take_requests(&mut self, now: Nanos) {
        let (requests, state) = (&mut self.ends.requests, self.state);
        let mut refused = Vec::new();
        self.server.poll_state_commands(now, |id, raw| {
            if let Err(refusal) = hand_over(requests, id, raw) {
                refused.push(StateReply { id, refusal, state });
            }
        });
        refused.into_iter().for_each(|reply| self.answer(reply));
    }

    /// Requests about models take long, so they go to a thread of their own.
    fn take_models(&mut self, now: Nanos) {
        let questions = &self.desk.questions;
        self.server.poll_models(now, |token, request| {
            // A keeper that is gone answers nothing, and the client is told so.
            let _ = questions.send((token, request));
        });
        while let Ok((token, reply)) = self.desk.answers.try_recv() {
            self.server.reply_model(token, reply);
        }
    }

    fn take_black_boxes(&mut self, now: Nanos) {
        let wishes = &self.desk.wishes;
        self.server.poll_black_boxes(now, |token, _| {
            let _ = wishes.send(Wish::Write(token));
        });
        while let Ok(Written { token, outcome }) = self.desk.written.try_recv() {
            let reply = match outcome {
                Ok((path, ticks)) => BlackBoxReply {
                    ticks,
                    text: padded_text(&path.to_string_lossy()),
                },
                Err(reason) => BlackBoxReply {
                    ticks: 0,
                    text: padded_text(&reason),
                },
            };
            self.server.reply_black_box(token, reply);
        }
    }

    /// Tells clients about another model.
    fn describe(&mut self, model: Option<ModelId>) {
        self.model = model;
        let chronicle = self.chronicle.lock();
        let known = chronicle.model(model).map(|known| known.model.as_ref());
        let names: Vec<&str> = known.map(names).unwrap_or_default();
        let shape = [
            self.identity.motors as u8,
            names.len().min(MAX_OUTPUTS) as u8,
        ];
        self.server
            .describe(shape, model.unwrap_or_default().0, output_names(&names));
    }

    /// Ways to a pose go to the loop as state commands, with a mark on the token that tells their
    /// answers apart.
    fn take_moves(&mut self, now: Nanos) {
        let (requests, state) = (&mut self.ends.requests, self.state);
        let mut refused = Vec::new();
        self.server.poll_moves(now, |token, raw| {
            let (id, pose) = (token | MOVE, Some((raw.position, raw.count)));
            let request = StateRequest {
                id,
                client_id: raw.client_id,
                command: StateCommand::Move,
                pose,
            };
            if requests.push(request).is_err() {
                refused.push(StateReply {
                    id,
                    refusal: Refusal::Busy,
                    state,
                });
            }
        });
        refused.into_iter().for_each(|reply| self.answer(reply));
    }

    fn answer(&mut self, reply: StateReply) {
        let answer = StateCommandReply {
            refusal: reply.refusal.number(),
            state: reply.state.number(),
        };
        match reply.id & MOVE {
            0 => self.server.reply(reply.id, answer),
            _ => self.server.reply_move(reply.id & !MOVE, answer),
        }
    }

    fn publish(&mut self, record: &Record) {
        let report = &record.report;
        (self.lease_client_id, self.state) = (report.lease_client_id, report.state);
        self.statistics.record(record.timing);
        self.chronicle.lock().note(report);
        if report.models.active != self.model {
            self.describe(report.models.active);
        }
        let [goal, setpoint, measured] = payload_conversion::joint_states(report);
        self.server.publish_goal(goal);
        self.server.publish_setpoint(setpoint);
        self.server.publish_measured(measured);
        self.server
            .publish_actuators(payload_conversion::actuator_state(report, &self.identity));
        self.server
            .publish_operating_state(payload_conversion::operating_state(report, &self.granted));
    }
}

fn hand_over(
    requests: &mut rtrb::Producer<StateRequest>,
    id: u64,
    raw: StateCommandRequest,
) -> Result<(), Refusal> {
    let command = StateCommand::from_number(raw.command).ok_or(Refusal::Malformed)?;
    if raw.client_id == 0 {
        return Err(Refusal::Malformed);
    }
    requests
        .push(StateRequest {
            id,
            client_id: raw.client_id,
            command,
            pose: None,
        })
        .map_err(|_| Refusal::Busy)
}

/// Names of a model's outputs.
fn names(model: &Model) -> Vec<&str> {
    model
        .file()
        .outputs
        .iter()
        .map(|output| output.name.as_str())
        .collect()
}

/// Names of the outputs as the `version` reply carries them.
fn output_names(names: &[&str]) -> [[u8; 16]; MAX_OUTPUTS] {
    let mut padded = [[0; 16]; MAX_OUTPUTS];
    for (slot, name) in padded.iter_mut().zip(names) {
        slot.iter_mut()
            .zip(name.bytes())
            .for_each(|(to, from)| *to = from);
    }
    padded
}
