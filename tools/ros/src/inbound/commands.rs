//! Everything that can move the robot.

use i2ris::clock;
use i2ris::ipc::client::{ExternalPublisher, Forwarder, Latest, Watcher};
use i2ris::ipc::payload::{JointState as JointPayload, ServoJp};
use i2ris::robot::StateCommand;
use i2ris::units::{Nanos, OutputVec};

use super::Shared;
use super::burst::{Arrivals, Received, take};
use super::graph::Graph;
use super::requests::{Ask, Requests, What};
use crate::RosError;
use crate::admission::{Admission, Participant, Pose, Reason, Topic, Writer, checked};
use crate::clock::Moment;
use crate::event::Event;
use crate::message::{JointState, StringStamped};
use crate::topics::Inputs;

/// A goal is continued by `servo_jr` for so long; after that it starts at the setpoint.
const CONTINUES: Nanos = Nanos::from_millis(200);

/// A setpoint older than this is none: the controller is gone or hangs.
const FRESH: Nanos = Nanos::from_millis(500);

/// How long ago an exposure of a camera may have been, and how far its clock may be ahead.
const EXPOSURE_LIMIT: Nanos = Nanos::from_millis(1000);

/// Subscriptions, and the connections to the controller.
pub(super) struct Commands {
    pub inputs: Inputs,
    admission: Admission,
    forwarder: Forwarder,
    requests: Requests,
    camera: ExternalPublisher,
    setpoint: Latest<JointPayload>,
    /// The last goal that was passed on: whose, where, when.
    last: Option<(u64, OutputVec, Nanos)>,
    sequence: u64,
    shared: Shared,
}

impl Commands {
    pub fn new(inputs: Inputs, shared: Shared) -> Result<Self, RosError> {
        let domain = &shared.domain;
        Ok(Self {
            inputs,
            admission: Admission::new(Moment::now().unix_ns),
            forwarder: Forwarder::new(domain),
            requests: Requests::start(domain, &shared.events, &shared.names)?,
            camera: ExternalPublisher::new(domain),
            setpoint: Latest::new(Watcher::new(domain).setpoint_js()),
            last: None,
            sequence: 0,
            shared,
        })
    }

    /// A participant is gone.
    pub fn lost(&mut self, participant: Participant) {
        self.admission.lost(participant);
    }

    /// Does what arrived: first what stops the robot.
    pub fn take_all(&mut self, graph: &Graph) {
        let arrivals = take(&self.inputs.hold);
        self.judge(graph, Topic::Hold, arrivals, |commands, received, _| {
            commands.hold(received.writer, &received.times)
        });
        let arrivals = take(&self.inputs.state_command);
        self.judge_all(graph, Topic::StateCommand, arrivals, Self::change_state);
        for topic in [Topic::ServoJp, Topic::ServoJr] {
            let arrivals = take(match topic {
                Topic::ServoJp => &self.inputs.servo_jp,
                _ => &self.inputs.servo_jr,
            });
            self.judge(graph, topic, arrivals, |commands, received, count| {
                commands.servo(topic, received, count)
            });
        }
        for topic in [Topic::MoveJp, Topic::MoveJr] {
            let arrivals = take(match topic {
                Topic::MoveJp => &self.inputs.move_jp,
                _ => &self.inputs.move_jr,
            });
            self.judge(graph, topic, arrivals, |commands, received, _| {
                commands.move_to(topic, received)
            });
        }
        let arrivals = take(&self.inputs.external);
        self.judge(graph, Topic::External, arrivals, |commands, received, count| {
            commands.see(received, count)
        });
        // Kept, so that the first command finds it.
        let _ = self.setpoint.refresh();
    }

    /// Judges the newest message of every writer.
    fn judge<M>(
        &mut self,
        graph: &Graph,
        topic: Topic,
        arrivals: Arrivals<M>,
        mut carry_out: impl FnMut(&mut Self, &Received<M>, u32) -> Result<(), Reason>,
    ) {
        self.count_undecodable(topic, arrivals.undecodable);
        for (received, count) in arrivals.newest() {
            self.name(graph, received.writer, topic);
            let outcome = carry_out(self, &received, count);
            self.report(graph, received.writer, topic, count, outcome);
        }
    }

