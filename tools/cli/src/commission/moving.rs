//! Stages with powered drives: every motion goes through [`PoweredDrive`].

use i2ris::drive::error::{AxisError, LinkError};
use i2ris::drive::{capture::CapturedLine, cia402::DriveState};
use i2ris::drive::{object::Object, transport::Transport};
use i2ris::units::Nanos;
use i2ris_report::bail;

use super::guard::{Mode, PowerOn, PoweredDrive};
use super::record::{NOT_THERE, Sweep, Topic};
use super::session::{Motor, ms};
use super::watch::{FEW, Permit, PowerCutReason, SILENT, Seen};
use crate::procedure::{Halt, Permission, permission};

/// Time with power before communication stops, and duration of that silence.
const QUIET: Nanos = Nanos::from_millis(1000);
const SILENCE: Nanos = Nanos::from_millis(3000);
const SETTLED: Nanos = Nanos::from_millis(150);
const FIRST_MA: f64 = 10.0;
const SECOND_MA: f64 = 60.0;
const SECOND_COUNTS: i32 = 200;
const MIN_LIMIT_MA: u32 = 20;
/// Position limits for the test of a setpoint beyond them, and that setpoint, counts.
const LIMIT: i32 = 5;
const BEYOND: i32 = 9;
/// A setpoint during a halt, counts.
const HALTED: i32 = 6;
const MAX_TURN_COUNTS: i32 = 16_384;
/// Encoder pulses per turn, four counts each.
const EPOS4_PULSES: Object<u32> = Object::of(0x3010, 1);
const EPOS2_PULSES: Object<u32> = Object::of(0x2210, 1);
/// Period between two setpoints of an EPOS4, ms.
const PERIOD: Object<u8> = Object::of(0x60C2, 1);

pub fn power<T: Transport>(motor: &mut Motor<'_, T>, yes: &Permission) -> Result<String, Halt> {
    acknowledge(motor)?;
    let how = PowerOn::new(Permit::power(yes), Mode::Current, FIRST_MA as u32);
    let mut guard = on(motor, how)?;
    guard.rest(QUIET)?;
    guard.be_silent(SILENCE);
    let looked = or_fault(guard.look())?;
    guard.off()?;
    let value = looked.map_or_else(fault, |_| "stays on".to_owned());
    let evidence = format!(
        "with power and 0 mA, {} without an exchange; then 0x6041:00 and the error code were read",
        ms(SILENCE)
    );
    motor.find(Topic::Silence, &value, evidence);
    if looked.is_err() {
        acknowledge(motor)?;
    }
    Ok(format!("power came on and nothing moved; without communication for 3 s it {value}"))
}

pub fn fault(code: u16) -> String {
    format!("fault 0x{code:04X}")
}

/// The reaction of a drive to a test, which may be a fault.
fn or_fault<V>(outcome: Result<V, PowerCutReason>) -> Result<Result<V, u16>, Halt> {
    match outcome {
        Ok(seen) => Ok(Ok(seen)),
        Err(PowerCutReason::Fault(code)) => Ok(Err(code)),
        Err(trip) => Err(trip.into()),
    }
}

pub fn acknowledge<T: Transport>(motor: &mut Motor<'_, T>) -> Result<(), Halt> {
    let node = &mut motor.node;
    if node.state()? != DriveState::Fault {
        return Ok(());
    }
    let fault = node.family.fault(node.fault());
    match node.reset_fault()? {
        DriveState::Fault => Err(format!("{fault}; it cannot be acknowledged").into()),
        _ => Ok(()),
    }
}

type PoweredMotor<'a, 'b, T> = PoweredDrive<'a, 'b, CapturedLine<T>>;

/// Switches a drive on. Counts are relative to the first position of the motor.
fn on<'a, 'b, T: Transport>(
    motor: &'a mut Motor<'b, T>,
    how: PowerOn,
) -> Result<PoweredMotor<'a, 'b, T>, PowerCutReason> {
    let guard = PoweredDrive::on(&mut motor.node, PowerOn { origin: *motor.origin, ..how })?;
    *motor.origin = Some(guard.origin);
    Ok(guard)
}

pub fn steps<T: Transport>(motor: &mut Motor<'_, T>, yes: &Permission) -> Result<String, Halt> {
    let friction_ma = find_friction(motor, yes)?;
    let how = PowerOn::new(Permit::few(yes), Mode::Position, limit_ma(friction_ma));
    let mut guard = on(motor, how)?;
    for there in [FEW, -FEW, 0] {
        guard.go(there, 1, |_| ())?;
    }
    guard.off()?;
    find_halt(motor, how)?;
    find_soft_limit(motor, how)?;
    find_interpolation(motor, how)?;
    Ok(format!("turns from {friction_ma:.0} mA up; moved {FEW} counts back and forth and followed"))
}

