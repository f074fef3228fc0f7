//! Every service carries its messages from end to end, and survives the comings and goings on both
//! sides.
#![allow(clippy::unwrap_used)]

mod ipc_common;

use std::sync::mpsc;

use i2ris::clock;
use i2ris::ipc::client::{Client, ClientError, Latest, Watcher};
use i2ris::ipc::payload::{
    ActuatorState, JointState, OperatingStateMsg, PeriodStatistics, ServoActuator, ServoJp,
    StateCommandReply, StateCommandRequest,
};
use i2ris::ipc::{Message, OperatingState, Refusal, StateCommand};
use i2ris::units::Nanos;
use ipc_common::{Controller, PATIENCE, eventually, serve, unique};

#[test]
fn a_servo_command_arrives_as_it_was_sent() {
    let domain = unique();
    let mut server = serve(&domain);
    let client = Client::connect(&domain, Nanos::ZERO).unwrap();
    let mut commander = client.commander().with_deadline(Nanos::from_millis(80));
    let before = clock::now();
    commander.servo_jp(&[0.1, -0.2]).unwrap();
    commander.servo_actuators(&[-500, 500]).unwrap();
    let joint = server.poll_servo(0).unwrap();
    let stamp_ns = joint.stamp_ns;
    assert!(stamp_ns >= before.0 && stamp_ns <= clock::now().0);
    assert_eq!(
        joint,
        ServoJp {
            sequence: 1,
            stamp_ns,
            client_id: client.id(),
            deadline_ns: 80_000_000,
            position: [0.1, -0.2, 0.0],
            count: 2,
            flags: 0
        }
    );
    let actuator = server.poll_actuator(0).unwrap();
    let stamp_ns = actuator.stamp_ns;
    assert_eq!(
        actuator,
        ServoActuator {
            sequence: 2,
            stamp_ns,
            client_id: client.id(),
            deadline_ns: 80_000_000,
            position_counts: [-500, 500],
            count: 2,
            flags: 0
        }
    );
    assert_eq!(
        (server.poll_servo(0), server.poll_actuator(0)),
        (None, None)
    );
}

#[test]
fn only_the_newest_command_counts() {
    let domain = unique();
    let mut server = serve(&domain);
    let client = Client::connect(&domain, Nanos::ZERO).unwrap();
    let mut commander = client.commander();
    for step in 1..=20 {
        commander.servo_jp(&[f64::from(step), 0.0]).unwrap();
    }
    assert_eq!(server.poll_servo(0).unwrap().position[0], 20.0);
    assert_eq!(server.poll_servo(0), None);
}

#[test]
fn the_holder_of_the_lease_is_not_crowded_out() {
    let domain = unique();
    let mut server = serve(&domain);
    let [holder, intruder] = [(); 2].map(|()| Client::connect(&domain, Nanos::ZERO).unwrap());
    let (mut first, mut second) = (holder.commander(), intruder.commander());
    first.servo_jp(&[0.1, 0.0]).unwrap();
    second.servo_jp(&[0.2, 0.0]).unwrap();
    assert_eq!(
        server.poll_servo(holder.id()).unwrap().client_id,
        holder.id()
    );
    first.servo_jp(&[0.1, 0.0]).unwrap();
    second.servo_jp(&[0.2, 0.0]).unwrap();
    assert_eq!(server.poll_servo(0).unwrap().client_id, intruder.id());
    second.servo_jp(&[0.2, 0.0]).unwrap();
    assert_eq!(
        server.poll_servo(holder.id()).unwrap().client_id,
        intruder.id()
    );
}

#[test]
fn a_state_command_is_answered_or_refused_with_the_reason() {
    let domain = unique();
    let (sender, seen) = mpsc::channel::<StateCommandRequest>();
    let _controller = Controller::start(&domain, move |server, now| {
        let mut waiting = Vec::new();
        server.poll_state_commands(now, |token, request| waiting.push((token, request)));
        for (token, request) in waiting {
            let refusal = if request.command == StateCommand::Enable.number() {
                Refusal::NotHomed
            } else {
                Refusal::None
            };
            server.reply(
                token,
                StateCommandReply {
                    refusal: refusal.number(),
                    state: 0,
                },
            );
            sender.send(request).unwrap();
        }
    });
    let mut client = Client::connect(&domain, Nanos::ZERO).unwrap();
    let error = client.state_command(StateCommand::Enable).unwrap_err();
    assert!(
        matches!(
            error,
            ClientError::Refused {
                refusal: Refusal::NotHomed,
                ..
            }
        ),
        "{error}"
    );
    assert_eq!(
        client.state_command(StateCommand::Home).unwrap(),
        OperatingState::Disabled
    );
    let requests: Vec<_> = seen
        .try_iter()
        .map(|request| (request.client_id, request.command))
        .collect();
    let (enable, home) = (StateCommand::Enable.number(), StateCommand::Home.number());
    assert_eq!(requests, [(client.id(), enable), (client.id(), home)]);
}

