//! Ports and their drives, for `i2ris doctor`; and `i2ris doctor drives`, which reads and compares
//! drive settings. Nothing is written to a drive.

use std::path::{Path, PathBuf};
use std::{collections::BTreeMap, fs};

use i2ris::config::{AxisConfig, Config, Family, PortConfig};
use i2ris::drive::fingerprint::{differences, key, read_port, settings};
use i2ris::drive::inspect::{Inspection, inspect};
use i2ris::drive::survey::{FoundNode, answering_rate, nodes};
use i2ris::drive::{DriveError, latency_timer};
use i2ris::drive::{cia402::DriveState, object::Address};
use i2ris::units::{AUXILIARY, MAX_AXES};
use i2ris::{model::Model, robot::DriveFingerprint};
use i2ris_report::{DomainOption, Failure, bail, while_working};
use i2ris_simulation::drive::{self, DeviceFile};

use super::Report;

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris doctor drives > drives.json                the drives of the running controller
  i2ris doctor drives --config my-robot.toml       while no controller runs
  i2ris doctor drives drives.json                  compare with the present drives
  i2ris doctor drives before.json after.json
  i2ris doctor drives motor.dcf                    as EPOS Studio exports it

The drives are only read: nothing is written to them.")]
pub struct Arguments {
    /// Settings to compare: from `i2ris doctor drives`, a model, or a DCF file [default: print
    /// every setting of every drive as JSON]
    first: Option<PathBuf>,
    /// Settings to compare with [default: those of the present drives]
    second: Option<PathBuf>,
    /// Read the drives of this configuration; no controller may be running [default: the settings
    /// that the running controller read at its start]
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    #[command(flatten)]
    domain: DomainOption,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    if let Some(first) = &arguments.first {
        return compare(arguments, first);
    }
    println!("{}", serde_json::to_string_pretty(&read(arguments)?)?);
    Ok(())
}

fn read(present: &Arguments) -> Result<Vec<DriveFingerprint>, Failure> {
    if let Some(path) = &present.config {
        let config = Config::load(path)?;
        let drives = while_working("reading every setting", || {
            config.ports.iter().map(read_port).collect::<Result<Vec<_>, _>>()
        })?;
        return Ok(drives.concat());
    }
    let domain = present.domain.domain()?;
    crate::command::prepare::connect(&domain)?;
    let drives = domain.drives();
    if drives.is_empty() {
        bail!(
            "this controller does not report the settings of its drives; end it, and name its \
             configuration with --config"
        );
    }
    Ok(drives)
}

fn compare(arguments: &Arguments, first: &Path) -> Result<(), Failure> {
    let before = load(first)?;
    let after = match &arguments.second {
        Some(second) => load(second)?,
        None => (read(arguments)?, false),
    };
    let (mut compared, mut lines) = (0, Vec::new());
    for old in &before.0 {
        for new in &after.0 {
            // A DCF file names no motor.
            let is_pair = old.motor == new.motor || before.1 || after.1;
            if !is_pair || old.family != new.family {
                continue;
            }
            compared += 1;
            let (old, new) = match (before.1, after.1) {
                (true, _) => (&DriveFingerprint { motor: new.motor, ..old.clone() }, new),
                _ => (old, new),
            };
            lines.extend(differences(old, new, false));
        }
    }
    if compared == 0 {
        bail!("the two have no drive of the same motor and family in common");
    }
    lines.iter().for_each(|line| println!("{line}"));
    match lines.len() {
        0 => {
            println!("no differences: {compared} drives");
            Ok(())
        }
        count => Err(format!("{count} settings differ").into()),
    }
}

/// The drives of a file, and whether it describes a single drive without a motor.
fn load(path: &Path) -> Result<(Vec<DriveFingerprint>, bool), Failure> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if ["dcf", "eds", "csv"].contains(&extension.as_str()) {
        return Ok((vec![of_device(&DeviceFile::load(path)?)], true));
    }
    let text = fs::read_to_string(path)
        .map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    if let Ok(drives) = serde_json::from_str(&text) {
        return Ok((drives, false));
    }
    let shown = path.display();
    let model = Model::load(path).map_err(|_| {
        format!(
            "{shown} contains no settings: name a file of `i2ris doctor drives`, a model, or a DCF \
             file"
        )
    })?;
    let drives = &model.file().training.drives;
    if drives.is_empty() {
        bail!("the model {shown} does not name the drives it was made with");
    }
    Ok((drives.clone(), false))
}