/// A limit for the position loop, above the friction of motor and gear.
fn limit_ma(friction_ma: f64) -> u32 {
    MIN_LIMIT_MA.max((4.0 * friction_ma) as u32)
}

/// Finds the current at which the motor turns, and checks the encoder direction, by pulses in both
/// directions: a position loop with a reversed encoder would run away.
fn find_friction<T: Transport>(motor: &mut Motor<'_, T>, yes: &Permission) -> Result<f64, Halt> {
    let unit = motor.node.current_unit_ma()?;
    let least = unit.max(2.0);
    let most = f64::from(motor.node.axis.current_limit_ma);
    let first = (1..).map(|step| f64::from(step) * least);
    let first: Vec<f64> = first.take_while(|ma| *ma <= FIRST_MA.min(most)).collect();
    if let Some(ma) = pulses(motor, Permit::few(yes), &first)? {
        return Ok(ma);
    }
    let last = first.last().copied().unwrap_or_default();
    let more = permission(
        motor.person,
        &format!(
            "{} does not turn with {last:.0} mA: it is blocked, its encoder gives no signal, \
             or its friction is higher. The next pulses go up to {SECOND_MA:.0} mA. IF ITS ENCODER \
             GIVES NO SIGNAL, IT MAY TURN MORE THAN {FEW} COUNTS.",
            motor.place
        ),
        "more",
        "any other input ends the run",
    )?;
    let still = "is blocked, its encoder gives no signal, or its friction is higher; turn it by \
                 hand with the power off and look at 0x6064:00 (`i2ris doctor drives`)";
    let Some(more) = more else {
        bail!("it does not turn with {last:.0} mA: it {still}");
    };
    let second = std::iter::successors(Some(last.max(least)), |ma| Some((1.3 * ma).max(ma + unit)));
    let second: Vec<f64> = second.skip(1).take_while(|ma| *ma <= SECOND_MA.min(most)).collect();
    let found = pulses(motor, Permit::further(yes, &more, SECOND_COUNTS), &second)?;
    found.ok_or_else(|| format!("it does not turn with more current: it {still}").into())
}

/// Pulses of rising current in both directions, until the encoder shows both. `None`: no counts.
fn pulses<T: Transport>(
    motor: &mut Motor<'_, T>,
    permit: Permit,
    ladder: &[f64],
) -> Result<Option<f64>, Halt> {
    let Some(most) = ladder.last() else { return Ok(None) };
    let mut guard = on(motor, PowerOn::new(permit, Mode::Current, most.ceil() as u32))?;
    for &ma in ladder {
        let there = guard.pulse(ma)?;
        let back = guard.pulse(-ma)?;
        let evidence = format!("a pulse of {ma:.0} mA: {there:+} counts, of -{ma:.0} mA: {back:+}");
        if there - back <= -2 {
            guard.off()?;
            let text = format!(
                "it turns the other way: {evidence}. A position loop would run away: reverse the \
                 direction of the encoder (0x3010:02; EPOS2 0x2210:04), or swap two phases of the \
                 motor"
            );
            motor.find(Topic::Direction, "against the current", evidence);
            return Err(text.into());
        }
        if there - back >= 2 {
            guard.off()?;
            motor.find(Topic::Friction, &format!("{ma:.0} mA"), evidence);
            motor.record.frictions_ma.insert(motor.place.clone(), ma);
            return Ok(Some(ma));
        }
        if guard.flowed > SILENT {
            break;
        }
    }
    guard.off()?;
    Ok(None)
}

fn find_halt<T: Transport>(motor: &mut Motor<'_, T>, how: PowerOn) -> Result<(), Halt> {
    let mut guard = on(motor, how)?;
    guard.halt(true)?;
    let seen = guard.try_place(HALTED, SETTLED)?;
    guard.try_place(0, SETTLED)?;
    guard.halt(false)?;
    guard.rest(SETTLED)?;
    guard.off()?;
    let value = if seen.counts > HALTED / 2 { "does not act" } else { "acts" };
    let evidence = format!(
        "0x6040:00 = 0x010F, then a setpoint of {HALTED} counts: the encoder showed {}",
        seen.counts
    );
    motor.find(Topic::Halt, value, evidence);
    Ok(())
}

