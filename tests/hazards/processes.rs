//! H02, H03, H15, H18: clients and controllers that die, hang, restart, or run twice.

use i2ris::clock;
use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{Domain, OperatingState, StateCommand};
use i2ris::units::Nanos;
use i2ris_simulation::drive::State;
use i2ris_simulation::log::EventKind;
use i2ris_testing::{
    Killed, Rig, TIMEOUT, assert_stopped_within, enable, has, settle, settle_in, stream_counts,
    swing, wait_for, wait_for_end, wait_until, wait_until_holding, wait_until_idle,
    while_streaming,
};
use nix::sys::signal::Signal;

/// Not a test of its own: the commander that other tests kill.
#[test]
#[ignore = "a role: run by another test"]
fn commander_process() {
    let Ok(domain) = std::env::var("RIG_DOMAIN") else { return };
    let client = Client::connect(&Domain::new(&domain).unwrap(), TIMEOUT).unwrap();
    stream_counts(&client, 60.0, swing);
}

#[test]
fn h02_the_snake_holds_when_its_commander_is_killed() {
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    let role = "hazards::processes::commander_process";
    let commander = Killed::role(role, &[("RIG_DOMAIN", &rig.config.domain)]);
    wait_for(&mut client, |state| state.accepted > 50);
    commander.signal(Signal::SIGKILL);
    let killed = clock::now();
    drop(commander);
    let held = wait_until_holding(&mut client);
    assert_eq!(held.state, OperatingState::Enabled.number());
    assert!(held.stale_stops >= 1);
    let deadline = Nanos::from_millis(rig.config.command.deadline_ms + 250);
    assert_stopped_within(&rig, killed..killed + deadline);
    // The lease becomes free, so the next commander is not locked out.
    wait_for(&mut client, |state| state.lease_client_id == 0);
    let here = rig.positions();
    stream_counts(&client, 0.5, |_| here);
    assert!(settle(&mut client, |state| state.lease_client_id != 0).accepted > held.accepted);
}

/// The drives hold after a signal to the controller during fast motion.
fn check_drives_hold_after(signal: Signal) {
    let mut rig = Rig::start();
    let client = rig.enabled();
    let fast = |t: f64| [(1500.0 * t).min(1500.0) as i32, 0];
    while_streaming(&client, fast, || {
        let is_fast = || rig.setpoints(0).last().is_some_and(|(_, counts)| *counts > 500);
        wait_until("it moves fast", is_fast);
        rig.signal(signal);
        rig.wait_until_still();
    });
    let setpoints = rig.setpoints(0);
    let (_, last) = *setpoints.last().unwrap();
    let drive = rig.emulator.snapshot().axes[0].drive;
    assert_eq!(drive.state, State::OperationEnabled, "it holds under power");
    assert!((100..1500).contains(&last), "{last}");
    assert!((drive.position - last).abs() <= 3, "{drive:?}, setpoint {last}");
    clock::sleep(Nanos::from_millis(300));
    assert_eq!(rig.setpoints(0).len(), setpoints.len(), "no further setpoints");
    assert_eq!(rig.positions()[0], drive.position);
    if signal == Signal::SIGSTOP {
        rig.signal(Signal::SIGKILL);
    }
    rig.wait_for_end();
}

#[test]
fn h03_the_drives_hold_when_the_controller_is_killed() {
    check_drives_hold_after(Signal::SIGKILL);
}

#[test]
fn h03_the_drives_hold_when_the_controller_hangs() {
    check_drives_hold_after(Signal::SIGSTOP);
}

/// A controller that resumes after a hang does not catch up.
#[test]
fn h03_resumed_controller_continues_by_holding() {
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    stream_counts(&client, 0.3, |t| [(900.0 * t) as i32, 0]);
    rig.signal(Signal::SIGSTOP);
    clock::sleep(Nanos::from_millis(800));
    let before = rig.setpoints(0).len();
    rig.signal(Signal::SIGCONT);
    wait_until_holding(&mut client);
    clock::sleep(Nanos::from_millis(200));
    let setpoints = rig.setpoints(0);
    // A controller that holds immediately sends no further setpoint.
    let (first, last) = (setpoints[before - 1].1, setpoints.last().unwrap().1);
    // At most the motion of the ticks between its last write and the tick that sees the deadline.
    assert!((last - first).abs() <= 60, "{first} {last}");
}

/// The client has given up and no longer expects the effect.
#[test]
fn h29_abandoned_request_is_not_executed_after_hang() {
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    client.carry_out(StateCommand::Disable, || false).unwrap();
    rig.signal(Signal::SIGSTOP);
    let reply = client.state_command(StateCommand::Enable);
    assert!(matches!(reply, Err(ClientError::NoReply { .. })), "{reply:?}");
    rig.signal(Signal::SIGCONT);
    clock::sleep(Nanos::from_millis(700));
    let state = wait_until_idle(&mut client);
    assert_eq!(state.state, OperatingState::Disabled.number());
    enable(&mut client);
    // A stop is valid at any age.
    rig.signal(Signal::SIGSTOP);
    let reply = client.state_command(StateCommand::Disable);
    assert!(matches!(reply, Err(ClientError::NoReply { .. })), "{reply:?}");
    rig.signal(Signal::SIGCONT);
    wait_for(&mut client, |state| state.state == OperatingState::Disabled.number());
}

/// Starts a second controller on a domain and returns its refusal. The first one stays enabled.
fn refusal_of_second(change_domain: impl FnOnce(&mut String)) -> String {
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    let events = rig.emulator.log().len();
    let domain = rig.config.domain.clone();
    change_domain(&mut rig.config.domain);
    let mut second = rig.spawn_controller("second");
    rig.config.domain = domain;
    assert_eq!(wait_for_end(&mut second).code(), Some(1));
    assert_eq!(wait_until_idle(&mut client).state, OperatingState::Enabled.number());
    let log = rig.emulator.log();
    assert!(!log[events..].iter().any(|event| matches!(event.kind, EventKind::Line(_))));
    let text = rig.log_text("second");
    assert!(text.starts_with("error: ") && text.lines().count() == 1, "{text}");
    text
}

#[test]
fn h15_a_second_controller_is_refused_and_changes_nothing() {
    let text = refusal_of_second(|_| {});
    assert!(text.contains("already"), "{text}");
}

#[test]
fn h15_controller_of_second_domain_cannot_open_port() {
    let text = refusal_of_second(|domain| domain.push_str("-b"));
    assert!(text.contains("in use"), "{text}");
}

#[test]
fn h18_restarted_controller_continues_with_same_client_and_zero() {
    let mut rig = Rig::start();
    let mut client = rig.enabled();
    for _ in 0..3 {
        rig.signal(Signal::SIGKILL);
        rig.wait_for_end();
        rig.started();
        settle(&mut client, |state| has(state, OperatingStateMsg::HOMED));
        enable(&mut client);
        stream_counts(&client, 0.3, |t| [(200.0 * t) as i32, 0]);
    }
    client.state_command(StateCommand::Disable).unwrap();
    settle_in(&mut client, OperatingState::Disabled);
}
