//! H02 over a network: the commander is on another computer, and the link is cut or slow. The
//! controller knows nothing of networks; what stops the snake is the deadline of the last command,
//! as for any commander.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::print_stderr,
    clippy::print_stdout,
    reason = "tests, and one that skips says so"
)]

#[path = "../../../tests/rig/mod.rs"]
mod rig;

use std::collections::VecDeque;
use std::fs;
use std::io::{BufRead, BufReader};
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};

use i2ris::clock;
use i2ris::ipc::client::{Client, ClientError, Watcher};
use i2ris::ipc::{Domain, OperatingState, Refusal};
use i2ris::units::Nanos;
use i2ris_network::keys::{Access, Lifetime, PersonalKey, make_key, revoke};
use i2ris_network::{BridgeClient, BridgeServer};

use rig::motion::{
    SEND_PERIOD, assert_constant, assert_stopped_within, setpoints_after, stream_counts, swing,
};
use rig::{Rig, TIMEOUT, eventually, settle, wait_for, wait_until_holding, wait_until_idle};

/// Long compared with stalls of the machine, short compared with the timeout of the test.
const LOST_AFTER: Nanos = Nanos::from_millis(1500);
const ANY_PORT: &str = "127.0.0.1:0";

/// A thread that is stopped and joined on drop.
struct Running {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Running {
    fn start(work: impl FnOnce(Arc<AtomicBool>) + Send + 'static) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        let thread = Some(thread::spawn(move || work(flag)));
        Self { stop, thread }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// The folder of keys of a rig.
fn keys(rig: &Rig) -> PathBuf {
    rig.folder.path().join("keys")
}

/// A key that may command.
fn key(rig: &Rig) -> PersonalKey {
    let hosts = ["127.0.0.1", "10.77.0.1"].map(str::to_owned);
    let lifetime = Lifetime::days(1);
    let made = make_key(&keys(rig), "surgeon", Access::Command, &hosts, lifetime);
    PersonalKey::load(&made.unwrap()).unwrap()
}

/// A UDP port that nobody uses.
fn free_port() -> u16 {
    UdpSocket::bind(ANY_PORT)
        .unwrap()
        .local_addr()
        .unwrap()
        .port()
}

fn start_server(rig: &Rig, listen: &str) -> Running {
    let server = BridgeServer {
        domain: rig.domain(),
        listen: listen.to_owned(),
        keys: keys(rig),
        commands: true,
        period: Nanos::from_millis(5),
        lost_after: LOST_AFTER,
    };
    let server = server.open().unwrap();
    Running::start(move |stop| server.run(|| stop.load(Ordering::Relaxed), drop))
}

fn start_client(domain: &Domain, server: &str, key: PersonalKey) -> Running {
    let client = BridgeClient {
        domain: domain.clone(),
        server: server.to_owned(),
        key,
        lost_after: LOST_AFTER,
    };
    Running::start(move |stop| client.run(|| stop.load(Ordering::Relaxed), drop).unwrap())
}

/// A network between client and server that can be cut and delayed. Only the direction to the
/// server is delayed.
struct Network {
    cut: Arc<AtomicBool>,
    delay_ms: Arc<AtomicU64>,
    address: String,
    _running: Running,
}

impl Network {
    fn to(server: &str) -> Self {
        let near = UdpSocket::bind(ANY_PORT).unwrap();
        let far = UdpSocket::bind(ANY_PORT).unwrap();
        far.connect(server).unwrap();
        near.set_nonblocking(true).unwrap();
        far.set_nonblocking(true).unwrap();
        let address = near.local_addr().unwrap().to_string();
        let (cut, delay_ms) = <(Arc<AtomicBool>, Arc<AtomicU64>)>::default();
        let switches = (Arc::clone(&cut), Arc::clone(&delay_ms));
        let running = Running::start(move |stop| {
            carry(&near, &far, &switches.0, &switches.1, &stop);
        });
        Self {
            cut,
            delay_ms,
            address,
            _running: running,
        }
    }
}

/// Carries packets until `stop`.
fn carry(
    near: &UdpSocket,
    far: &UdpSocket,
    cut: &AtomicBool,
    delay_ms: &AtomicU64,
    stop: &AtomicBool,
) {
    let (mut client, mut buffer, mut delayed) = (None, [0; 65_536], VecDeque::new());
    while !stop.load(Ordering::Relaxed) {
        while let Ok((length, from)) = near.recv_from(&mut buffer) {
            client = Some(from);
            let due = clock::now() + Nanos::from_millis(delay_ms.load(Ordering::Relaxed));
            delayed.push_back((due, buffer[..length].to_vec()));
        }
        let is_due = |(due, _): &(Nanos, Vec<u8>)| *due <= clock::now();
        while let Some((_, packet)) = delayed.front().filter(|delayed| is_due(delayed)) {
            if !cut.load(Ordering::Relaxed) {
                let _ = far.send(packet);
            }
            delayed.pop_front();
        }
        while let Ok(length) = far.recv(&mut buffer) {
            if let (false, Some(client)) = (cut.load(Ordering::Relaxed), client) {
                let _ = near.send_to(&buffer[..length], client);
            }
        }
        clock::sleep(Nanos::from_micros(500));
    }
}

/// Streams until it fails; the error.
fn stream_until_it_fails(client: &Client) -> ClientError {
    let (mut commander, start) = (client.commander(), clock::now());
    loop {
        let now = clock::now();
        match commander.servo_actuators(&swing((now - start).as_seconds())) {
            Ok(_) => assert!(now.since(start) < TIMEOUT, "it never fails"),
            Err(error) => return error,
        }
        clock::sleep_until(now + SEND_PERIOD);
    }
}

/// The time from a cut until the setpoints must be constant.
fn deadline(rig: &Rig) -> Nanos {
    Nanos::from_millis(rig.config.command.deadline_ms + 250)
}

/// Waits until the robot holds because its commander has fallen silent.
fn wait_until_stopped(client: &mut Client) -> u64 {
    let held = wait_until_holding(client);
    assert!(held.state == OperatingState::Enabled.number() && held.stale_stops >= 1);
    held.accepted
}

#[test]
fn h02_the_snake_holds_when_the_network_to_the_commander_is_cut() {
    let mut rig = Rig::new();
    let mut client = rig.enabled();
    let (key, server) = (key(&rig), format!("127.0.0.1:{}", free_port()));
    let _server = start_server(&rig, &server);
    let network = Network::to(&server);
    let far = rig.another_domain("far");
    let _client = start_client(&far, &network.address, key);
    let mut remote = Client::connect(&far, TIMEOUT).unwrap();
    eventually("the number of motors arrives over the network", || {
        (remote.version().unwrap().shape[0] == 2).then_some(())
    });
    let watcher = Watcher::new(&far);
    let (mut health, mut events) = (watcher.health(), watcher.events());
    eventually("the log arrives, too", || events.read().unwrap());
    eventually("health arrives, too", || health.newest().unwrap());
    let remote = thread::spawn(move || {
        let error = stream_until_it_fails(&remote);
        (remote, error)
    });
    let moving = wait_for(&mut client, |state| state.accepted > 50);
    assert_ne!(moving.lease_client_id, 0);
    network.cut.store(true, Ordering::Relaxed);
    let cut = clock::now();
    let accepted = wait_until_stopped(&mut client);
    // Programs on the far side get an error.
    let (remote, error) = remote.join().unwrap();
    assert!(error.is_absent(), "{error}");
    wait_for(&mut client, |state| state.lease_client_id == 0);
    assert_stopped_within(&rig, cut..cut + deadline(&rig));
    // When the network is back nothing moves by itself, and new commands are followed.
    drop(remote);
    network.cut.store(false, Ordering::Relaxed);
    let again = Client::connect(&far, TIMEOUT).unwrap();
    clock::sleep(Nanos::from_millis(300));
    assert_stopped_within(&rig, cut..cut + deadline(&rig));
    let here = rig.positions();
    stream_counts(&again, 0.5, |_| here);
    assert!(settle(&mut client, |state| state.accepted > accepted).lease_client_id != 0);
}

#[test]
fn h02_commands_that_the_network_delays_are_refused_as_stale() {
    let mut rig = Rig::new();
    let mut client = rig.enabled();
    let (key, server) = (key(&rig), format!("127.0.0.1:{}", free_port()));
    let _server = start_server(&rig, &server);
    let network = Network::to(&server);
    let far = rig.another_domain("far");
    let _client = start_client(&far, &network.address, key);
    let remote = Client::connect(&far, TIMEOUT).unwrap();
    // Three times the deadline, but below the silence after which the link counts as lost.
    let deadline_ms = rig.config.command.deadline_ms;
    network.delay_ms.store(3 * deadline_ms, Ordering::Relaxed);
    clock::sleep(Nanos::from_millis(4 * deadline_ms));
    let (before, began) = (wait_until_idle(&mut client), clock::now());
    stream_counts(&remote, 2.0, swing);
    let refused = before.refused + 10;
    let after = wait_for(&mut client, |state| state.refused > refused);
    assert_eq!(after.accepted, before.accepted);
    assert_eq!(after.last_refusal, Refusal::Stale.number());
    for axis in 0..2 {
        assert_constant(&setpoints_after(&rig, axis, began), axis);
    }
}

#[test]
fn h02_a_key_that_is_revoked_while_it_commands_ends_in_a_hold() {
    let mut rig = Rig::new();
    let mut client = rig.enabled();
    let (key, server) = (key(&rig), format!("127.0.0.1:{}", free_port()));
    let _server = start_server(&rig, &server);
    let far = rig.another_domain("far");
    let id = key.id().to_owned();
    let _client = start_client(&far, &server, key);
    let remote = Client::connect(&far, TIMEOUT).unwrap();
    let remote = thread::spawn(move || stream_until_it_fails(&remote));
    wait_for(&mut client, |state| state.accepted > 50);
    revoke(&keys(&rig), &id).unwrap();
    let accepted = wait_until_stopped(&mut client);
    let error = remote.join().unwrap();
    assert!(error.is_absent(), "{error}");
    wait_for(&mut client, |state| state.lease_client_id == 0);
    clock::sleep(Nanos::from_millis(1500));
    assert!(
        Client::connect(&far, Nanos::ZERO).is_err(),
        "the key is of no use any more"
    );
    assert_eq!(wait_until_holding(&mut client).accepted, accepted);
}

/// A command that runs a test of this binary in new namespaces.
fn command_in_a_namespace(options: &str, test: &str) -> Command {
    let mut command = Command::new("unshare");
    command.arg(options).arg(std::env::current_exe().unwrap());
    command
        .args(["--ignored", "--exact", "--nocapture", test])
        .stdin(Stdio::null());
    command
}

fn ip(arguments: &str) -> bool {
    let status = Command::new("ip").args(arguments.split(' ')).status();
    status.is_ok_and(|status| status.success())
}

/// Two network namespaces with only a virtual cable between them: two computers for the network.
#[test]
fn h02_the_snake_holds_when_the_cable_between_two_computers_is_pulled() {
    let mut allowed = Command::new("unshare");
    let allowed = allowed
        .args(["-Urn", "true"])
        .stderr(Stdio::null())
        .status();
    if !allowed.is_ok_and(|status| status.success()) {
        return eprintln!(
            "skipped: this machine allows no network namespaces (`unshare -Urn true` fails)"
        );
    }
    let mut command = command_in_a_namespace("-Urn", "computer_of_the_robot");
    let output = command.env("RIG_NAMESPACE", "1").output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}");
    match text.lines().find(|line| line.contains("skipped:")) {
        Some(reason) => eprintln!("{reason}"),
        None => assert!(text.contains("the cable was pulled"), "{text}"),
    }
}

/// Kills a child on drop.
struct KilledOnDrop(Child);

impl Drop for KilledOnDrop {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn namespace(process: &str) -> Option<PathBuf> {
    fs::read_link(format!("/proc/{process}/ns/net")).ok()
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
    let mut surgeon = command_in_a_namespace("-n", "computer_of_the_surgeon");
    let key = key(&rig);
    let folder = key.secret().parent().unwrap().to_owned();
    surgeon
        .env("RIG_FAR_DOMAIN", far.name())
        .env("RIG_KEY", folder);
    surgeon.stdout(Stdio::piped());
    let mut surgeon = KilledOnDrop(surgeon.spawn().unwrap());
    let id = surgeon.0.id().to_string();
    let own = namespace("self");
    eventually("another namespace", || {
        namespace(&id).filter(|there| Some(there) != own.as_ref())
    });
    if !ip(&format!(
        "link add robot type veth peer name surgeon netns {id}"
    )) {
        return eprintln!("skipped: this kernel has no virtual cables (veth)");
    }
    assert!(ip("addr add 10.77.0.1/24 dev robot") && ip("link set robot up"));
    let mut client = rig.enabled();
    let _server = start_server(&rig, "10.77.0.1:7447");
    wait_for(&mut client, |state| state.accepted > 50);
    assert!(ip("link set robot down"));
    let cut = clock::now();
    wait_until_stopped(&mut client);
    wait_for(&mut client, |state| state.lease_client_id == 0);
    clock::sleep(Nanos::from_millis(500));
    assert_stopped_within(&rig, cut..cut + deadline(&rig));
    // The cable is back: a new session, and nothing goes on by itself.
    assert!(ip("link set robot up"));
    let back = surgeon.0.stdout.take().map(BufReader::new).unwrap();
    let mut lines = back.lines().map_while(Result::ok);
    assert!(lines.any(|line| line.contains("the robot is there again")));
    clock::sleep(Nanos::from_millis(500));
    assert_stopped_within(&rig, cut..cut + deadline(&rig));
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
    eventually("the cable", || ip("link show surgeon").then_some(()));
    assert!(ip("addr add 10.77.0.2/24 dev surgeon") && ip("link set surgeon up"));
    let key = PersonalKey::load(Path::new(&std::env::var("RIG_KEY").unwrap())).unwrap();
    let _client = start_client(&far, "10.77.0.1:7447", key);
    let client = Client::connect(&far, TIMEOUT).unwrap();
    let error = stream_until_it_fails(&client);
    assert!(error.is_absent(), "{error}");
    drop(client);
    let mut again = Client::connect(&far, TIMEOUT).unwrap();
    wait_until_holding(&mut again);
    println!("the robot is there again");
    // Until it is killed.
    clock::sleep(TIMEOUT);
}
