//! The age of commands of another computer at the tick that reads them, over a link that loses and
//! delays packets.
//!
//! ```text
//! cargo build --release -p i2ris -p i2ris-network --bins --examples
//! target/release/examples/bridge_age [SECONDS] [LOST, PERCENT] [DELAY, MS, BOTH DIRECTIONS]
//! ```
//!
//! Controller and both ends of the bridge are processes of their own, on one computer; a relay
//! between the ends drops and delays packets. A client in the far domain sends `servo_jp` at about
//! 200 Hz. The black box of the controller holds the tick that read every command; its goal says
//! which one it is.
#![allow(clippy::print_stdout, reason = "it prints what it measured")]

use std::collections::VecDeque;
use std::error::Error;
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;

use i2ris::clock;
use i2ris::config::Config;
use i2ris::core::ServoGoal;
use i2ris::ipc::client::Client;
use i2ris::ipc::{Domain, random_id};
use i2ris::process::black_box::BlackBox;
use i2ris::units::Nanos;
use i2ris_emulator::snake::SnakeConfig;
use i2ris_emulator::{Emulator, EmulatorConfig};
use i2ris_network::keys::{Access, Lifetime, make_key};
use i2ris_testing::home_and_enable;
use rand::RngExt;
use rand_pcg::Pcg64Mcg;

type Failure = Box<dyn Error>;

/// Not a multiple of the period of the loop: commands arrive at all phases.
const SEND_PERIOD: Nanos = Nanos::from_micros(4937);
const TIMEOUT: Nanos = Nanos::from_millis(30_000);
/// Every command asks for so much more than the one before, which makes them distinct: rad.
const STEP: f64 = 1e-9;

/// A process that ends with its owner.
struct Running(Child);

