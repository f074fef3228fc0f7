//! The topics and services under the name of the robot, with types and quality of service as in
//! cisst-ros 4.
//!
//! Unsupported features have no topic: CRTK's client names them in `check_connections`.

use ros2_client::qos::{Durability, History, Reliability, WhenFull};
use ros2_client::{
    Message, MessageTypeName, Name, Node, Publisher, QosProfile, Server, ServiceMapping,
    ServiceTypeName, Subscription,
};
use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::RosError;
use crate::admission::Topic;
use crate::message::{
    Empty, IntervalStatistics, JointState, MultiArray, NoRequest, OperatingState, PoseStamped,
    QueryForwardKinematics, QueryForwardKinematicsResponse, QueryInverseKinematics,
    QueryInverseKinematicsResponse, StringStamped, Text, Transforms, TriggerOperatingStateResponse,
    TriggerResponse, TwistStamped, Typed,
};

/// A reader that is stopped must not stop the others: the oldest sample is dropped instead.
const RELIABLE: Reliability = Reliability::Reliable { when_full: WhenFull::Fail };

const fn qos(durability: Durability, depth: usize) -> QosProfile {
    QosProfile::subscription_default()
        .reliability(RELIABLE)
        .durability(durability)
        .history(History::KeepLast { depth })
}

/// Streams out, as deep as those of cisst-ros. A best-effort publisher would be incompatible with
/// every client of CRTK.
const STREAM: QosProfile = qos(Durability::Volatile, 100);

/// Quality of service for messages that late joiners must get: the state and the lines.
const LATCHED: QosProfile = qos(Durability::TransientLocal, 100);

/// Commands, of which only the newest counts. VOLATILE: clients latch `state_command`, and a late
/// reader must not get an old one.
const COMMAND: QosProfile = qos(Durability::Volatile, 1);

/// Services, as in rmw.
const SERVICE: QosProfile = qos(Durability::Volatile, 10);

/// Listens to the streams of another arm.
pub(crate) struct Listener<'a>(Maker<'a>);

impl<'a> Listener<'a> {
    pub fn new(node: &'a mut Node, robot: &'a str) -> Self {
        Self(Maker { node, robot })
    }

    pub fn subscription<M: DeserializeOwned + Typed + 'static>(
        &mut self,
        name: &str,
    ) -> Result<Subscription<M>, RosError> {
        self.0.subscription_to(name)
    }
}

/// Makes topics under the name of a robot.
struct Maker<'a> {
    node: &'a mut Node,
    robot: &'a str,
}

impl Maker<'_> {
    fn topic<M: Typed>(&self, name: &str, qos: &QosProfile) -> Result<rustdds::Topic, RosError> {
        let kind = MessageTypeName::new(M::TYPE.0, M::TYPE.1);
        let topic = self.node.create_topic(&self.name(name)?, kind, qos);
        topic.map_err(self.failed(name))
    }

    fn publisher<M: Serialize + Typed>(
        &mut self,
        name: &str,
        qos: &QosProfile,
    ) -> Result<Publisher<M>, RosError> {
        let topic = self.topic::<M>(name, qos)?;
        let made = self.node.create_publisher(&topic, Some(qos.clone()));
        made.map_err(self.failed(name))
    }

    fn subscription<M: DeserializeOwned + Typed + 'static>(
        &mut self,
        topic: Topic,
    ) -> Result<Subscription<M>, RosError> {
        self.subscription_to(topic.name())
    }

    fn subscription_to<M: DeserializeOwned + Typed + 'static>(
        &mut self,
        name: &str,
    ) -> Result<Subscription<M>, RosError> {
        let dds_topic = self.topic::<M>(name, &COMMAND)?;
        let made = self.node.create_subscription(&dds_topic, Some(COMMAND));
        made.map_err(self.failed(name))
    }

    fn server<Q: Message + Clone + 'static, R: Message + Clone + 'static>(
        &mut self,
        mapping: ServiceMapping,
        name: &str,
        (package, kind): (&str, &str),
    ) -> Result<Server<Q, R>, RosError> {
        let (full, kind) = (self.name(name)?, ServiceTypeName::new(package, kind));
        let made = self.node.create_server(mapping, &full, &kind, SERVICE, SERVICE);
        made.map_err(self.failed(name))
    }

    fn name(&self, name: &str) -> Result<Name, RosError> {
        Name::parse(&self.full_name(name)).map_err(self.failed(name))
    }

    /// `/robot/topic`; topics with a slash in front have their name already.
    fn full_name(&self, name: &str) -> String {
        if name.starts_with('/') { name.to_owned() } else { format!("/{}/{name}", self.robot) }
    }

    fn failed<E: ToString>(&self, name: &str) -> impl Fn(E) -> RosError + use<E> {
        let name = self.full_name(name);
        move |error| RosError::Topic { name: name.clone(), reason: error.to_string() }
    }
}

