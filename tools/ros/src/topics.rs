//! The topics and services under the name of the robot, with types and quality of service as
//! cisst-ros 4 has them.
//!
//! What is not supported has no topic: CRTK's client names it in `check_connections`.

use ros2_client::qos::{Durability, History, Reliability, WhenFull};
use ros2_client::{
    Message, MessageTypeName, Name, Node, Publisher, QosProfile, Server, ServiceMapping,
    ServiceTypeName, Subscription,
};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::RosError;
use crate::message::{
    Empty, JointState, NoRequest, OperatingState, PoseStamped, StringStamped, Text, Transforms,
    TriggerOperatingStateResponse, TriggerResponse,
};

/// Samples that a publisher keeps: as cisst-ros.
const DEPTH_OUT: usize = 100;

/// Only the newest command counts.
const DEPTH_IN: usize = 1;

/// A reader that is stopped must not stop the others: the oldest sample is dropped instead.
const RELIABLE: Reliability = Reliability::Reliable { when_full: WhenFull::Fail };

const fn qos(durability: Durability, depth: usize) -> QosProfile {
    QosProfile::subscription_default()
        .reliability(RELIABLE)
        .durability(durability)
        .history(History::KeepLast { depth })
}

/// Streams out. A best-effort publisher would be incompatible with every client of CRTK.
const STREAM: QosProfile = qos(Durability::Volatile, DEPTH_OUT);

/// What a late joiner must get: the state and what was said.
const LATCHED: QosProfile = qos(Durability::TransientLocal, DEPTH_OUT);

/// Commands. VOLATILE: clients latch `state_command`, and a late reader must not get an old one.
const COMMAND: QosProfile = qos(Durability::Volatile, DEPTH_IN);

/// Services, as rmw has them.
const SERVICE: QosProfile = qos(Durability::Volatile, 10);

/// Makes topics under the name of a robot.
struct Maker<'a> {
    node: &'a mut Node,
    robot: &'a str,
}

impl Maker<'_> {
    fn topic(
        &self,
        name: &str,
        (package, kind): (&str, &str),
        qos: &QosProfile,
    ) -> Result<rustdds::Topic, RosError> {
        let full = full_name(self.robot, name);
        let made = Name::parse(&full).map_err(|error| error.to_string());
        let kind = MessageTypeName::new(package, kind);
        made.and_then(|name| {
            let topic = self.node.create_topic(&name, kind, qos);
            topic.map_err(|error| error.to_string())
        })
        .map_err(|reason| RosError::Topic { name: full, reason })
    }

    fn publisher<M: Serialize>(
        &mut self,
        name: &str,
        kind: (&str, &str),
        qos: &QosProfile,
    ) -> Result<Publisher<M>, RosError> {
        let topic = self.topic(name, kind, qos)?;
        let made = self.node.create_publisher(&topic, Some(qos.clone()));
        made.map_err(|error| self.failed(name, error.to_string()))
    }

    fn subscription<M: DeserializeOwned + 'static>(
        &mut self,
        name: &str,
        kind: (&str, &str),
    ) -> Result<Subscription<M>, RosError> {
        let topic = self.topic(name, kind, &COMMAND)?;
        let made = self.node.create_subscription(&topic, Some(COMMAND));
        made.map_err(|error| self.failed(name, error.to_string()))
    }

    fn server<Q: Message + Clone + 'static, R: Message + Clone + 'static>(
        &mut self,
        mapping: ServiceMapping,
        name: &str,
        (package, kind): (&str, &str),
    ) -> Result<Server<Q, R>, RosError> {
        let full = full_name(self.robot, name);
        let parsed = Name::parse(&full).map_err(|error| self.failed(name, error.to_string()))?;
        let kind = ServiceTypeName::new(package, kind);
        let made = self.node.create_server(mapping, &parsed, &kind, SERVICE, SERVICE);
        made.map_err(|error| self.failed(name, error.to_string()))
    }

    fn failed(&self, name: &str, reason: String) -> RosError {
        let name = full_name(self.robot, name);
        RosError::Topic { name, reason }
    }
}

