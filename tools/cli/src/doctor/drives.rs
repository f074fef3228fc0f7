//! `i2ris doctor drives`: reads and compares drive settings. Nothing is written to a drive.

use std::fs;
use std::path::{Path, PathBuf};

use i2ris::config::{Config, Family};
use i2ris::drive::fingerprint::{differences, key, read_port, settings};
use i2ris::model::Model;
use i2ris::robot::DriveFingerprint;
use i2ris_report::{DomainOption, Failure, bail, while_working};
use i2ris_simulation::drive::DeviceFile;

/// Arguments of `i2ris doctor drives`.
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
    match &arguments.first {
        Some(first) => compare(arguments, first),
        None => {
            println!("{}", serde_json::to_string_pretty(&read(arguments)?)?);
            Ok(())
        }
    }
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
    let model = Model::load(path).map_err(|_| {
        format!(
            "{} contains no settings: name a file of `i2ris doctor drives`, a model, or a DCF \
             file",
            path.display()
        )
    })?;
    let drives = &model.file().training.drives;
    if drives.is_empty() {
        let path = path.display();
        bail!("the model {path} does not name the drives it was made with");
    }
    Ok((drives.clone(), false))
}

/// The settings in a device file, which names no motor.
pub fn of_device(file: &DeviceFile) -> DriveFingerprint {
    let family = match file.family {
        i2ris_simulation::drive::Family::Epos4 => Family::Epos4,
        i2ris_simulation::drive::Family::Epos2 => Family::Epos2,
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
