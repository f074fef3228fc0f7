//! Who may watch and who may command: certificates and access control, with Zenoh clients that
//! keep to no rule of ours.
use std::path::Path;
use std::time::Duration;

use i2ris::clock;
use i2ris::ipc::payload::{ServoJp, StateCommandReply};
use i2ris::ipc::{Refusal, RequestService, StateCommand, Stream};
use i2ris::units::Nanos;
use i2ris_gateway::Reason;
use i2ris_network::keys::{Access, AccessList, Lifetime, make_key, revoke};
use i2ris_network::message::{QuestionHeader, refusal_number};
use i2ris_network::names::What;
use i2ris_network::request::Outcome;
use i2ris_testing::{Controller, wait_until};
use zenoh::sample::Sample;
use zerocopy::{FromBytes, IntoBytes};

use crate::common::{
    self, LOST_AFTER, RawClient, RunningServer, free_address, hosts, make, state_command,
};

/// Longer than anything takes that comes to something here.
const LONG: Nanos = Nanos::from_millis(700);

/// Far beyond what counts as late, us.
const LATE_US: u32 = 1_000_000;

fn command(client_id: u64, sequence: u64, pitch: f64) -> ServoJp {
    ServoJp {
        sequence,
        stamp_ns: clock::now().0,
        client_id,
        position: [pitch, 0.0, 0.0],
        count: 2,
        ..ServoJp::default()
    }
}

#[test]
fn a_key_that_may_command_does_so_under_its_own_name_only() {
    let (controller, folder) = (Controller::enabled(), tempfile::tempdir().unwrap());
    let alice = make(folder.path(), "alice", Access::Command);
    let bob = make(folder.path(), "bob", Access::Command);
    let watcher = make(folder.path(), "eve", Access::Watch);
    let server = RunningServer::start(&controller, folder.path());
    let alice = RawClient::join(&server.address, &alice);
    assert_eq!(alice.reply.commands, 1);
    alice.put(What::Command(Stream::ServoJp), command(1, 1, 0.02).as_bytes());
    controller.wait("a command of alice", |robot| robot.poses.len() == 1);
    // Bob in alice's session: his certificate has another name.
    let bob = RawClient::join(&server.address, &bob);
    let forged = command(1, 2, 0.03);
    bob.put_as(&alice.source(What::Command(Stream::ServoJp)), forged.as_bytes());
    bob.put_as("i2ris/from/**", forged.as_bytes());
    bob.put_as("i2ris/from/*/*/servo_jp", forged.as_bytes());
    // Eve may only watch, and sends commands all the same, in her own session.
    let eve = RawClient::join(&server.address, &watcher);
    assert_eq!(eve.reply.commands, 0);
    eve.put(What::Command(Stream::ServoJp), command(2, 1, 0.04).as_bytes());
    eve.put(What::Command(Stream::ServoActuators), &[0; 48]);
    let answer = eve.ask(state_command(1, StateCommand::Disable)).unwrap();
    assert_eq!(answer.0.outcome, Outcome::Watching as u32);
    // What is sent to others is for them alone.
    let overheard = eve.listen("i2ris/from/**");
    alice.put(What::Command(Stream::ServoJp), command(1, 3, 0.02).as_bytes());
    controller.wait("another command of alice", |robot| robot.poses.len() == 2);
    clock::sleep(LONG);
    assert!(overheard.try_recv().is_err());
    let robot = controller.robot();
    assert_eq!(robot.poses.len(), 2, "only alice's");
    assert!(robot.asked.is_empty() && robot.places.is_empty() && robot.refused == 0);
}

