//! Topics of a recording.

use std::collections::BTreeMap;
use std::io::{Seek, Write};

use i2ris::ipc::Stream;
use i2ris_report::ros::{JointState, OperatingState, PoseStamped, Text, Transforms, Typed};

use crate::messages::{cdr, schema};

/// Schema of the standard message with the content of a stream, if there is one.
fn standard(stream: Stream) -> Option<TopicSchema> {
    match stream {
        Stream::Measured
        | Stream::Setpoint
        | Stream::Goal
        | Stream::ServoJp
        | Stream::Jaw
        | Stream::ServoJaw => Some(TopicSchema::of::<JointState>()),
        Stream::State => Some(TopicSchema::of::<OperatingState>()),
        _ => None,
    }
}

/// A topic of the file.
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

/// Schema of a topic: name and definition.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TopicSchema {
    /// Full name of the message.
    pub name: String,
    /// Its definition with all that it needs.
    pub definition: String,
}

impl Topic {
    /// All topics of a recording.
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

    /// Name in the file.
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
            TopicSchema { name: schema::name(&layout), definition: schema::definition(&layout) }
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
    pub(crate) fn declare<W: Write + Seek>(
        self,
        file: &mut mcap::Writer<W>,
    ) -> mcap::McapResult<u16> {
        self.schema().declare(file, &self.name())
    }
}

impl TopicSchema {
    /// Schema of a standard message.
    pub fn of<M: Typed>() -> Self {
        Self { name: M::full_name(), definition: M::definition() }
    }

    /// Declares a topic of this schema in a file and returns its channel number.
    pub(crate) fn declare<W: Write + Seek>(
        &self,
        file: &mut mcap::Writer<W>,
        topic: &str,
    ) -> mcap::McapResult<u16> {
        let schema = file.add_schema(&self.name, schema::ENCODING, self.definition.as_bytes())?;
        file.add_channel(schema, topic, cdr::ENCODING, &BTreeMap::new())
    }
}