fn find_soft_limit<T: Transport>(motor: &mut Motor<'_, T>, how: PowerOn) -> Result<(), Halt> {
    let mut guard = on(motor, PowerOn { limits: Some(LIMIT), ..how })?;
    let tried = or_fault(guard.try_place(BEYOND, SETTLED))?;
    let (value, shown) = match tried {
        Ok(seen) if seen.counts > (LIMIT + BEYOND) / 2 => ("ignored".to_owned(), seen.counts),
        Ok(seen) => ("clipped".to_owned(), seen.counts),
        Err(code) => (fault(code), 0),
    };
    if tried.is_ok() {
        guard.try_place(0, SETTLED)?;
    }
    guard.off()?;
    let evidence = format!(
        "0x607D at {LIMIT} counts and a setpoint of {BEYOND}: the encoder showed {shown}, {value}"
    );
    motor.find(Topic::SoftLimit, &value, evidence);
    acknowledge(motor)
}

fn find_interpolation<T: Transport>(motor: &mut Motor<'_, T>, how: PowerOn) -> Result<(), Halt> {
    if motor.node.is_epos2() {
        let why = "an EPOS2 interpolates only in its mode 7, which is not used".to_owned();
        motor.find(Topic::Interpolation, NOT_THERE, why);
        return Ok(());
    }
    let how = PowerOn { extra: Some(PERIOD.set(10)), ..how };
    let waited = on(motor, how).and_then(|mut guard| {
        guard.rest(SETTLED)?;
        guard.off()
    });
    if let Err(PowerCutReason::Drive(AxisError::Exchange { object, error })) = &waited
        && let LinkError::Refused(code) = error
        && *object == PERIOD.address()
    {
        let why = format!("this drive refuses 0x60C2:01: {code}");
        motor.find(Topic::Interpolation, NOT_THERE, why);
        return Ok(());
    }
    let value = or_fault(waited)?.map_or_else(fault, |()| "no timeout".to_owned());
    let evidence = format!(
        "0x60C2:01 = 10 (ms), power on, {} without a setpoint; then the error code was read",
        ms(SETTLED)
    );
    motor.find(Topic::Interpolation, &value, evidence);
    acknowledge(motor)
}

pub fn gear<T: Transport>(motor: &mut Motor<'_, T>, yes: &Permission) -> Result<String, Halt> {
    let (object, name) = match motor.node.is_epos2() {
        true => (EPOS2_PULSES, "0x2210:01"),
        false => (EPOS4_PULSES, "0x3010:01"),
    };
    let pulses = match motor.node.read(object) {
        Err(AxisError::Exchange { error: LinkError::Refused(code), .. }) if code.is_missing() => 0,
        pulses => pulses?,
    };
    let turn = i32::try_from(pulses.saturating_mul(4)).unwrap_or(i32::MAX);
    let second = match turn {
        FEW..=MAX_TURN_COUNTS => permission(
            motor.person,
            &format!(
                "{} MAY MOVE MORE THAN {FEW} COUNTS: one turn to positive counts and back, \
                 {turn} counts by its setting {name} = {pulses}, a few seconds each way. Put a \
                 mark on its shaft and count its turns on the way out.",
                motor.place
            ),
            "turn",
            "any other input leaves it at 20 counts",
        )?,
        _ => None,
    };
    let found_ma = motor.record.frictions_ma.get(&motor.place).copied();
    let limit = limit_ma(found_ma.unwrap_or(FIRST_MA));
    let (permit, ends) = match &second {
        Some(second) => (Permit::further(yes, second, turn + FEW), [turn, 0]),
        None => (Permit::few(yes), [FEW, -FEW]),
    };
    let step = (turn / 256).clamp(1, if second.is_some() { 8 } else { 1 });
    let back = sweep(motor, PowerOn::new(permit, Mode::Position, limit), ends, step)?;
    note_play(motor, back);
    if pulses == 0 {
        // The play has been measured in any case.
        let text = format!(
            "counts per turn are unknown, because this drive has no {name}: take four times the \
             pulses in the data sheet of the encoder, and compare with 0x6064:00 before and after \
             a turn by hand (`i2ris doctor drives`)"
        );
        motor.find(Topic::CountsPerTurn, "not known", text.clone());
        motor.find(Topic::Direction, NOT_THERE, format!("without {name} no turn is made"));
        return Ok(text);
    }
    let evidence = format!("{name} = {pulses}, four counts each");
    if second.is_none() {
        let unseen = format!("{evidence}; no turn was permitted, so none was observed");
        motor.find(Topic::CountsPerTurn, &turn.to_string(), unseen);
        motor.skip(Topic::Direction, "no turn was permitted");
        return Ok(format!("{turn} counts per turn by its setting"));
    }
    note_turn(motor, turn, name, &evidence)
}