pub fn of_device(file: &DeviceFile) -> DriveFingerprint {
    let family = match file.family {
        drive::Family::Epos4 => Family::Epos4,
        drive::Family::Epos2 => Family::Epos2,
    };
    let value = |entry: &i2ris::drive::objects::Entry| {
        let address = (entry.index, entry.subindex);
        file.objects.iter().find(|it| (it.index, it.subindex) == address).map(|it| it.default)
    };
    DriveFingerprint {
        motor: 0,
        family: format!("{family:?}").to_uppercase(),
        firmware: String::new(),
        serial_number: 0,
        settings: settings(family).filter_map(|it| Some((key(it), value(it)?))).collect(),
    }
}

/// Supply voltages that a small drive should see, volts.
const SUPPLY_V: std::ops::RangeInclusive<f64> = 9.0..=50.0;
const MAX_NAMED: usize = 3;

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
            if port.is_delayed(seen.exchange) {
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
            let is_garbled = matches!(&error, DriveError::InvalidReply(.., it)
                if !it.is_frame() && !it.is_late());
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

fn say_other(port: &PortConfig, baud: u32, report: &mut Report) {
    let found = nodes(&PortConfig { baud, ..port.clone() }).unwrap_or_default();
    let shown =
        |it: &FoundNode| format!("; node {} is an {} {}", it.node_id, it.family, it.serial_number);
    let listed: String = found.iter().map(shown).collect();
    let found = format!("no reply at {} baud; a drive answers at {baud}{listed}", port.baud);
    report.fail(port.device.display().to_string(), found, format!("set `baud = {baud}`"));
}

fn list_nodes(port: &PortConfig, found: &[FoundNode], report: &mut Report) {
    let is_of = |node: &FoundNode, axis: &AxisConfig| {
        [0, node.node_id].contains(&axis.node_id)
            && axis.short_serial_number() == node.serial_number
    };
    let is_known = |node: &FoundNode| port.axes.iter().any(|axis| is_of(node, axis));
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
    let found = format!("{family}, serial number {serial_number}, firmware 0x{firmware:04X}");
    report.pass(name, found);
    check_state(name, seen, report);
    if let Some(volts) = seen.supply_v {
        let (name, found) = (format!("{name} supply"), format!("{volts:.1} V"));
        if SUPPLY_V.contains(&volts) {
            report.pass(name, found);
        } else {
            report.fail(name, found, "check the power supply of the drive");
        }
    }
    let (errors, listed) = (format!("{name} errors"), seen.errors.iter().map(ToString::to_string));
    let fix = "remove the cause of the first; write 0 to object 0x1003:00 to clear";
    match seen.errors.is_empty() {
        true => report.pass(errors, "none in the history"),
        false => report.warn(errors, listed.collect::<Vec<_>>().join("; "), fix),
    }
    check_limits(name, seen, report);
}

fn check_state(name: &str, seen: &Inspection, report: &mut Report) {
    let name = format!("{name} state");
    let homed = if seen.homed { "homed" } else { "not homed" };
    match seen.state {
        Some(DriveState::Fault | DriveState::FaultReaction) => {
            let newest = seen.errors.first().map(|error| format!(" ({error})")).unwrap_or_default();
            let fix = "remove the cause, then acknowledge: `i2ris command state acknowledge`";
            report.fail(name, format!("fault{newest}, {homed}"), fix);
        }
        Some(state @ (DriveState::OperationEnabled | DriveState::QuickStopActive)) => {
            let found = format!("{state:?} without a controller, {homed}");
            let fix = "left on by a controller that died; the next one switches it off cleanly at \
                       start-up";
            report.warn(name, found, fix);
        }
        Some(state) => report.pass(name, format!("{state:?}, {homed}")),
        None => report.fail(name, "unknown state", "check that the firmware is supported"),
    }
}

fn check_limits(name: &str, seen: &Inspection, report: &mut Report) {
    let name = format!("{name} limits");
    if seen.differences.is_empty() {
        return report.pass(name, "as configured");
    }
    // A value near 2^32 is a negative number.
    let differs = |(object, wanted, found): &(Address, u32, u32)| {
        format!("{object} is {}, not {}", found.cast_signed(), wanted.cast_signed())
    };
    let listed: Vec<String> = seen.differences.iter().take(MAX_NAMED).map(differs).collect();
    let more = seen.differences.len().saturating_sub(MAX_NAMED);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    let listed = listed.join(", ");
    // The controller writes them at every start, so a difference before the first is expected.
    report.pass(name, format!("{listed}{more}; the controller writes them at its start"));
}
