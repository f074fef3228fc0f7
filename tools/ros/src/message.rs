//! The messages of the bridge, and the topics and services under the name of the robot, with types
//! and quality of service as in cisst-ros 4. What arrives is checked in [`crate::admission`].
//!
//! Unsupported features have no topic: CRTK's client names them in `check_connections`.

use i2ris_report::ros_messages;
use ros2_client::qos::{Durability, History, Reliability, WhenFull};
use ros2_client::{
    Message, MessageTypeName, Name, Node, Publisher, QosProfile, Server, ServiceMapping,
    ServiceTypeName, Subscription,
};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::RosError;
use crate::admission::Topic;

pub use i2ris_report::ros::{
    Header, JointState, OperatingState, Point, Pose, PoseStamped, Quaternion, Text, Time,
    Transforms, Typed, Vector3,
};

/// The names of the joints; also those of the URDF.
pub const JOINTS: [&str; 2] = ["pitch", "yaw"];

ros_messages! {
    /// Empty message, with the byte that IDL adds.
    Empty "std_msgs" "Empty" {
        structure_needs_at_least_one_member: u8,
    }

    /// Axes and buttons of a pedal or a joystick.
    Joy "sensor_msgs" "Joy" {
        header: Header,
        axes: Vec<f32>,
        buttons: Vec<i32>,
    }

    /// With `geometry_msgs/Twist` in it.
    TwistStamped "geometry_msgs" "TwistStamped" {
        header: Header,
        linear: Vector3,
        angular: Vector3,
    }

    MultiArrayDimension "std_msgs" "MultiArrayDimension" {
        label: String,
        size: u32,
        stride: u32,
    }

    /// With `std_msgs/MultiArrayLayout` in it.
    MultiArray "std_msgs" "Float64MultiArray" {
        dim: Vec<MultiArrayDimension>,
        data_offset: u32,
        data: Vec<f64>,
    }

    /// Statistics of the control loop, seconds. Unknown values are NaN.
    IntervalStatistics "cisst_msgs" "IntervalStatistics" {
        header: Header,
        period_avg: f64,
        period_std_dev: f64,
        period_min: f64,
        period_max: f64,
        compute_time_avg: f64,
        compute_time_std_dev: f64,
        compute_time_min: f64,
        compute_time_max: f64,
        number_of_samples: i64,
        number_of_overruns: i64,
        statistics_interval: f64,
        user_data: i64,
    }

    StringStamped "crtk_msgs" "StringStamped" {
        header: Header,
        string: String,
    }
}

