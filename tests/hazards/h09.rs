//! H09: NaN, infinite values, huge steps. Refused on arrival; nothing moves.

use i2ris::clock;
use i2ris::ipc::client::Client;
use i2ris::ipc::{OperatingState, Refusal};
use i2ris::units::Nanos;

use crate::rig::motion::rig_with_model;
use crate::rig::{TIMEOUT, wait_for};

/// Sends a goal until it is refused for this reason.
fn send_until_refused(client: &mut Client, goal: [f64; 2], refusal: Refusal) {
    let mut commander = client.commander();
    let before = wait_for(client, |_| true).refused;
    let start = clock::now();
    loop {
        commander.servo_jp(&goal).unwrap();
        clock::sleep(Nanos::from_millis(5));
        let state = client.operating_state().unwrap().unwrap();
        if state.refused > before && state.last_refusal == refusal.number() {
            return assert_eq!(state.state, OperatingState::Enabled.number());
        }
        assert!(clock::now().since(start) < TIMEOUT, "{goal:?}: {state:?}");
    }
}

#[test]
fn h09_invalid_values_and_huge_steps_are_refused_and_nothing_moves() {
    let mut rig = rig_with_model();
    let mut client = rig.enabled();
    let huge = rig.config.command.max_step_deg.to_radians() * 1.5;
    for (goal, refusal) in [
        ([f64::NAN, 0.0], Refusal::NotFinite),
        ([0.0, f64::INFINITY], Refusal::NotFinite),
        ([f64::NEG_INFINITY, f64::NAN], Refusal::NotFinite),
        ([huge, 0.0], Refusal::Step),
        ([0.0, -1e300], Refusal::Step),
    ] {
        send_until_refused(&mut client, goal, refusal);
    }
    for axis in 0..2 {
        assert!(rig.setpoints(axis).iter().all(|(_, counts)| counts.abs() <= 1));
    }
}
