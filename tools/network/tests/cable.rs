//! H02 over a network: the commander is on another computer, and the link is cut or slow. The
//! controller knows nothing of networks; what stops the snake is the deadline of the last command,
//! as for any commander.

use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::thread;

use i2ris::clock;
use i2ris::ipc::client::{Client, ClientError, Watcher};
use i2ris::ipc::{Domain, OperatingState, Refusal};
use i2ris::units::Nanos;
use i2ris_network::BridgeClient;
use i2ris_network::keys::{Access, Lifetime, PersonalKey, make_key, revoke};
use i2ris_testing::{
    Background, Rig, SEND_PERIOD, TIMEOUT, assert_constant, assert_stopped_within, setpoints_after,
    settle, stream_counts, swing, wait_for, wait_until, wait_until_holding, wait_until_idle,
};

use crate::common::{free_address, serve};
use crate::relay::Relay;

/// Long compared with stalls of the machine, short compared with the timeout of the test.
const LOST_AFTER: Nanos = Nanos::from_millis(1500);

fn keys(rig: &Rig) -> PathBuf {
    rig.folder.path().join("keys")
}

/// A key that may command.
pub fn key(rig: &Rig) -> PersonalKey {
    let hosts = ["127.0.0.1", "10.77.0.1"].map(str::to_owned);
    let lifetime = Lifetime::days(1);
    let made = make_key(&keys(rig), "surgeon", Access::Command, &hosts, lifetime);
    PersonalKey::load(&made.unwrap()).unwrap()
}

pub fn start_server(rig: &Rig, listen: &str) -> Background {
    serve(&rig.domain(), listen, &keys(rig), LOST_AFTER)
}

pub fn start_client(domain: &Domain, server: &str, key: PersonalKey) -> Background {
    let (domain, server) = (domain.clone(), server.to_owned());
    let client = BridgeClient { domain, server, key, lost_after: LOST_AFTER };
    Background::start(move |stop| client.run(|| stop.load(Ordering::Relaxed), drop).unwrap())
}

/// Streams until it fails; the error.
pub fn stream_until_it_fails(client: &Client) -> ClientError {
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
pub fn deadline(rig: &Rig) -> Nanos {
    Nanos::from_millis(rig.config.command.deadline_ms + 250)
}

/// Waits until the robot holds because its commander has fallen silent.
pub fn wait_until_stopped(client: &mut Client) -> u64 {
    let held = wait_until_holding(client);
    assert!(held.state == OperatingState::Enabled.number() && held.stale_stops >= 1);
    held.accepted
}

#[test]
fn h02_the_snake_holds_when_the_network_to_the_commander_is_cut() {
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    let (key, server) = (key(&rig), free_address());
    let _server = start_server(&rig, &server);
    let network = Relay::to(&server);
    let far = rig.another_domain("far");
    let _client = start_client(&far, &network.address, key);
    let mut remote = Client::connect(&far, TIMEOUT).unwrap();
    wait_until("the number of motors arrives over the network", || {
        remote.version().unwrap().shape[0] == 2
    });
    let watcher = Watcher::new(&far);
    let (mut health, mut events) = (watcher.health(), watcher.events());
    wait_until("the log arrives, too", || events.read().unwrap());
    wait_until("health arrives, too", || health.newest().unwrap());
    let remote = thread::spawn(move || {
        let error = stream_until_it_fails(&remote);
        (remote, error)
    });
    let moving = wait_for(&mut client, |state| state.accepted > 50);
    assert_ne!(moving.lease_client_id, 0);
    network.conditions.cut.store(true, Ordering::Relaxed);
    let cut = clock::now();
    let accepted = wait_until_stopped(&mut client);
    // Programs on the far side get an error.
    let (remote, error) = remote.join().unwrap();
    assert!(error.is_absent(), "{error}");
    wait_for(&mut client, |state| state.lease_client_id == 0);
    assert_stopped_within(&rig, cut..cut + deadline(&rig));
    // When the network is back nothing moves by itself, and new commands are followed.
    drop(remote);
    network.conditions.cut.store(false, Ordering::Relaxed);
    let again = Client::connect(&far, TIMEOUT).unwrap();
    clock::sleep(Nanos::from_millis(300));
    assert_stopped_within(&rig, cut..cut + deadline(&rig));
    let here = rig.positions();
    stream_counts(&again, 0.5, |_| here);
    assert!(settle(&mut client, |state| state.accepted > accepted).lease_client_id != 0);
}

#[test]
fn h02_commands_that_the_network_delays_are_refused_as_stale() {
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    let (key, server) = (key(&rig), free_address());
    let _server = start_server(&rig, &server);
    let network = Relay::to(&server);
    let far = rig.another_domain("far");
    let _client = start_client(&far, &network.address, key);
    let remote = Client::connect(&far, TIMEOUT).unwrap();
    // Three times the deadline, but below the silence after which the link counts as lost.
    let deadline_ms = rig.config.command.deadline_ms;
    network.conditions.delay_ms[0].store(3 * deadline_ms, Ordering::Relaxed);
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
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    let (key, server) = (key(&rig), free_address());
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
