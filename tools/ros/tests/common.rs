//! Emulated drives and a controller on them, and `i2ris-ros` as a process.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU16, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::units::Nanos;
use i2ris_ros::message::{
    Empty, JointState, OperatingState, PoseStamped, StringStamped, Text, Typed,
};
use i2ris_testing::{Killed, Rig, wait_until, wait_until_idle};
use nix::sys::signal::Signal;
use ros2_client::qos::{Durability, History, WhenFull};
use ros2_client::{Context, MessageTypeName, Name, Node, Publisher, QosProfile, Subscription};
use serde::Serialize;
use serde::de::DeserializeOwned;

pub const ROBOT: &str = "i2ris";

/// A robot neither homed nor enabled, at a rate and a deadline that leave six at once enough time.
pub fn robot() -> Rig {
    let mut rig = Rig::with_model();
    (rig.config.control.rate_hz, rig.config.command.deadline_ms) = (500, 400);
    rig.start_controller_thread();
    wait_until_idle(&mut rig.client());
    rig
}

/// Waits for a state of the robot, as seen by a client in shared memory.
pub fn wait_for(rig: &mut Rig, wanted: impl Fn(&OperatingStateMsg) -> bool) -> OperatingStateMsg {
    i2ris_testing::wait_for(&mut rig.client(), wanted)
}

/// A robot, its bridge with nothing but these arguments, and a client of ROS.
pub fn start_with(arguments: &[&str]) -> (Rig, Bridge, Peer) {
    let (rig, domain) = (robot(), ros_domain());
    let bridge = Bridge::start_with(&rig.domain(), domain, arguments);
    let peer = Peer::new(domain, ROBOT, "console");
    (rig, bridge, peer)
}

/// The same for clients that command and home.
pub fn start() -> (Rig, Bridge, Peer) {
    start_with(&["--command", "--home"])
}

/// The same, homed and enabled.
pub fn enabled() -> (Rig, Bridge, Peer) {
    let (rig, bridge, mut peer) = start();
    peer.enable();
    (rig, bridge, peer)
}

/// `i2ris-ros` as a process, killed when dropped. Its output is stored.
pub struct Bridge {
    process: Killed,
    lines: Arc<Mutex<Vec<String>>>,
}

impl Bridge {
    /// Starts it for clients that command and home, and waits until it has joined ROS.
    pub fn start(domain: &Domain, ros_domain: u16, arguments: &[&str]) -> Self {
        Self::start_with(domain, ros_domain, &[&["--command", "--home"], arguments].concat())
    }

    pub fn start_with(domain: &Domain, ros_domain: u16, arguments: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_i2ris-ros"));
        command.args(arguments).env("I2RIS_DOMAIN", domain.name());
        command.env("ROS_DOMAIN_ID", ros_domain.to_string()).env_remove("RMW_IMPLEMENTATION");
        command.stdin(Stdio::null()).stdout(Stdio::piped());
        let mut process = Killed::start(&mut command);
        let lines = Arc::<Mutex<Vec<String>>>::default();
        let (output, kept) = (process.0.stdout.take().unwrap(), Arc::clone(&lines));
        thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                kept.lock().unwrap().push(line);
            }
        });
        let bridge = Self { process, lines };
        bridge.wait_for("in ROS domain");
        bridge
    }

    pub fn id(&self) -> u32 {
        self.process.0.id()
    }

    pub fn lines(&self) -> Vec<String> {
        self.lines.lock().unwrap().clone()
    }

    pub fn wait_for(&self, words: &str) {
        wait_until(&format!("{words:?} among {:?}", self.lines()), || {
            self.lines().iter().any(|line| line.contains(words))
        });
    }

    /// Resident memory, kB.
    pub fn memory_kb(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.id())).unwrap();
        let line = status.lines().find(|line| line.starts_with("VmRSS")).unwrap();
        line.split_whitespace().nth(1).unwrap().parse().unwrap()
    }

    pub fn end(mut self) -> bool {
        self.process.signal(Signal::SIGINT);
        wait_until("it ends", || self.process.0.try_wait().unwrap()).success()
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        if thread::panicking() {
            eprintln!("output of i2ris-ros:\n{}", self.lines().join("\n"));
        }
    }
}

/// Tests of one or more processes do not meet. Above 101, any program may have their ports.
pub fn ros_domain() -> u16 {
    static NEXT: AtomicU16 = AtomicU16::new(0);
    let own = (std::process::id() as u16).wrapping_mul(16);
    1 + (own.wrapping_add(NEXT.fetch_add(1, Ordering::Relaxed))) % 101
}

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
        let topics =
            "servo_jp servo_jr servo_jv interpolate_jp move_jp move_jr external/measured_jp";
        let (volatile, mut joints) = (qos(Durability::Volatile), BTreeMap::new());
        for topic in topics.split(' ') {
            joints.insert(topic, publisher(&mut node, robot, topic, &volatile));
        }
        let latched = qos(Durability::TransientLocal);
        let texts = ["error", "warning", "status"]
            .map(|topic| (topic, subscription::<Text>(&mut node, robot, topic, &latched)));
        Self {
            joints,
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
        let string = word.to_owned();
        self.send_state_command(StringStamped { string, ..StringStamped::default() });
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

    pub fn wait_for(&mut self, what: &str, wanted: impl Fn(&OperatingState) -> bool) {
        wait_until(what, || {
            self.update();
            self.seen.last().is_some_and(&wanted)
        });
    }

    pub fn wait_for_line(&mut self, topic: &str, words: &str) -> String {
        wait_until(words, || self.line(topic, words))
    }

    /// The first line with these words, if there was one so far.
    pub fn line(&mut self, topic: &str, words: &str) -> Option<String> {
        self.update();
        let mut lines = self.lines.iter();
        let found = lines.find(|(on, line)| *on == topic && line.contains(words));
        found.map(|(_, line)| line.clone())
    }

    /// Waits until the robot is running and listens.
    pub fn connect(&mut self) {
        self.wait_for("a state", |_| true);
        for topic in self.joints.keys().chain(&["state_command", "hold"]) {
            let topic = format!("/{}/{topic}", self.robot);
            wait_until(&topic, || self.node.subscription_count(&topic) > 0);
        }
    }

    /// Sends a state command until the robot follows: no message reports a match.
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

/// Sends something with its number, and waits after each.
pub fn repeat(times: u32, period_ms: u64, mut send: impl FnMut(u32)) {
    for number in 0..times {
        send(number);
        clock::sleep(Nanos::from_millis(period_ms));
    }
}