#[test]
fn an_id_of_another_key_is_another_client_and_cannot_take_its_lease() {
    let (controller, folder) = (Controller::enabled(), tempfile::tempdir().unwrap());
    let alice = make(folder.path(), "alice", Access::Command);
    let bob = make(folder.path(), "bob", Access::Command);
    let server = RunningServer::start(&controller, folder.path());
    let (alice, bob) =
        (RawClient::join(&server.address, &alice), RawClient::join(&server.address, &bob));
    alice.put(What::Command(Stream::ServoJp), command(1, 1, 0.02).as_bytes());
    controller.wait("a command of alice", |robot| robot.poses.len() == 1);
    // The id of alice, which everybody can read who may watch, and the last sequence number.
    bob.put(What::Command(Stream::ServoJp), command(1, u64::MAX, 0.03).as_bytes());
    controller.wait("a refusal of bob", |robot| robot.refused == 1);
    alice.put(What::Command(Stream::ServoJp), command(1, 2, 0.02).as_bytes());
    controller.wait("another command of alice", |robot| robot.poses.len() == 2);
    assert_eq!(controller.robot().refused, 1, "she is not locked out");
}

#[test]
fn a_request_is_carried_out_once_and_a_late_one_never() {
    let (controller, folder) = (Controller::start(), tempfile::tempdir().unwrap());
    let alice = make(folder.path(), "alice", Access::Command);
    let server = RunningServer::start(&controller, folder.path());
    let alice = RawClient::join(&server.address, &alice);
    for _ in 0..3 {
        let (header, payload) = alice.ask(state_command(7, StateCommand::Home)).unwrap();
        assert_eq!(header.outcome, Outcome::Answered as u32);
        let reply = StateCommandReply::read_from_bytes(&payload).unwrap();
        assert_eq!(reply.refusal, Refusal::None.number());
    }
    assert_eq!(controller.robot().asked, [StateCommand::Home]);
    let late = |number, command: StateCommand| {
        let (mut header, request) = state_command(number, command);
        header.asked_ns -= 2_000_000_000;
        alice.ask((header, request)).unwrap().0.outcome
    };
    assert_eq!(late(8, StateCommand::Enable), Outcome::Late as u32);
    assert_eq!(late(9, StateCommand::Disable), Outcome::Answered as u32);
    let asked = [StateCommand::Home, StateCommand::Disable];
    assert_eq!(controller.robot().asked, asked);
}

#[test]
fn a_session_that_was_silent_never_lives_again() {
    let (controller, folder) = (Controller::enabled(), tempfile::tempdir().unwrap());
    let key = make(folder.path(), "alice", Access::Command);
    let server = RunningServer::start(&controller, folder.path());
    let alice = RawClient::join(&server.address, &key);
    alice.put(What::Command(Stream::ServoJp), command(1, 1, 0.02).as_bytes());
    controller.wait("a command", |robot| robot.poses.len() == 1);
    // Longer than the silence after which the server gives a client up.
    clock::sleep(LOST_AFTER + LONG);
    alice.put(What::Command(Stream::ServoJp), command(1, 2, 0.02).as_bytes());
    assert!(alice.ask(state_command(1, StateCommand::Home)).is_none());
    let reply = alice.alive().unwrap();
    assert_eq!(reply.refusal, refusal_number(&Reason::Ended));
    alice.put(What::Command(Stream::ServoJp), command(1, 3, 0.02).as_bytes());
    clock::sleep(LONG);
    assert_eq!(controller.robot().poses.len(), 1);
    assert!(controller.robot().asked.is_empty());
    // Another number is another session.
    let again = RawClient::join(&server.address, &key);
    again.put(What::Command(Stream::ServoJp), command(1, 4, 0.02).as_bytes());
    controller.wait("a command again", |robot| robot.poses.len() == 2);
}

/// No session, or none that is admitted.
fn is_kept_out(address: &str, key: &Path) -> bool {
    match RawClient::connect(address, key) {
        Ok(client) => client.alive().is_none_or(|reply| reply.refusal != 0),
        Err(_) => true,
    }
}

