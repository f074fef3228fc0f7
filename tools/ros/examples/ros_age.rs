//! The age of commands of ROS at the tick that reads them, against a bare echo over DDS.
//!
//! ```text
//! cargo build --release -p i2ris -p i2ris-ros --bins --examples
//! target/release/examples/ros_age [SECONDS]
//! ```
//!
//! Controller, `i2ris-ros` and the echo are processes of their own. A client sends `servo_jp`, and
//! a message of the same kind to the echo, at about 200 Hz. The black box of the controller holds
//! the tick that read every command; its goal says which one it is. The echo sends back what it
//! gets, and does nothing else: its round trip is what DDS costs here.
#![allow(clippy::print_stdout, reason = "it prints what it measured")]

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

use i2ris::clock;
use i2ris::config::Config;
use i2ris::core::ServoGoal;
use i2ris::ipc::client::Client;
use i2ris::ipc::{Domain, random_id};
use i2ris::process::black_box::BlackBox;
use i2ris::units::Nanos;
use i2ris_emulator::snake::SnakeConfig;
use i2ris_emulator::{Emulator, EmulatorConfig};
use i2ris_ros::message::JointState;
use i2ris_testing::home_and_enable;
use ros2_client::qos::{History, WhenFull};
use ros2_client::{MessageTypeName, Name, Node, Publisher, QosProfile, Subscription};
use rustdds::mio1::event::Source;
use rustdds::mio1::{Events, Interest, Poll, Token};

type Failure = Box<dyn Error>;

/// Not a multiple of the period of the loop: commands arrive at all phases.
const SEND_PERIOD: Nanos = Nanos::from_micros(4937);
const TIMEOUT: Nanos = Nanos::from_millis(30_000);
/// Every command asks for so much more than the one before, which tells them apart: rad.
const STEP: f64 = 1e-9;
const ROBOT: &str = "age";

/// A process that ends with its owner.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.first().map(String::as_str) {
        Some("echo") => echo(arguments[1].parse()?),
        seconds => measure(seconds.map_or(Ok(20), str::parse)?),
    }
}

fn qos() -> QosProfile {
    QosProfile::subscription_default()
        .reliability_reliable(WhenFull::DEFAULT)
        .history(History::KeepLast { depth: 10 })
}

fn topic(node: &Node, name: &str) -> Result<rustdds::Topic, Failure> {
    let kind = MessageTypeName::new("sensor_msgs", "JointState");
    Ok(node.create_topic(&Name::parse(name)?, kind, &qos())?)
}

fn publisher(node: &mut Node, name: &str) -> Result<Publisher<JointState>, Failure> {
    let topic = topic(node, name)?;
    Ok(node.create_publisher(&topic, None)?)
}

fn subscription(node: &mut Node, name: &str) -> Result<Subscription<JointState>, Failure> {
    let topic = topic(node, name)?;
    Ok(node.create_subscription(&topic, None)?)
}

/// Calls `take` with every message, as it comes.
fn receive(
    mut subscription: Subscription<JointState>,
    mut take: impl FnMut(JointState),
) -> Result<(), Failure> {
    let (mut poll, mut events) = (Poll::new()?, Events::with_capacity(4));
    subscription.register(poll.registry(), Token(0), Interest::READABLE)?;
    loop {
        poll.poll(&mut events, Some(Duration::from_millis(10)))?;
        while let Ok(Some((message, _))) = subscription.take() {
            take(message);
        }
    }
}

/// The process that sends back what it gets.
fn echo(ros_domain: u16) -> Result<(), Failure> {
    let (_context, mut node) = i2ris_ros::join(ros_domain, &[], "echo")?;
    let back = publisher(&mut node, "/echo/pong")?;
    let there = subscription(&mut node, "/echo/ping")?;
    receive(there, |message| drop(back.publish(message)))
}

