//! Measures the two ways by which a servo command can reach the control loop, and what a faulty
//! client does to them: `cargo run --release --package i2ris-cli --example servo_path`.
//!
//! A process sends a command about every millisecond at no fixed phase; a loop of 1 kHz
//! (SCHED_FIFO, pinned, spinning, where granted) looks for the newest one at every tick. Printed:
//! the age of the command when the loop has it, at best uniform over one period, and what the look
//! costs the loop.
//!
//! | way | how |
//! |---|---|
//! | relay | a thread polls publish-subscribe and fills a mailbox that the loop reads; this is what the controller does |
//! | blackboard | the loop reads the memory that the client writes |
//!
//! The faulty client sends as fast as it can. At the end a writer of the blackboard is killed, and
//! the next one tries.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::process::{Child, Command};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use hdrhistogram::Histogram;
use i2ris::clock;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::ServoJp;
use i2ris::ipc::{Domain, DomainLock, Server, random_id, server};
use i2ris::realtime::{self, Ticker, Wanted};
use i2ris::units::Nanos;
use iceoryx2::node::Node;
use iceoryx2::prelude::{
    Config, FileName, NodeBuilder, Path, SemanticString, SignalHandlingMode, ipc,
};
use iceoryx2::service::port_factory::blackboard::PortFactory;

type Board = PortFactory<ipc::Service, u32>;

const PERIOD: Nanos = Nanos::from_millis(1);
const SPIN: Nanos = Nanos::from_micros(100);
const TICKS: u64 = 10_000;
const LOOP_CPU: usize = 1;

fn main() {
    // Neither senders nor helpers belong on the processor of the loop.
    realtime::keep_normal(Some(LOOP_CPU));
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["relay", pace, domain] => send_to_relay(pace, domain),
        ["blackboard", pace, name] => send_to_board(pace, name),
        _ => measure(),
    }
}

fn measure() {
    println!(
        "{:<38} {:>34} {:>24}",
        "", "age p50 / p99 / p99.9 / max us", "look p50 / p99 / max us"
    );
    relay(
        "relay, every 250 us",
        Nanos::from_micros(250),
        Nanos::ZERO,
        "steady",
    );
    relay(
        "relay, once ahead of every tick",
        PERIOD,
        server::COMMAND_POLL_LEAD,
        "steady",
    );
    relay(
        "relay, faulty client",
        PERIOD,
        server::COMMAND_POLL_LEAD,
        "faulty",
    );
    blackboard("blackboard", "steady");
    blackboard("blackboard, faulty client", "faulty");
    kill_a_writer();
}

/// Runs the loop with `look` at every tick, and prints what came of it.
fn run_loop(name: &str, first: Nanos, mut look: impl FnMut() -> ServoJp) {
    let granted = realtime::request(Wanted {
        priority: 80,
        cpu: Some(LOOP_CPU),
        lock_memory: true,
    });
    let [mut ages, mut looks] = [(); 2].map(|()| Histogram::<u64>::new(3).unwrap());
    let mut last = 0;
    let mut ticker = Ticker::new(first, PERIOD, SPIN);
    for _ in 0..TICKS {
        let _ = ticker.wait();
        let before = clock::now();
        let command = look();
        let after = clock::now();
        looks.record((after - before).0).unwrap();
        if command.sequence != last {
            last = command.sequence;
            if command.stamp_ns == 0 {
                continue;
            }
            ages.record((after - Nanos(command.stamp_ns)).0).unwrap();
        }
    }
    realtime::keep_normal(Some(LOOP_CPU));
    let (age, look) = (
        row(&ages, &[0.5, 0.99, 0.999, 1.0]),
        row(&looks, &[0.5, 0.99, 1.0]),
    );
    println!(
        "{name:<38} {age:>34} {look:>24}  ({} commands, FIFO {})",
        ages.len(),
        granted.priority
    );
}

fn row(histogram: &Histogram<u64>, quantiles: &[f64]) -> String {
    if histogram.is_empty() {
        return "-".to_owned();
    }
    let microseconds = |quantile: &f64| {
        format!(
            "{:.1}",
            histogram.value_at_quantile(*quantile) as f64 / 1000.0
        )
    };
    quantiles
        .iter()
        .map(microseconds)
        .collect::<Vec<_>>()
        .join(" / ")
}

