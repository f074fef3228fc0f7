//! Ports and the drives behind them.

use i2ris::config::{Config, PortConfig};
use i2ris::drive::DriveError;
use i2ris::drive::cia402::DriveState;
use i2ris::drive::family_selection::family_of_port;
use i2ris::drive::inspect::{Inspection, inspect};
use i2ris::drive::latency_timer;
use i2ris::drive::survey::{FoundNode, answering_rate, nodes};
use i2ris::units::Nanos;

use super::report::Report;

/// An exchange that takes longer is held back by something.
const SLOW: Nanos = Nanos::from_millis(4);

/// Supply voltages that a small drive should see, volts.
const SUPPLY_V: std::ops::RangeInclusive<f64> = 9.0..=50.0;

/// Differing limits that are named at most.
const MOST_NAMED: usize = 3;

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
                report.warn(name, found, format!("`{shorten}`, and use no hub"));
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
                    Err(why) => report.fail(
                        name,
                        why,
                        "correct `serial_number` and `node_id`, or swap the cables back",
                    ),
                }
            }
            // What answered a moment ago answers.
            list_nodes(port, &nodes(port).unwrap_or_default(), report);
        }
        Err(error @ DriveError::Busy { .. }) => {
            report.warn(name, error.to_string(), "end the controller to check its drives")
        }
        Err(error) => {
            let is_garbled =
                matches!(&error, DriveError::NotUnderstood(.., heard) if !heard.is_frame());
            let may_be_rate = is_garbled || matches!(error, DriveError::NoAnswer { .. });
            if let Some(rate) = may_be_rate.then(|| answering_rate(port)).flatten() {
                let found = format!("nothing at {} baud; a drive answers at {rate}", port.baud);
                return report.fail(name, found, format!("set `baud = {rate}`"));
            }
            let text = error.to_string();
            // A sentence of what, and how to mend it.
            let (found, fix) = text.split_once("; ").unwrap_or((&text, "check the drive"));
            report.fail(name, found, fix);
        }
    }
}

/// The drives on a port, and a table of those that the configuration does not name.
fn list_nodes(port: &PortConfig, found: &[FoundNode], report: &mut Report) {
    let is_known = |node: &FoundNode| {
        port.axes.iter().any(|axis| {
            [0, node.node_id].contains(&axis.node_id)
                && axis.short_serial_number() == node.serial_number
        })
    };
    let device = port.device.display();
    let (baud, family) = (port.baud, family_of_port(port).name().to_lowercase());
    let mut table =
        format!("\n[[ports]]\ndevice = \"{device}\"\nbaud = {baud}\nfamily = \"{family}\"\n");
    for (index, node) in found.iter().enumerate() {
        let FoundNode { node_id, family, firmware, serial_number } = node;
        let motor = port.axes.get(index).map_or(index, |axis| axis.motor);
        let what = format!("{family}, firmware 0x{firmware:04X}");
        let found = format!("{what}, serial number {serial_number}");
        report.pass(format!("{device} node {node_id}"), found);
        table += &format!(
            "\n[[ports.axes]] # {what}\nmotor = {motor}\nfamily = \"{}\"\nnode_id = {node_id}\n\
             serial_number = {serial_number}\n",
            family.to_lowercase()
        );
    }
    if !found.iter().all(is_known) {
        report.paste(table);
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
            report.fail(
                name,
                format!("fault, {homed}"),
                "remove the cause, then acknowledge: `i2ris command state acknowledge`",
            );
        }
        Some(state @ (DriveState::OperationEnabled | DriveState::QuickStopActive)) => report.warn(
            name,
            format!("{state:?} without a controller, {homed}"),
            "a controller died here; the next one switches the drive off in order at its start",
        ),
        Some(state) => report.pass(name, format!("{state:?}, {homed}")),
        None => report.fail(name, "no known state", "check that the firmware is supported"),
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
        .take(MOST_NAMED)
        // What is near 2^32 is a number below 0.
        .map(|(object, wanted, found)| {
            format!("{object} is {}, not {}", found.cast_signed(), wanted.cast_signed())
        })
        .collect();
    let more = seen.differences.len().saturating_sub(MOST_NAMED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    // Every start of the controller writes them, so before the first one this is as it should be.
    report.pass(
        name,
        format!("{}{more}; the controller writes them at its start", listed.join(", ")),
    );
}