#[test]
fn without_a_valid_certificate_of_this_authority_nobody_gets_in() {
    let (controller, folder) = (Controller::enabled(), tempfile::tempdir().unwrap());
    let (keys, others) = (folder.path().join("keys"), folder.path().join("others"));
    let valid = make(&keys, "alice", Access::Command);
    let life = |seconds| {
        let made = make_key(&keys, "bob", Access::Command, &[], Lifetime::seconds(seconds));
        made.unwrap()
    };
    let expired = life(-60);
    let foreign = make(&others, "alice", Access::Command);
    let server = RunningServer::start(&controller, &keys);
    assert!(!is_kept_out(&server.address, &valid));
    assert!(is_kept_out(&server.address, &expired), "expired");
    assert!(is_kept_out(&server.address, &foreign), "of another authority");
    // The right authority to trust in, and a certificate of another one.
    std::fs::copy(valid.join("ca.pem"), foreign.join("ca.pem")).unwrap();
    assert!(is_kept_out(&server.address, &foreign), "of another authority");
    // On the same computer, too: no certificate, and another transport.
    assert!(RawClient::without_certificate(&server.address, &keys).is_none());
    // A key that was taken out of the list, and not only marked.
    let list = AccessList::file(&keys);
    let text = std::fs::read_to_string(&list).unwrap();
    let gone = make(&keys, "carol", Access::Command);
    std::fs::write(&list, text).unwrap();
    clock::sleep(Nanos::from_millis(1500));
    assert!(is_kept_out(&server.address, &gone), "not in the list");
    assert!(controller.robot().poses.is_empty());
}

#[test]
fn a_certificate_that_ends_ends_the_connection() {
    let (controller, folder) = (Controller::enabled(), tempfile::tempdir().unwrap());
    let lifetime = Lifetime::seconds(6);
    let made = make_key(folder.path(), "alice", Access::Command, &hosts(), lifetime);
    let key = made.unwrap();
    let server = RunningServer::start(&controller, folder.path());
    let alice = RawClient::join(&server.address, &key);
    alice.put(What::Command(Stream::ServoJp), command(1, 1, 0.02).as_bytes());
    controller.wait("a command", |robot| robot.poses.len() == 1);
    wait_until("it ends", || alice.alive().is_none());
    alice.put(What::Command(Stream::ServoJp), command(1, 2, 0.02).as_bytes());
    assert!(is_kept_out(&server.address, &key));
    assert_eq!(controller.robot().poses.len(), 1);
}

#[test]
fn a_revoked_key_gets_the_reason_and_others_come_back() {
    let (controller, folder) = (Controller::enabled(), tempfile::tempdir().unwrap());
    let alice = make(folder.path(), "alice", Access::Command);
    let bob = make(folder.path(), "bob", Access::Command);
    let server = RunningServer::start(&controller, folder.path());
    let former = RawClient::join(&server.address, &alice);
    revoke(folder.path(), "alice").unwrap();
    let refusal = |client: &RawClient| client.alive().map(|reply| reply.refusal);
    let is_refused = |client: &RawClient| refusal(client) == Some(refusal_number(&Reason::Revoked));
    // Zenoh connects the former session again by itself.
    wait_until("a refusal", || is_refused(&former));
    former.put(What::Command(Stream::ServoJp), command(1, 1, 0.02).as_bytes());
    let again = RawClient::connect(&server.address, &alice).unwrap();
    assert!(is_refused(&again));
    // Others hear that their sessions have ended, too, and begin another one.
    let bob = wait_until("bob is back", || {
        let client = RawClient::connect(&server.address, &bob).ok()?;
        (refusal(&client) == Some(0)).then_some(client)
    });
    bob.put(What::Command(Stream::ServoJp), command(2, 1, 0.02).as_bytes());
    controller.wait("a command of bob", |robot| robot.poses.len() == 1);
}

#[test]
fn a_personal_key_cannot_pass_for_the_server() {
    let folder = tempfile::tempdir().unwrap();
    let alice = make(folder.path(), "alice", Access::Command);
    let bob = make(folder.path(), "bob", Access::Watch);
    let address = free_address();
    let _thief = common::serve_with(&address, &alice);
    assert!(RawClient::connect(&address, &bob).is_err());
}