    /// Judges every message, in order: the newest alone may mean something else.
    fn judge_all<M>(
        &mut self,
        graph: &Graph,
        topic: Topic,
        arrivals: Arrivals<M>,
        mut carry_out: impl FnMut(&mut Self, &Received<M>) -> Result<(), Reason>,
    ) {
        self.count_undecodable(topic, arrivals.undecodable);
        for received in &arrivals.messages {
            self.name(graph, received.writer, topic);
            let outcome = carry_out(self, received);
            self.report(graph, received.writer, topic, 1, outcome);
        }
    }

    fn hold(&mut self, writer: Writer, times: &crate::admission::Times) -> Result<(), Reason> {
        let client_id = self.admission.once(writer, Topic::Hold, None, times)?;
        self.requests.hold(client_id);
        Ok(())
    }

    fn change_state(&mut self, received: &Received<StringStamped>) -> Result<(), Reason> {
        let Received { message, writer, times } = received;
        let header = message.header.stamp.unix_ns();
        let known = |command: &&StateCommand| command.text() == message.string;
        // A pose comes by `move_jp`.
        let command = { StateCommand::ALL.iter() }
            .filter(|command| **command != StateCommand::Move)
            .find(known)
            .ok_or(Reason::UnknownCommand)?;
        let client_id = self.admission.once(*writer, Topic::StateCommand, header, times)?;
        let what = What::State(*command);
        if *command == StateCommand::Hold {
            self.requests.hold(client_id);
            return Ok(());
        }
        self.requests.ask(Ask { client_id, what })
    }

    fn servo(
        &mut self,
        topic: Topic,
        received: &Received<JointState>,
        count: u32,
    ) -> Result<(), Reason> {
        let Received { message, writer, times } = received;
        let given = checked(&message.position, self.joints(&message.position)?)?;
        let start = match topic {
            Topic::ServoJr => self.goal_of(*writer, topic, times.arrived)?,
            _ => OutputVec::default(),
        };
        let goal = given.from(&start);
        let admitted = self.admission.servo(*writer, topic, &goal, count, times)?;
        self.sequence += 1;
        let command = ServoJp {
            sequence: self.sequence,
            stamp_ns: admitted.stamp.0,
            client_id: admitted.client_id,
            deadline_ns: 0,
            position: goal.position,
            count: goal.count,
            flags: 0,
        };
        let sent = self.forwarder.servo_jp(command);
        sent.map_err(|_| Reason::NoController)?;
        self.last = Some((admitted.client_id, goal.position, times.arrived));
        Ok(())
    }

    fn move_to(&mut self, topic: Topic, received: &Received<JointState>) -> Result<(), Reason> {
        let Received { message, writer, times } = received;
        let given = checked(&message.position, self.joints(&message.position)?)?;
        let goal = match topic {
            Topic::MoveJr => given.from(&self.setpoint()?.position),
            _ => given,
        };
        let header = message.header.stamp.unix_ns();
        let client_id = self.admission.once(*writer, topic, header, times)?;
        let what = What::Move(topic, goal);
        self.requests.ask(Ask { client_id, what })
    }

    /// What a camera saw. Its stamp is the time of the exposure; nothing moves by it, so a stamp
    /// that can be true is taken as it is.
    fn see(&mut self, received: &Received<JointState>, count: u32) -> Result<(), Reason> {
        let Received { message, writer, times } = received;
        self.admission.camera(*writer, count, times)?;
        let exposed = match message.header.stamp.unix_ns() {
            None => times.arrived,
            Some(stamp) => exposure(stamp, times.arrived_unix_ns, times.arrived)?,
        };
        let sent = if message.position.is_empty() {
            self.camera.publish_nothing(exposed)
        } else {
            let seen = checked(&message.position, self.joints(&message.position)?)?;
            let values = seen.position.get(..seen.count as usize).unwrap_or_default();
            self.camera.publish(exposed, values, &[])
        };
        sent.map_err(|_| Reason::NoController)
    }

