//! The stops: what happens when the cable is pulled, the controller is killed, or the supply is
//! switched. Each test is done by hand, with a separate permission, and timed.

use i2ris::drive::{cia402::DriveState, transport::Transport};
use i2ris::units::Nanos;
use i2ris_report::bail;

use super::guard::{Mode, PowerOn, PoweredDrive};
use super::moving::{acknowledge, fault};
use super::reading::NO_CAN;
use super::record::Topic;
use super::session::{Lines, Motor, Session, ms};
use super::watch::{Permit, PowerCutReason};
use crate::procedure::{Gone, Halt, Permission, permission};

const PATIENCE: Nanos = Nanos::from_millis(30_000);
const AWAY: Nanos = Nanos::from_millis(120_000);
const POLL: Nanos = Nanos::from_millis(20);
const HOLDING_MA: u32 = 20;

pub fn stops<L: Lines>(session: &mut Session<'_, L>) -> Result<String, Halt> {
    for port in 0..session.ports.len() {
        let mut motor = session.motor(port, 0);
        cable(&mut motor).map_err(|halt| halt.at(&motor.place))?;
    }
    controller(session)?;
    for port in 0..session.ports.len() {
        let mut motor = session.motor(port, 0);
        supply(&mut motor).map_err(|halt| halt.at(&motor.place))?;
    }
    let topics = [Topic::CablePulled, Topic::ControllerKilled, Topic::SupplySwitched];
    let stops = session.record.findings.iter().filter(|it| topics.contains(&it.topic));
    let texts: Vec<String> =
        stops.map(|it| format!("{} ({}): {}", it.topic.name(), it.place, it.value)).collect();
    Ok(texts.join("; "))
}

const OTHERWISE: &str = "any other input skips this test";

/// A test by hand: the drive holds with power until its line fails or its state changes.
struct Outage {
    /// Time from the last good reply to the detection of the failure.
    noticed: Nanos,
    /// Time from the last good reply until the drive answered again.
    back: Nanos,
    state: DriveState,
    code: u16,
}

fn cable<T: Transport>(motor: &mut Motor<'_, T>) -> Result<(), Halt> {
    let what = format!(
        "THE CABLE: {} holds with power for at most 30 s, nothing moves. Wait for the prompt, \
         then pull the cable of its port at the computer; plug it in again at the second prompt. \
         A cable pulled before the prompt spoils the timing.",
        motor.place
    );
    let Some(yes) = permission(motor.person, &what, "cable", OTHERWISE)? else {
        motor.skip(Topic::CablePulled, "it was not permitted");
        return Ok(());
    };
    let Some(outage) = outage(motor, &yes, "pull the cable NOW", "plug it in again")? else {
        motor.skip(Topic::CablePulled, "the cable was not pulled within 30 s");
        return Ok(());
    };
    let value = match outage.state {
        DriveState::Fault => fault(outage.code),
        state if state.is_off() => "power off".to_owned(),
        _ => "holds with power".to_owned(),
    };
    motor.find(Topic::CablePulled, &value, times(&outage));
    off(motor)
}

fn supply<T: Transport>(motor: &mut Motor<'_, T>) -> Result<(), Halt> {
    let what = format!(
        "THE SUPPLY: {} holds with power for at most 30 s, nothing moves. Wait for the prompt, \
         then switch the drive supply off; switch it on again at the second prompt. The position \
         is lost.",
        motor.place
    );
    let Some(yes) = permission(motor.person, &what, "supply", OTHERWISE)? else {
        motor.skip(Topic::SupplySwitched, "it was not permitted");
        return Ok(());
    };
    let on_again = "switch the supply on again";
    let Some(outage) = outage(motor, &yes, "switch the supply off NOW", on_again)? else {
        motor.skip(Topic::SupplySwitched, "the supply was not switched within 30 s");
        return Ok(());
    };
    let has_power = !outage.state.is_off() && outage.state != DriveState::Fault;
    let value = if has_power { "ON AGAIN WITH POWER" } else { "off, and stays off" };
    motor.find(Topic::SupplySwitched, value, times(&outage));
    let boot = if outage.code == 0 { "no fault".to_owned() } else { fault(outage.code) };
    let evidence = "the error code at the first reply after the supply was switched";
    motor.find(Topic::PowerUp, &boot, evidence.to_owned());
    off(motor)?;
    match (has_power, outage.code) {
        (true, _) => bail!(
            "its power stage is on after its supply was switched off and on: it must stay off"
        ),
        (false, 0 | NO_CAN) => Ok(()),
        (false, code) => {
            let fault = motor.node.family.fault(code);
            bail!("it starts with a fault after its supply was switched: {fault}")
        }
    }
}

