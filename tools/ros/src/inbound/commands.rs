//! All commands that can move the robot.

use std::collections::VecDeque;

use i2ris::clock;
use i2ris::ipc::client::{ExternalPublisher, Forwarder, Latest, Watcher};
use i2ris::ipc::payload::{JointState as JointPayload, ServoJp};
use i2ris::robot::StateCommand;
use i2ris::units::{Nanos, OutputVec};
use ros2_client::Subscription;
use serde::de::DeserializeOwned;

use super::graph::Graph;
use super::requests::{Requests, STOPS, What};
use super::{Arrivals, Received, Shared, take};
use crate::RosError;
use crate::admission::{Admission, Ages, Pose, Topic, Writer, checked};
use crate::clock::Moment;
use crate::event::{Event, Reason, Refused};
use crate::message::{Header, Inputs, JOINTS, JointState, Point, StringStamped, Vector3};

const ONCE_LIMIT: Nanos = Nanos::from_millis(2000);
/// Time for which `servo_jr` continues a goal; after that it starts at the setpoint.
const CONTINUES: Nanos = Nanos::from_millis(200);
/// Maximum age of a setpoint: beyond, the controller is gone or hangs.
const FRESH: Nanos = Nanos::from_millis(500);
/// Maximum age of a camera's exposure, and maximum lead of its clock.
const EXPOSURE_LIMIT: Nanos = Nanos::from_millis(1000);
const MAX_WARNED: usize = 64;

pub(super) struct Commands {
    pub inputs: Inputs,
    pub admission: Admission,
    forwarder: Forwarder,
    requests: Requests,
    camera: ExternalPublisher,
    setpoint: Latest<JointPayload>,
    /// The last goal that was passed on: client, pose, time.
    last: Option<(u64, OutputVec, Nanos)>,
    sequence: u64,
    /// Clients that were warned that their velocities are not used.
    warned_of_velocity: VecDeque<u64>,
    shared: Shared,
}

impl Commands {
    pub fn new(inputs: Inputs, shared: Shared) -> Result<Self, RosError> {
        let domain = &shared.domain;
        let since_ns = Moment::now().unix_ns;
        let ages = Ages { oldest: ONCE_LIMIT, ahead: ONCE_LIMIT, since_ns };
        Ok(Self {
            inputs,
            admission: Admission::new(ages),
            forwarder: Forwarder::new(domain),
            requests: Requests::start(domain, &shared.events, &shared.names)?,
            camera: ExternalPublisher::new(domain),
            setpoint: Latest::new(Watcher::new(domain).setpoint_js()),
            last: None,
            sequence: 0,
            warned_of_velocity: VecDeque::new(),
            shared,
        })
    }

    /// Executes all commands that arrived, those that stop the robot first. They are read last, so
    /// that no pose is read without the hold that was sent before it.
    pub fn take_all(&mut self, graph: &Graph) {
        let of_joints = take_newest(&self.inputs.joints);
        let of_places = take_newest(&self.inputs.places);
        let of_twist = take(&self.inputs.twist).newest();
        for (topic, arrivals) in take_newest(&self.inputs.stops) {
            self.judge(graph, topic, arrivals, |commands, Received { writer, times, .. }| {
                let client_id = commands.admission.stop(*writer, topic, times);
                let command = match topic {
                    // Without power the motors turn freely.
                    Topic::Free => StateCommand::Disable,
                    _ => StateCommand::Hold,
                };
                commands.requests.stop(client_id, command);
                Ok(())
            });
        }
        // All of them, in sequence: the newest alone may have a different meaning.
        let arrivals = take(&self.inputs.state_command);
        self.judge(graph, Topic::StateCommand, arrivals, Self::change_state);
        for (topic, arrivals) in of_joints {
            self.judge(graph, topic, arrivals, |commands, received| match topic {
                Topic::ServoJp | Topic::ServoJr | Topic::ServoJv | Topic::InterpolateJp => {
                    commands.servo(topic, received)
                }
                Topic::Jaw => {
                    let angle = checked(&received.message.position, 1)?;
                    commands.stream(topic, received, &angle).map(drop)
                }
                Topic::External => commands.see(received),
                _ => commands.move_to(topic, received),
            });
        }
        for (topic, arrivals) in of_places {
            self.judge(graph, topic, arrivals, |commands, received| {
                let Received { message, writer, times, .. } = received;
                let Point { x, y, z } = message.pose.position;
                let place = commands.in_frame(&message.header, [x, y, z])?;
                if topic == Topic::ServoCp {
                    return commands.stream(topic, received, &place).map(drop);
                }
                let header = message.header.stamp.unix_ns();
                let client_id = commands.admission.once(*writer, topic, header, times)?;
                commands.requests.ask(client_id, What::Move(topic, place))
            });
        }
        self.judge(graph, Topic::ServoCv, of_twist, |commands, received| {
            let Vector3 { x, y, z } = received.message.linear;
            let velocity = commands.in_frame(&received.message.header, [x, y, z])?;
            commands.stream(Topic::ServoCv, received, &velocity).map(drop)
        });
        // Stored, so that the first command finds it.
        let _ = self.setpoint.refresh();
    }

