//! Publishing measurements of a camera or another sensor.

use std::sync::Arc;

use super::commander::{CommandPublisher, padded};
use super::controller_link::ControllerLink;
use super::error::ClientError;
use crate::ipc::domain::Domain;
use crate::ipc::payload::ExternalPosition;
use crate::ipc::streams::Stream;
use crate::units::{Nanos, OutputVec};

/// Publishes `external/measured_jp`.
///
/// It can be created before the controller starts and survives its restarts: while none is running,
/// [`ExternalPublisher::publish`] returns [`ClientError::NoController`] and the message is lost. A
/// controller that starts is found within 20 ms.
#[derive(Debug)]
pub struct ExternalPublisher {
    link: Arc<ControllerLink>,
    publisher: CommandPublisher<ExternalPosition>,
    sequence: u64,
}

impl ExternalPublisher {
    /// A publisher for this domain. Opens nothing yet.
    #[must_use]
    pub fn new(domain: &Domain) -> Self {
        Self {
            link: ControllerLink::new(domain),
            publisher: CommandPublisher::new(Stream::External),
            sequence: 0,
        }
    }

    /// Publishes one measurement of unknown quality.
    ///
    /// - `stamp`: time of the exposure, on the clock of [`crate::clock::now`].
    /// - `position`: pitch and yaw, rad (x, y, z, m).
    /// - `deviation`: standard deviation of every entry; 0 or an empty slice if unknown.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`] while no controller serves the domain, [`ClientError::Count`]
    /// for a wrong number of values, [`ClientError::Transport`] when iceoryx2 fails.
    pub fn publish(
        &mut self,
        stamp: Nanos,
        position: &[f64],
        deviation: &[f64],
    ) -> Result<(), ClientError> {
        self.publish_with_quality(stamp, position, deviation, 0.0)
    }

    /// Publishes as [`ExternalPublisher::publish`], with the sensor's confidence `quality`, up to
    /// 1.
    ///
    /// # Errors
    ///
    /// See [`ExternalPublisher::publish`].
    pub fn publish_with_quality(
        &mut self,
        stamp: Nanos,
        position: &[f64],
        deviation: &[f64],
        quality: f64,
    ) -> Result<(), ClientError> {
        let (position, count) = padded(position)?;
        let deviation = match deviation {
            [] => OutputVec::default(),
            deviation => padded(deviation)?.0,
        };
        self.send(ExternalPosition {
            stamp_ns: stamp.0,
            position,
            deviation,
            quality,
            count,
            flags: ExternalPosition::VALID,
            ..ExternalPosition::default()
        })
    }

    /// Publishes that the sensor has no detection.
    ///
    /// # Errors
    ///
    /// See [`ExternalPublisher::publish`].
    pub fn publish_nothing(&mut self, stamp: Nanos) -> Result<(), ClientError> {
        self.send(ExternalPosition { stamp_ns: stamp.0, ..ExternalPosition::default() })
    }

    fn send(&mut self, message: ExternalPosition) -> Result<(), ClientError> {
        self.sequence += 1;
        let sequence = self.sequence;
        let numbered = ExternalPosition { sequence, ..message };
        self.publisher.send(&self.link, |_| numbered)
    }
}
