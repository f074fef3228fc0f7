//! Every service transports its messages, and survives restarts on both sides.

use std::sync::mpsc;

use i2ris::ipc::server::ReceivedCommand;
use i2ris::ipc::{Message, Server};

use super::*;

/// The next command while the lease is free.
fn poll(server: &mut Server) -> Option<ReceivedCommand> {
    server.poll_command(0, |_| true)
}

/// The next command, which is in angles.
fn poll_joint(server: &mut Server) -> Option<ServoJp> {
    match poll(server)? {
        ReceivedCommand::Joint(command) => Some(command),
        ReceivedCommand::Actuator(command) => panic!("{command:?}"),
    }
}

/// A message with a stamp and zeros.
macro_rules! stamped {
    ($kind:ident, $stamp:expr) => {
        $kind { stamp_ns: $stamp, ..$kind::default() }
    };
}

#[test]
fn a_servo_command_arrives_as_it_was_sent() {
    let domain = unique_domain();
    let mut server = serve(&domain);
    let client = connect(&domain);
    let mut commander = client.commander().with_deadline(Nanos::from_millis(80));
    let before = clock::now();
    commander.servo_jp(&[0.1, -0.2]).unwrap();
    let joint = poll_joint(&mut server).unwrap();
    assert!(joint.stamp_ns >= before.0 && joint.stamp_ns <= clock::now().0);
    let expected = ServoJp {
        sequence: 1,
        stamp_ns: joint.stamp_ns,
        client_id: client.id(),
        deadline_ns: 80_000_000,
        position: [0.1, -0.2, 0.0],
        count: 2,
        flags: 0,
    };
    assert_eq!(joint, expected);
    commander.servo_actuators(&[-500, 500]).unwrap();
    let Some(ReceivedCommand::Actuator(actuator)) = poll(&mut server) else {
        panic!("a command in counts");
    };
    let expected = ServoActuator {
        sequence: 2,
        stamp_ns: actuator.stamp_ns,
        client_id: client.id(),
        deadline_ns: 80_000_000,
        position_counts: [-500, 500],
        count: 2,
        flags: 0,
    };
    assert_eq!(actuator, expected);
    assert!(poll(&mut server).is_none());
}

#[test]
fn only_the_newest_command_counts() {
    let domain = unique_domain();
    let mut server = serve(&domain);
    let client = connect(&domain);
    let mut commander = client.commander();
    for step in 1..=20 {
        commander.servo_actuators(&[step, 0]).unwrap();
        commander.servo_jp(&[f64::from(step), 0.0]).unwrap();
    }
    assert_eq!(poll_joint(&mut server).unwrap().position[0], 20.0);
    assert_eq!(poll(&mut server), None);
}

#[test]
fn state_command_is_confirmed_or_refused_with_reason() {
    let domain = unique_domain();
    let (sender, received) = mpsc::channel::<StateCommandRequest>();
    let _server = serve_on_thread(&domain, move |server, now| {
        for (token, request) in server.poll_requests(now) {
            let Request::StateCommand(request) = request else { panic!("{request:?}") };
            let enable = request.command == StateCommand::Enable.number();
            let refusal = if enable { Refusal::NotHomed } else { Refusal::None };
            let refusal = refusal.number();
            server.reply(token, StateCommandReply { refusal, ..StateCommandReply::default() });
            sender.send(request).unwrap();
        }
    });
    let mut client = connect(&domain);
    let error = client.state_command(StateCommand::Enable).unwrap_err();
    assert!(matches!(error, ClientError::Refused { refusal, .. } if refusal == Refusal::NotHomed));
    assert_eq!(client.state_command(StateCommand::Home).unwrap(), OperatingState::Disabled);
    let requests = received.try_iter().map(|request| (request.client_id, request.command));
    let expected = [StateCommand::Enable, StateCommand::Home];
    let expected = expected.map(|command| (client.id(), command.number()));
    assert_eq!(requests.collect::<Vec<_>>(), expected);
}

