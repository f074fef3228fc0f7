//! H02 over a network: the commander is on another computer, and the link is cut or slow. The
//! controller knows nothing of networks; what stops the snake is the deadline of the last command,
//! as for any commander.
#![allow(clippy::print_stderr, reason = "a test that skips says so")]

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use i2ris::clock;
use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{Domain, OperatingState, Refusal};
use i2ris::units::Nanos;
use i2ris_network::{Console, Gate, Key};

use crate::live::stream_counts;
use crate::rig::{PATIENCE, Rig, settle};

const SECRET: &[u8] = b"a key of this test alone";
/// Long against stalls of the machine, short against the patience of the test.
const LOST_AFTER: Nanos = Nanos::from_millis(1500);

/// A thread that is told to end, and waited for, when dropped.
struct Running {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Running {
    fn start(work: impl FnOnce(Arc<AtomicBool>) + Send + 'static) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        Self {
            stop,
            thread: Some(thread::spawn(move || work(flag))),
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn start_gate(rig: &Rig, listen: SocketAddr) -> (SocketAddr, Running) {
    let gate = Gate {
        domain: rig.domain(),
        listen,
        key: Key::of(SECRET),
        commands: true,
        period: Nanos::from_millis(5),
        lost_after: LOST_AFTER,
    };
    let gate = gate.open().unwrap();
    let address = gate.address();
    (
        address,
        Running::start(move |stop| gate.run(|| stop.load(Ordering::Relaxed), drop)),
    )
}

fn start_console(domain: &Domain, gate: SocketAddr) -> Running {
    let console = Console {
        domain: domain.clone(),
        gate,
        key: Key::of(SECRET),
        lost_after: LOST_AFTER,
    };
    Running::start(move |stop| console.run(|| stop.load(Ordering::Relaxed), drop).unwrap())
}

/// A network between a console and a gate, which can be cut and slowed down. Only the way to the
/// gate is slow.
struct Network {
    cut: Arc<AtomicBool>,
    delay_ms: Arc<AtomicU64>,
    address: SocketAddr,
    _running: Running,
}

impl Network {
    fn to(gate: SocketAddr) -> Self {
        let near = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        let far = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        far.connect(gate).unwrap();
        near.set_nonblocking(true).unwrap();
        far.set_nonblocking(true).unwrap();
        let address = near.local_addr().unwrap();
        let (cut, delay_ms) = (
            Arc::new(AtomicBool::new(false)),
            Arc::new(AtomicU64::new(0)),
        );
        let switches = (Arc::clone(&cut), Arc::clone(&delay_ms));
        let running = Running::start(move |stop| carry(&near, &far, &switches, &stop));
        Self {
            cut,
            delay_ms,
            address,
            _running: running,
        }
    }
}

fn carry(
    near: &UdpSocket,
    far: &UdpSocket,
    (cut, delay_ms): &(Arc<AtomicBool>, Arc<AtomicU64>),
    stop: &AtomicBool,
) {
    let (mut console, mut buffer, mut waiting) =
        (None, [0; 2048], std::collections::VecDeque::new());
    while !stop.load(Ordering::Relaxed) {
        while let Ok((length, from)) = near.recv_from(&mut buffer) {
            console = Some(from);
            let due = clock::now() + Nanos::from_millis(delay_ms.load(Ordering::Relaxed));
            waiting.push_back((due, buffer[..length].to_vec()));
        }
        while waiting.front().is_some_and(|(due, _)| *due <= clock::now()) {
            let (_, packet) = waiting.pop_front().unwrap();
            if !cut.load(Ordering::Relaxed) {
                let _ = far.send(&packet);
            }
        }
        while let Ok(length) = far.recv(&mut buffer) {
            if let (false, Some(console)) = (cut.load(Ordering::Relaxed), console) {
                let _ = near.send_to(&buffer[..length], console);
            }
        }
        clock::sleep(Nanos::from_micros(500));
    }
}

fn swing(t: f64) -> [i32; 2] {
    [
        (600.0 * (t * 2.0).sin()) as i32,
        (600.0 * (t * 1.7).sin()) as i32,
    ]
}

/// Streams until nobody takes it any more; the reason.
fn stream_until_it_fails(client: &Client) -> ClientError {
    let (mut commander, start) = (client.commander(), clock::now());
    loop {
        let now = clock::now();
        match commander.servo_actuators(&swing((now - start).as_seconds())) {
            Ok(_) => assert!(now.since(start) < PATIENCE, "it goes on for ever"),
            Err(error) => return error,
        }
        clock::sleep_until(now + Nanos::from_millis(5));
    }
}

fn is_holding(state: &OperatingStateMsg) -> bool {
    state.flags & OperatingStateMsg::HOLDING != 0
}

/// The set-points that an axis received after an instant: some at least, however slow the machine
/// is.
fn setpoints_after(rig: &Rig, axis: usize, instant: Nanos) -> Vec<i32> {
    let end = clock::now() + PATIENCE;
    loop {
        let setpoints = rig.setpoints(axis);
        let after: Vec<i32> = setpoints
            .iter()
            .filter(|(stamp, _)| *stamp > instant)
            .map(|(_, counts)| *counts)
            .collect();
        if after.len() > 20 {
            return after;
        }
        assert!(
            clock::now() < end,
            "set-points are still sent to axis {axis}"
        );
        thread::sleep(Duration::from_millis(20));
    }
}

/// The set-points moved before the cut, and stand from the deadline on: in the log of the emulated
/// drives.
fn moved_before_and_held_after(rig: &Rig, cut: Nanos) {
    let quiet = cut + Nanos::from_millis(rig.config.command.deadline_ms + 250);
    for axis in 0..2 {
        let setpoints = rig.setpoints(axis);
        let before = setpoints
            .iter()
            .filter(|(stamp, _)| *stamp < cut)
            .map(|(_, counts)| counts);
        assert!(
            before.clone().max().unwrap() - before.min().unwrap() > 20,
            "axis {axis} moved before"
        );
        let after = setpoints_after(rig, axis, quiet);
        assert!(
            after.iter().all(|counts| counts == &after[0]),
            "axis {axis} holds: {after:?}"
        );
    }
}

#[test]
fn h02_the_snake_holds_when_the_network_to_the_commander_is_cut() {
    let mut rig = Rig::new();
    let mut client = rig.enabled();
    let (gate, _gate) = start_gate(&rig, (Ipv4Addr::LOCALHOST, 0).into());
    let network = Network::to(gate);
    let far = rig.another_domain("far");
    let _console = start_console(&far, network.address);
    let mut remote = Client::connect(&far, PATIENCE).unwrap();
    let end = clock::now() + PATIENCE;
    while remote.version().unwrap().shape[0] != 2 {
        assert!(
            clock::now() < end,
            "how many motors there are is told over the network"
        );
    }
    let remote = thread::spawn(move || {
        let failed = stream_until_it_fails(&remote);
        (remote, failed)
    });
    let moving = client
        .wait_for(PATIENCE, |state| state.accepted > 50)
        .unwrap();
    assert_ne!(moving.lease_client_id, 0);
    network.cut.store(true, Ordering::Relaxed);
    let cut = clock::now();
    let held = client.wait_for(PATIENCE, is_holding).unwrap();
    assert!(held.state == OperatingState::Enabled.number() && held.stale_stops >= 1);
    // Programs at the console see the controller go, and end.
    let (remote, failed) = remote.join().unwrap();
    assert!(failed.is_absent(), "{failed}");
    client
        .wait_for(PATIENCE, |state| state.lease_client_id == 0)
        .unwrap();
    moved_before_and_held_after(&rig, cut);
    // When the link is back nothing moves by itself, and whoever begins anew is followed.
    drop(remote);
    network.cut.store(false, Ordering::Relaxed);
    let again = Client::connect(&far, PATIENCE).unwrap();
    clock::sleep(Nanos::from_millis(300));
    moved_before_and_held_after(&rig, cut);
    let here = rig.emulator.snapshot().axes.map(|axis| axis.drive.position);
    stream_counts(&again, 0.5, |_| here);
    assert!(settle(&mut client, |state| state.accepted > held.accepted).lease_client_id != 0);
}

#[test]
fn h02_commands_that_the_network_holds_up_arrive_old_and_are_refused() {
    let mut rig = Rig::new();
    let mut client = rig.enabled();
    let (gate, _gate) = start_gate(&rig, (Ipv4Addr::LOCALHOST, 0).into());
    let network = Network::to(gate);
    let far = rig.another_domain("far");
    let _console = start_console(&far, network.address);
    let remote = Client::connect(&far, PATIENCE).unwrap();
    // Three times the deadline, but below the silence after which the link counts as lost.
    network
        .delay_ms
        .store(3 * rig.config.command.deadline_ms, Ordering::Relaxed);
    clock::sleep(Nanos::from_millis(4 * rig.config.command.deadline_ms));
    let (before, began) = (settle(&mut client, |_| true), clock::now());
    stream_counts(&remote, 2.0, swing);
    let after = client
        .wait_for(PATIENCE, |state| state.refused > before.refused + 10)
        .unwrap();
    assert_eq!(
        (after.accepted, after.last_refusal),
        (before.accepted, Refusal::Stale.number())
    );
    for axis in 0..2 {
        let since = setpoints_after(&rig, axis, began);
        assert!(
            since.iter().all(|counts| counts == &since[0]),
            "axis {axis} moved: {since:?}"
        );
    }
}

/// `None`, with the reason on the screen: this machine does not allow it.
fn command_in_a_namespace(test: &str) -> Option<Command> {
    let allowed = Command::new("unshare")
        .args(["-Urn", "true"])
        .stderr(Stdio::null())
        .status();
    if !allowed.is_ok_and(|status| status.success()) {
        eprintln!("skipped: this machine allows no network namespaces (`unshare -Urn true` fails)");
        return None;
    }
    let mut command = Command::new("unshare");
    command.arg("-Urn").arg(std::env::current_exe().unwrap());
    command
        .args(["--ignored", "--exact", "--nocapture", test])
        .stdin(Stdio::null());
    Some(command)
}

fn ip(arguments: &str) -> bool {
    Command::new("ip")
        .args(arguments.split(' '))
        .status()
        .is_ok_and(|status| status.success())
}

/// Two network namespaces with nothing but a virtual cable between them: for the network they are
/// two computers.
#[test]
fn h02_the_snake_holds_when_the_cable_between_two_computers_is_pulled() {
    let Some(mut command) = command_in_a_namespace("h02_network::computer_of_the_robot") else {
        return;
    };
    let output = command.env("RIG_NAMESPACE", "1").output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}");
    if let Some(reason) = text.lines().find(|line| line.contains("skipped:")) {
        eprintln!("{reason}");
    } else {
        assert!(text.contains("the cable was pulled"), "{text}");
    }
}

/// Ends a child of the test, also when the test fails.
struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn namespace_of(process: &str) -> Option<std::path::PathBuf> {
    std::fs::read_link(format!("/proc/{process}/ns/net")).ok()
}

/// Waits for something that takes other processes a moment.
fn eventually(what: &str, done: impl Fn() -> bool) {
    let end = clock::now() + PATIENCE;
    while !done() {
        assert!(clock::now() < end, "waited in vain: {what}");
        thread::sleep(Duration::from_millis(5));
    }
}

/// Not a test of its own: one end of the cable.
#[test]
#[ignore = "run in a namespace by another test"]
fn computer_of_the_robot() {
    if std::env::var_os("RIG_NAMESPACE").is_none() {
        return;
    }
    let mut rig = Rig::new();
    let far = rig.another_domain("far");
    let console = Command::new("unshare")
        .arg("-n")
        .arg(std::env::current_exe().unwrap())
        .args([
            "--ignored",
            "--exact",
            "--nocapture",
            "h02_network::computer_of_the_surgeon",
        ])
        .env("RIG_FAR_DOMAIN", far.name())
        .stdin(Stdio::null())
        .spawn()
        .unwrap();
    let console = Ended(console);
    let id = console.0.id().to_string();
    eventually("another namespace", || {
        namespace_of(&id).is_some_and(|there| Some(there) != namespace_of("self"))
    });
    if !ip(&format!(
        "link add robot type veth peer name surgeon netns {id}"
    )) {
        eprintln!("skipped: this kernel has no virtual cables (veth)");
        return;
    }
    assert!(ip("addr add 10.77.0.1/24 dev robot") && ip("link set robot up"));
    let mut client = rig.enabled();
    let (_, _gate) = start_gate(&rig, "10.77.0.1:7410".parse().unwrap());
    client
        .wait_for(PATIENCE, |state| state.accepted > 50)
        .unwrap();
    assert!(ip("link set robot down"));
    let cut = clock::now();
    let held = client.wait_for(PATIENCE, is_holding).unwrap();
    assert!(held.state == OperatingState::Enabled.number() && held.stale_stops >= 1);
    client
        .wait_for(PATIENCE, |state| state.lease_client_id == 0)
        .unwrap();
    clock::sleep(Nanos::from_millis(500));
    moved_before_and_held_after(&rig, cut);
    eprintln!("the cable was pulled and the snake held");
}

/// Not a test of its own: the other end, with the commander.
#[test]
#[ignore = "run in a namespace by another test"]
fn computer_of_the_surgeon() {
    let Ok(domain) = std::env::var("RIG_FAR_DOMAIN") else {
        return;
    };
    let far = Domain::new(&domain).unwrap();
    eventually("the cable", || {
        std::path::Path::new("/sys/class/net").exists() && ip("link show surgeon")
    });
    assert!(ip("addr add 10.77.0.2/24 dev surgeon") && ip("link set surgeon up"));
    let _console = start_console(&far, "10.77.0.1:7410".parse().unwrap());
    let client = Client::connect(&far, PATIENCE).unwrap();
    let failed = stream_until_it_fails(&client);
    assert!(failed.is_absent(), "{failed}");
}
