//! Read-only stages: identity and settings of the drives, and duration of an exchange.

use std::collections::BTreeMap;

use i2ris::drive::error::{DriveError, LinkError};
use i2ris::drive::fingerprint::{differences, read_axes};
use i2ris::drive::inspect::{Inspection, inspect_link};
use i2ris::drive::object::{self, Address};
use i2ris::drive::{cia402::DriveState, latency_timer, survey::nodes_on, transport::Transport};
use i2ris::{config::AxisConfig, robot::DriveFingerprint, units::Nanos};

use super::record::{Change, NOT_THERE, Record, Topic};
use super::session::{Lines, OpenPort, Session, ms};
use crate::doctor::drives::rename_axes;
use crate::procedure::{Gone, Halt};

const NOWHERE: Address =
    Address { index: 0x5FFF, subindex: 0, size: 4, name: "an object that no drive has" };

/// Fault of a drive without another node on CAN.
pub const NO_CAN: u16 = 0x8120;
/// Duration of an exchange above which the adapter delays replies.
const HELD_BACK: Nanos = Nanos::from_millis(10);
pub const BAR_US: u32 = 50;

pub fn identify<L: Lines>(session: &mut Session<'_, L>) -> Result<String, Halt> {
    let (mut problems, mut found) = (Vec::new(), Vec::new());
    let record = &mut session.record;
    record.changes.clear();
    for (number, port) in session.ports.iter_mut().enumerate() {
        let seen = match inspect_link(&mut port.link, &port.config) {
            Ok(seen) => seen,
            Err(error) => {
                if let DriveError::WrongDriveFamily(_, _, other) = &error {
                    let value = format!("\"{}\"", other.to_lowercase());
                    propose(record, number, None, "family", value);
                }
                problems.push(error.to_string());
                continue;
            }
        };
        let before = problems.len();
        for (axis, seen) in port.config.axes.iter().zip(&seen.axes) {
            match seen {
                Ok(seen) => {
                    found.push(identity(seen));
                    problems.extend(state_problem(seen));
                    note_power_up(record, seen);
                }
                Err(why) => problems.push(format!("motor {}: {why}", axis.motor)),
            }
        }
        if seen.axes.iter().any(Result::is_err) {
            propose_serial_numbers(port, number, record);
        } else if problems.len() == before {
            find_replies(port, record)
                .map_err(|error| format!("{}: {error}", port.config.device.display()))?;
        }
    }
    if problems.is_empty() { Ok(found.join("; ")) } else { Err(problems.join("; ").into()) }
}

fn identity(seen: &Inspection) -> String {
    let Inspection { motor, family, serial_number, firmware, .. } = seen;
    let supply = seen.supply_v.map_or(String::new(), |volts| format!(", supply {volts:.1} V"));
    format!(
        "motor {motor} is an {family}, serial number {serial_number}, firmware 0x{firmware:04X}\
         {supply}"
    )
}

fn state_problem(seen: &Inspection) -> Option<String> {
    let motor = seen.motor;
    match seen.state {
        Some(DriveState::Fault) => {
            let newest = seen.errors.first().filter(|fault| fault.code != NO_CAN)?;
            Some(format!("motor {motor} is in a fault: {newest}"))
        }
        Some(state) if state.is_off() => None,
        Some(state) => Some(format!(
            "motor {motor} is already switched on ({state:?}): another program has enabled it, or \
             a controller died; end that program, or switch the supply off and on"
        )),
        None => Some(format!("motor {motor} is in no known state")),
    }
}

/// Records the power-up fault, as known before the supply is switched.
fn note_power_up(record: &mut Record, seen: &Inspection) {
    let place = format!("motor {}", seen.motor);
    match seen.errors.iter().find(|fault| fault.code == NO_CAN) {
        Some(fault) => {
            let evidence = format!("state {:?}, error history 0x1003: {fault}", seen.state);
            record.find(Topic::PowerUp, &place, "fault 0x8120", evidence);
        }
        None => {
            let evidence = "since the last power-up the error history 0x1003 has no 0x8120".into();
            record.find(Topic::PowerUp, &place, "no fault", evidence);
        }
    }
}

fn propose(record: &mut Record, port: usize, axis: Option<usize>, key: &str, value: String) {
    record.changes.push(Change { port, axis, key: key.to_owned(), value });
}

