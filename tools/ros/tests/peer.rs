//! A client of ROS with the topics of CRTK's Python client, in this process.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU16, Ordering};

use i2ris::clock;
use i2ris::units::Nanos;
use i2ris_ros::message::{
    Empty, JointState, OperatingState, PoseStamped, StringStamped, Text, Typed,
};
use i2ris_testing::wait_until;
use ros2_client::qos::{Durability, History, WhenFull};
use ros2_client::{Context, MessageTypeName, Name, Node, Publisher, QosProfile, Subscription};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Tests of one or more processes do not meet. Above 101, any program may have their ports.
pub fn ros_domain() -> u16 {
    static NEXT: AtomicU16 = AtomicU16::new(0);
    let own = (std::process::id() as u16).wrapping_mul(16);
    1 + (own.wrapping_add(NEXT.fetch_add(1, Ordering::Relaxed))) % 101
}

/// Quality of service of CRTK's client.
pub fn qos(durability: Durability) -> QosProfile {
    QosProfile::subscription_default()
        .reliability_reliable(WhenFull::DEFAULT)
        .durability(durability)
        .history(History::KeepLast { depth: 10 })
}

pub struct Peer {
    pub node: Node,
    robot: String,
    joints: BTreeMap<&'static str, Publisher<JointState>>,
    state_command: Publisher<StringStamped>,
    hold: Publisher<Empty>,
    measured: Subscription<JointState>,
    setpoint: Subscription<JointState>,
    tip: Subscription<PoseStamped>,
    states: Subscription<OperatingState>,
    texts: BTreeMap<&'static str, Subscription<Text>>,
    pub seen: Vec<OperatingState>,
    pub lines: Vec<(&'static str, String)>,
    _context: Context,
}

impl Peer {
    pub fn new(ros_domain: u16, robot: &str, name: &str) -> Self {
        let (context, mut node) = i2ris_ros::join(ros_domain, &[], name).unwrap();
        let joints = [
            "servo_jp",
            "servo_jr",
            "servo_jv",
            "interpolate_jp",
            "move_jp",
            "move_jr",
            "external/measured_jp",
        ];
        let volatile = qos(Durability::Volatile);
        let joints = joints.map(|topic| {
            let publisher = publisher::<JointState>(&mut node, robot, topic, &volatile);
            (topic, publisher)
        });
        let latched = qos(Durability::TransientLocal);
        let texts = ["error", "warning", "status"]
            .map(|topic| (topic, subscription::<Text>(&mut node, robot, topic, &latched)));
        Self {
            joints: joints.into(),
            state_command: publisher(&mut node, robot, "state_command", &latched),
            hold: publisher(&mut node, robot, "hold", &volatile),
            measured: subscription(&mut node, robot, "measured_js", &volatile),
            setpoint: subscription(&mut node, robot, "setpoint_js", &volatile),
            tip: subscription(&mut node, robot, "measured_cp", &volatile),
            states: subscription(&mut node, robot, "operating_state", &latched),
            texts: texts.into(),
            seen: Vec::new(),
            lines: Vec::new(),
            robot: robot.to_owned(),
            node,
            _context: context,
        }
    }

    pub fn publisher<M: Serialize + Typed>(&mut self, topic: &str) -> Publisher<M> {
        publisher(&mut self.node, &self.robot, topic, &qos(Durability::Volatile))
    }

    pub fn subscription<M>(&mut self, topic: &str) -> Subscription<M>
    where
        M: DeserializeOwned + Typed + 'static,
    {
        subscription(&mut self.node, &self.robot, topic, &qos(Durability::Volatile))
    }

    pub fn send(&self, topic: &str, position: &[f64]) {
        let message = JointState { position: position.to_vec(), ..JointState::default() };
        // Dropped if the other end does not keep up.
        let _ = self.joints[topic].publish(message);
    }

    pub fn send_message(&self, topic: &str, message: JointState) {
        self.joints[topic].publish(message).unwrap();
    }

    pub fn send_degrees(&self, topic: &str, position: [f64; 2]) {
        self.send(topic, &position.map(f64::to_radians));
    }

    pub fn command(&self, word: &str) {
        self.send_state_command(StringStamped {
            string: word.to_owned(),
            ..StringStamped::default()
        });
    }

    pub fn send_state_command(&self, message: StringStamped) {
        self.state_command.publish(message).unwrap();
    }

    pub fn hold(&self) {
        self.hold.publish(Empty::default()).unwrap();
    }

    pub fn update(&mut self) {
        while let Ok(Some((state, _))) = self.states.take() {
            self.seen.push(state);
        }
        for (topic, texts) in &self.texts {
            while let Ok(Some((Text { data }, _))) = texts.take() {
                self.lines.push((topic, data));
            }
        }
    }

    /// Waits until the newest operating state fits.
    pub fn wait_for(
        &mut self,
        what: &str,
        wanted: impl Fn(&OperatingState) -> bool,
    ) -> OperatingState {
        wait_until(what, || {
            self.update();
            self.seen.last().filter(|state| wanted(state)).cloned()
        })
    }

