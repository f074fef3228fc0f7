//! A serial port and its axes, from opened to ready to run.
//!
//! ```text
//! Port -bring_up-> ReadyPort -split-> PortRunner + one AxisLink per axis
//! ```

use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::config::{AxisConfig, PortConfig};
use crate::drive::bring_up::{self, AxisIdentity, DriveNode, explain};
use crate::drive::error::{AxisError, DriveError};
use crate::drive::family::DriveFamily;
use crate::drive::family_selection::{family_of_axis, family_of_port};
use crate::drive::fingerprint;
use crate::drive::link::DriveLink;
use crate::drive::object::{self, Setting};
use crate::drive::port_runner::{AxisLink, PortRequest, PortRunner};
use crate::drive::serial_transport::SerialTransport;
use crate::drive::transport::Transport;
use crate::file_permissions::read_trusted;
use crate::robot::DriveFingerprint;
use crate::units::{Counts, Nanos};

/// An open port; its drives are unknown.
#[derive(Debug)]
pub struct Port<T = SerialTransport> {
    link: DriveLink<T>,
    config: PortConfig,
}

/// A port on which every axis is the configured drive, is off, and has its limits.
#[derive(Debug)]
pub struct ReadyPort<T = SerialTransport> {
    link: DriveLink<T>,
    config: PortConfig,
    /// The drives, in the order of the configuration.
    pub axes: Vec<AxisIdentity>,
    /// Median duration of an exchange.
    pub exchange: Nanos,
    positions: Vec<Counts>,
}

impl Port {
    /// Opens the serial port, locked against other programs. Fails when the device does not exist,
    /// may not be opened, is in use, or is not a serial port.
    pub fn open(config: &PortConfig) -> Result<Self, DriveError> {
        Ok(Self::over(SerialTransport::open(config)?, config))
    }
}

impl<T: Transport> Port<T> {
    /// A port over an open line.
    pub fn over(transport: T, config: &PortConfig) -> Self {
        let link = DriveLink::new(transport, family_of_port(config), config);
        Self { link, config: config.clone() }
    }

    /// Checks that every axis is the configured drive, and switches off drives that a previous
    /// controller left enabled. Then writes the limits of every axis, reads them back and compares.
    /// Enables nothing. A fault is left for the operator. Fails when a drive does not answer, is
    /// not the configured one, does not switch off, or does not accept a limit, and when an adapter
    /// holds its replies back.
    pub fn bring_up(self) -> Result<ReadyPort<T>, DriveError> {
        let Self { mut link, config } = self;
        let (mut axes, mut positions) = (Vec::new(), Vec::new());
        for axis in &config.axes {
            let identity = identify(&mut link, &config, axis);
            axes.push(identity.map_err(|error| explain(&config, axis, error))?);
        }
        let exchange = match config.axes.first() {
            Some(axis) => time_exchanges(&mut link, &config, axis)?,
            None => Nanos::ZERO,
        };
        for (axis, identity) in config.axes.iter().zip(&mut axes) {
            let family = family_of_axis(&config, axis);
            let drive = DriveNode::new(&mut link, axis.node_id);
            let position = configure(drive, family, axis, identity);
            let position = position.map_err(|error| explain(&config, axis, error))?;
            positions.push(Counts(position));
        }
        Ok(ReadyPort { link, config, axes, exchange, positions })
    }
}

impl<T: Transport> ReadyPort<T> {
    /// Every setting of every axis. Writes nothing.
    pub(crate) fn read_fingerprints(&mut self) -> Result<Vec<DriveFingerprint>, DriveError> {
        fingerprint::read_axes(&mut self.link, &self.config)
    }

    /// Splits the port into its thread's end and the loop's, in the order of the configuration.
    pub fn split<R: PortRequest>(self) -> (PortRunner<T, R>, Vec<AxisLink<R>>) {
        let Self { link, config, axes, exchange, positions } = self;
        PortRunner::with_links(link, &config, axes, exchange, &positions)
    }
}

/// How much longer than usual an exchange with an adapter at 16 ms takes, at least.
const HELD_BACK: Nanos = Nanos::from_millis(10);

/// A timer holds every reply back, a computer that stalls does not.
const ATTEMPTS: usize = 3;

