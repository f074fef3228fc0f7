//! H02 over a network: the commander is on another computer, and the link is cut or slow. The
//! controller knows nothing of networks; what stops the snake is the deadline of the last command,
//! as for any commander.
#![allow(clippy::unwrap_used, clippy::expect_used)]

mod ends;
#[path = "../../../tests/rig/mod.rs"]
mod rig;

use std::collections::VecDeque;
use std::net::UdpSocket;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;

use i2ris::clock;
use i2ris::ipc::Refusal;
use i2ris::ipc::client::{Client, Watcher};
use i2ris::units::Nanos;
use i2ris_network::keys::revoke;

use ends::{
    Running, deadline, key, keys, start_client, start_server, stream_until_it_fails,
    wait_until_stopped,
};
use rig::motion::{assert_constant, assert_stopped_within, setpoints_after, stream_counts, swing};
use rig::{Rig, TIMEOUT, eventually, settle, wait_for, wait_until_holding, wait_until_idle};

const ANY_PORT: &str = "127.0.0.1:0";

/// A UDP port that nobody uses.
fn free_port() -> u16 {
    UdpSocket::bind(ANY_PORT).unwrap().local_addr().unwrap().port()
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
        Self { cut, delay_ms, address, _running: running }
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
    assert!(Client::connect(&far, Nanos::ZERO).is_err(), "the key is of no use any more");
    assert_eq!(wait_until_holding(&mut client).accepted, accepted);
}
