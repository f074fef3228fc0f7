//! `i2ris doctor config`: inspects a configuration without starting anything.

mod describe;
mod schema;

use std::fs;
use std::path::{Path, PathBuf};

use i2ris::config::{Config, PortConfig};
use i2ris::model::Model;
use i2ris_calibration::hand_limits::HandLimits;
use i2ris_report::Failure;
use i2ris_report::exit::{Coded, NOT_READY};

/// Configurations as delivered.
const TEMPLATES: [&str; 2] = [
    include_str!("../../../../config/robot.toml"),
    include_str!("../../../../config/robot-rs232.toml"),
];

/// Mark after every line that the operator must check.
const MARK: &str = " # CHECK";

/// Arguments of `i2ris doctor config`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris doctor config my-robot.toml
  i2ris doctor config --all config/robot.toml       all keys with values and meanings")]
pub struct Arguments {
    /// The configuration
    file: PathBuf,
    /// Print all keys, including defaults, with values and meanings
    #[arg(long)]
    all: bool,
    /// Print JSON; with --all, without meanings
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let Arguments { file, all, json } = arguments;
    if !all {
        return check(file, *json);
    }
    let config = Config::load(file)?;
    match json {
        true => println!("{}", serde_json::to_string_pretty(&config)?),
        false => print!("{}", describe::describe(&config)?),
    }
    Ok(())
}

fn check(file: &Path, json: bool) -> Result<(), Failure> {
    let config = Config::load_and_check_files(file)?;
    let (robot, motors, axes) = (&config.robot_id, config.motors(), config.axes().count());
    let of_line = |port: &PortConfig| config.line_findings(port, port.nominal_exchange());
    let mut findings = as_delivered(&fs::read_to_string(file)?, &config);
    findings.extend(config.ports.iter().flat_map(of_line).map(|finding| finding.to_string()));
    let model = config.control.model.as_deref().map(Model::load_trusted).transpose()?;
    let hand = model.map(|model| HandLimits::new(&model, &config.limits, &config.joint_limits));
    let [stale_ms, lost_ms] =
        [config.feedback_stale(), config.feedback_lost()].map(|age| age.as_seconds() * 1e3);
    if json {
        println!(
            "{}",
            serde_json::json!({
                "file": file, "valid": true, "robot_id": robot, "motors": motors, "axes": axes,
                "feedback_stale_ms": stale_ms, "feedback_lost_ms": lost_ms, "hand": hand,
                "not_ready": findings,
            })
        );
    } else {
        println!("{}: valid; robot {robot}, {axes} axes, {motors} of the snake", file.display());
        println!(
            "the motion stops if a position is older than {stale_ms:.0} ms, FAULT after \
             {lost_ms:.0} ms"
        );
        for port in &config.ports {
            let line = port.describe_line(port.nominal_exchange());
            println!("{}: {line}", port.device.display());
        }
        if let Some(delay_s) = config.command.tremor_filter_delay_s() {
            println!(
                "the tremor filter of {} Hz delays the goal by {:.0} ms",
                config.command.tremor_filter_hz,
                delay_s * 1e3
            );
        }
        hand.iter().for_each(|hand| println!("with its model, {hand}"));
        config.disabled_monitors().iter().for_each(|watch| println!("off: {watch}"));
        findings.iter().for_each(|finding| println!("{finding}"));
    }
    match findings.len() {
        0 => Ok(()),
        count => {
            let sentence = format!("{}: {count} line(s) are not ready", file.display());
            Err(Coded { code: NOT_READY, sentence }.into())
        }
    }
}

/// Template lines still to be filled in by the operator: marked CHECK, with the value as delivered.
/// Deleting the mark confirms the value. A serial number of 0 is never valid.
pub fn as_delivered(text: &str, config: &Config) -> Vec<String> {
    let is_delivered = |line: &&str| {
        let mut delivered = TEMPLATES.iter().flat_map(|template| template.lines());
        delivered.any(|delivered| delivered.ends_with(MARK) && delivered == line.trim())
    };
    let lines = text.lines().enumerate().filter(|(_, line)| is_delivered(line));
    let marked = lines.map(|(index, line)| {
        let line = line.trim().trim_end_matches(MARK);
        format!("line {}: {line}: as delivered; correct it, or delete the mark CHECK", index + 1)
    });
    let unknown = config.axes().filter(|axis| axis.serial_number == 0);
    let unknown = unknown.map(|axis| {
        let motor = axis.motor;
        format!("ports.axes[motor {motor}].serial_number = 0: no drive has it (object 0x1018:04)")
    });
    marked.chain(unknown).collect()
}