    /// The number of joints of the robot. Without a model the controller refuses every number.
    fn joints(&mut self, given: &[f64]) -> Result<usize, Reason> {
        match self.setpoint.refresh().ok().flatten() {
            None => Err(Reason::NoController),
            Some(state) if state.count == 3 => Err(Reason::NoAngles),
            Some(state) if state.count == 0 => Ok(given.len().clamp(1, 2)),
            Some(state) => Ok(state.count as usize),
        }
    }

    fn setpoint(&mut self) -> Result<JointPayload, Reason> {
        let now = clock::now();
        let setpoint = self.setpoint.refresh().ok().flatten().copied();
        let valid = |state: &JointPayload| {
            state.flags & JointPayload::VALID != 0 && now.since(Nanos(state.stamp_ns)) < FRESH
        };
        setpoint.filter(valid).ok_or(Reason::NoSetpoint)
    }

    /// Where the goal of a client is: where it last was if it still streams, else the setpoint.
    fn goal_of(&mut self, writer: Writer, topic: Topic, now: Nanos) -> Result<OutputVec, Reason> {
        let client_id = self.admission.client_id(writer, topic, now);
        match self.last {
            Some((owner, goal, at)) if client_id == Some(owner) && now.since(at) < CONTINUES => {
                Ok(goal)
            }
            _ => Ok(self.setpoint()?.position),
        }
    }

    fn name(&mut self, graph: &Graph, writer: Writer, topic: Topic) {
        let now = clock::now();
        if let Some(client_id) = self.admission.client_id(writer, topic, now) {
            self.shared.names.note(client_id, &graph.name(writer));
        }
    }

    fn count_undecodable(&self, topic: Topic, count: u64) {
        if count > 0 {
            let reason = Reason::Undecodable;
            self.shared.events.report(Event::Refused {
                client: "somebody".to_owned(),
                kind: (topic.name(), u32::from(reason.kind())),
                reason: reason.to_string(),
                count,
            });
        }
    }

    fn report(
        &self,
        graph: &Graph,
        writer: Writer,
        topic: Topic,
        count: u32,
        outcome: Result<(), Reason>,
    ) {
        match outcome {
            // What was expected: the next one is followed.
            Ok(()) | Err(Reason::FirstOfStream) => {}
            Err(reason) => self.shared.events.report(Event::Refused {
                client: graph.name(writer),
                kind: (topic.name(), u32::from(reason.kind())),
                reason: reason.to_string(),
                count: u64::from(count),
            }),
        }
    }
}

impl Pose {
    /// The pose so far from another one.
    fn from(&self, start: &OutputVec) -> Self {
        let mut position = self.position;
        for (to, from) in position.iter_mut().zip(start) {
            *to += from;
        }
        Self { position, ..*self }
    }
}

fn exposure(stamp: u64, arrived_unix_ns: u64, arrived: Nanos) -> Result<Nanos, Reason> {
    let apart = Nanos(stamp.abs_diff(arrived_unix_ns));
    let future = stamp > arrived_unix_ns;
    match future {
        _ if apart > EXPOSURE_LIMIT => Err(Reason::Old { apart, future }),
        true => Ok(arrived),
        false => Ok(arrived - apart),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exposure_is_before_its_arrival_and_not_long_before() {
        let (unix, arrived) = (1_795_000_000_000_000_000, Nanos(60_000_000_000));
        let ms = 1_000_000;
        let found = |stamp| exposure(stamp, unix, arrived);
        assert_eq!(found(unix - 30 * ms), Ok(arrived - Nanos(30 * ms)));
        assert_eq!(found(unix + 5 * ms), Ok(arrived), "a clock a little ahead");
        for wrong in [unix - 1001 * ms, unix + 1001 * ms, 1, u64::MAX] {
            assert!(matches!(found(wrong), Err(Reason::Old { .. })), "{wrong}");
        }
    }
}
