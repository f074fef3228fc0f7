//! Ports and their drives.

use std::collections::BTreeMap;

use i2ris::config::{AxisConfig, Config, PortConfig};
use i2ris::drive::DriveError;
use i2ris::drive::cia402::DriveState;
use i2ris::drive::inspect::{Inspection, inspect};
use i2ris::drive::latency_timer;
use i2ris::drive::survey::{FoundNode, answering_rate, nodes};
use i2ris::units::{AUXILIARY, MAX_AXES, Nanos};

use super::report::Report;

/// Duration of an exchange above which something delays it.
const SLOW: Nanos = Nanos::from_millis(4);

/// Supply voltages that a small drive should see, volts.
const SUPPLY_V: std::ops::RangeInclusive<f64> = 9.0..=50.0;

/// Maximum number of differing limits to print.
const MAX_NAMED: usize = 3;

/// Checks a port, and its drives where `open`.
pub fn check_port(config: &Config, port: &PortConfig, open: bool, report: &mut Report) {
    let name = port.device.display().to_string();
    if !port.device.exists() {
        let fix = "plug in the drive, or correct `device` (`ls -l /dev/serial/by-id`)";
        return report.fail(name, "does not exist", fix);
    }
    if !open {
        return report.pass(name, "exists; not opened");
    }
    match inspect(port) {
        Ok(seen) => {
            let found = format!("answers; {}", port.describe_line(seen.exchange));
            if seen.exchange > SLOW {
                let shorten = latency_timer::command(&port.device);
                report.warn(name, found, format!("run `{shorten}`, and connect without a hub"));
            } else {
                report.pass(name, found);
            }
            for finding in config.line_findings(port, seen.exchange) {
                let found = format!("{} = {}", finding.key, finding.value);
                report.warn("feedback", found, finding.reason);
            }
            for (axis, seen) in port.axes.iter().zip(seen.axes) {
                let name = format!("motor {}", axis.motor);
                match seen {
                    Ok(seen) => check_drive(&name, &seen, report),
                    Err(why) => fail(name, &why, report),
                }
            }
            // The drive answered a moment ago.
            list_nodes(port, &nodes(port).unwrap_or_default(), report);
        }
        Err(error @ DriveError::Busy(_)) => {
            report.warn(name, error.to_string(), "end the controller to check its drives")
        }
        Err(error) => {
            let is_garbled = matches!(
                &error,
                DriveError::InvalidReply(.., it) if !it.is_frame() && !it.is_late()
            );
            let is_silent = matches!(error, DriveError::NoAnswer { .. });
            match (is_garbled || is_silent).then(|| answering_rate(port)).flatten() {
                Some(baud) => say_other(port, baud, report),
                None if is_silent => report.fail(
                    name,
                    "no reply at any rate from 9600 to 1000000 baud",
                    "switch on the drive power, press in the cable at both ends, and check that \
                     `device` is the port of the drives; an EPOS2 is driven over USB, not RS232",
                ),
                None => fail(name, &error.to_string(), report),
            }
        }
    }
}

/// Adds a failure from a text of the form `finding; fix`.
fn fail(name: String, text: &str, report: &mut Report) {
    let (found, fix) = text.split_once("; ").unwrap_or((text, "check the drive"));
    report.fail(name, found, fix);
}

/// Reports a drive that answers at another rate than configured.
fn say_other(port: &PortConfig, baud: u32, report: &mut Report) {
    let found = nodes(&PortConfig { baud, ..port.clone() }).unwrap_or_default();
    let found: Vec<String> = found
        .iter()
        .map(|it| format!("; node {} is an {} {}", it.node_id, it.family, it.serial_number))
        .collect();
    let found =
        format!("no reply at {} baud; a drive answers at {baud}{}", port.baud, found.concat());
    let fix = format!("set `baud = {baud}`");
    report.fail(port.device.display().to_string(), found, fix);
}

/// Lists the drives on a port, with a table of those missing in the configuration.
fn list_nodes(port: &PortConfig, found: &[FoundNode], report: &mut Report) {
    let is_known = |node: &FoundNode| {
        port.axes.iter().any(|axis| {
            [0, node.node_id].contains(&axis.node_id)
                && axis.short_serial_number() == node.serial_number
        })
    };
    let device = port.device.display();
    for FoundNode { node_id, family, firmware, serial_number } in found {
        let what = format!("{family}, firmware 0x{firmware:04X}, serial number {serial_number}");
        report.pass(format!("{device} node {node_id}"), what);
    }
    if !found.iter().all(is_known) {
        // Complete, with the configured limits, so that the pasted text is a valid file.
        let mut port = port.clone();
        rename_axes(&mut port, found);
        let table = BTreeMap::from([("ports", [port])]);
        report.paste(toml::to_string(&table).unwrap_or_default());
    }
}