#[test]
fn a_controller_that_does_not_answer_is_reported() {
    let domain = unique();
    let _controller = Controller::start(&domain, |_, _| {});
    let mut client = Client::connect(&domain, Nanos::ZERO).unwrap();
    let error = client.state_command(StateCommand::Pause).unwrap_err();
    assert!(matches!(error, ClientError::NoReply { .. }), "{error}");
}

#[test]
fn the_version_names_this_start_and_its_model() {
    let domain = unique();
    let mut described = false;
    let _controller = Controller::start(&domain, move |server, _| {
        if !described {
            described = true;
            let mut names = [[0; 16]; 3];
            names[0][..5].copy_from_slice(b"pitch");
            server.describe([2, 2], [7; 32], names);
        }
    });
    let mut client = Client::connect(&domain, Nanos::ZERO).unwrap();
    let version = client.version().unwrap();
    assert_eq!(
        (version.pid, version.interface, version.shape),
        (std::process::id(), 1, [2, 2])
    );
    assert_eq!(
        (version.model_id, &version.output_names[0][..6]),
        ([7; 32], b"pitch\0".as_slice())
    );
    assert_ne!(version.boot_id, 0);
}

/// Sends one message of each kind, once, and keeps the streams alive.
fn tell_once(told: &mut bool, server: &mut i2ris::ipc::Server) {
    if std::mem::replace(told, true) {
        return;
    }
    server.publish_measured(JointState {
        stamp_ns: 1,
        ..JointState::default()
    });
    server.publish_setpoint(JointState {
        stamp_ns: 2,
        ..JointState::default()
    });
    server.publish_goal(JointState {
        stamp_ns: 3,
        ..JointState::default()
    });
    server.publish_actuators(ActuatorState {
        stamp_ns: 4,
        ..ActuatorState::default()
    });
    server.publish_operating_state(OperatingStateMsg {
        stamp_ns: 5,
        ..OperatingStateMsg::default()
    });
    server.publish_period_statistics(PeriodStatistics {
        stamp_ns: 6,
        ..PeriodStatistics::default()
    });
}

fn last<T: Message>(subscription: i2ris::ipc::client::Subscription<T>) -> T {
    let mut latest = Latest::new(subscription);
    eventually("a message", || latest.refresh().unwrap().copied())
}