#[test]
fn a_controller_that_does_not_answer_is_reported() {
    let domain = unique_domain();
    let _server = serve_on_thread(&domain, |_, _| {});
    let mut client = connect(&domain);
    let error = client.state_command(StateCommand::Pause).unwrap_err();
    assert!(matches!(error, ClientError::NoReply { .. }), "{error}");
}

#[test]
fn the_version_identifies_this_start_and_its_model() {
    let domain = unique_domain();
    let _server = serve_on_thread(&domain, |server, _| {
        let mut names = [[0; 16]; 3];
        names[0][..5].copy_from_slice(b"pitch");
        server.describe([2, 2], [7; 32], names);
    });
    let version = connect(&domain).version().unwrap();
    let (pid, interface) = (std::process::id(), INTERFACE_VERSION);
    assert_eq!((version.pid, version.interface), (pid, interface));
    assert_eq!((version.shape, version.model_id), ([2, 2], [7; 32]));
    assert_eq!(&version.output_names[0][..6], b"pitch\0");
    assert_ne!(version.boot_id, 0);
}

/// Publishes one message of each kind.
fn publish_all(server: &mut Server) {
    server.publish(StreamMessage::Measured(stamped!(JointState, 1)));
    server.publish(StreamMessage::Setpoint(stamped!(JointState, 2)));
    server.publish(StreamMessage::Goal(stamped!(JointState, 3)));
    server.publish(StreamMessage::Actuators(stamped!(ActuatorState, 4)));
    server.publish(StreamMessage::State(stamped!(OperatingStateMsg, 5)));
    server.publish(StreamMessage::Statistics(stamped!(PeriodStatistics, 6)));
}

fn last<T: Message>(subscription: Subscription<T>) -> T {
    let mut latest = Latest::new(subscription);
    wait_until("a message", || latest.refresh().unwrap().copied())
}

#[test]
fn a_late_subscriber_receives_the_last_message_of_every_stream() {
    let domain = unique_domain();
    let mut published = false;
    let _server = serve_on_thread(&domain, move |server, _| {
        if !std::mem::replace(&mut published, true) {
            publish_all(server);
        }
    });
    clock::sleep(Nanos::from_millis(20));
    let watcher = Watcher::new(&domain);
    let measured = last(watcher.measured_js());
    assert_eq!((measured.stamp_ns, measured.sequence), (1, 1));
    assert_ne!(measured.boot_id, 0);
    assert_eq!(last(watcher.setpoint_js()).stamp_ns, 2);
    assert_eq!(last(watcher.goal_js()).stamp_ns, 3);
    assert_eq!(last(watcher.actuators()).stamp_ns, 4);
    assert_eq!(last(watcher.operating_state()).stamp_ns, 5);
    assert_eq!(last(watcher.period_statistics()).stamp_ns, 6);
}

#[test]
fn a_subscription_buffers_messages_and_counts_lost_ones() {
    let domain = unique_domain();
    let mut server = serve(&domain);
    let mut subscription = Watcher::new(&domain).measured_js();
    assert_eq!(subscription.read().unwrap(), None);
    for stamp in 1..=100 {
        server.publish(StreamMessage::Measured(stamped!(JointState, stamp)));
    }
    let mut stamps = Vec::new();
    let count = subscription.drain(|message| stamps.push(message.stamp_ns)).unwrap();
    assert_eq!((count, subscription.missed()), (100, 0));
    assert_eq!(stamps, (1..=100).collect::<Vec<u64>>());
    for stamp in 101..=400 {
        server.publish(StreamMessage::Measured(stamped!(JointState, stamp)));
    }
    assert_eq!(subscription.newest().unwrap().unwrap().stamp_ns, 400);
    assert_eq!(subscription.missed(), 300 - 128);
}

