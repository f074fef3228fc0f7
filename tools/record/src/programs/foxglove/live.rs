//! What goes to Foxglove: the messages of a recording, each stream as often as a screen needs it.

use std::collections::{BTreeMap, VecDeque};

use i2ris::ipc::payload::JointState;
use i2ris::ipc::{Stream, StreamMessage};
use i2ris::units::Nanos;
use i2ris_gateway::clock::Moment;
use i2ris_record::joints::DEFAULT_NAMES;
use i2ris_record::schema::JOINT_STATE;
use i2ris_record::standard::{StandardMessages, text};
use i2ris_record::topic::Topic;
use i2ris_record::{cdr, joints};

use crate::server::Server;

/// Topic of the goal minus the estimate.
const ERROR: &str = "/tracking_error";
/// Estimates that wait for the goal of their tick. Streams are read one after the other.
const UNMATCHED: usize = 128;

/// The topics of a recording, in their order, and the error; each with name and definition of its
/// messages.
pub fn channels() -> Vec<[String; 3]> {
    let topics = Topic::all().map(|topic| {
        let schema = topic.schema();
        [topic.name(), schema.name, schema.definition]
    });
    let error = [ERROR.to_owned(), JOINT_STATE.name.to_owned(), JOINT_STATE.definition()];
    topics.chain([error]).collect()
}

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
    /// Sends by a server of [`channels`], a stream at most once in `period`.
    pub fn new(server: Server, period: Nanos) -> Self {
        // A step of the wall clock later shifts the display only.
        let Moment { monotonic, unix_ns } = Moment::now();
        let unix_offset_ns = unix_ns.wrapping_sub(monotonic.0);
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

    pub fn boot_id(&self) -> Option<u64> {
        self.boot_id
    }

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

    /// Sends a message of a stream, if it is due, and what belongs to it.
    pub fn send_message(&mut self, message: &StreamMessage) {
        let (stream, stamp) = (message.stream(), message.stamp());
        match message {
            StreamMessage::Measured(state)
            | StreamMessage::Setpoint(state)
            | StreamMessage::Goal(state) => self.boot_id = Some(state.boot_id),
            _ => {}
        }
        if let StreamMessage::Goal(goal) = message {
            self.send_error(goal);
        }
        let is_due = is_log(stream) || self.is_due(stream, stamp);
        // Changes of state pass all.
        if (is_due || stream == Stream::State)
            && let Some(bytes) = self.standard.message(message)
        {
            self.send(Topic::Standard(stream), stamp.0, &bytes);
            if stream == Stream::State {
                self.last_state = Some((stamp.0, bytes));
            }
        }
        if !is_due {
            return;
        }
        self.send(Topic::Payload(stream), stamp.0, &cdr::encode(message.bytes()));
        if let StreamMessage::Measured(measured) = message {
            for (topic, bytes) in self.standard.poses(measured) {
                self.send(topic, stamp.0, &bytes);
            }
            self.unmatched.push_back(*measured);
            if self.unmatched.len() > UNMATCHED {
                self.unmatched.pop_front();
            }
        }
    }
}

/// Whether every message counts. `health` changes seldom, and then all of it.
fn is_log(stream: Stream) -> bool {
    stream.properties().history > 1 || stream == Stream::Health
}