    fn judge<M>(
        &mut self,
        graph: &Graph,
        topic: Topic,
        arrivals: Arrivals<M>,
        mut carry_out: impl FnMut(&mut Self, &Received<M>) -> Result<(), Reason>,
    ) {
        if arrivals.undecodable > 0 {
            let client = "unknown".to_owned();
            self.refuse(client, topic, Reason::Undecodable, arrivals.undecodable);
        }
        for received in arrivals.messages {
            let (writer, name) = (received.writer, graph.name(received.writer));
            if let Some(client_id) = self.admission.client_id(writer, topic, clock::now()) {
                self.shared.names.note(client_id, &name);
            }
            match carry_out(self, &received) {
                // Expected: the next one is followed.
                Ok(()) | Err(Reason::FirstOfStream) => {}
                Err(reason) => self.refuse(name, topic, reason, received.count.into()),
            }
        }
    }

    fn refuse(&self, client: String, topic: Topic, reason: Reason, count: u64) {
        let refused = Refused { client, topic: topic.name(), reason, count };
        self.shared.events.report(Event::Refused(refused));
    }

    fn change_state(&mut self, received: &Received<StringStamped>) -> Result<(), Reason> {
        let Received { message, writer, times, .. } = received;
        let header = message.header.stamp.unix_ns();
        // A pose comes by `move_jp`.
        let is_known =
            |it: &&StateCommand| **it != StateCommand::Move && it.text() == message.string;
        let command = StateCommand::ALL.iter().find(is_known);
        let command = command.ok_or_else(|| Reason::UnknownCommand(shortened(&message.string)))?;
        if STOPS.contains(command) {
            let client_id = self.admission.stop(*writer, Topic::StateCommand, times);
            self.requests.stop(client_id, *command);
            return Ok(());
        }
        if *command == StateCommand::Home && !self.shared.may_home {
            return Err(Reason::NoHoming);
        }
        let client_id = self.admission.once(*writer, Topic::StateCommand, header, times)?;
        self.requests.ask(client_id, What::State(*command))
    }

    fn servo(&mut self, topic: Topic, received: &Received<JointState>) -> Result<(), Reason> {
        let Received { message, writer, times, .. } = received;
        if topic == Topic::ServoJv {
            let rate = self.ordered(&message.name, &message.velocity)?;
            return self.stream(topic, received, &rate).map(drop);
        }
        let given = self.given(message)?;
        let start = match topic {
            Topic::ServoJr => self.goal_of(*writer, topic, times.arrived)?,
            _ => OutputVec::default(),
        };
        let goal = given.from(&start);
        let client_id = self.stream(topic, received, &goal)?;
        self.warn_of_velocity(client_id, topic, message);
        self.last = Some((client_id, goal.position, times.arrived));
        Ok(())
    }

    /// Passes on a command of a stream. Returns its client.
    fn stream<M>(&mut self, topic: Topic, of: &Received<M>, goal: &Pose) -> Result<u64, Reason> {
        let admitted = self.admission.servo(of.writer, topic, of.count, &of.times)?;
        self.sequence += 1;
        let command = ServoJp {
            sequence: self.sequence,
            stamp_ns: admitted.stamp.0,
            client_id: admitted.client_id,
            deadline_ns: 0,
            position: goal.position,
            count: goal.count,
            flags: match topic {
                Topic::ServoJv => ServoJp::RATE,
                Topic::InterpolateJp => ServoJp::INTERPOLATE,
                Topic::ServoCp => ServoJp::TIP,
                Topic::ServoCv => ServoJp::TIP | ServoJp::RATE,
                _ => 0,
            },
        };
        let sent = if topic == Topic::Jaw {
            self.forwarder.servo_jaw(command)
        } else {
            self.last = None;
            self.forwarder.servo_jp(command)
        };
        sent.map_err(|_| Reason::NoController)?;
        Ok(admitted.client_id)
    }

    /// A position or a velocity of the tip, in the frame of the base.
    fn in_frame(&self, header: &Header, values: [f64; 3]) -> Result<Pose, Reason> {
        let own = format!("{}_base", self.shared.robot);
        if !header.frame_id.is_empty() && header.frame_id != own {
            return Err(Reason::Frame { frame: shortened(&header.frame_id), own });
        }
        checked(&values, 3)
    }