fn measure(seconds: u64) -> Result<(), Failure> {
    let folder = tempfile::tempdir()?;
    let snake = SnakeConfig::load("config/snakes/steel.toml".as_ref())?;
    let emulator = Emulator::start(EmulatorConfig::new(snake, &folder.path().join("ports")))?;
    let mut config = Config::load("config/emulator.toml".as_ref())?;
    for (axis, port) in config.ports.iter_mut().enumerate() {
        port.device = emulator.device(axis).to_owned();
        port.reply_timeout_ms = 1000;
    }
    config.ipc.domain = format!("t{:016x}", random_id());
    config.limits.feedback_stale_ms = 2000;
    config.limits.feedback_lost_ms = 10_000;
    config.command.deadline_ms = 500;
    config.record.folder = folder.path().join("records");
    config.record.seconds = 2 * seconds + 15;
    let model = folder.path().join("model.json");
    std::fs::write(&model, MODEL)?;
    config.control.model = Some(model);
    let file = folder.path().join("age.toml");
    std::fs::write(&file, toml::to_string(&config)?)?;
    let domain = Domain::new(&config.ipc.domain)?;
    let ros_domain = 1 + (std::process::id() % 200) as u16;
    let start = |command: &mut Command| -> Result<Running, Failure> {
        command.stdout(Stdio::null()).stderr(Stdio::null());
        Ok(Running(command.spawn()?))
    };
    let _controller = start(Command::new(beside("i2ris-control")?).arg("--config").arg(&file))?;
    let mut client = Client::connect(&domain, TIMEOUT)?;
    home_and_enable(&mut client, TIMEOUT)?;
    let _ros = start(
        Command::new(beside("i2ris-ros")?)
            .args(["--name", ROBOT, "--domain", domain.name()])
            .args(["--ros-domain", &ros_domain.to_string()]),
    )?;
    let _echo =
        start(Command::new(std::env::current_exe()?).args(["echo", &ros_domain.to_string()]))?;
    let length = Nanos::from_millis(seconds * 1000);
    let (mut sent, round_trips) = stream(ros_domain, length)?;
    let by_ros = sent.len();
    // The lease of the client of ROS ends.
    clock::sleep(Nanos::from_millis(config.command.lease_timeout_ms + 500));
    stream_by_shared_memory(&client, length, &mut sent)?;
    let recorded = BlackBox::read(&client.write_black_box()?)?;
    report(&recorded, &sent, by_ros, round_trips.try_iter().collect());
    Ok(())
}

/// The program in the folder above.
fn beside(program: &str) -> Result<PathBuf, Failure> {
    let own = std::env::current_exe()?;
    let folder = own.parent().and_then(Path::parent).ok_or("no folder")?;
    let file = folder.join(program);
    if !file.is_file() {
        return Err(format!("build {program} first, in the same profile").into());
    }
    Ok(file)
}

/// Sends commands and echoes. When every command was sent, and the round trips of the echoes.
fn stream(ros_domain: u16, length: Nanos) -> Result<(Vec<Nanos>, Receiver<Nanos>), Failure> {
    let (_context, mut node) = i2ris_ros::join(ros_domain, &[], "client")?;
    let servo = publisher(&mut node, &format!("/{ROBOT}/servo_jp"))?;
    let ping = publisher(&mut node, "/echo/ping")?;
    let pong = subscription(&mut node, "/echo/pong")?;
    let (took, round_trips) = channel();
    thread::spawn(move || {
        // Ends with the process.
        let _ = receive(pong, |message| {
            let sent = message.effort.first().map_or(0, |sent| sent.to_bits());
            let _ = took.send(clock::now().since(Nanos(sent)));
        });
    });
    let there = |name: &str| node.subscription_count(name) > 0;
    while !there(&format!("/{ROBOT}/servo_jp")) || !there("/echo/ping") {
        clock::sleep(Nanos::from_millis(10));
    }
    clock::sleep(Nanos::from_millis(2000));
    let (start, mut sent) = (clock::now(), Vec::new());
    let mut next = start;
    while clock::now().since(start) < length {
        let goal = |index: usize| vec![index as f64 * STEP, 0.0];
        let now = clock::now();
        servo.publish(JointState { position: goal(sent.len()), ..JointState::default() })?;
        sent.push(now);
        clock::sleep(Nanos(SEND_PERIOD.0 / 2));
        ping.publish(JointState {
            position: goal(sent.len()),
            effort: vec![f64::from_bits(clock::now().0)],
            ..JointState::default()
        })?;
        next = (next + SEND_PERIOD).max(clock::now());
        clock::sleep_until(next);
    }
    clock::sleep(Nanos::from_millis(200));
    Ok((sent, round_trips))
}