#[test]
fn messages_that_are_none_and_a_flood_change_nothing() {
    let (controller, folder) = (Controller::enabled(), tempfile::tempdir().unwrap());
    let alice = make(folder.path(), "alice", Access::Command);
    let server = RunningServer::start(&controller, folder.path());
    let alice = RawClient::join(&server.address, &alice);
    for length in [0, 1, size_of::<ServoJp>() - 1, size_of::<ServoJp>() + 1, 5000] {
        alice.put(What::Command(Stream::ServoJp), &vec![1; length]);
        alice.put(What::Request(RequestService::Move), &vec![1; length]);
    }
    let empty = QuestionHeader { number: 1, asked_ns: clock::now().0 };
    let (answer, _) = alice.ask_bytes(RequestService::Move, empty.as_bytes()).unwrap();
    assert_eq!(answer.outcome, Outcome::Silent as u32, "no payload");
    for number in 0..20_000 {
        alice.put(What::Command(Stream::ServoJp), &[number as u8; 7]);
    }
    // A sign of life in the flood can be lost, as everything of the client that floods.
    wait_until("the session lives", || alice.alive());
    assert!(controller.robot().poses.is_empty());
    alice.put(What::Command(Stream::ServoJp), command(1, 1, 0.02).as_bytes());
    controller.wait("a command", |robot| robot.poses.len() == 1);
}

#[test]
fn a_key_that_is_slow_or_says_so_slows_nobody_else() {
    let (controller, folder) = (Controller::enabled(), tempfile::tempdir().unwrap());
    let [alice, bob] = ["alice", "bob"].map(|name| make(folder.path(), name, Access::Command));
    let server = RunningServer::start(&controller, folder.path());
    let [alice, bob] = [alice, bob].map(|key| RawClient::join(&server.address, &key));
    for _ in 0..20 {
        assert_eq!(bob.alive_late(LATE_US).unwrap().refusal, 0);
    }
    let [quick, slow] = [&alice, &bob].map(|client| client.follow(Stream::Measured));
    for _ in 0..60 {
        quick.recv_timeout(Duration::from_secs(20)).unwrap();
    }
    let slow = slow.try_iter().count();
    assert!(slow < 20, "bob got {slow} while alice got 60");
    // Each gets what is meant for it, and nothing of anybody else.
    let overheard = bob.listen("i2ris/to/**");
    clock::sleep(LONG);
    let of_alice = |sample: &Sample| sample.key_expr().contains("alice");
    assert!(quick.try_iter().count() > 0 && !overheard.try_iter().any(|sample| of_alice(&sample)));
}

#[test]
fn a_key_has_one_session_and_a_place_is_kept_for_keys_that_command() {
    let (controller, folder) = (Controller::enabled(), tempfile::tempdir().unwrap());
    let make = |name: &str, access| make(folder.path(), name, access);
    let watchers = ["a", "b", "c", "d"].map(|name| make(name, Access::Watch));
    let alice = make("alice", Access::Command);
    let server = RunningServer::start(&controller, folder.path());
    let connect = |key| RawClient::connect(&server.address, key).unwrap();
    let clients = watchers.each_ref().map(|key| connect(key));
    let [first, .., last] = &clients;
    let refusal = |client: &RawClient| client.alive().unwrap().refusal;
    let again = connect(&watchers[0]);
    assert_eq!([refusal(first), refusal(&again)], [0, refusal_number(&Reason::KeyInUse)]);
    assert_eq!([refusal(&clients[1]), refusal(&clients[2])], [0; 2]);
    assert_eq!(refusal(last), refusal_number(&Reason::Full));
    assert_eq!(refusal(&connect(&alice)), 0);
}

#[test]
fn the_newest_of_every_stream_is_sent_on_request_and_then_as_it_comes() {
    let (controller, folder) = (Controller::enabled(), tempfile::tempdir().unwrap());
    let eve = make(folder.path(), "eve", Access::Watch);
    let server = RunningServer::start(&controller, folder.path());
    let eve = RawClient::join(&server.address, &eve);
    let known = wait_until("seven streams", || Some(eve.states()).filter(|it| it.len() >= 7));
    for stream in ["operating_state", "measured_js", "actuators/measured_js", "version"] {
        assert!(known.contains(&format!("i2ris/state/{stream}")), "{known:?}");
    }
    let states = eve.follow(Stream::Measured);
    assert!(states.recv_timeout(Duration::from_secs(20)).is_ok());
}