/// Topics from the robot.
pub(crate) struct Outputs {
    pub measured_js: Publisher<JointState>,
    pub setpoint_js: Publisher<JointState>,
    pub goal_js: Publisher<JointState>,
    pub jaw_measured_js: Publisher<JointState>,
    pub measured_cp: Publisher<PoseStamped>,
    pub setpoint_cp: Publisher<PoseStamped>,
    pub measured_cv: Publisher<TwistStamped>,
    pub jacobian: Publisher<MultiArray>,
    pub period_statistics: Publisher<IntervalStatistics>,
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
            measured_js: make.publisher("measured_js", &STREAM)?,
            setpoint_js: make.publisher("setpoint_js", &STREAM)?,
            goal_js: make.publisher("goal_js", &STREAM)?,
            jaw_measured_js: make.publisher("jaw/measured_js", &STREAM)?,
            measured_cp: make.publisher("measured_cp", &STREAM)?,
            setpoint_cp: make.publisher("setpoint_cp", &STREAM)?,
            measured_cv: make.publisher("measured_cv", &STREAM)?,
            jacobian: make.publisher("jacobian", &STREAM)?,
            period_statistics: make.publisher("period_statistics", &STREAM)?,
            transforms: make.publisher("/tf", &STREAM)?,
            operating_state: make.publisher("operating_state", &LATCHED)?,
            error: make.publisher("error", &LATCHED)?,
            warning: make.publisher("warning", &LATCHED)?,
            status: make.publisher("status", &LATCHED)?,
            description: make.publisher("robot_description", &LATCHED)?,
        })
    }
}

/// Topics to the robot. A read-only robot has none of them.
pub(crate) struct Inputs {
    /// Topics that stop the robot.
    pub stops: [(Topic, Subscription<Empty>); 2],
    pub state_command: Subscription<StringStamped>,
    pub joints: [(Topic, Subscription<JointState>); 8],
    /// Positions of the tip.
    pub places: [(Topic, Subscription<PoseStamped>); 2],
    pub twist: Subscription<TwistStamped>,
}

impl Inputs {
    pub fn new(node: &mut Node, robot: &str) -> Result<Self, RosError> {
        let mut make = Maker { node, robot };
        let mut joints = |topic| -> Result<_, RosError> { Ok((topic, make.subscription(topic)?)) };
        let joints = [
            joints(Topic::ServoJp)?,
            joints(Topic::ServoJr)?,
            joints(Topic::ServoJv)?,
            joints(Topic::InterpolateJp)?,
            joints(Topic::MoveJp)?,
            joints(Topic::MoveJr)?,
            joints(Topic::Jaw)?,
            joints(Topic::External)?,
        ];
        let mut stops = |topic| -> Result<_, RosError> { Ok((topic, make.subscription(topic)?)) };
        let stops = [stops(Topic::Hold)?, stops(Topic::Free)?];
        let mut places = |topic| -> Result<_, RosError> { Ok((topic, make.subscription(topic)?)) };
        Ok(Self {
            stops,
            places: [places(Topic::ServoCp)?, places(Topic::MoveCp)?],
            twist: make.subscription(Topic::ServoCv)?,
            state_command: make.subscription(Topic::StateCommand)?,
            joints,
        })
    }

    /// Whether a topic of DDS with commands to this robot has this type; true for topics of others.
    pub fn is_own_type(robot: &str, dds_topic: &str, dds_type: &str) -> bool {
        let name = dds_topic.strip_prefix(&format!("rt/{robot}/")).unwrap_or_default();
        let Some(topic) = Topic::ALL.into_iter().find(|topic| topic.name() == name) else {
            return true;
        };
        let (package, kind) = match topic {
            Topic::Hold | Topic::Free => Empty::TYPE,
            Topic::StateCommand => StringStamped::TYPE,
            Topic::ServoCp | Topic::MoveCp => PoseStamped::TYPE,
            Topic::ServoCv => TwistStamped::TYPE,
            _ => JointState::TYPE,
        };
        dds_type == format!("{package}::msg::dds_::{kind}_")
    }
}

/// Services of the robot.
pub(crate) struct Services {
    pub operating_state: Server<NoRequest, TriggerOperatingStateResponse>,
    pub crtk_version: Server<NoRequest, TriggerResponse>,
    pub forward: Server<QueryForwardKinematics, QueryForwardKinematicsResponse>,
    pub inverse: Server<QueryInverseKinematics, QueryInverseKinematicsResponse>,
}

impl Services {
    pub fn new(node: &mut Node, robot: &str, mapping: ServiceMapping) -> Result<Self, RosError> {
        let mut make = Maker { node, robot };
        let trigger = ("crtk_msgs", "TriggerOperatingState");
        let forward = ("crtk_msgs", "QueryForwardKinematics");
        let inverse = ("crtk_msgs", "QueryInverseKinematics");
        Ok(Self {
            operating_state: make.server(mapping, "operating_state", trigger)?,
            crtk_version: make.server(mapping, "crtk_version", ("std_srvs", "Trigger"))?,
            forward: make.server(mapping, "forward_kinematics", forward)?,
            inverse: make.server(mapping, "inverse_kinematics", inverse)?,
        })
    }
}