/// Gives the axes the nodes and serial numbers of the found drives, matched by node first; the rest
/// are assigned in sequence. Additional drives become additional axes.
pub fn rename_axes(port: &mut PortConfig, found: &[FoundNode]) {
    let mut left: Vec<&FoundNode> = found.iter().collect();
    let mut rest = Vec::new();
    for (index, axis) in port.axes.iter_mut().enumerate() {
        let is_it =
            |node: &&FoundNode| axis.node_id == node.node_id || axis.node_id == 0 && index == 0;
        match left.iter().position(is_it) {
            Some(found) => axis.serial_number = left.remove(found).serial_number.into(),
            None => rest.push(axis),
        }
    }
    let mut left = left.into_iter();
    for (axis, node) in rest.into_iter().zip(&mut left) {
        (axis.node_id, axis.serial_number) = (node.node_id, node.serial_number.into());
    }
    for node in left.take(MAX_AXES.saturating_sub(port.axes.len())) {
        let motor = port.axes.len();
        let (node_id, serial_number) = (node.node_id, node.serial_number.into());
        let auxiliary_counts_per_deg = (motor == AUXILIARY).then_some(20.0);
        let like = port.axes.first().cloned();
        port.axes.extend(like.map(|like| AxisConfig {
            motor,
            node_id,
            serial_number,
            auxiliary_counts_per_deg,
            ..like
        }));
    }
}

fn check_drive(name: &str, seen: &Inspection, report: &mut Report) {
    let Inspection { family, serial_number, firmware, .. } = seen;
    report
        .pass(name, format!("{family}, serial number {serial_number}, firmware 0x{firmware:04X}"));
    check_state(name, seen, report);
    if let Some(volts) = seen.supply_v {
        let (name, found) = (format!("{name} supply"), format!("{volts:.1} V"));
        if SUPPLY_V.contains(&volts) {
            report.pass(name, found);
        } else {
            report.fail(name, found, "check the power supply of the drive");
        }
    }
    let errors = format!("{name} errors");
    if seen.errors.is_empty() {
        report.pass(errors, "none in the history");
    } else {
        let listed: Vec<String> = seen.errors.iter().map(ToString::to_string).collect();
        report.warn(
            errors,
            listed.join("; "),
            "remove the cause of the first; write 0 to object 0x1003:00 to clear",
        );
    }
    check_limits(name, seen, report);
}

fn check_state(name: &str, seen: &Inspection, report: &mut Report) {
    let name = format!("{name} state");
    let homed = if seen.homed { "homed" } else { "not homed" };
    match seen.state {
        Some(DriveState::Fault | DriveState::FaultReaction) => {
            let newest = seen.errors.first().map(|error| format!(" ({error})")).unwrap_or_default();
            report.fail(
                name,
                format!("fault{newest}, {homed}"),
                "remove the cause, then acknowledge: `i2ris command state acknowledge`",
            );
        }
        Some(state @ (DriveState::OperationEnabled | DriveState::QuickStopActive)) => report.warn(
            name,
            format!("{state:?} without a controller, {homed}"),
            "left on by a controller that died; the next one switches it off cleanly at start-up",
        ),
        Some(state) => report.pass(name, format!("{state:?}, {homed}")),
        None => report.fail(name, "unknown state", "check that the firmware is supported"),
    }
}

fn check_limits(name: &str, seen: &Inspection, report: &mut Report) {
    let name = format!("{name} limits");
    if seen.differences.is_empty() {
        return report.pass(name, "as configured");
    }
    let listed: Vec<String> = seen
        .differences
        .iter()
        .take(MAX_NAMED)
        // A value near 2^32 is a negative number.
        .map(|(object, wanted, found)| {
            format!("{object} is {}, not {}", found.cast_signed(), wanted.cast_signed())
        })
        .collect();
    let more = seen.differences.len().saturating_sub(MAX_NAMED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    // The controller writes them at every start, so a difference before the first is expected.
    report.pass(
        name,
        format!("{}{more}; the controller writes them at its start", listed.join(", ")),
    );
}
