//! The age of servo commands at the tick that reads them, with busy processes on all processors.
//!
//! ```text
//! cargo build --release --workspace --examples
//! target/release/examples/command_age [SECONDS] [BUSY PROCESSES]
//! ```
//!
//! The controller runs as a process on emulated drives. A client under SCHED_FIFO streams commands
//! at about 200 Hz. The black box holds the time of every tick and the stamp of the command that it
//! read.
//! The longest gap between two stamps is the client's part; the age is the controller's part.
#![allow(clippy::print_stdout, reason = "it prints what it measured")]

use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use i2ris::clock;
use i2ris::config::{AxisConfig, Config, PortConfig};
use i2ris::ipc::Domain;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::process::black_box::BlackBox;
use i2ris::realtime::{self, Wanted};
use i2ris::units::{Counts, Nanos};
use i2ris_emulator::snake::SnakeConfig;
use i2ris_emulator::{Emulator, EmulatorConfig};
use i2ris_testing::home_and_enable;

/// Not a multiple of the period of the loop: commands arrive at all phases.
const SEND_PERIOD: Nanos = Nanos::from_micros(4937);
const TIMEOUT: Nanos = Nanos::from_millis(30_000);
/// SCHED_FIFO priority of the control loop.
const LOOP_PRIORITY: u8 = 80;
/// Below all threads of the controller.
const CLIENT_PRIORITY: u8 = 50;

/// A process that ends with its owner.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default: u64| arguments.next().map_or(Ok(default), |text| text.parse());
    let (seconds, busy) = (number(20)?, number(2)?);
    let folder = tempfile::tempdir()?;
    let snake = SnakeConfig::load("config/snakes/steel.toml".as_ref())?;
    let emulation = EmulatorConfig::new(snake, &folder.path().join("ports"));
    let serial_numbers = emulation.drives.clone().map(|drive| drive.serial_number);
    let emulator = Emulator::start(emulation)?;
    let mut config = Config::load("config/emulator.toml".as_ref())?;
    config.robot_id = "age".to_owned();
    config.ports = (0..2)
        .map(|axis| {
            let limits = [Counts(-2000), Counts(2000)];
            let mut one = AxisConfig::new(axis, serial_numbers[axis], limits);
            one.motor_speed_rpm = 10_000;
            let mut port = PortConfig::new(emulator.device(axis).to_owned(), vec![one]);
            port.reply_timeout_ms = 1000;
            port
        })
        .collect();
    config.ipc.domain = format!("age-{}", std::process::id());
    config.control.priority = LOOP_PRIORITY;
    config.control.lock_memory = true;
    config.limits.feedback_stale_ms = 2000;
    config.limits.feedback_lost_ms = 10_000;
    config.record.folder = folder.path().join("records");
    config.record.seconds = seconds;
    let file = folder.path().join("age.toml");
    std::fs::write(&file, toml::to_string(&config)?)?;
    let domain = Domain::new(&config.ipc.domain)?;
    let mut controller = Running(
        Command::new(controller_program()?)
            .arg("--config")
            .arg(&file)
            .stdout(Stdio::null())
            .stderr(std::fs::File::create(folder.path().join("log"))?)
            .spawn()?,
    );
    let mut client = Client::connect(&domain, TIMEOUT)?;
    home_and_enable(&mut client, TIMEOUT)?;
    let load: Vec<Running> = (0..busy)
        .map(|_| Ok(Running(Command::new("sh").args(["-c", "while :; do :; done"]).spawn()?)))
        .collect::<Result<_, std::io::Error>>()?;
    let stale_before = state(&mut client)?.stale_stops;
    let longest_gap = stream(&client, Nanos::from_millis(seconds * 1000))?;
    let stale_stops = state(&mut client)?.stale_stops - stale_before;
    drop(load);
    let path = client.write_black_box()?;
    report(&BlackBox::read(&path)?, longest_gap, stale_stops);
    let id = nix::unistd::Pid::from_raw(controller.0.id() as i32);
    nix::sys::signal::kill(id, nix::sys::signal::Signal::SIGTERM)?;
    controller.0.wait()?;
    print!("{}", std::fs::read_to_string(folder.path().join("log"))?);
    Ok(())
}

/// The program next to this one.
fn controller_program() -> Result<PathBuf, Box<dyn Error>> {
    let own = std::env::current_exe()?;
    let folder = own.parent().and_then(Path::parent);
    let program = folder.ok_or("no folder")?.join("i2ris-control");
    if !program.is_file() {
        return Err("build the controller first: cargo build --release".into());
    }
    Ok(program)
}

fn state(client: &mut Client) -> Result<OperatingStateMsg, Box<dyn Error>> {
    Ok(client.wait_for(TIMEOUT, |_| true)?)
}

/// Streams commands; returns the longest time between two of them.
fn stream(client: &Client, length: Nanos) -> Result<Nanos, Box<dyn Error>> {
    let mut commander = client.commander();
    let streaming = std::thread::spawn(move || {
        let granted = realtime::request(Wanted { priority: CLIENT_PRIORITY, ..Wanted::default() });
        println!("client: SCHED_FIFO {}", granted.priority);
        let start = clock::now();
        let (mut last, mut next, mut longest) = (start, start, Nanos::ZERO);
        while clock::now().since(start) < length {
            commander.servo_actuators(&[0, 0])?;
            let now = clock::now();
            longest = longest.max(now.since(last));
            last = now;
            next = (next + SEND_PERIOD).max(now);
            clock::sleep_until(next);
        }
        Ok::<_, i2ris::ipc::client::ClientError>(longest)
    });
    Ok(streaming.join().map_err(|_| "the client ended early")??)
}

fn report(recorded: &BlackBox, longest_gap: Nanos, stale_stops: u64) {
    let mut ages: Vec<f64> = recorded
        .ticks
        .iter()
        .filter_map(|tick| {
            let servo = tick.inputs.servo?;
            Some(tick.timing.tick.started.since(servo.stamp).as_seconds() * 1e3)
        })
        .collect();
    ages.sort_by(f64::total_cmp);
    let quantile = |q: f64| {
        let last = ages.len().saturating_sub(1) as f64;
        ages.get((q * last) as usize).copied().unwrap_or(f64::NAN)
    };
    let [p50, p90, p99, p999, max] = [0.5, 0.9, 0.99, 0.999, 1.0].map(quantile);
    println!(
        "{} commands; age at the tick, ms: p50 {p50:.2}, p90 {p90:.2}, p99 {p99:.2}, p99.9 \
         {p999:.2}, max {max:.2}",
        ages.len()
    );
    println!(
        "longest gap between two commands of the client: {:.1} ms; stale stops: {stale_stops}",
        longest_gap.as_seconds() * 1e3
    );
}
