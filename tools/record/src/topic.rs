//! Streams of the controller and topics of a recording.

use std::collections::BTreeMap;
use std::io::{Seek, Write};

use i2ris::ipc::payload::{
    ActuatorState, AdaptationMsg, EventMsg, ExternalPosition, Health, JointState,
    OperatingStateMsg, PeriodStatistics, ReasonMsg, ServoActuator, ServoJp,
};

use crate::cdr;
use crate::layout::{Layout, PayloadLayout};
use crate::schema;

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
    /// `events`.
    Events,
    /// `error`.
    Error,
    /// `warning`.
    Warning,
    /// `external/measured_jp`.
    External,
    /// `servo_jp`.
    ServoJp,
    /// `actuators/servo_jp`.
    ServoActuators,
}

impl Stream {
    /// All streams.
    pub const ALL: [Self; 14] = [
        Self::Measured,
        Self::Setpoint,
        Self::Goal,
        Self::Actuators,
        Self::State,
        Self::Statistics,
        Self::Health,
        Self::Adaptation,
        Self::Events,
        Self::Error,
        Self::Warning,
        Self::External,
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
            Self::Events => "events",
            Self::Error => "error",
            Self::Warning => "warning",
            Self::External => "external/measured_jp",
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
            Self::Events => EventMsg::LAYOUT,
            Self::Error | Self::Warning => ReasonMsg::LAYOUT,
            Self::External => ExternalPosition::LAYOUT,
            Self::ServoJp => ServoJp::LAYOUT,
            Self::ServoActuators => ServoActuator::LAYOUT,
        }
    }

    /// Whether its messages are recorded as the standard message, too.
    #[must_use]
    pub const fn is_joint(self) -> bool {
        matches!(self, Self::Measured | Self::Setpoint | Self::Goal)
    }

    /// Whether only the controller sends. Commands and camera angles can have several senders, so
    /// their sequence numbers do not show missing messages.
    #[must_use]
    pub const fn has_one_sender(self) -> bool {
        !matches!(self, Self::External | Self::ServoJp | Self::ServoActuators)
    }
}

/// A topic of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Topic {
    /// `i2ris/NAME`: payloads, bit by bit.
    Payload(Stream),
    /// `NAME`: the same angles as `sensor_msgs/JointState`.
    Joint(Stream),
}

impl Topic {
    /// All topics of a recording.
    pub fn all() -> impl Iterator<Item = Self> {
        let joints = Stream::ALL.into_iter().filter(|stream| stream.is_joint());
        Stream::ALL
            .into_iter()
            .map(Self::Payload)
            .chain(joints.map(Self::Joint))
    }

    /// Its name in the file.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Payload(stream) => format!("/i2ris/{}", stream.name()),
            Self::Joint(stream) => format!("/{}", stream.name()),
        }
    }

    /// The stream whose payloads are in the topic of this name.
    #[must_use]
    pub fn payload_stream(name: &str) -> Option<Stream> {
        Stream::ALL
            .into_iter()
            .find(|stream| Self::Payload(*stream).name() == name)
    }

    /// Declares the topic in a file and returns its channel number.
    pub(crate) fn declare<W: Write + Seek>(
        self,
        file: &mut mcap::Writer<W>,
    ) -> mcap::McapResult<u16> {
        let (name, definition) = match self {
            Self::Joint(_) => (
                schema::JOINT_STATE.to_owned(),
                schema::joint_state_definition(),
            ),
            Self::Payload(stream) => {
                let layout = stream.layout();
                (schema::name(&layout), schema::definition(&layout))
            }
        };
        let schema = file.add_schema(&name, schema::ENCODING, definition.as_bytes())?;
        file.add_channel(schema, &self.name(), cdr::ENCODING, &BTreeMap::new())
    }
}
