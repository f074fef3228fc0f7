//! A serial port with the axes behind it, from opened to ready to run.
//!
//! ```text
//! Port<Opened> -identify-> Port<Identified> -configure-> Port<Configured> -split-> PortRunner + one AxisLink per axis
//! ```

use crate::config::{AxisConfig, PortConfig};

use super::bring_up::{self, AxisIdentity};
use super::error::{AxisFault, DriveError, LinkError};
use super::exchange::Link;
use super::family::{self, Parts};
use super::runner::{AxisLink, PortRunner};
use super::serial::SerialTransport;
use super::transport::Transport;
use crate::units::{Counts, Nanos};

/// A port whose stage of bring-up is `Stage`.
#[derive(Debug)]
pub struct Port<Stage, T = SerialTransport> {
    link: Link<T>,
    config: PortConfig,
    stage: Stage,
}

/// The port is open; who is behind it is not known.
#[derive(Debug)]
pub struct Opened(());

/// Every axis is the drive that was configured, and its power stage is off.
#[derive(Debug)]
pub struct Identified {
    axes: Vec<AxisIdentity>,
    exchange: Nanos,
}

/// Every axis has its limits.
#[derive(Debug)]
pub struct Configured {
    axes: Vec<AxisIdentity>,
    exchange: Nanos,
    /// Where each axis stands.
    stands: Vec<Counts>,
}

impl Port<Opened> {
    /// Opens the serial port, for this process alone.
    ///
    /// # Errors
    ///
    /// When the device does not exist, may not be opened, is in use, or is no serial port.
    pub fn open(config: &PortConfig) -> Result<Self, DriveError> {
        Ok(Self::over(SerialTransport::open(config)?, config))
    }
}

impl<T: Transport> Port<Opened, T> {
    /// Takes a line that is open already.
    pub fn over(transport: T, config: &PortConfig) -> Self {
        Self {
            link: Link::new(transport, family::of_port(config), config),
            config: config.clone(),
            stage: Opened(()),
        }
    }

    /// Checks that every axis is the drive that was configured, and switches off what a former
    /// controller left on. Nothing is enabled. A drive in fault is left so, for the operator.
    ///
    /// # Errors
    ///
    /// When a drive does not answer, is another one, or does not go off.
    pub fn identify(mut self) -> Result<Port<Identified, T>, DriveError> {
        let mut axes = Vec::new();
        for axis in &self.config.axes {
            let parts = family::of_axis(&self.config, axis).parts();
            let identity = identify(&mut self.link, axis, parts)
                .map_err(|fault| explain(&self.config, axis, fault))?;
            axes.push(identity);
        }
        let exchange = match self.config.axes.first() {
            Some(axis) => bring_up::time_exchanges(&mut self.link)
                .map_err(|fault| explain(&self.config, axis, fault))?,
            None => Nanos::ZERO,
        };
        Ok(Port {
            link: self.link,
            config: self.config,
            stage: Identified { axes, exchange },
        })
    }

    /// All of bring-up.
    ///
    /// # Errors
    ///
    /// As [`Port::identify`] and [`Port::configure`].
    pub fn bring_up(self) -> Result<Port<Configured, T>, DriveError> {
        self.identify()?.configure()
    }
}

impl<T: Transport> Port<Identified, T> {
    /// Who is behind the port, in the order of the configuration.
    pub fn axes(&self) -> &[AxisIdentity] {
        &self.stage.axes
    }

    /// Writes the limits of every axis, reads them back and compares.
    ///
    /// # Errors
    ///
    /// When a drive does not answer, or does not take a limit.
    pub fn configure(mut self) -> Result<Port<Configured, T>, DriveError> {
        let mut stands = Vec::new();
        for axis in &self.config.axes {
            let settings = family::of_axis(&self.config, axis).settings(axis);
            bring_up::configure(&mut self.link, axis.node_id, &settings)
                .map_err(|fault| explain(&self.config, axis, fault))?;
            let position = family::of_axis(&self.config, axis).parts().position;
            let found = bring_up::read(&mut self.link, axis.node_id, position);
            stands.push(Counts(
                found.map_err(|fault| explain(&self.config, axis, fault))?,
            ));
        }
        Ok(Port {
            link: self.link,
            config: self.config,
            stage: Configured {
                axes: self.stage.axes,
                exchange: self.stage.exchange,
                stands,
            },
        })
    }
}

impl<T: Transport> Port<Configured, T> {
    /// Who is behind the port, in the order of the configuration.
    pub fn axes(&self) -> &[AxisIdentity] {
        &self.stage.axes
    }

    /// What half of the exchanges take at least, as measured.
    pub fn exchange_time(&self) -> Nanos {
        self.stage.exchange
    }

    /// Parts the port into the thread's end and the control loop's ends, in the order of the
    /// configuration.
    #[must_use]
    pub fn split(self) -> (PortRunner<T>, Vec<AxisLink>) {
        PortRunner::with_links(
            self.link,
            &self.config,
            self.stage.axes,
            self.stage.exchange,
            &self.stage.stands,
        )
    }
}

fn identify<T: Transport>(
    link: &mut Link<T>,
    axis: &AxisConfig,
    parts: &Parts,
) -> Result<AxisIdentity, AxisFault> {
    bring_up::know_line(link)?;
    bring_up::check_identity(link, axis, parts)?;
    let identity = bring_up::read_identity(link, axis, parts)?;
    bring_up::switch_off(link, axis.node_id, parts)?;
    Ok(identity)
}

/// What a fault at bring-up means to a person.
pub(super) fn explain(port: &PortConfig, axis: &AxisConfig, fault: AxisFault) -> DriveError {
    let (device, node) = (port.device.clone(), axis.node_id);
    match fault {
        AxisFault::Exchange {
            error: LinkError::Lost | LinkError::Unanswered,
            ..
        } => DriveError::NoAnswer {
            device,
            baud: port.baud,
            node,
        },
        fault => DriveError::Axis {
            device,
            node,
            fault,
        },
    }
}