macro_rules! services {
    ($($(#[$meta:meta])* $name:ident {
        $($(#[$field_meta:meta])* $field:ident: $kind:ty,)*
    })*) => {$(
        $(#[$meta])*
        #[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
        pub struct $name { $($(#[$field_meta])* pub $field: $kind,)* }
        impl Message for $name {}
    )*};
}

services! {
    QueryForwardKinematics {
        jp: Vec<f64>,
        /// Not used.
        cp: Pose,
    }

    QueryForwardKinematicsResponse {
        cp: Pose,
        result: bool,
        message: String,
    }

    QueryInverseKinematics {
        cp: Pose,
        /// Start of the search; empty: straight.
        jp: Vec<f64>,
    }

    QueryInverseKinematicsResponse {
        jp: Vec<f64>,
        result: bool,
        message: String,
    }

    /// Request of services without parameters, with the byte that IDL adds to an empty message.
    NoRequest {
        structure_needs_at_least_one_member: u8,
    }

    TriggerOperatingStateResponse {
        operating_state: OperatingState,
    }

    TriggerResponse {
        success: bool,
        message: String,
    }
}

/// A reader that is stopped must not stop the others: the oldest sample is dropped instead.
const RELIABLE: Reliability = Reliability::Reliable { when_full: WhenFull::Fail };

const fn qos(durability: Durability, depth: usize) -> QosProfile {
    QosProfile::subscription_default()
        .reliability(RELIABLE)
        .durability(durability)
        .history(History::KeepLast { depth })
}

/// Streams out, as deep as those of cisst-ros. Best effort is incompatible with every client.
const STREAM: QosProfile = qos(Durability::Volatile, 100);
/// Quality of service for messages that late joiners must get: the state and the lines.
const LATCHED: QosProfile = qos(Durability::TransientLocal, 100);
/// Commands, of which only the newest counts. VOLATILE: clients latch `state_command`, and a late
/// reader must not get an old one.
const COMMAND: QosProfile = qos(Durability::Volatile, 1);
/// Services, as in rmw.
const SERVICE: QosProfile = qos(Durability::Volatile, 10);

pub(crate) struct Maker<'a> {
    pub node: &'a mut Node,
    pub robot: &'a str,
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

    pub fn subscription<M: DeserializeOwned + Typed + 'static>(
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

macro_rules! outputs {
    ($($field:ident: $message:ident $name:literal $qos:ident,)*) => {
        pub(crate) struct Outputs { $(pub $field: Publisher<$message>,)* }

        impl Outputs {
            pub fn new(node: &mut Node, robot: &str) -> Result<Self, RosError> {
                let mut make = Maker { node, robot };
                Ok(Self { $($field: make.publisher($name, &$qos)?,)* })
            }
        }
    };
}

outputs! {
    measured_js: JointState "measured_js" STREAM,
    setpoint_js: JointState "setpoint_js" STREAM,
    goal_js: JointState "goal_js" STREAM,
    jaw_measured_js: JointState "jaw/measured_js" STREAM,
    measured_cp: PoseStamped "measured_cp" STREAM,
    setpoint_cp: PoseStamped "setpoint_cp" STREAM,
    measured_cv: TwistStamped "measured_cv" STREAM,
    jacobian: MultiArray "jacobian" STREAM,
    period_statistics: IntervalStatistics "period_statistics" STREAM,
    transforms: Transforms "/tf" STREAM,
    operating_state: OperatingState "operating_state" LATCHED,
    error: Text "error" LATCHED,
    warning: Text "warning" LATCHED,
    status: Text "status" LATCHED,
    description: Text "robot_description" LATCHED,
}

/// Topics to the robot. A read-only robot has none of them.
pub(crate) struct Inputs {
    pub stops: Vec<(Topic, Subscription<Empty>)>,
    pub state_command: Subscription<StringStamped>,
    pub joints: Vec<(Topic, Subscription<JointState>)>,
    pub places: Vec<(Topic, Subscription<PoseStamped>)>,
    pub twist: Subscription<TwistStamped>,
}

impl Inputs {
    const JOINTS: [Topic; 8] = {
        use Topic::{External, InterpolateJp, Jaw, MoveJp, MoveJr, ServoJp, ServoJr, ServoJv};
        [ServoJp, ServoJr, ServoJv, InterpolateJp, MoveJp, MoveJr, Jaw, External]
    };

    pub fn new(node: &mut Node, robot: &str) -> Result<Self, RosError> {
        let mut make = Maker { node, robot };
        Ok(Self {
            stops: named(&mut make, [Topic::Hold, Topic::Free])?,
            state_command: make.subscription(Topic::StateCommand.name())?,
            joints: named(&mut make, Self::JOINTS)?,
            places: named(&mut make, [Topic::ServoCp, Topic::MoveCp])?,
            twist: make.subscription(Topic::ServoCv.name())?,
        })
    }

    /// Whether a topic of DDS with commands to this robot has this type; true for topics of others.
    pub fn is_own_type(robot: &str, dds_topic: &str, dds_type: &str) -> bool {
        let name = dds_topic.strip_prefix(&format!("rt/{robot}/")).unwrap_or_default();
        let Some(topic) = Topic::ALL.iter().find(|topic| topic.name() == name) else { return true };
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

fn named<M: DeserializeOwned + Typed + 'static, const N: usize>(
    make: &mut Maker<'_>,
    topics: [Topic; N],
) -> Result<Vec<(Topic, Subscription<M>)>, RosError> {
    topics.into_iter().map(|topic| Ok((topic, make.subscription(topic.name())?))).collect()
}

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

#[cfg(test)]
mod tests {
    use super::*;

    /// Names that other programs of ROS use.
    #[test]
    fn types_are_those_of_ros() {
        let types = [
            (Empty::full_name(), "std_msgs/Empty"),
            (Joy::full_name(), "sensor_msgs/Joy"),
            (TwistStamped::full_name(), "geometry_msgs/TwistStamped"),
            (MultiArray::full_name(), "std_msgs/Float64MultiArray"),
            (IntervalStatistics::full_name(), "cisst_msgs/IntervalStatistics"),
            (StringStamped::full_name(), "crtk_msgs/StringStamped"),
            (JointState::full_name(), "sensor_msgs/JointState"),
            (OperatingState::full_name(), "crtk_msgs/OperatingState"),
            (PoseStamped::full_name(), "geometry_msgs/PoseStamped"),
            (Text::full_name(), "std_msgs/String"),
            (Transforms::full_name(), "tf2_msgs/TFMessage"),
        ];
        for (found, expected) in types {
            assert_eq!(found.replace("/msg/", "/"), expected);
        }
    }
}
