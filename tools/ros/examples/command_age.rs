//! The age of commands at the tick that reads them: of ROS, against a bare echo over DDS, or of
//! another computer, over a link that loses and delays packets.
//!
//! ```text
//! cargo build --release -p i2ris -p i2ris-network -p i2ris-ros --bins --examples
//! target/release/examples/command_age ros [SECONDS]
//! target/release/examples/command_age bridge [SECONDS] [LOST, PERCENT] [DELAY, MS, BOTH DIRECTIONS]
//! ```
//!
//! Controller, `i2ris-ros`, the ends of the bridge and the echo are processes of their own. A client
//! sends `servo_jp` at about 200 Hz. The black box of the controller holds the tick that read every
//! command; its goal says which one it is. The echo sends back what it gets, and does nothing else:
//! its round trip is what DDS costs here.
#![allow(
    clippy::print_stdout,
    clippy::unwrap_used,
    dead_code,
    reason = "it prints what it measured, and ends where something fails"
)]

#[path = "../../network/tests/relay.rs"]
mod relay;

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

use i2ris::clock;
use i2ris::config::Config;
use i2ris::core::ServoGoal;
use i2ris::ipc::client::Client;
use i2ris::process::black_box::BlackBox;
use i2ris::units::Nanos;
use i2ris_ros::message::JointState;
use i2ris_testing::{Rig, TIMEOUT, program};
use ros2_client::qos::{History, WhenFull};
use ros2_client::{MessageTypeName, Name, Node, Publisher, QosProfile, Subscription};
use rustdds::mio1::event::Source;
use rustdds::mio1::{Events, Interest, Poll, Token};

use relay::Relay;

/// Not a multiple of the period of the loop: commands arrive at all phases.
const SEND_PERIOD: Nanos = Nanos::from_micros(4937);
/// Every command asks for so much more than the one before, which tells them apart: rad.
const STEP: f64 = 1e-9;
const ROBOT: &str = "age";

/// A process that ends with its owner.
struct Running(Child);