/// Median duration of an exchange.
fn time_exchanges(
    link: &mut DriveLink<impl Transport>,
    port: &PortConfig,
    axis: &AxisConfig,
) -> Result<Nanos, DriveError> {
    let mut exchange = Nanos::ZERO;
    for _ in 0..ATTEMPTS {
        let [quarter, median] =
            bring_up::time_exchanges(link).map_err(|error| explain(port, axis, error))?;
        if quarter < port.nominal_exchange() + HELD_BACK {
            return Ok(median);
        }
        exchange = quarter;
    }
    Err(DriveError::SlowAdapter { device: port.device.clone(), exchange })
}

fn identify(
    link: &mut DriveLink<impl Transport>,
    port: &PortConfig,
    axis: &AxisConfig,
) -> Result<AxisIdentity, AxisError> {
    bring_up::prepare_line(link)?;
    let mut drive = DriveNode::new(link, axis.node_id);
    drive.check_identity(axis.serial_number)?;
    let identity = drive.read_identity(axis, family_of_axis(port, axis))?;
    drive.switch_off()?;
    Ok(identity)
}

/// Writes the settings of an axis, and those of its homing, so that a drive that cannot be homed as
/// configured is refused at the start. Returns its position.
fn configure(
    mut drive: DriveNode<'_, impl Transport>,
    family: &dyn DriveFamily,
    axis: &AxisConfig,
    identity: &mut AxisIdentity,
) -> Result<i32, AxisError> {
    let mut settings = family.settings(axis);
    // Homing lowers the current limit, and restores it.
    let homing = family.homing(axis);
    let is_other =
        |setting: &&Setting| !homing.restored.iter().any(|it| it.object == setting.object);
    settings.extend(homing.settings.iter().filter(is_other));
    let left_out = &mut identity.left_out;
    drive.configure(&settings, identity.model, &mut |object| left_out.push(object))?;
    let current = family.object_map().current;
    if drive.read_if_present(current)?.is_none() {
        left_out.push(current);
    }
    drive.read(object::POSITION)
}

/// The position of one drive at an orderly end of the controller, saved for its next start.
///
/// An incremental encoder loses its position with its power, and a drive that kept its power may
/// have been moved by hand or by another program. The drive reports whether it is homed; a saved
/// position can only revoke that, never grant it. An axis is not homed if its position differs from
/// the saved one, or if none was saved because the controller was killed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::drive) struct SavedPosition {
    pub(in crate::drive) serial_number: u32,
    pub(in crate::drive) position: Counts,
}

#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedPositions {
    axes: Vec<SavedPosition>,
}

/// Longest file, bytes.
const MAX_FILE_BYTES: u64 = 1 << 16;

/// Reads and removes the file: a position is valid for one start. A file that cannot be read or
/// removed, or that another user may have written, is empty.
pub(in crate::drive) fn take_positions(file: &Path) -> Vec<SavedPosition> {
    let text = read_trusted(file, MAX_FILE_BYTES).unwrap_or_default();
    let Ok(()) = fs::remove_file(file) else { return Vec::new() };
    toml::from_str::<SavedPositions>(&text).unwrap_or_default().axes
}

pub(in crate::drive) fn save_positions(file: &Path, axes: Vec<SavedPosition>) -> io::Result<()> {
    let text = toml::to_string(&SavedPositions { axes }).map_err(io::Error::other)?;
    // Renamed when complete: an older file must not survive a partial write.
    let draft = file.with_extension("draft");
    // A FIFO or a link in its place would block, or lead elsewhere.
    let _ = fs::remove_file(&draft);
    let created = OpenOptions::new().write(true).create_new(true).mode(0o600).open(&draft);
    created?.write_all(text.as_bytes())?;
    fs::rename(&draft, file)
}

#[cfg(test)]
mod tests {
    use nix::sys::stat::Mode;
    use nix::unistd::mkfifo;

    use super::*;

    #[test]
    fn a_saved_position_is_valid_for_one_start() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("positions.toml");
        let position = SavedPosition { serial_number: 62_000_001, position: Counts(-417) };
        save_positions(&file, vec![position]).unwrap();
        assert_eq!(take_positions(&file), [position]);
        assert!(take_positions(&file).is_empty());
        fs::write(&file, "axes = 3").unwrap();
        assert!(take_positions(&file).is_empty());
        assert!(!file.exists());
    }

    #[test]
    fn fifo_in_place_of_file_blocks_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("positions.toml");
        for fifo in [&file, &file.with_extension("draft")] {
            mkfifo(fifo, Mode::S_IRWXU).unwrap();
        }
        assert!(take_positions(&file).is_empty());
        let position = SavedPosition { serial_number: 62_000_001, position: Counts(7) };
        save_positions(&file, vec![position]).unwrap();
        assert_eq!(take_positions(&file), [position]);
    }
}
