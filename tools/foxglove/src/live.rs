//! What goes to Foxglove: the messages of a recording, each stream as often as a screen needs it.

use std::collections::{BTreeMap, VecDeque};

use i2ris::ipc::Message;
use i2ris::ipc::payload::{JointState, OperatingStateMsg, ServoJp};
use i2ris::units::Nanos;
use i2ris_record::layout::Layout;
use i2ris_record::schema::{self, JOINT_STATE};
use i2ris_record::standard::{DEFAULT_NAMES, StandardMessages, text};
use i2ris_record::subscriptions::Sink;
use i2ris_record::topic::{Stream, Topic};
use i2ris_record::{cdr, joints};

use crate::server::{Channel, Server};

/// Topic of the goal minus the estimate.
const ERROR: &str = "/tracking_error";
/// Estimates that wait for the goal of their tick. Streams are read one after the other.
const UNMATCHED: usize = 128;

/// All channels: the topics of a recording, in their order, and the error.
pub fn channels() -> Vec<Channel> {
    let channel = |topic: String, schema_name: String, schema: String| Channel {
        topic,
        encoding: cdr::ENCODING,
        schema_name,
        schema_encoding: schema::ENCODING,
        schema,
    };
    let topics = Topic::all().map(|topic| {
        let schema = topic.schema();
        channel(topic.name(), schema.name, schema.definition)
    });
    let (name, definition) = (JOINT_STATE.name.to_owned(), JOINT_STATE.definition());
    let error = channel(ERROR.to_owned(), name, definition);
    topics.chain([error]).collect()
}

/// What goes to Foxglove.
#[derive(Debug)]
pub struct Live {
    server: Server,
    topics: Vec<Topic>,
    standard: StandardMessages,
    period: Nanos,
    next: BTreeMap<Stream, Nanos>,
    unmatched: VecDeque<JointState>,
    last_state: Option<(u64, Vec<u8>)>,
    boot_id: Option<u64>,
}

impl Live {
    /// Sends by a server of [`channels`].
    pub fn new(server: Server, unix_offset_ns: u64, period: Nanos) -> Self {
        let names = DEFAULT_NAMES.map(str::to_owned).to_vec();
        Self {
            server,
            topics: Topic::all().collect(),
            standard: StandardMessages::new(unix_offset_ns, names, joints::snake().base()),
            period,
            next: BTreeMap::new(),
            unmatched: VecDeque::new(),
            last_state: None,
            boot_id: None,
        }
    }

    /// The start of the controller that sent last.
    pub fn boot_id(&self) -> Option<u64> {
        self.boot_id
    }

    /// Sets the names of the joints.
    pub fn name_joints(&mut self, names: Vec<String>) {
        self.standard.joints = names;
    }

    /// Sends again what is sent once, the URDF and the operating state, when somebody has come.
    pub fn repeat_for_newcomers(&self) {
        if !self.server.has_newcomer() {
            return;
        }
        let now = i2ris::clock::now().0;
        self.send(Topic::Description, now, &text(&joints::snake().urdf()));
        if let Some((stamp_ns, bytes)) = &self.last_state {
            self.send(Topic::Standard(Stream::State), *stamp_ns, bytes);
        }
    }

    fn send(&self, topic: Topic, stamp_ns: u64, bytes: &[u8]) {
        if let Some(channel) = self.topics.iter().position(|known| *known == topic) {
            self.send_to(channel, stamp_ns, bytes);
        }
    }

    fn send_to(&self, channel: usize, stamp_ns: u64, bytes: &[u8]) {
        let unix_ns = stamp_ns.wrapping_add(self.standard.unix_offset_ns);
        self.server.send(channel, unix_ns, bytes);
    }

    /// Whether the next message of a stream is due. Streams of a tick stay together.
    fn is_due(&mut self, stream: Stream, stamp: Nanos) -> bool {
        let next = self.next.entry(stream).or_insert(Nanos::ZERO);
        // A controller that was started again may be on another computer's clock.
        let is_due = stamp >= *next || next.since(stamp) > self.period;
        if is_due {
            *next = stamp + self.period;
        }
        is_due
    }

    /// Sends the goal minus the estimate of the same tick.
    fn send_error(&mut self, goal: &JointState) {
        let is_past = |measured: &JointState| measured.stamp_ns <= goal.stamp_ns;
        while self.unmatched.front().is_some_and(is_past) {
            let Some(mut error) = self.unmatched.pop_front() else {
                return;
            };
            if error.stamp_ns != goal.stamp_ns || goal.flags & JointState::VALID == 0 {
                continue;
            }
            for (error, goal) in error.position.iter_mut().zip(goal.position) {
                *error = goal - *error;
            }
            if let Some(bytes) = self.standard.joint_state(&error) {
                self.send_to(self.topics.len(), error.stamp_ns, &bytes);
            }
        }
    }
}

impl Sink for Live {
    fn message<T: Layout + Message>(&mut self, stream: Stream, message: &T, _received: Nanos) {
        let every_one =
            matches!(stream, Stream::Events | Stream::Health | Stream::Error | Stream::Warning);
        if every_one || self.is_due(stream, message.stamp()) {
            let bytes = cdr::encode(message);
            self.send(Topic::Payload(stream), message.stamp().0, &bytes);
        }
    }

    fn joints(&mut self, stream: Stream, message: &JointState, _received: Nanos) {
        self.boot_id = Some(message.boot_id);
        if stream == Stream::Goal {
            self.send_error(message);
        }
        if !self.is_due(stream, message.stamp()) {
            return;
        }
        let stamp_ns = message.stamp_ns;
        self.send(Topic::Payload(stream), stamp_ns, &cdr::encode(message));
        if let Some(bytes) = self.standard.joint_state(message) {
            self.send(Topic::Standard(stream), stamp_ns, &bytes);
        }
        if stream == Stream::Measured {
            self.unmatched.push_back(*message);
            if self.unmatched.len() > UNMATCHED {
                self.unmatched.pop_front();
            }
        }
    }

    fn servo_jp(&mut self, command: &ServoJp, _received: Nanos) {
        if !self.is_due(Stream::ServoJp, command.stamp()) {
            return;
        }
        let bytes = cdr::encode(command);
        self.send(Topic::Payload(Stream::ServoJp), command.stamp_ns, &bytes);
        if let Some(bytes) = self.standard.servo_jp(command) {
            self.send(Topic::Standard(Stream::ServoJp), command.stamp_ns, &bytes);
        }
    }

    fn state(&mut self, message: &OperatingStateMsg, _received: Nanos) {
        let stamp_ns = message.stamp_ns;
        if let Some(bytes) = self.standard.operating_state(message) {
            self.send(Topic::Standard(Stream::State), stamp_ns, &bytes);
            self.last_state = Some((stamp_ns, bytes));
        }
        if self.is_due(Stream::State, message.stamp()) {
            let bytes = cdr::encode(message);
            self.send(Topic::Payload(Stream::State), stamp_ns, &bytes);
        }
    }
}
