//! Streams of the controller and topics of a recording.

use std::collections::BTreeMap;
use std::io::{Seek, Write};

use i2ris::ipc::payload::{
    ActuatorState, AdaptationMsg, EventMsg, ExternalPosition, Health, JointState,
    OperatingStateMsg, PeriodStatistics, ReachTarget, ReasonMsg, ServoActuator, ServoJp,
    VirtualFixturesMsg,
};

use crate::cdr;
use crate::layout::{Layout, PayloadLayout};
use crate::schema::{self, StandardType};

/// A stream of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stream {
    /// `measured_js`.
    Measured,
    /// `setpoint_js`.
    Setpoint,
    /// `goal_js`.
    Goal,
    /// `actuators/measured_js`.
    Actuators,
    /// `operating_state`.
    State,
    /// `period_statistics`.
    Statistics,
    /// `health`.
    Health,
    /// `adaptation`.
    Adaptation,
    /// `virtual_fixtures`.
    VirtualFixtures,
    /// `events`.
    Events,
    /// `error`.
    Error,
    /// `warning`.
    Warning,
    /// `external/measured_jp`.
    External,
    /// `reach_target`.
    ReachTarget,
    /// `servo_jp`.
    ServoJp,
    /// `actuators/servo_jp`.
    ServoActuators,
}

impl Stream {
    /// All streams.
    pub const ALL: [Self; 16] = [
        Self::Measured,
        Self::Setpoint,
        Self::Goal,
        Self::Actuators,
        Self::State,
        Self::Statistics,
        Self::Health,
        Self::Adaptation,
        Self::VirtualFixtures,
        Self::Events,
        Self::Error,
        Self::Warning,
        Self::External,
        Self::ReachTarget,
        Self::ServoJp,
        Self::ServoActuators,
    ];

    /// Its name in shared memory.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Measured => "measured_js",
            Self::Setpoint => "setpoint_js",
            Self::Goal => "goal_js",
            Self::Actuators => "actuators/measured_js",
            Self::State => "operating_state",
            Self::Statistics => "period_statistics",
            Self::Health => "health",
            Self::Adaptation => "adaptation",
            Self::VirtualFixtures => "virtual_fixtures",
            Self::Events => "events",
            Self::Error => "error",
            Self::Warning => "warning",
            Self::External => "external/measured_jp",
            Self::ReachTarget => "reach_target",
            Self::ServoJp => "servo_jp",
            Self::ServoActuators => "actuators/servo_jp",
        }
    }

    /// The fields of its messages.
    #[must_use]
    pub const fn layout(self) -> PayloadLayout {
        match self {
            Self::Measured | Self::Setpoint | Self::Goal => JointState::LAYOUT,
            Self::Actuators => ActuatorState::LAYOUT,
            Self::State => OperatingStateMsg::LAYOUT,
            Self::Statistics => PeriodStatistics::LAYOUT,
            Self::Health => Health::LAYOUT,
            Self::Adaptation => AdaptationMsg::LAYOUT,
            Self::VirtualFixtures => VirtualFixturesMsg::LAYOUT,
            Self::Events => EventMsg::LAYOUT,
            Self::Error | Self::Warning => ReasonMsg::LAYOUT,
            Self::External => ExternalPosition::LAYOUT,
            Self::ReachTarget => ReachTarget::LAYOUT,
            Self::ServoJp => ServoJp::LAYOUT,
            Self::ServoActuators => ServoActuator::LAYOUT,
        }
    }

    /// The standard message with the same content, if there is one.
    #[must_use]
    pub const fn standard(self) -> Option<StandardType> {
        match self {
            Self::Measured | Self::Setpoint | Self::Goal | Self::ServoJp => {
                Some(schema::JOINT_STATE)
            }
            Self::State => Some(schema::OPERATING_STATE),
            _ => None,
        }
    }

    /// Whether only the controller sends. Commands and camera angles can have several senders, so
    /// their sequence numbers do not show missing messages.
    #[must_use]
    pub const fn has_one_sender(self) -> bool {
        !matches!(self, Self::External | Self::ReachTarget | Self::ServoJp | Self::ServoActuators)
    }
}

/// A topic of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Topic {
    /// `i2ris/NAME`: payloads, bit by bit.
    Payload(Stream),
    /// `NAME`: the same as a standard message.
    Standard(Stream),
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
        let has_standard = |stream: &Stream| stream.standard().is_some();
        let standard = Stream::ALL.into_iter().filter(has_standard);
        Stream::ALL
            .into_iter()
            .map(Self::Payload)
            .chain(standard.map(Self::Standard))
            .chain([Self::Description])
    }

    /// Its name in the file.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Payload(stream) => format!("/i2ris/{}", stream.name()),
            Self::Standard(stream) => format!("/{}", stream.name()),
            Self::Description => "/robot_description".to_owned(),
        }
    }

    /// Its schema.
    #[must_use]
    pub fn schema(self) -> TopicSchema {
        let payload = |stream: Stream| {
            let layout = stream.layout();
            TopicSchema { name: schema::name(&layout), definition: schema::definition(&layout) }
        };
        let standard = |standard: StandardType| TopicSchema {
            name: standard.name.to_owned(),
            definition: standard.definition(),
        };
        match self {
            Self::Payload(stream) => payload(stream),
            Self::Standard(stream) => {
                { stream.standard() }.map_or_else(|| payload(stream), standard)
            }
            Self::Description => standard(schema::STRING),
        }
    }

    /// The stream whose payloads are in the topic of this name.
    #[must_use]
    pub fn payload_stream(name: &str) -> Option<Stream> {
        Stream::ALL.into_iter().find(|stream| Self::Payload(*stream).name() == name)
    }

    /// Declares the topic in a file and returns its channel number.
    pub(crate) fn declare<W: Write + Seek>(
        self,
        file: &mut mcap::Writer<W>,
    ) -> mcap::McapResult<u16> {
        let TopicSchema { name, definition } = self.schema();
        let schema = file.add_schema(&name, schema::ENCODING, definition.as_bytes())?;
        file.add_channel(schema, &self.name(), cdr::ENCODING, &BTreeMap::new())
    }
}
