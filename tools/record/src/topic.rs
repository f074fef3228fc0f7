//! What a recording holds.

use std::collections::BTreeMap;

use i2ris::ipc::payload::{
    ActuatorState, ExternalPosition, JointState, OperatingStateMsg, PeriodStatistics,
    ServoActuator, ServoJp,
};

use crate::layout::{Laid, Payload};
use crate::{cdr, schema};

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
    /// `external/measured_jp`.
    External,
    /// `servo_jp`.
    ServoJp,
    /// `actuators/servo_jp`.
    ServoActuators,
}

impl Stream {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Measured,
        Self::Setpoint,
        Self::Goal,
        Self::Actuators,
        Self::State,
        Self::Statistics,
        Self::External,
        Self::ServoJp,
        Self::ServoActuators,
    ];

    /// Its name, as in shared memory.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Measured => "measured_js",
            Self::Setpoint => "setpoint_js",
            Self::Goal => "goal_js",
            Self::Actuators => "actuators/measured_js",
            Self::State => "operating_state",
            Self::Statistics => "period_statistics",
            Self::External => "external/measured_jp",
            Self::ServoJp => "servo_jp",
            Self::ServoActuators => "actuators/servo_jp",
        }
    }

    /// What its messages are.
    #[must_use]
    pub const fn payload(self) -> Payload {
        match self {
            Self::Measured | Self::Setpoint | Self::Goal => JointState::PAYLOAD,
            Self::Actuators => ActuatorState::PAYLOAD,
            Self::State => OperatingStateMsg::PAYLOAD,
            Self::Statistics => PeriodStatistics::PAYLOAD,
            Self::External => ExternalPosition::PAYLOAD,
            Self::ServoJp => ServoJp::PAYLOAD,
            Self::ServoActuators => ServoActuator::PAYLOAD,
        }
    }

    /// Whether it is recorded as the standard message, too.
    #[must_use]
    pub const fn is_joint(self) -> bool {
        matches!(self, Self::Measured | Self::Setpoint | Self::Goal)
    }
}

/// A channel of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Topic {
    /// `i2ris/NAME`: payloads, bit by bit.
    Own(Stream),
    /// `NAME`: the same angles as `sensor_msgs/JointState`.
    Joint(Stream),
}

impl Topic {
    /// Every topic of a recording.
    pub fn all() -> impl Iterator<Item = Self> {
        let joints = Stream::ALL
            .into_iter()
            .filter(|stream| stream.is_joint())
            .map(Self::Joint);
        Stream::ALL.into_iter().map(Self::Own).chain(joints)
    }

    /// Its name in the file.
    #[must_use]
    pub fn name(self) -> String {
        match self {
            Self::Own(stream) => format!("/i2ris/{}", stream.name()),
            Self::Joint(stream) => format!("/{}", stream.name()),
        }
    }

    /// The topic of the controller's own payloads that has this name.
    #[must_use]
    pub fn own(name: &str) -> Option<Stream> {
        Stream::ALL
            .into_iter()
            .find(|stream| Self::Own(*stream).name() == name)
    }

    /// Declares it in a file and returns its number there.
    pub(crate) fn declare<W: std::io::Write + std::io::Seek>(
        self,
        file: &mut mcap::Writer<W>,
    ) -> mcap::McapResult<u16> {
        let (name, definition) = match self {
            Self::Own(stream) => (
                schema::name(&stream.payload()),
                schema::definition(&stream.payload()),
            ),
            Self::Joint(_) => (schema::JOINT_STATE.to_owned(), schema::joint_state()),
        };
        let schema = file.add_schema(&name, schema::ENCODING, definition.as_bytes())?;
        file.add_channel(schema, &self.name(), cdr::ENCODING, &BTreeMap::new())
    }
}