/// What every client pays: commands through shared memory alone.
fn stream_by_shared_memory(
    client: &Client,
    length: Nanos,
    sent: &mut Vec<Nanos>,
) -> Result<(), Failure> {
    let (mut commander, start) = (client.commander(), clock::now());
    let mut next = start;
    while clock::now().since(start) < length {
        let now = clock::now();
        commander.servo_jp(&[sent.len() as f64 * STEP, 0.0])?;
        sent.push(now);
        next = (next + SEND_PERIOD).max(clock::now());
        clock::sleep_until(next);
    }
    clock::sleep(Nanos::from_millis(200));
    Ok(())
}

fn report(recorded: &BlackBox, sent: &[Nanos], by_ros: usize, round_trips: Vec<Nanos>) {
    let age = |tick: &i2ris::process::black_box::TickRecord| {
        let servo = tick.inputs.servo?;
        let ServoGoal::Joint(goal, _) = servo.goal else {
            return None;
        };
        let index = (goal[0] / STEP).round() as usize;
        let age = tick.timing.tick.started.since(*sent.get(index)?);
        Some((index < by_ros, age))
    };
    let ages: Vec<(bool, Nanos)> = recorded.ticks.iter().filter_map(age).collect();
    let of = |ros: bool| { ages.iter() }.filter(move |(by_ros, _)| *by_ros == ros);
    let [by_ros, direct] = [true, false].map(|ros| of(ros).map(|(_, age)| *age).collect());
    let by_ros = print("age at the tick, by ROS", by_ros);
    let direct = print("age at the tick, by shared memory", direct);
    let echo = print("echo, there and back", round_trips);
    println!("age / echo at the median: {:.2}", by_ros / echo);
    println!("(age - that by shared memory) / echo: {:.2}", (by_ros - direct) / echo);
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

/// A linear model of the emulated snake, good to a few degrees.
const MODEL: &str = r#"{"format": "i2ris-model", "schema_version": 1, "robot_id": "i2ris-emulated",
    "outputs": [{"name": "pitch", "unit": "deg"}, {"name": "yaw", "unit": "deg"}],
    "family": {"kind": "linear", "gain": [[0.0156, -0.0156], [0.0156, 0.0156]],
        "offset": [0.0, 0.0], "covariance": [[1.0, 0.0], [0.0, 1.0]]},
    "hull": {"corners": [[-1000.0, -1000.0], [1000.0, -1000.0], [1000.0, 1000.0],
        [-1000.0, 1000.0]]},
    "training": {"data_file": "none", "data_sha256":
        "0000000000000000000000000000000000000000000000000000000000000000", "rows": 10, "seed": 0,
        "restarts": 0, "log_likelihood": null, "bic": null, "software": "example"},
    "metrics": [
        {"training": {"r2": 1.0, "rmsd": 1.0, "nrmsd": 0.1, "mae": 1.0, "max": 2.0},
         "held_out": null},
        {"training": {"r2": 1.0, "rmsd": 1.0, "nrmsd": 0.1, "mae": 1.0, "max": 2.0},
         "held_out": null}]}"#;