impl Running {
    fn start(command: &mut Command) -> Result<Self, Failure> {
        command.stdout(Stdio::null()).stderr(Stdio::null());
        Ok(Self(command.spawn()?))
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn main() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |place: usize, default: u64| -> Result<u64, Failure> {
        let given = arguments.get(place);
        Ok(given.map_or(Ok(default), |text| text.parse())?)
    };
    let (seconds, lost_percent, delay_ms) = (number(0, 20)?, number(1, 0)?, number(2, 0)?);
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
    config.record.seconds = seconds + 5;
    let model = folder.path().join("model.json");
    std::fs::write(&model, MODEL)?;
    config.control.model = Some(model);
    let file = folder.path().join("age.toml");
    std::fs::write(&file, toml::to_string(&config)?)?;
    let domain = Domain::new(&config.ipc.domain)?;
    let mut control = Command::new(beside("i2ris-control")?);
    let _controller = Running::start(control.arg("--config").arg(&file))?;
    let mut client = Client::connect(&domain, TIMEOUT)?;
    home_and_enable(&mut client, TIMEOUT)?;

    let far = Domain::new(&format!("t{:016x}", random_id()))?;
    let server = free_address()?;
    let relay = relay(&server, lost_percent, Nanos::from_millis(delay_ms))?;
    let _ends = ends(folder.path(), &domain, &far, &server, &relay)?;
    let remote = Client::connect(&far, TIMEOUT)?;
    clock::sleep(Nanos::from_millis(3000));
    let sent = stream(&remote, Nanos::from_millis(seconds * 1000))?;
    let recorded = BlackBox::read(&client.write_black_box()?)?;
    report(&recorded, &sent);
    Ok(())
}

/// Both ends of the bridge.
fn ends(
    folder: &Path,
    domain: &Domain,
    far: &Domain,
    server: &str,
    relay: &str,
) -> Result<[Running; 2], Failure> {
    let keys = folder.join("keys");
    let hosts = ["127.0.0.1".to_owned()];
    let key = make_key(&keys, "surgeon", Access::Command, &hosts, Lifetime::days(1))?;
    let mut serve = Command::new(beside("i2ris-bridge")?);
    serve.args(["serve", "--command", "--lost-ms", "5000"]);
    serve.args(["--listen", server, "--domain", domain.name()]);
    let serve = Running::start(serve.arg("--keys").arg(&keys))?;
    let mut connect = Command::new(beside("i2ris-bridge")?);
    connect.args(["connect", relay, "--lost-ms", "5000"]);
    connect.args(["--domain", far.name()]).arg("--key").arg(&key);
    Ok([serve, Running::start(&mut connect)?])
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

fn free_address() -> Result<String, Failure> {
    Ok(UdpSocket::bind("127.0.0.1:0")?.local_addr()?.to_string())
}

/// A thread for each direction, until the process ends; the address to call. Without loss and delay
/// there is none: a relay takes time, too.
fn relay(server: &str, lost_percent: u64, delay: Nanos) -> Result<String, Failure> {
    if lost_percent == 0 && delay == Nanos::ZERO {
        return Ok(server.to_owned());
    }
    let near = UdpSocket::bind("127.0.0.1:0")?;
    let far = UdpSocket::bind("127.0.0.1:0")?;
    far.connect(server)?;
    let address = near.local_addr()?.to_string();
    let mut buffer = [0; 65_536];
    let (near_again, far_again) = (near.try_clone()?, far.try_clone()?);
    thread::spawn(move || {
        let Ok((length, client)) = near.recv_from(&mut buffer) else {
            return;
        };
        let _ = (near.connect(client), far.send(&buffer[..length]));
        let back = (far_again, near_again);
        thread::spawn(move || carry(&back.0, &back.1, lost_percent, delay, 1));
        carry(&near, &far, lost_percent, delay, 2);
    });
    Ok(address)
}

/// Carries packets of one direction.
fn carry(from: &UdpSocket, to: &UdpSocket, lost_percent: u64, delay: Nanos, seed: u128) {
    let (mut random, mut buffer) = (Pcg64Mcg::new(seed), [0; 65_536]);
    let mut delayed: VecDeque<(Nanos, Vec<u8>)> = VecDeque::new();
    let poll = delay != Nanos::ZERO;
    let _ = from.set_nonblocking(poll);
    loop {
        match from.recv(&mut buffer) {
            Ok(_) if random.random_range(0..100) < lost_percent => {}
            Ok(length) => {
                let packet = buffer[..length].to_vec();
                delayed.push_back((clock::now() + delay, packet));
            }
            Err(_) => clock::sleep(Nanos::from_micros(100)),
        }
        while delayed.front().is_some_and(|(due, _)| *due <= clock::now()) {
            let packet = delayed.pop_front().map(|(_, packet)| packet);
            let _ = to.send(&packet.unwrap_or_default());
        }
    }
}

/// Sends commands; when every one was sent.
fn stream(client: &Client, length: Nanos) -> Result<Vec<Nanos>, Failure> {
    let (mut commander, start) = (client.commander(), clock::now());
    let (mut sent, mut next) = (Vec::new(), start);
    while clock::now().since(start) < length {
        let now = clock::now();
        commander.servo_jp(&[sent.len() as f64 * STEP, 0.0])?;
        sent.push(now);
        next = (next + SEND_PERIOD).max(clock::now());
        clock::sleep_until(next);
    }
    clock::sleep(Nanos::from_millis(500));
    Ok(sent)
}

fn report(recorded: &BlackBox, sent: &[Nanos]) {
    let age = |tick: &i2ris::process::black_box::TickRecord| {
        let ServoGoal::Joint(goal, _) = tick.inputs.servo?.goal else {
            return None;
        };
        let sent = sent.get((goal[0] / STEP).round() as usize)?;
        Some(tick.timing.tick.started.since(*sent).as_seconds() * 1e3)
    };
    let mut ages_ms: Vec<f64> = recorded.ticks.iter().filter_map(age).collect();
    ages_ms.sort_by(f64::total_cmp);
    let quantile = |q: f64| {
        let last = ages_ms.len().saturating_sub(1) as f64;
        let place = (q * last) as usize;
        ages_ms.get(place).copied().unwrap_or(f64::NAN)
    };
    let [p50, p90, p99, max] = [0.5, 0.9, 0.99, 1.0].map(quantile);
    println!(
        "{} commands, {} followed; age at the tick, ms: p50 {p50:.3}, p90 {p90:.3}, p99 {p99:.3}, \
         max {max:.3}",
        sent.len(),
        ages_ms.len()
    );
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