#[test]
fn a_late_joiner_gets_the_last_message_of_every_stream() {
    let domain = unique();
    let mut told = false;
    let _controller = Controller::start(&domain, move |server, _| tell_once(&mut told, server));
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
fn a_watcher_that_looks_away_for_a_while_misses_nothing() {
    let domain = unique();
    let mut server = serve(&domain);
    let mut subscription = Watcher::new(&domain).measured_js();
    assert_eq!(subscription.read().unwrap(), None);
    for stamp_ns in 1..=100 {
        server.publish_measured(JointState {
            stamp_ns,
            ..JointState::default()
        });
    }
    let mut stamps = Vec::new();
    assert_eq!(
        subscription
            .drain(|message| stamps.push(message.stamp_ns))
            .unwrap(),
        100
    );
    assert_eq!(stamps, (1..=100).collect::<Vec<u64>>());
    assert_eq!(subscription.missed(), 0);
    for stamp_ns in 101..=400 {
        server.publish_measured(JointState {
            stamp_ns,
            ..JointState::default()
        });
    }
    assert_eq!(subscription.newest().unwrap().unwrap().stamp_ns, 400);
    assert_eq!(subscription.missed(), 300 - 128);
}

#[test]
fn a_sensor_is_heard_by_the_controller_and_by_watchers() {
    let domain = unique();
    let mut server = serve(&domain);
    let mut subscription = Watcher::new(&domain).external();
    assert_eq!(subscription.read().unwrap(), None);
    let mut camera = i2ris::ipc::client::ExternalPublisher::new(&domain);
    camera.publish(Nanos(5), &[0.1, 0.2], &[]).unwrap();
    camera
        .publish_with_quality(Nanos(6), &[0.1, 0.2], &[0.01, 0.02], 0.7)
        .unwrap();
    camera.publish_nothing(Nanos(7)).unwrap();
    let mut seen = Vec::new();
    subscription
        .drain(|message| {
            seen.push((
                message.stamp_ns,
                message.flags,
                message.count,
                message.quality,
            ))
        })
        .unwrap();
    assert_eq!(seen, [(5, 1, 2, 0.0), (6, 1, 2, 0.7), (7, 0, 0, 0.0)]);
    assert_eq!(server.poll_external().unwrap().stamp_ns, 7);
}

#[test]
fn commands_can_be_watched_but_an_old_one_is_not_repeated() {
    let domain = unique();
    let mut server = serve(&domain);
    let client = Client::connect(&domain, Nanos::ZERO).unwrap();
    let (mut commander, mut early) = (client.commander(), client.watcher().servo_jp());
    assert_eq!(early.read().unwrap(), None);
    for step in 1..=5 {
        commander.servo_jp(&[f64::from(step)]).unwrap();
    }
    let mut watched = Vec::new();
    early
        .drain(|command| watched.push(command.position[0]))
        .unwrap();
    assert_eq!(watched, [1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_eq!(server.poll_servo(0).unwrap().sequence, 5);

    let mut late = client.watcher().servo_jp();
    assert_eq!(late.read().unwrap(), None);
    commander.servo_jp(&[6.0]).unwrap();
    let mut watched = Vec::new();
    late.drain(|command| watched.push(command.position[0]))
        .unwrap();
    assert_eq!(watched, [6.0]);
}

#[test]
fn without_a_controller_a_client_is_told_at_once() {
    let domain = unique();
    let start = clock::now();
    let error = Client::connect(&domain, Nanos::from_millis(30)).unwrap_err();
    assert!(
        error.is_absent() && error.to_string().contains(domain.name()),
        "{error}"
    );
    assert!(clock::now().since(start) >= Nanos::from_millis(30));
    assert!(matches!(
        Watcher::new(&domain).measured_js().read(),
        Err(ClientError::NoController { .. })
    ));
    assert!(!domain.directory().exists(), "a client creates nothing");
}

#[test]
fn waiting_ends_with_the_condition_or_with_the_time() {
    let domain = unique();
    let mut stamp = 0;
    let _controller = Controller::start(&domain, move |server, _| {
        stamp += 1;
        let now = clock::now().0;
        server.publish_operating_state(OperatingStateMsg {
            accepted: stamp,
            stamp_ns: now,
            ..OperatingStateMsg::default()
        });
    });
    let mut client = Client::connect(&domain, Nanos::ZERO).unwrap();
    assert!(
        client
            .wait_for(PATIENCE, |state| state.accepted > 20)
            .unwrap()
            .accepted
            > 20
    );
    let error = client
        .wait_for(Nanos::from_millis(20), |state| state.accepted == 0)
        .unwrap_err();
    assert!(matches!(error, ClientError::Timeout { .. }), "{error}");
}

#[test]
fn a_live_client_finds_the_next_start() {
    let domain = unique();
    let mut server = serve(&domain);
    let mut client = Client::connect(&domain, Nanos::ZERO).unwrap();
    let mut commander = client.commander();
    let mut state = Latest::new(client.watcher().operating_state());
    for round in 1..=3_u64 {
        let arrived = eventually("a command arrives", || {
            let _ = commander.servo_jp(&[0.1]);
            server.poll_servo(0)
        });
        assert_eq!(arrived.client_id, client.id());
        server.publish_operating_state(OperatingStateMsg {
            accepted: round,
            ..OperatingStateMsg::default()
        });
        let seen = eventually("a state arrives", || {
            server.maintain(clock::now());
            state.refresh().unwrap().copied()
        });
        assert_eq!((seen.accepted, seen.boot_id), (round, server.boot_id()));
        drop(server);
        eventually("the client notices", || {
            commander
                .servo_jp(&[0.1])
                .is_err_and(|e| e.is_absent())
                .then_some(())
        });
        assert!(state.refresh().is_err_and(|error| error.is_absent()) && state.value().is_none());
        server = serve(&domain);
    }
    assert_eq!(server.failures().0, 0);
    eventually("the old client asks the new controller", || {
        client.operating_state().ok()
    });
}