/// Moves to a place and back through another; returns the currents on the way back.
fn sweep<T: Transport>(
    motor: &mut Motor<'_, T>,
    how: PowerOn,
    [there, back]: [i32; 2],
    step: i32,
) -> Result<Vec<(i32, i32)>, Halt> {
    let mut currents = Vec::new();
    let mut guard = on(motor, how)?;
    let mut note = |seen: Seen| currents.push((seen.counts, -seen.current_ma));
    let outcome = guard
        .go(there, step, |_| ())
        // A small play ends early.
        .and_then(|_| guard.go(back.max(there - 2 * FEW), 1, &mut note))
        .and_then(|_| guard.go(back, step, &mut note));
    outcome.and_then(|_| guard.go(0, step, |_| ()))?;
    guard.off()?;
    Ok(currents)
}

fn note_play<T: Transport>(motor: &mut Motor<'_, T>, back: Vec<(i32, i32)>) {
    let ends = back.first().zip(back.last());
    let travelled = ends.map_or(0, |((first, _), (last, _))| first - last);
    let (value, evidence) = match play(&back) {
        Some((counts, low, high)) => {
            let turn = format!("{low} mA turn the motor for {counts} counts, then {high} mA");
            (format!("{counts} counts"), format!("after a reversal, {turn}"))
        }
        None => {
            let why = "nothing is coupled, or the play is larger";
            let rise = format!("did not rise within {travelled} counts after a reversal");
            ("not found".to_owned(), format!("the current {rise}: {why}"))
        }
    };
    motor.find(Topic::Play, &value, evidence);
    motor.record.sweeps.retain(|it| it.place != motor.place);
    motor.record.sweeps.push(Sweep { place: motor.place.clone(), back });
}

/// The play after a reversal: counts until the current rises, and the current before and after.
fn play(back: &[(i32, i32)]) -> Option<(i32, i32, i32)> {
    let median = |part: &[(i32, i32)]| {
        let mut currents: Vec<i32> = part.iter().map(|it| it.1).collect();
        currents.sort_unstable();
        currents.get(currents.len() / 2).copied()
    };
    // At the first places the loop unloads.
    let low = median(back.get(2..6)?)?;
    let high = median(back.get(back.len() - 5..)?)?;
    let (start, _) = *back.first()?;
    if high < low + 2.max(low / 2) {
        return None;
    }
    let is_behind = |it: &&(i32, i32)| 2 * it.1 >= low + high;
    let (at, _) = back.get(2..)?.iter().find(is_behind)?;
    Some((start - at, low, high))
}

fn note_turn<T: Transport>(
    motor: &mut Motor<'_, T>,
    turn: i32,
    name: &str,
    evidence: &str,
) -> Result<String, Halt> {
    let seen = motor.person.answer(&format!(
        "\nHow many turns did the shaft of {} make on its way out (1, 0.5, 2, ...)? Enter: not \
         seen.",
        motor.place
    ))?;
    let way = motor.person.answer(
        "\nWhich way did it turn on its way out, seen from the end of the shaft: c (clockwise) or \
         a (anticlockwise)? Enter: not seen.",
    )?;
    match way.as_str() {
        "c" | "a" => {
            let value = if way == "c" { "clockwise" } else { "anticlockwise" };
            let evidence = format!("seen by the operator over {turn} counts");
            motor.find(Topic::Direction, value, evidence);
        }
        _ => motor.skip(Topic::Direction, "the operator did not see it"),
    }
    let turns: Option<f64> = seen.parse().ok().filter(|turns: &f64| *turns > 0.0);
    let (value, saw) = match turns {
        Some(turns) => {
            let saw = format!("counted {turns} turns for {turn} counts");
            ((f64::from(turn) / turns).round().to_string(), saw)
        }
        None => (turn.to_string(), "did not see the turn".to_owned()),
    };
    motor.find(Topic::CountsPerTurn, &value, format!("{evidence}; the operator {saw}"));
    match turns {
        Some(turns) if (turns - 1.0).abs() > 0.1 => bail!(
            "its encoder has another resolution: one turn is {value} counts, but the drive \
             assumes {turn}; correct {name} in EPOS Studio"
        ),
        _ => Ok(format!("{value} counts per turn")),
    }
}
