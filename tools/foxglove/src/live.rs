//! What goes to Foxglove: the messages of a recording, each stream as often as a screen needs it.

use std::collections::BTreeMap;
use std::sync::Arc;

use foxglove::{Context, FoxgloveError, PartialMetadata, RawChannel, Schema};
use i2ris::ipc::Message;
use i2ris::ipc::payload::{JointState, OperatingStateMsg, ServoJp};
use i2ris::units::Nanos;
use i2ris_record::layout::Layout;
use i2ris_record::schema::{self, JOINT_STATE};
use i2ris_record::standard::{DEFAULT_NAMES, StandardMessages, text};
use i2ris_record::subscriptions::Sink;
use i2ris_record::topic::{Stream, Topic};
use i2ris_record::{cdr, joints};

/// Topic of the goal minus the estimate.
const ERROR: &str = "/tracking_error";

/// What goes to Foxglove.
#[derive(Debug)]
pub struct Live {
    channels: BTreeMap<Topic, Arc<RawChannel>>,
    error: Arc<RawChannel>,
    standard: StandardMessages,
    period: Nanos,
    next: BTreeMap<Stream, Nanos>,
    goal: Option<JointState>,
    last_state: Option<(u64, Vec<u8>)>,
    boot_id: Option<u64>,
}

impl Live {
    /// Offers all topics.
    pub fn new(
        context: &Arc<Context>,
        unix_offset_ns: u64,
        period: Nanos,
    ) -> Result<Self, FoxgloveError> {
        let offer = |topic: &str, name: String, definition: String| {
            let schema = Schema::new(name, schema::ENCODING, definition.into_bytes());
            { context.channel_builder(topic) }
                .message_encoding(cdr::ENCODING)
                .schema(schema)
                .build_raw()
        };
        let mut channels = BTreeMap::new();
        for topic in Topic::all() {
            let schema = topic.schema();
            let channel = offer(&topic.name(), schema.name, schema.definition)?;
            channels.insert(topic, channel);
        }
        let error = offer(ERROR, JOINT_STATE.name.to_owned(), JOINT_STATE.definition())?;
        let names = DEFAULT_NAMES.map(str::to_owned).to_vec();
        Ok(Self {
            channels,
            error,
            standard: StandardMessages::new(unix_offset_ns, names, joints::snake().base()),
            period,
            next: BTreeMap::new(),
            goal: None,
            last_state: None,
            boot_id: None,
        })
    }

    /// The start of the controller that was heard last.
    pub fn boot_id(&self) -> Option<u64> {
        self.boot_id
    }

    /// Sets the names of the joints.
    pub fn name_joints(&mut self, names: Vec<String>) {
        self.standard.joints = names;
    }

    /// Sends again what is sent once: the URDF, and the operating state.
    pub fn repeat(&self) {
        let now = i2ris::clock::now().0;
        self.send(Topic::Description, now, &text(&joints::snake().urdf()));
        if let Some((stamp_ns, bytes)) = &self.last_state {
            self.send(Topic::Standard(Stream::State), *stamp_ns, bytes);
        }
    }

    fn send(&self, topic: Topic, stamp_ns: u64, bytes: &[u8]) {
        if let Some(channel) = self.channels.get(&topic) {
            self.log(channel, stamp_ns, bytes);
        }
    }

    fn log(&self, channel: &RawChannel, stamp_ns: u64, bytes: &[u8]) {
        let unix_ns = stamp_ns.wrapping_add(self.standard.unix_offset_ns);
        channel.log_with_meta(bytes, PartialMetadata::with_log_time(unix_ns));
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

    /// The goal minus the estimate of the same tick.
    fn tracking_error(&self, measured: &JointState) -> Option<Vec<u8>> {
        let goal = self
            .goal
            .filter(|goal| goal.stamp_ns == measured.stamp_ns)?;
        let is_valid = goal.flags & measured.flags & JointState::VALID != 0;
        let mut error = *measured;
        for (error, goal) in error.position.iter_mut().zip(goal.position) {
            *error = goal - *error;
        }
        is_valid.then(|| self.standard.joint_state(&error))?
    }
}

impl Sink for Live {
    fn message<T: Layout + Message>(&mut self, stream: Stream, message: &T, _received: Nanos) {
        let every_one = matches!(stream, Stream::Events | Stream::Health);
        if every_one || self.is_due(stream, message.stamp()) {
            let bytes = cdr::encode(message);
            self.send(Topic::Payload(stream), message.stamp().0, &bytes);
        }
    }

    fn joints(&mut self, stream: Stream, message: &JointState, _received: Nanos) {
        self.boot_id = Some(message.boot_id);
        if stream == Stream::Goal {
            self.goal = Some(*message);
        }
        if !self.is_due(stream, message.stamp()) {
            return;
        }
        let stamp_ns = message.stamp_ns;
        self.send(Topic::Payload(stream), stamp_ns, &cdr::encode(message));
        if let Some(bytes) = self.standard.joint_state(message) {
            self.send(Topic::Standard(stream), stamp_ns, &bytes);
        }
        if stream == Stream::Measured
            && let Some(bytes) = self.tracking_error(message)
        {
            self.log(&self.error, stamp_ns, &bytes);
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