    fn move_to(&mut self, topic: Topic, received: &Received<JointState>) -> Result<(), Reason> {
        let Received { message, writer, times, .. } = received;
        let given = self.given(message)?;
        let goal = match topic {
            Topic::MoveJr => given.from(&self.setpoint()?.position),
            _ => given,
        };
        let header = message.header.stamp.unix_ns();
        let client_id = self.admission.once(*writer, topic, header, times)?;
        self.warn_of_velocity(client_id, topic, message);
        self.requests.ask(client_id, What::Move(topic, goal))
    }

    /// Warns a client once that commands have positions only.
    fn warn_of_velocity(&mut self, client_id: u64, topic: Topic, message: &JointState) {
        let is_zero = message.velocity.iter().all(|velocity| *velocity == 0.0);
        if is_zero || self.warned_of_velocity.contains(&client_id) {
            return;
        }
        self.warned_of_velocity.truncate(MAX_WARNED - 1);
        self.warned_of_velocity.push_front(client_id);
        let (name, topic) = (self.shared.names.of(client_id).unwrap_or_default(), topic.name());
        let line = format!("{name}: {topic}: its velocity is not used, only its position");
        self.shared.events.report(Event::Warning(line));
    }

    /// Passes on a camera's measurement. Its stamp is the exposure; any plausible one is accepted.
    fn see(&mut self, received: &Received<JointState>) -> Result<(), Reason> {
        let Received { message, writer, times, count } = received;
        self.admission.camera(*writer, *count, times)?;
        let exposed = match message.header.stamp.unix_ns() {
            None => times.arrived,
            Some(stamp) => exposure(stamp, times.arrived_unix_ns, times.arrived)?,
        };
        let sent = if message.position.is_empty() {
            self.camera.publish_nothing(exposed)
        } else {
            let seen = self.given(message)?;
            let values = seen.position.get(..seen.count as usize).unwrap_or_default();
            self.camera.publish(exposed, values, &[])
        };
        sent.map_err(|_| Reason::NoController)
    }

    fn given(&mut self, message: &JointState) -> Result<Pose, Reason> {
        self.ordered(&message.name, &message.position)
    }

    fn ordered(&mut self, names: &[String], values: &[f64]) -> Result<Pose, Reason> {
        let joints = self.joints(values)?;
        checked(&in_order(names, values, joints)?, joints)
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
        let is_fresh = |state: &JointPayload| now.duration_since(Nanos(state.stamp_ns)) < FRESH;
        let valid = |it: &JointPayload| it.flags & JointPayload::VALID != 0 && is_fresh(it);
        setpoint.filter(valid).ok_or(Reason::NoSetpoint)
    }

    /// The goal of a client: its last one if it still streams, else the setpoint.
    fn goal_of(&mut self, writer: Writer, topic: Topic, now: Nanos) -> Result<OutputVec, Reason> {
        let client_id = self.admission.client_id(writer, topic, now);
        let is_own = |(owner, _, _): &(u64, OutputVec, Nanos)| client_id == Some(*owner);
        match self.last.filter(is_own) {
            Some((_, goal, at)) if now.duration_since(at) < CONTINUES => Ok(goal),
            _ => Ok(self.setpoint()?.position),
        }
    }
}

fn take_newest<M: DeserializeOwned + 'static>(
    inputs: &[(Topic, Subscription<M>)],
) -> Vec<(Topic, Arrivals<M>)> {
    inputs.iter().map(|(topic, input)| (*topic, take(input).newest())).collect()
}

/// Values in the order of the joints: by their names if given, else unchanged.
fn in_order(names: &[String], values: &[f64], joints: usize) -> Result<Vec<f64>, Reason> {
    if names.is_empty() {
        return Ok(values.to_vec());
    }
    let own = JOINTS.get(..joints).unwrap_or_default();
    if names.len() != values.len() || names.len() != own.len() {
        return Err(Reason::Length { given: names.len().min(values.len()), joints });
    }
    let value = |joint: &&str| names.iter().position(|name| name == joint).map(|at| values[at]);
    let ordered: Option<Vec<f64>> = own.iter().map(value).collect();
    ordered.ok_or_else(|| {
        let other = names.iter().find(|name| !own.contains(&name.as_str())).unwrap_or(&names[0]);
        Reason::JointName { name: shortened(other), own: own.join(" and ") }
    })
}

fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}

fn exposure(stamp: u64, arrived_unix_ns: u64, arrived: Nanos) -> Result<Nanos, Reason> {
    let ages = Ages { oldest: EXPOSURE_LIMIT, ahead: EXPOSURE_LIMIT, since_ns: 0 };
    ages.check(stamp, arrived_unix_ns)?;
    Ok(arrived - Nanos(arrived_unix_ns.saturating_sub(stamp)))
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
