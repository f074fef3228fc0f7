//! Messages in a recording: topics, with their definitions as those of ROS 2 (`.msg` files, joined
//! as rosbag2 joins them); the standard messages of ROS 2 and CRTK, which every tool of ROS knows.
//! `cdr` is their encoding.

pub mod cdr;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::File;
use std::io::BufWriter;

use i2ris::ipc::payload::{
    FieldType, JointState, OperatingStateMsg, PayloadLayout, ServoJp, Version, unpadded_text,
};
use i2ris::ipc::{OperatingState, Stream, StreamMessage};
use i2ris::units::Nanos;
use i2ris_report::ros::{
    self, CompressedImage, Header, PoseStamped, SEPARATOR, Text, Transforms, Typed,
};
use i2ris_report::snake::{Bend, Snake};
use mcap::Writer;

use cdr::encode_standard;

pub(crate) type McapFile = Writer<BufWriter<File>>;

/// Name of the schema language in MCAP.
const SCHEMA_ENCODING: &str = "ros2msg";

/// The package of the controller's own messages.
const PACKAGE: &str = "i2ris_msgs";

/// Time between two poses of the tip and the links, as in ROS.
const POSE_PERIOD: Nanos = Nanos::from_millis(20);

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Topic {
    /// `i2ris/NAME`: payloads, bit for bit.
    Payload(Stream),
    /// `NAME`: the same as a standard message.
    Standard(Stream),
    /// `measured_cp`: pose of the tip relative to the base.
    Tip,
    /// `tf`: poses of the links.
    Links,
    /// `robot_description`: the URDF of the robot, once.
    Description,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TopicSchema {
    pub name: String,
    /// Its definition with all that it needs.
    pub definition: String,
}

impl Topic {
    pub fn all() -> impl Iterator<Item = Self> {
        let streams = || Stream::ALL.iter().copied();
        let has_standard = |stream: &Stream| standard(*stream).is_some();
        let standard = streams().filter(has_standard).map(Self::Standard);
        streams().map(Self::Payload).chain(standard).chain([
            Self::Tip,
            Self::Links,
            Self::Description,
        ])
    }

    pub fn name(self) -> String {
        match self {
            Self::Payload(stream) => format!("/i2ris/{}", stream.name()),
            Self::Standard(stream) => format!("/{}", stream.name()),
            Self::Tip => "/measured_cp".to_owned(),
            Self::Links => "/tf".to_owned(),
            Self::Description => "/robot_description".to_owned(),
        }
    }

    pub fn schema(self) -> TopicSchema {
        let payload = |stream: Stream| {
            let layout = stream.layout();
            let name = format!("{PACKAGE}/msg/{}", layout.name);
            TopicSchema { name, definition: payload_definition(&layout) }
        };
        match self {
            Self::Payload(stream) => payload(stream),
            Self::Standard(stream) => standard(stream).unwrap_or_else(|| payload(stream)),
            Self::Tip => TopicSchema::of::<PoseStamped>(),
            Self::Links => TopicSchema::of::<Transforms>(),
            Self::Description => TopicSchema::of::<Text>(),
        }
    }

    /// The stream whose payloads are in the topic of this name.
    pub fn payload_stream(name: &str) -> Option<Stream> {
        Stream::named(name.strip_prefix("/i2ris/")?)
    }

    /// Declares the topic in a file and returns its channel number.
    pub(crate) fn declare(self, file: &mut McapFile) -> mcap::McapResult<u16> {
        self.schema().declare(file, &self.name())
    }
}

impl TopicSchema {
    pub fn of<M: Typed>() -> Self {
        Self { name: M::full_name(), definition: M::definition() }
    }

    /// Declares a topic of this schema in a file and returns its channel number.
    pub(crate) fn declare(&self, file: &mut McapFile, topic: &str) -> mcap::McapResult<u16> {
        let schema = file.add_schema(&self.name, SCHEMA_ENCODING, self.definition.as_bytes())?;
        file.add_channel(schema, topic, cdr::ENCODING, &BTreeMap::new())
    }
}

/// Schema of the standard message with the content of a stream, if there is one.
fn standard(stream: Stream) -> Option<TopicSchema> {
    match stream {
        Stream::Measured
        | Stream::Setpoint
        | Stream::Goal
        | Stream::ServoJp
        | Stream::Jaw
        | Stream::ServoJaw => Some(TopicSchema::of::<ros::JointState>()),
        Stream::State => Some(TopicSchema::of::<ros::OperatingState>()),
        _ => None,
    }
}

/// Definition of the message of a payload, with those of the payloads in it.
fn payload_definition(payload: &PayloadLayout) -> String {
    let mut text = fields(payload);
    let mut defined: Vec<&str> = Vec::new();
    for field in payload.fields {
        if let FieldType::Payload(inner) = field.kind
            && !defined.contains(&inner.name)
        {
            defined.push(inner.name);
            let _ = write!(text, "{SEPARATOR}\nMSG: {PACKAGE}/{}\n{}", inner.name, fields(inner));
        }
    }
    text
}

/// One line for every field.
fn fields(payload: &PayloadLayout) -> String {
    let mut text = String::new();
    for field in payload.fields {
        let kind = match field.kind {
            FieldType::U8 => "uint8".to_owned(),
            FieldType::U16 => "uint16".to_owned(),
            FieldType::U32 => "uint32".to_owned(),
            FieldType::I32 => "int32".to_owned(),
            FieldType::U64 => "uint64".to_owned(),
            FieldType::F64 => "float64".to_owned(),
            FieldType::Payload(inner) => format!("{PACKAGE}/{}", inner.name),
        };
        // Writing to a string cannot fail.
        let _ = match field.count {
            1 => writeln!(text, "{kind} {}", field.name),
            count => writeln!(text, "{kind}[{count}] {}", field.name),
        };
    }
    text
}

/// Content of standard messages besides the values.
#[derive(Debug, Clone)]
pub struct StandardMessages {
    /// Unix time minus monotonic time, ns.
    pub unix_offset_ns: u64,
    pub joints: Vec<String>,
    /// The fixed link, in which angles are given.
    pub frame: String,
    last_state: Option<([u32; 2], u64)>,
    snake: Snake,
    next_pose: Nanos,
}

impl StandardMessages {
    pub fn new(unix_offset_ns: u64, joints: Vec<String>, frame: String) -> Self {
        let (snake, next_pose) = (snake(), Nanos::ZERO);
        Self { unix_offset_ns, joints, frame, last_state: None, snake, next_pose }
    }

    /// The standard message of a message; `None` if there is none.
    pub fn message(&mut self, message: &StreamMessage) -> Option<Vec<u8>> {
        let joints = match message {
            StreamMessage::Measured(state)
            | StreamMessage::Setpoint(state)
            | StreamMessage::Goal(state) => self.joint_state(state)?,
            StreamMessage::State(state) => {
                return self.operating_state(state).map(|state| encode_standard(&state));
            }
            StreamMessage::ServoJp(command) => self.servo_jp(command)?,
            StreamMessage::Jaw(state) if state.flags & JointState::VALID != 0 => {
                self.jaw(state.stamp_ns, state.position[0])
            }
            StreamMessage::ServoJaw(command) => self.jaw(command.stamp_ns, command.position[0]),
            _ => return None,
        };
        Some(encode_standard(&joints))
    }

    /// Angles; `None` if they are not valid.
    fn joint_state(&self, state: &JointState) -> Option<ros::JointState> {
        let count = state.count as usize;
        if state.flags & JointState::VALID == 0 || count == 0 {
            return None;
        }
        let velocity = state.velocity.get(..count)?;
        Some(self.angles(state.stamp_ns, state.position.get(..count)?, velocity))
    }

    /// Poses of the tip and the links, if due; nothing without valid angles.
    pub fn poses(&mut self, state: &JointState) -> Vec<(Topic, Vec<u8>)> {
        let stamp = Nanos(state.stamp_ns);
        // A restarted controller may use another computer's clock.
        let is_due = stamp >= self.next_pose || self.next_pose.duration_since(stamp) > POSE_PERIOD;
        if state.flags & JointState::VALID == 0 || !(1..=2).contains(&state.count) || !is_due {
            return Vec::new();
        }
        self.next_pose = stamp + POSE_PERIOD;
        let [pitch, yaw, _] = state.position;
        let bend = Bend { pitch, yaw: if state.count == 2 { yaw } else { 0.0 } };
        let (header, pose) = (self.header(state.stamp_ns), self.snake.tip_pose(bend).into());
        let unix_ns = state.stamp_ns.wrapping_add(self.unix_offset_ns);
        let links = Transforms::of_links(&self.snake, bend, unix_ns);
        vec![
            (Topic::Tip, encode_standard(&PoseStamped { header, pose })),
            (Topic::Links, encode_standard(&links)),
        ]
    }

    /// A command, as it was sent; `None` if it has no values for joints.
    fn servo_jp(&self, command: &ServoJp) -> Option<ros::JointState> {
        let values = command.position.get(..command.count as usize)?;
        let of_joints = command.flags & ServoJp::TIP == 0 && !values.is_empty();
        let is_rate = command.flags & ServoJp::RATE != 0;
        let (position, velocity) = if is_rate { (&[][..], values) } else { (values, &[][..]) };
        of_joints.then(|| self.angles(command.stamp_ns, position, velocity))
    }

    fn jaw(&self, stamp_ns: u64, angle: f64) -> ros::JointState {
        ros::JointState { name: vec!["jaw".to_owned()], ..self.angles(stamp_ns, &[angle], &[]) }
    }

    fn angles(&self, stamp_ns: u64, position: &[f64], velocity: &[f64]) -> ros::JointState {
        let joints = 0..position.len().max(velocity.len());
        ros::JointState {
            header: self.header(stamp_ns),
            name: joints.map(|joint| self.joints.get(joint).cloned().unwrap_or_default()).collect(),
            position: position.to_vec(),
            velocity: velocity.to_vec(),
            effort: Vec::new(),
        }
    }

    /// The operating state as in CRTK; `None` if it is that of the last call, because CRTK sends
    /// changes. Stamps rise strictly: clients of CRTK ignore a message that is not newer.
    fn operating_state(&mut self, message: &OperatingStateMsg) -> Option<ros::OperatingState> {
        let flags = OperatingStateMsg::HOMED | OperatingStateMsg::BUSY;
        let value = [message.state, message.flags & flags];
        let unix_ns = message.stamp_ns.wrapping_add(self.unix_offset_ns);
        let unix_ns = match self.last_state {
            Some((last, _)) if last == value => return None,
            Some((_, last_ns)) => unix_ns.max(last_ns + 1),
            None => unix_ns,
        };
        self.last_state = Some((value, unix_ns));
        let state = OperatingState::from_number(message.state);
        Some(ros::OperatingState {
            header: Header::new(unix_ns, &self.frame),
            state: state.map_or_else(String::new, |state| state.to_string()),
            is_homed: message.flags & OperatingStateMsg::HOMED != 0,
            is_busy: message.flags & OperatingStateMsg::BUSY != 0,
        })
    }

    fn header(&self, stamp_ns: u64) -> Header {
        Header::new(stamp_ns.wrapping_add(self.unix_offset_ns), &self.frame)
    }
}

/// Names of the joints if a controller reports none.
pub const DEFAULT_NAMES: [&str; 2] = ["pitch", "yaw"];

pub fn joint_names(version: &Version) -> Vec<String> {
    let named = version.output_names.iter().map(|name| unpadded_text(name));
    let named: Vec<String> = named.take(usize::from(version.shape[1])).collect();
    if named.is_empty() { DEFAULT_NAMES.map(str::to_owned).to_vec() } else { named }
}

/// The snake in URDF and frames. All robots have the same; where several are shown together, each
/// has a recording of its own.
pub fn snake() -> Snake {
    Snake::new("i2ris")
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Exposure, Unix time.
    pub unix_ns: u64,
    pub jpeg: Vec<u8>,
}

/// The topic that has the pictures of this view.
pub fn picture_topic(view: &str) -> String {
    format!("/camera/{view}/compressed")
}

/// The view whose pictures a topic has, if it has any.
pub fn view_of_topic(topic: &str) -> Option<&str> {
    topic.strip_prefix("/camera/")?.strip_suffix("/compressed")
}

impl Picture {
    pub fn encode(&self, view: &str) -> Vec<u8> {
        let (header, format) = (Header::new(self.unix_ns, view), "jpeg".to_owned());
        let mut bytes = encode_standard(&CompressedImage { header, format, data: Vec::new() });
        // Not byte by byte: pictures are large.
        bytes.truncate(bytes.len() - size_of::<u32>());
        [&bytes[..], &(self.jpeg.len() as u32).to_le_bytes(), &self.jpeg].concat()
    }

    /// Decodes a message; `None` if it is not a picture.
    pub fn decode(message: &[u8]) -> Option<Self> {
        let (header, _, jpeg): (Header, String, &[u8]) = cdr::decode_standard(message)?;
        let unix_ns = header.stamp.unix_ns().unwrap_or_default();
        Some(Self { unix_ns, jpeg: jpeg.to_vec() })
    }
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::{Payload, PeriodStatistics};

    use super::*;

    #[test]
    fn a_definition_has_name_type_and_count_of_every_field() {
        assert_eq!(Topic::Payload(Stream::ServoJp).schema().name, "i2ris_msgs/msg/ServoJp");
        let expected = "uint64 sequence\nuint64 stamp_ns\nuint64 client_id\nuint64 deadline_ns\n\
                        float64[3] position\nuint32 count\nuint32 flags\n";
        assert_eq!(payload_definition(&ServoJp::LAYOUT), expected);
        let text = payload_definition(&PeriodStatistics::LAYOUT);
        assert!(text.contains("i2ris_msgs/SpanSummary lateness\n"));
        assert!(text.contains("MSG: i2ris_msgs/SpanSummary\nuint64 p50_ns"));
    }

    #[test]
    fn an_operating_state_is_sent_on_change_with_rising_stamps() {
        let mut messages = StandardMessages::new(0, Vec::new(), "base".to_owned());
        let at = |stamp_ns, state: OperatingState, flags| OperatingStateMsg {
            stamp_ns,
            state: state.number(),
            flags,
            ..OperatingStateMsg::default()
        };
        let (enabled, busy) = (OperatingState::Enabled, OperatingStateMsg::BUSY);
        let stamp = |message: &ros::OperatingState| message.header.stamp.nanosec;
        let first = messages.operating_state(&at(5, enabled, 0)).unwrap();
        assert_eq!(stamp(&first), 5);
        assert_eq!(messages.operating_state(&at(6, enabled, 0)), None);
        let holding = at(6, enabled, OperatingStateMsg::HOLDING);
        assert_eq!(messages.operating_state(&holding), None, "CRTK has no such flag");
        // A motion of length zero: busy and not busy in the same tick.
        let second = messages.operating_state(&at(7, enabled, busy)).unwrap();
        let third = messages.operating_state(&at(7, enabled, 0)).unwrap();
        assert_eq!((stamp(&second), stamp(&third)), (7, 8));
        assert_eq!(first.state, "ENABLED");
        assert_eq!((second.is_busy, third.is_busy), (true, false));
    }

    #[test]
    fn invalid_angles_have_no_message() {
        let messages = StandardMessages::new(0, Vec::new(), String::new());
        assert_eq!(messages.joint_state(&JointState::default()), None);
        assert_eq!(messages.servo_jp(&ServoJp::default()), None);
        let too_many = ServoJp { count: 99, ..ServoJp::default() };
        assert_eq!(messages.servo_jp(&too_many), None);
    }
}