#[test]
fn measurements_of_a_sensor_reach_the_controller_and_watchers() {
    let domain = unique_domain();
    let mut server = serve(&domain);
    let mut subscription = Watcher::new(&domain).external();
    assert_eq!(subscription.read().unwrap(), None);
    let mut camera = ExternalPublisher::new(&domain);
    let (position, deviation) = ([0.1, 0.2], [0.01, 0.02]);
    camera.publish(Nanos(5), &position, &[]).unwrap();
    camera.publish_with_quality(Nanos(6), &position, &deviation, 0.7).unwrap();
    camera.publish_nothing(Nanos(7)).unwrap();
    let mut seen = Vec::new();
    let count = subscription.drain(|m| seen.push((m.stamp_ns, m.flags, m.count, m.quality)));
    assert_eq!(count.unwrap(), 3);
    assert_eq!(seen, [(5, 1, 2, 0.0), (6, 1, 2, 0.7), (7, 0, 0, 0.0)]);
    assert_eq!(server.poll_external().unwrap().stamp_ns, 7);
}

#[test]
fn watcher_receives_only_commands_after_subscribing() {
    let domain = unique_domain();
    let mut server = serve(&domain);
    let client = connect(&domain);
    let mut commander = client.commander();
    let mut received_after = |steps: &[f64]| {
        let mut subscription = client.watcher().servo_jp();
        assert_eq!(subscription.read().unwrap(), None);
        for step in steps {
            commander.servo_jp(&[*step]).unwrap();
        }
        let mut received = Vec::new();
        subscription.drain(|command| received.push(command.position[0])).unwrap();
        received
    };
    assert_eq!(received_after(&[1.0, 2.0, 3.0, 4.0, 5.0]), [1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_eq!(poll_joint(&mut server).unwrap().sequence, 5);
    assert_eq!(received_after(&[6.0]), [6.0]);
}

#[test]
fn client_without_controller_fails_and_creates_no_files() {
    let domain = unique_domain();
    let start = clock::now();
    let error = Client::connect(&domain, Nanos::from_millis(30)).unwrap_err();
    assert!(error.is_absent() && error.to_string().contains(domain.name()), "{error}");
    assert!(clock::now().duration_since(start) >= Nanos::from_millis(30));
    assert!(Watcher::new(&domain).measured_js().read().unwrap_err().is_absent());
    assert!(!domain.directory().exists());
}

#[test]
fn waiting_ends_with_the_condition_or_the_timeout() {
    let domain = unique_domain();
    let mut passes = 0;
    let _server = serve_on_thread(&domain, move |server, now| {
        passes += 1;
        let mut message = stamped!(OperatingStateMsg, now.0);
        message.accepted = passes;
        server.publish(StreamMessage::State(message));
    });
    let mut client = connect(&domain);
    let state = client.wait_for(TIMEOUT, |state| state.accepted > 20).unwrap();
    assert!(state.accepted > 20);
    let error = client.wait_for(Nanos::from_millis(20), |state| state.accepted == 0).unwrap_err();
    assert!(matches!(error, ClientError::Timeout(_)), "{error}");
}

#[test]
fn client_reconnects_to_restarted_controller() {
    let domain = unique_domain();
    let mut server = serve(&domain);
    let mut client = connect(&domain);
    let mut commander = client.commander();
    let mut state = Latest::new(client.watcher().operating_state());
    for round in 1..=3_u64 {
        let command = wait_until("a command arrives", || {
            let _ = commander.servo_jp(&[0.1]);
            poll_joint(&mut server)
        });
        assert_eq!(command.client_id, client.id());
        server.publish(StreamMessage::State(stamped!(OperatingStateMsg, round)));
        let seen = wait_until("a state arrives", || {
            server.maintain(clock::now());
            state.refresh().unwrap().copied()
        });
        assert_eq!((seen.stamp_ns, seen.boot_id), (round, server.boot_id()));
        drop(server);
        assert!(client.watcher().measured_js().read().is_err_and(|error| error.is_absent()));
        assert!(commander.servo_jp(&[0.1]).is_err_and(|error| error.is_absent()));
        assert!(state.refresh().is_err_and(|error| error.is_absent()) && state.value().is_none());
        server = serve(&domain);
    }
    assert_eq!(server.failures().0, 0);
    wait_until("the client connects again", || client.operating_state().ok());
}