impl Running {
    fn start(command: &mut Command) -> Self {
        command.stdout(Stdio::null()).stderr(Stdio::null());
        Self(command.spawn().unwrap())
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |place: usize, default: u64| -> u64 {
        arguments.get(place).map_or(default, |text| text.parse().unwrap())
    };
    match arguments.first().map(String::as_str) {
        Some("echo") => echo(number(1, 0) as u16),
        Some("ros") => measure_ros(number(1, 20)),
        Some("bridge") => measure_bridge(number(1, 20), number(2, 0), number(3, 0)),
        _ => println!("say `ros` or `bridge`"),
    }
}

/// A robot that is enabled, with a loop that is timed as that of `config/emulator.toml`.
fn robot(seconds: u64) -> (Rig, Client) {
    let mut rig = Rig::with_model();
    let config = Config::load("config/emulator.toml".as_ref()).unwrap();
    let model = rig.config.control.model.take();
    rig.config.control = config.control;
    rig.config.control.model = model;
    rig.config.command.deadline_ms = 500;
    rig.config.record.seconds = seconds;
    let client = rig.enabled();
    (rig, client)
}

fn measure_bridge(seconds: u64, lost_percent: u64, delay_ms: u64) {
    let (mut rig, mut client) = robot(seconds + 5);
    let far = rig.another_domain("far");
    let socket = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let server = socket.local_addr().unwrap().to_string();
    drop(socket);
    // Without loss and delay there is none: a relay takes time, too.
    let relay = (lost_percent + delay_ms > 0).then(|| Relay::to(&server));
    if let Some(Relay { conditions, .. }) = &relay {
        conditions.lost_percent.store(lost_percent, Ordering::Relaxed);
        for delay in &conditions.delay_ms {
            delay.store(delay_ms, Ordering::Relaxed);
        }
    }
    let keys = rig.folder.path().join("keys");
    let bridge = |arguments: &[&str], option: &str, folder: &Path| {
        let mut command = Command::new(program::path("i2ris-bridge"));
        command.args(arguments).arg(option).arg(folder);
        command
    };
    let make = ["key", "surgeon", "--may", "command", "--host", "127.0.0.1"];
    let made = bridge(&make, "--keys", &keys).output().unwrap();
    let key = PathBuf::from(String::from_utf8(made.stdout).unwrap().split(':').next().unwrap());
    let domain = rig.domain();
    let serve = ["serve", "--command", "--lost-ms", "5000", "--domain", domain.name()];
    let serve = [&serve[..], &["--listen", &server]].concat();
    let _server = Running::start(&mut bridge(&serve, "--keys", &keys));
    let address = relay.as_ref().map_or(&server, |relay| &relay.address);
    let connect = ["connect", address, "--lost-ms", "5000", "--domain", far.name()];
    let _client = Running::start(&mut bridge(&connect, "--key", &key));
    let remote = Client::connect(&far, TIMEOUT).unwrap();
    clock::sleep(Nanos::from_millis(3000));
    let mut sent = Vec::new();
    stream(&remote, seconds, &mut sent);
    let ages = ages(&mut client, &sent);
    println!("{} commands, {} followed", sent.len(), ages.len());
    print("age at the tick", ages.into_iter().map(|(_, age)| age).collect());
}

fn measure_ros(seconds: u64) {
    let (rig, mut client) = robot(2 * seconds + 15);
    let (domain, ros_domain) = (rig.domain(), (1 + std::process::id() % 200) as u16);
    let number = ros_domain.to_string();
    let _ros = Running::start(Command::new(program::path("i2ris-ros")).args([
        "--name",
        ROBOT,
        "--domain",
        domain.name(),
        "--ros-domain",
        &number,
    ]));
    let own = std::env::current_exe().unwrap();
    let _echo = Running::start(Command::new(own).args(["echo", &number]));
    let (mut sent, round_trips) = stream_by_ros(ros_domain, seconds);
    let by_ros = sent.len();
    // The lease of the client of ROS ends.
    clock::sleep(Nanos::from_millis(rig.config.command.lease_timeout_ms + 500));
    // What every client pays: commands through shared memory alone.
    stream(&client, seconds, &mut sent);
    let ages = ages(&mut client, &sent);
    let (ros, direct): (Vec<_>, Vec<_>) = ages.into_iter().partition(|(at, _)| *at < by_ros);
    let [ros, direct] = [ros, direct].map(|it| it.into_iter().map(|(_, age)| age).collect());
    let ros = print("age at the tick, by ROS", ros);
    let direct = print("age at the tick, by shared memory", direct);
    let echo = print("echo, there and back", round_trips.try_iter().collect());
    println!("age / echo at the median: {:.2}", ros / echo);
    println!("(age - that by shared memory) / echo: {:.2}", (ros - direct) / echo);
}

/// Sends commands, and adds when every one was sent.
fn stream(client: &Client, seconds: u64, sent: &mut Vec<Nanos>) {
    let mut commander = client.commander();
    at_period(seconds, || {
        let now = clock::now();
        commander.servo_jp(&[sent.len() as f64 * STEP, 0.0]).unwrap();
        sent.push(now);
    });
    clock::sleep(Nanos::from_millis(500));
}

fn at_period(seconds: u64, mut send: impl FnMut()) {
    let start = clock::now();
    let mut next = start;
    while clock::now().since(start) < Nanos::from_millis(seconds * 1000) {
        send();
        next = (next + SEND_PERIOD).max(clock::now());
        clock::sleep_until(next);
    }
}

/// The ages of commands at the ticks that read them, with their places among those that were sent.
fn ages(client: &mut Client, sent: &[Nanos]) -> Vec<(usize, Nanos)> {
    let recorded = BlackBox::read(&client.write_black_box().unwrap()).unwrap();
    let age = |tick: &i2ris::process::black_box::TickRecord| {
        let ServoGoal::Joint(goal, _) = tick.inputs.servo?.goal else {
            return None;
        };
        let index = (goal[0] / STEP).round() as usize;
        Some((index, tick.timing.tick.started.since(*sent.get(index)?)))
    };
    recorded.ticks.iter().filter_map(age).collect()
}

/// Prints percentiles, ms; the median.
fn print(what: &str, spans: Vec<Nanos>) -> f64 {
    let mut ms: Vec<f64> = spans.iter().map(|span| span.as_seconds() * 1e3).collect();
    ms.sort_by(f64::total_cmp);
    let quantile = |q: f64| {
        let last = ms.len().saturating_sub(1) as f64;
        ms.get((q * last) as usize).copied().unwrap_or(f64::NAN)
    };
    let [p50, p90, p99, max] = [0.5, 0.9, 0.99, 1.0].map(quantile);
    let count = ms.len();
    println!("{what}: {count}, ms: p50 {p50:.3}, p90 {p90:.3}, p99 {p99:.3}, max {max:.3}");
    p50
}

fn qos() -> QosProfile {
    QosProfile::subscription_default()
        .reliability_reliable(WhenFull::DEFAULT)
        .history(History::KeepLast { depth: 10 })
}

fn topic(node: &Node, name: &str) -> rustdds::Topic {
    let kind = MessageTypeName::new("sensor_msgs", "JointState");
    node.create_topic(&Name::parse(name).unwrap(), kind, &qos()).unwrap()
}

fn publisher(node: &mut Node, name: &str) -> Publisher<JointState> {
    let topic = topic(node, name);
    node.create_publisher(&topic, None).unwrap()
}

fn subscription(node: &mut Node, name: &str) -> Subscription<JointState> {
    let topic = topic(node, name);
    node.create_subscription(&topic, None).unwrap()
}

/// Calls `take` with every message, as it comes, until the process ends.
fn receive(mut subscription: Subscription<JointState>, mut take: impl FnMut(JointState)) {
    let (mut poll, mut events) = (Poll::new().unwrap(), Events::with_capacity(4));
    subscription.register(poll.registry(), Token(0), Interest::READABLE).unwrap();
    loop {
        poll.poll(&mut events, Some(Duration::from_millis(10))).unwrap();
        while let Ok(Some((message, _))) = subscription.take() {
            take(message);
        }
    }
}

/// The process that sends back what it gets.
fn echo(ros_domain: u16) {
    let (_context, mut node) = i2ris_ros::join(ros_domain, &[], "echo").unwrap();
    let back = publisher(&mut node, "/echo/pong");
    let there = subscription(&mut node, "/echo/ping");
    receive(there, |message| drop(back.publish(message)));
}

/// Sends commands and echoes. When every command was sent, and the round trips of the echoes.
fn stream_by_ros(ros_domain: u16, seconds: u64) -> (Vec<Nanos>, Receiver<Nanos>) {
    let (_context, mut node) = i2ris_ros::join(ros_domain, &[], "client").unwrap();
    let servo = publisher(&mut node, &format!("/{ROBOT}/servo_jp"));
    let ping = publisher(&mut node, "/echo/ping");
    let pong = subscription(&mut node, "/echo/pong");
    let (took, round_trips) = channel();
    thread::spawn(move || {
        receive(pong, |message| {
            let sent = message.effort.first().map_or(0, |sent| sent.to_bits());
            let _ = took.send(clock::now().since(Nanos(sent)));
        });
    });
    let there = |name: &str| node.subscription_count(name) > 0;
    while !there(&format!("/{ROBOT}/servo_jp")) || !there("/echo/ping") {
        clock::sleep(Nanos::from_millis(10));
    }
    clock::sleep(Nanos::from_millis(2000));
    let mut sent = Vec::new();
    at_period(seconds, || {
        let position = vec![sent.len() as f64 * STEP, 0.0];
        let now = clock::now();
        servo.publish(JointState { position: position.clone(), ..Default::default() }).unwrap();
        sent.push(now);
        clock::sleep(Nanos(SEND_PERIOD.0 / 2));
        let effort = vec![f64::from_bits(clock::now().0)];
        ping.publish(JointState { position, effort, ..Default::default() }).unwrap();
    });
    clock::sleep(Nanos::from_millis(200));
    (sent, round_trips)
}
