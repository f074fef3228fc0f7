//! Model, ports and drives at the start of the controller.

use std::path::PathBuf;

use crate::COMMIT;
use crate::clock;
use crate::config::Config;
use crate::core::Gated;
use crate::drive::AxisIdentity;
use crate::drive::error::DriveError;
use crate::drive::exclusive_use::WatchdogEntry;
use crate::drive::port::{Opened, Port};
use crate::drive::port_runner::{AxisLink, PortRunner};
use crate::drive::serial_transport::SerialTransport;
use crate::model::{Model, ModelError};
use crate::units::Nanos;

/// Maximum time until the port threads have read the first positions: a few exchanges, unless the
/// machine stalls.
const FIRST_POSITIONS: Nanos = Nanos::from_millis(2000);

/// Why the model of the configuration cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum StartModelError {
    /// The model is missing, damaged or writable by others.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The model is of another robot, or marked as worthless.
    #[error("model file {path} {source}")]
    Use {
        /// The file.
        path: PathBuf,
        /// Why this robot may not use it.
        source: ModelError,
    },
}

/// Loads the model of the configuration, if it names one.
pub fn load_model(config: &Config) -> Result<Option<Model>, StartModelError> {
    let Some(path) = &config.control.model else {
        return Ok(None);
    };
    let model = Model::load_trusted(path)?;
    config
        .check_model(&model)
        .map_err(|source| StartModelError::Use { path: path.clone(), source })?;
    Ok(Some(model))
}

/// Version and commit of this software.
pub fn software() -> String {
    format!("i2ris {} ({COMMIT})", env!("CARGO_PKG_VERSION"))
}

/// All drives, ready to be enabled.
pub struct Drives {
    pub runners: Vec<PortRunner<SerialTransport, Gated>>,
    pub links: Vec<AxisLink<Gated>>,
    pub identities: Vec<AxisIdentity>,
    /// How long an exchange takes on each port.
    pub exchanges: Vec<Nanos>,
}

/// Opens all ports, then configures them, so that a missing port is detected before any drive is
/// changed.
pub fn bring_up_ports(config: &Config, watchdog: &WatchdogEntry) -> Result<Drives, DriveError> {
    let opened = config.ports.iter().map(|port| Port::<Opened>::open_with(port, watchdog));
    let opened = opened.collect::<Result<Vec<_>, _>>()?;
    let mut drives = Drives {
        runners: Vec::new(),
        links: Vec::new(),
        identities: Vec::new(),
        exchanges: Vec::new(),
    };
    for port in opened {
        let port = port.bring_up()?;
        drives.exchanges.push(port.exchange());
        drives.identities.extend_from_slice(port.axes());
        let (runner, links) = port.split();
        drives.runners.push(runner);
        drives.links.extend(links);
    }
    Ok(drives)
}

/// Waits until the port threads have read positions. The positions from bring-up may be old, and
/// the loop would report a lost drive. A drive that is really lost is left to the loop, which names
/// it.
pub fn wait_for_positions(links: &mut [AxisLink<Gated>]) {
    let start = clock::now();
    let is_fresh = |link: &mut AxisLink<Gated>| link.feedback.read().stamp >= start;
    while !links.iter_mut().all(is_fresh) && clock::now() - start < FIRST_POSITIONS {
        clock::sleep(Nanos::from_millis(1));
    }
}