fn propose_serial_numbers<T: Transport>(
    port: &mut OpenPort<T>,
    number: usize,
    record: &mut Record,
) {
    let mut found = port.config.clone();
    rename_axes(&mut found, &nodes_on(&mut port.link));
    for (index, (axis, found)) in port.config.axes.iter().zip(&found.axes).enumerate() {
        if found.node_id != axis.node_id {
            propose(record, number, Some(index), "node_id", found.node_id.to_string());
        }
        if found.short_serial_number() != axis.short_serial_number() {
            let value = found.serial_number.to_string();
            propose(record, number, Some(index), "serial_number", value);
        }
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ")
}

fn find_replies(port: &mut OpenPort<impl Transport>, record: &mut Record) -> Result<(), LinkError> {
    for (index, AxisConfig { motor, node_id, .. }) in port.config.axes.iter().enumerate() {
        let (link, place) = (&mut port.link, format!("motor {motor}"));
        if index == 0 {
            let data = link.read_reply_data(*node_id, NOWHERE)?;
            let value = format!("{} words", data.len() / 2);
            let evidence = format!("the data of the reply to a read of 0x5FFF:00: {}", hex(&data));
            record.find(Topic::RefusedRead, &place, &value, evidence);
        }
        let data = link.read_reply_data(*node_id, object::STATUSWORD.address())?;
        let value = match data.get(4..) {
            Some([_, _, 0, 0]) => "zeros",
            Some([_, _, _, _]) => "filled",
            Some([_, _]) => "absent",
            _ => "unknown",
        };
        let evidence = format!("the data of the reply to a read of 0x6041:00: {}", hex(&data));
        record.find(Topic::UpperBytes, &place, value, evidence);
        if index == 0 {
            let why = "its drive is the one at the port".to_owned();
            record.find(Topic::SegmentsBehindGateway, &place, NOT_THERE, why);
            continue;
        }
        let (value, evidence) = match link.read_segmented(*node_id, object::DEVICE_NAME) {
            Ok(read) => ("forwarded", format!("0x1008:00 came: {}", hex(read.bytes()))),
            Err(LinkError::Refused(code)) => ("refused", format!("0x1008:00: {code}")),
            Err(error @ LinkError::Unanswered(_)) => ("not answered", error.to_string()),
            Err(error) => return Err(error),
        };
        record.find(Topic::SegmentsBehindGateway, &place, value, evidence);
    }
    Ok(())
}

pub fn settings<L: Lines>(session: &mut Session<'_, L>) -> Result<String, Halt> {
    let (mut lines, mut read) = (Vec::new(), 0);
    for port in &mut session.ports {
        let seen = inspect_link(&mut port.link, &port.config)?;
        for seen in seen.axes {
            let seen = seen?;
            let of_limit = |(object, wanted, found): &(Address, u32, u32)| {
                let (motor, found, wanted) =
                    (seen.motor, found.cast_signed(), wanted.cast_signed());
                format!(
                    "motor {motor}: {object} is {found}; the controller writes {wanted} at start-up"
                )
            };
            lines.extend(seen.differences.iter().map(of_limit));
        }
        for drive in read_axes(&mut port.link, &port.config)? {
            read += drive.settings.len();
            if let Some(device) = session.device.as_ref().filter(|it| it.family == drive.family) {
                let device = DriveFingerprint { motor: drive.motor, ..device.clone() };
                let of_file = differences(&device, &drive, false).into_iter();
                lines.extend(of_file.map(|it| format!("{it} (file -> drive)")));
            }
        }
    }
    lines.iter().for_each(|line| session.person.say(line));
    let text = format!("{read} settings read, {} differ", lines.len());
    session.record.differences = lines;
    Ok(text)
}

pub fn exchanges<L: Lines>(session: &mut Session<'_, L>) -> Result<String, Halt> {
    let count = session.exchanges / session.ports.len().max(1);
    let (mut texts, mut all) = (Vec::new(), Vec::new());
    for port in &mut session.ports {
        let device = port.config.device.display().to_string();
        let failed = |error: LinkError| format!("{device}: {error}");
        let (mut spans, before) = (Vec::with_capacity(count), port.link.counters());
        for axis in port.config.axes.iter().cycle().take(count) {
            if (session.interrupted)() {
                return Err(Gone::Interrupted.into());
            }
            let begin = port.link.now();
            port.link.read(axis.node_id, object::POSITION).map_err(failed)?;
            spans.push(port.link.now() - begin);
        }
        spans.sort_unstable();
        let quantile = |part: f64| {
            let index = (part * (spans.len() as f64 - 1.0)).round() as usize;
            spans.get(index).copied().unwrap_or_default()
        };
        let [median, high, longest] = [0.5, 0.99, 1.0].map(quantile);
        let after = port.link.counters();
        let lost = after.timeouts - before.timeouts + after.crc_errors - before.crc_errors;
        let value = format!("median {}, 99 % {}, longest {}", ms(median), ms(high), ms(longest));
        let mut evidence = format!("{count} reads of 0x6064:00, {lost} lost or corrupted");
        if median > HELD_BACK {
            let remedy = latency_timer::command(&port.config.device);
            evidence += &format!("; an adapter delays the replies: `{remedy}`");
        }
        session.record.find(Topic::Exchange, &device, &value, evidence);
        texts.push(format!("{device}: {value}"));
        let mut bars = BTreeMap::new();
        for span in &spans {
            *bars.entry((span.0 / 1000) as u32 / BAR_US * BAR_US).or_insert(0) += 1;
        }
        all.push((device, bars.into_iter().collect()));
    }
    session.record.exchanges = all;
    Ok(texts.join("; "))
}