/// `/robot/topic`; topics with a slash in front have their name already.
fn full_name(robot: &str, name: &str) -> String {
    if name.starts_with('/') { name.to_owned() } else { format!("/{robot}/{name}") }
}

const JOINT_STATE: (&str, &str) = ("sensor_msgs", "JointState");
const TEXT: (&str, &str) = ("std_msgs", "String");

/// What goes out.
pub(crate) struct Outputs {
    pub measured_js: Publisher<JointState>,
    pub setpoint_js: Publisher<JointState>,
    pub measured_cp: Publisher<PoseStamped>,
    pub transforms: Publisher<Transforms>,
    pub operating_state: Publisher<OperatingState>,
    pub error: Publisher<Text>,
    pub warning: Publisher<Text>,
    pub status: Publisher<Text>,
    pub description: Publisher<Text>,
}

impl Outputs {
    pub fn new(node: &mut Node, robot: &str) -> Result<Self, RosError> {
        let mut make = Maker { node, robot };
        Ok(Self {
            measured_js: make.publisher("measured_js", JOINT_STATE, &STREAM)?,
            setpoint_js: make.publisher("setpoint_js", JOINT_STATE, &STREAM)?,
            measured_cp: make.publisher(
                "measured_cp",
                ("geometry_msgs", "PoseStamped"),
                &STREAM,
            )?,
            transforms: make.publisher("/tf", ("tf2_msgs", "TFMessage"), &STREAM)?,
            operating_state: make.publisher(
                "operating_state",
                ("crtk_msgs", "OperatingState"),
                &LATCHED,
            )?,
            error: make.publisher("error", TEXT, &LATCHED)?,
            warning: make.publisher("warning", TEXT, &LATCHED)?,
            status: make.publisher("status", TEXT, &LATCHED)?,
            description: make.publisher("robot_description", TEXT, &LATCHED)?,
        })
    }
}

/// What comes in. A robot that may only be watched has none of it.
pub(crate) struct Inputs {
    pub servo_jp: Subscription<JointState>,
    pub servo_jr: Subscription<JointState>,
    pub move_jp: Subscription<JointState>,
    pub move_jr: Subscription<JointState>,
    pub state_command: Subscription<StringStamped>,
    pub hold: Subscription<Empty>,
    pub external: Subscription<JointState>,
}

impl Inputs {
    pub fn new(node: &mut Node, robot: &str) -> Result<Self, RosError> {
        let mut make = Maker { node, robot };
        Ok(Self {
            servo_jp: make.subscription("servo_jp", JOINT_STATE)?,
            servo_jr: make.subscription("servo_jr", JOINT_STATE)?,
            move_jp: make.subscription("move_jp", JOINT_STATE)?,
            move_jr: make.subscription("move_jr", JOINT_STATE)?,
            state_command: make.subscription("state_command", ("crtk_msgs", "StringStamped"))?,
            hold: make.subscription("hold", ("std_msgs", "Empty"))?,
            external: make.subscription("external/measured_jp", JOINT_STATE)?,
        })
    }
}

/// What is asked for and answered.
pub(crate) struct Services {
    pub operating_state: Server<NoRequest, TriggerOperatingStateResponse>,
    pub crtk_version: Server<NoRequest, TriggerResponse>,
}

impl Services {
    pub fn new(node: &mut Node, robot: &str, mapping: ServiceMapping) -> Result<Self, RosError> {
        let mut make = Maker { node, robot };
        let trigger = ("crtk_msgs", "TriggerOperatingState");
        Ok(Self {
            operating_state: make.server(mapping, "operating_state", trigger)?,
            crtk_version: make.server(mapping, "crtk_version", ("std_srvs", "Trigger"))?,
        })
    }
}