    pub fn wait_for_line(&mut self, topic: &str, words: &str) -> String {
        wait_until(words, || {
            self.update();
            let mut lines = self.lines.iter();
            let found = lines.find(|(on, line)| *on == topic && line.contains(words));
            found.map(|(_, line)| line.clone())
        })
    }

    /// Waits until the robot is running and listens.
    pub fn connect(&mut self) {
        self.wait_for("a state", |_| true);
        let topics: Vec<String> = { self.joints.keys() }
            .chain(&["state_command", "hold"])
            .map(|topic| format!("/{}/{topic}", self.robot))
            .collect();
        for topic in &topics {
            wait_until(topic, || self.node.subscription_count(topic) > 0);
        }
    }

    /// Sends a state command until the robot follows: no message reports that writer and reader
    /// have matched.
    pub fn command_until(&mut self, word: &str, wanted: impl Fn(&OperatingState) -> bool) {
        let mut sent = Nanos::ZERO;
        wait_until(word, || {
            if clock::now().duration_since(sent) > Nanos::from_millis(3000) {
                self.command(word);
                sent = clock::now();
            }
            self.update();
            self.seen.last().is_some_and(&wanted)
        });
    }

    /// Waits until a motion begins, and ends.
    pub fn wait_for_motion(&mut self) {
        self.wait_for("it is busy", |state| state.is_busy);
        self.wait_for("it has moved", |state| !state.is_busy);
    }

    pub fn enable(&mut self) {
        self.connect();
        self.wait_for("a robot that waits", |state| state.state == "DISABLED" && !state.is_busy);
        self.command_until("home", |state| state.is_homed && !state.is_busy);
        self.command_until("enable", |state| state.state == "ENABLED" && !state.is_busy);
    }

    pub fn measured_degrees(&self) -> [f64; 2] {
        degrees(&newest(&self.measured, |it| it.position.len() == 2))
    }

    pub fn setpoint_degrees(&self) -> [f64; 2] {
        degrees(&newest(&self.setpoint, |it| it.position.len() == 2))
    }

    pub fn next_measured(&self, wanted: impl Fn(&JointState) -> bool) -> JointState {
        newest(&self.measured, wanted)
    }

    pub fn next_tip(&self, wanted: impl Fn(&PoseStamped) -> bool) -> PoseStamped {
        newest(&self.tip, wanted)
    }

    /// Sends goals, degrees, every 5 ms, until there are none.
    pub fn stream(&self, mut goal: impl FnMut(f64) -> Option<[f64; 2]>) {
        let start = clock::now();
        let mut next = start;
        while let Some(goal) = goal((clock::now() - start).as_seconds()) {
            self.send_degrees("servo_jp", goal);
            next = next + Nanos::from_millis(5);
            clock::sleep_until(next);
        }
    }
}

fn degrees(state: &JointState) -> [f64; 2] {
    [state.position[0].to_degrees(), state.position[1].to_degrees()]
}

/// Drops earlier messages, and waits for the next that fits.
fn newest<M: DeserializeOwned + 'static>(
    subscription: &Subscription<M>,
    wanted: impl Fn(&M) -> bool,
) -> M {
    while let Ok(Some(_)) = subscription.take() {}
    wait_until("a message", || {
        let taken = subscription.take().ok().flatten();
        taken.map(|(message, _)| message).filter(|message| wanted(message))
    })
}

fn topic(
    node: &Node,
    robot: &str,
    name: &str,
    (package, kind): (&str, &str),
    qos: &QosProfile,
) -> rustdds::Topic {
    let full = if name.starts_with('/') { name.to_owned() } else { format!("/{robot}/{name}") };
    let kind = MessageTypeName::new(package, kind);
    node.create_topic(&Name::parse(&full).unwrap(), kind, qos).unwrap()
}

pub fn publisher<M: Serialize + Typed>(
    node: &mut Node,
    robot: &str,
    name: &str,
    qos: &QosProfile,
) -> Publisher<M> {
    publisher_as(node, robot, name, M::TYPE, qos)
}

/// Publishes under the name of a type, whatever the message is.
pub fn publisher_as<M: Serialize>(
    node: &mut Node,
    robot: &str,
    name: &str,
    kind: (&str, &str),
    qos: &QosProfile,
) -> Publisher<M> {
    let topic = topic(node, robot, name, kind, qos);
    node.create_publisher(&topic, Some(qos.clone())).unwrap()
}

pub fn subscription<M: DeserializeOwned + Typed + 'static>(
    node: &mut Node,
    robot: &str,
    name: &str,
    qos: &QosProfile,
) -> Subscription<M> {
    let topic = topic(node, robot, name, M::TYPE, qos);
    node.create_subscription(&topic, Some(qos.clone())).unwrap()
}

pub fn unix_ns() -> u64 {
    i2ris::wall_clock::unix_time().0
}
