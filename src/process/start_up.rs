//! Model, ports and drives at the start of the controller.

use std::io::Write;
use std::path::PathBuf;

use crate::config::Config;
use crate::core::Gated;
use crate::drive::AxisIdentity;
use crate::drive::capture::{Capture, CapturedLine};
use crate::drive::error::DriveError;
use crate::drive::fingerprint::differences_of_model;
use crate::drive::line_turn::{LoopBeat, PortLife, PortTurn};
use crate::drive::port::Port;
use crate::drive::port_runner::{AxisLink, PortRunner};
use crate::drive::serial_transport::SerialTransport;
use crate::model::{Model, ModelError};
use crate::process::black_box::write_failed_start;
use crate::process::run_log::write_line;
use crate::robot::DriveFingerprint;
use crate::units::Nanos;
use crate::{COMMIT, clock};

/// Maximum time until the first positions: a few exchanges, unless the machine stalls.
const FIRST_POSITIONS: Nanos = Nanos::from_millis(2000);

#[derive(Debug, thiserror::Error)]
pub enum StartModelError {
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error("model file {path} {source}")]
    Use {
        path: PathBuf,
        /// Why this robot may not use it.
        source: ModelError,
    },
    #[error(
        "model file {path} {differences}; or start without `control.model`, then `i2ris model use \
         {path} --other-drive`"
    )]
    OtherDrive { path: PathBuf, differences: String },
}

pub(crate) fn load_model(config: &Config) -> Result<Option<Model>, StartModelError> {
    let Some(path) = &config.control.model else {
        return Ok(None);
    };
    let model = Model::load_trusted(path)?;
    config
        .check_model(&model)
        .map_err(|source| StartModelError::Use { path: path.clone(), source })?;
    Ok(Some(model))
}

/// Maximum number of settings named in a message.
const MAX_NAMED_SETTINGS: usize = 5;

/// Checks that a model was calibrated with the present drive settings.
pub(crate) fn check_drives(model: &Model, drives: &[DriveFingerprint]) -> Result<(), String> {
    let calibrated = &model.file().training.drives;
    let found = differences_of_model(calibrated, drives, model.motors());
    if found.is_empty() {
        return Ok(());
    }
    let more = found.len().saturating_sub(MAX_NAMED_SETTINGS);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    Err(format!(
        "was calibrated with different drive settings (calibration -> now): {}{more}; restore \
         them, or recalibrate",
        found[..found.len().min(MAX_NAMED_SETTINGS)].join(", ")
    ))
}

pub(super) fn software() -> String {
    format!("i2ris {} ({COMMIT})", env!("CARGO_PKG_VERSION"))
}

/// A serial port whose traffic is captured.
pub(super) type PortLine = CapturedLine<SerialTransport>;

/// All drives, ready to be enabled.
#[derive(Default)]
pub(super) struct Drives {
    pub runners: Vec<PortRunner<PortLine, Gated>>,
    pub links: Vec<AxisLink<Gated>>,
    pub identities: Vec<AxisIdentity>,
    pub captures: Vec<Capture>,
    pub fingerprints: Vec<DriveFingerprint>,
    /// Duration of an exchange on each port.
    pub exchanges: Vec<Nanos>,
    pub beat: LoopBeat,
    pub lives: Vec<PortLife>,
}

impl Drives {
    fn bring_up(&mut self, opened: Vec<Port<PortLine>>) -> Result<(), DriveError> {
        for port in opened {
            let mut port = port.bring_up()?;
            self.fingerprints.extend(port.read_fingerprints()?);
            self.exchanges.push(port.exchange);
            self.identities.extend_from_slice(&port.axes);
            let (runner, links) = port.split();
            self.runners.push(runner);
            self.links.extend(links);
        }
        Ok(())
    }
}

/// Opens all ports, then configures them, so that a missing port is detected before any drive is
/// changed. If a drive fails, the port traffic is written to a file.
pub(crate) fn bring_up_ports(
    config: &Config,
    beat: LoopBeat,
    log: &mut dyn Write,
) -> Result<Drives, DriveError> {
    let (mut opened, mut captures, mut lives) = (Vec::new(), Vec::new(), Vec::new());
    for port in &config.ports {
        let turn = PortTurn::new(&beat);
        lives.push(turn.life());
        let line = SerialTransport::open_with(port, turn)?;
        let (line, capture) = CapturedLine::new(line, port);
        captures.push(capture);
        opened.push(Port::over(line, port));
    }
    let mut drives = Drives { captures, beat, lives, ..Drives::default() };
    if let Err(error) = drives.bring_up(opened) {
        match write_failed_start(&config.record_folder, &drives.captures, &software()) {
            Ok(path) => {
                let path = path.display();
                write_line(log, format_args!("serial capture of the failed start: {path}"));
            }
            Err(error) => write_line(log, format_args!("warning: {error}")),
        }
        return Err(error);
    }
    Ok(drives)
}

/// Waits until the port threads have read positions: with the older positions of bring-up, the loop
/// would report a lost drive. A drive that is really lost is left to the loop, which names it.
pub(super) fn wait_for_positions(links: &mut [AxisLink<Gated>]) {
    let start = clock::now();
    let is_fresh = |link: &mut AxisLink<Gated>| link.feedback.read().stamp >= start;
    while !links.iter_mut().all(is_fresh) && clock::now() - start < FIRST_POSITIONS {
        clock::sleep(Nanos::from_millis(1));
    }
}