fn relay(title: &str, period: Nanos, lead: Nanos, pace: &str) {
    let domain = Domain::new(&format!("servo-path-{:08x}", random_id() as u32)).unwrap();
    let first = clock::now() + Nanos::from_millis(500);
    let stop = Arc::new(AtomicBool::new(false));
    let (mut mailbox, mut outlet) = triple_buffer::triple_buffer(&ServoJp::default());
    let thread = thread::spawn({
        let (stop, domain) = (Arc::clone(&stop), domain.clone());
        move || {
            realtime::keep_normal(Some(LOOP_CPU));
            let mut server = Server::create(DomainLock::acquire(&domain).unwrap()).unwrap();
            let _ = realtime::request(Wanted {
                priority: 60,
                ..Wanted::default()
            });
            let mut ticker = Ticker::new(first - lead, period, Nanos::ZERO);
            while !stop.load(Ordering::Relaxed) {
                let tick = ticker.wait();
                if let Some(command) = server.poll_servo(0) {
                    mailbox.write(command);
                }
                server.maintain(tick.started);
            }
        }
    });
    let mut sender = start(["relay", pace, domain.name()]);
    run_loop(title, first, || *outlet.read());
    stop.store(true, Ordering::Relaxed);
    thread.join().unwrap();
    end(&mut sender);
}

fn send_to_relay(pace: &str, domain: &str) {
    let client = Client::connect(&Domain::new(domain).unwrap(), Nanos::from_millis(5000)).unwrap();
    let mut commander = client.commander();
    send(pace, |_| {
        let _ = commander.servo_jp(&[0.1, 0.2]);
    });
}

fn blackboard(title: &str, pace: &str) {
    let name = board_name();
    let node = board_node(&name);
    let board = create_board(&node);
    let entry = board
        .reader_builder()
        .create()
        .unwrap()
        .entry::<ServoJp>(&0)
        .unwrap();
    let mut sender = start(["blackboard", pace, &name]);
    run_loop(title, clock::now() + Nanos::from_millis(500), || {
        *entry.get()
    });
    end(&mut sender);
    drop((entry, board, node));
    remove_board(&name);
}

fn send_to_board(pace: &str, name: &str) {
    let node = board_node(name);
    let board: Board = node
        .service_builder(&"servo".try_into().unwrap())
        .blackboard_opener()
        .open()
        .unwrap();
    let writer = board.writer_builder().create().unwrap();
    match writer.entry::<ServoJp>(&0) {
        Ok(entry) => send(pace, |sequence| {
            // The faulty client does not even look at the clock.
            let stamp_ns = if pace == "steady" { clock::now().0 } else { 0 };
            entry.update_with_copy(ServoJp {
                sequence,
                stamp_ns,
                ..ServoJp::default()
            });
        }),
        Err(error) => println!("the next writer is refused: {error:?}"),
    }
}

/// What a killed writer leaves to the next one while the reader lives on.
fn kill_a_writer() {
    let name = board_name();
    let node = board_node(&name);
    let board = create_board(&node);
    let entry = board
        .reader_builder()
        .create()
        .unwrap()
        .entry::<ServoJp>(&0)
        .unwrap();
    for round in 1..=2 {
        let before = entry.get().sequence;
        let mut sender = start(["blackboard", "steady", &name]);
        clock::sleep(Nanos::from_millis(300));
        println!(
            "blackboard, writer {round}: its commands arrive: {}",
            entry.get().sequence != before
        );
        end(&mut sender);
        node.try_cleanup_dead_nodes();
    }
    drop((entry, board, node));
    remove_board(&name);
}

fn board_name() -> String {
    format!("i2ris-servo-path-{:08x}", random_id() as u32)
}

fn board_node(name: &str) -> Node<ipc::Service> {
    let mut config = Config::default();
    config
        .global
        .set_root_path(&Path::new(format!("/dev/shm/{name}").as_bytes()).unwrap());
    config.global.prefix = FileName::new(format!("{name}_").as_bytes()).unwrap();
    NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create()
        .unwrap()
}

fn create_board(node: &Node<ipc::Service>) -> Board {
    let creator = node
        .service_builder(&"servo".try_into().unwrap())
        .blackboard_creator::<u32>();
    creator
        .add::<ServoJp>(0, ServoJp::default())
        .create()
        .unwrap()
}

fn remove_board(name: &str) {
    let _ = std::fs::remove_dir_all(format!("/dev/shm/{name}"));
    for entry in std::fs::read_dir("/dev/shm").unwrap().flatten() {
        if entry.file_name().to_string_lossy().starts_with(name) {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// Calls `send` until the parent ends us: every 0.5 to 1.5 ms, or as fast as it goes.
fn send(pace: &str, mut send: impl FnMut(u64)) {
    for sequence in 1.. {
        if pace == "steady" {
            clock::sleep(Nanos::from_micros(500 + random_id() % 1000));
        }
        send(sequence);
    }
}

fn start(arguments: [&str; 3]) -> Child {
    Command::new(std::env::current_exe().unwrap())
        .args(arguments)
        .spawn()
        .unwrap()
}

fn end(child: &mut Child) {
    child.kill().unwrap();
    child.wait().unwrap();
}