fn times(outage: &Outage) -> String {
    let Outage { noticed, back, state, .. } = outage;
    format!(
        "noticed {} after the last good reply; it answered again after {:.1} s, in state {state:?}",
        ms(*noticed),
        back.as_seconds()
    )
}

/// Holds until the operator has acted (`None`: did not), then until the drive answers again.
fn outage<T: Transport>(
    motor: &mut Motor<'_, T>,
    yes: &Permission,
    now: &str,
    then: &str,
) -> Result<Option<Outage>, Halt> {
    // Another drive may share this supply.
    acknowledge(motor)?;
    let Motor { place, node, person, .. } = motor;
    let how = PowerOn::new(Permit::power(yes), Mode::Position, HOLDING_MA);
    let guard = PoweredDrive::on(node, how)?;
    person.say(&format!("{place} has power: {now}"));
    let (good, noticed, trip) = guard.hold(PATIENCE);
    match trip {
        None => return Ok(None),
        Some(PowerCutReason::Drive(_) | PowerCutReason::Switched(_)) => {}
        Some(trip) => return Err(trip.into()),
    }
    person.say(then);
    let end = noticed + AWAY;
    loop {
        // Earlier requests are no longer answered.
        let answers = (!node.link.is_broken() || node.link.reopen().is_ok())
            && node.link.synchronise().is_ok();
        if let Ok(state) = node.state()
            && answers
            && state != DriveState::NotReady
        {
            let code = if state == DriveState::Fault { node.fault() } else { 0 };
            let back = node.link.now() - good;
            return Ok(Some(Outage { noticed: noticed - good, back, state, code }));
        }
        if (node.is_interrupted)() || node.link.now() > end {
            bail!("it no longer answers. THE DRIVE MAY STILL BE ON: cut its supply");
        }
        let next = node.link.now() + POLL;
        node.link.sleep_until(next);
    }
}

fn off<T: Transport>(motor: &mut Motor<'_, T>) -> Result<(), Halt> {
    let node = &mut motor.node;
    node.cut()?;
    let _ = node.reset_fault();
    Ok(())
}

fn controller<L: Lines>(session: &mut Session<'_, L>) -> Result<(), Halt> {
    let what = "THE CONTROLLER: i2ris-watchdog and i2ris-control start with this configuration. \
                The controller makes the present pose the zero, switches every drive on, holds \
                for 2 s, and is killed. The watchdog must stop every drive. Nothing moves.";
    if permission(session.person, what, "kill", OTHERWISE)?.is_none() {
        session.record.skip(Topic::ControllerKilled, "all", "it was not permitted");
        return Ok(());
    }
    session.close();
    let killed = session.lines.kill_controller();
    session.open()?;
    let mut states = Vec::new();
    for port in 0..session.ports.len() {
        for axis in 0..session.ports[port].config.axes.len() {
            let mut motor = session.motor(port, axis);
            states.push(motor.node.state()?);
            off(&mut motor)?;
        }
    }
    if (session.interrupted)() {
        return Err(Gone::Interrupted.into());
    }
    let evidence = match killed {
        Ok(log) => format!("{log}; then the drives reported {states:?}"),
        Err(failure) => bail!("killing a controller: {failure}"),
    };
    let all = states.iter().all(|state| *state != DriveState::OperationEnabled);
    let value = if all { "every drive is stopped by the watchdog" } else { "NOT STOPPED" };
    session.record.find(Topic::ControllerKilled, "all", value, evidence);
    if !all {
        bail!("drives stay on after the controller is killed");
    }
    Ok(())
}
