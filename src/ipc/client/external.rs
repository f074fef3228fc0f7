//! Telling the controller what a camera or another sensor saw.

use std::sync::Arc;

use iceoryx2::port::publisher::Publisher;

use super::ClientError;
use super::commander::{open, padded, send};
use super::link::{Flavour, Link, Port};
use crate::clock;
use crate::ipc::domain::Domain;
use crate::ipc::payload::ExternalPosition;
use crate::ipc::service;
use crate::units::{Nanos, OutputVec};

/// Publishes `external/measured_jp`.
///
/// It can be created before there is a controller and lives through its restarts: while there is
/// none, [`ExternalPublisher::publish`] says [`ClientError::NoController`] and the message is lost,
/// which for a sensor is right. A controller that starts is found within 20 ms.
///
/// `Send`, so it can be created in one thread and used in another.
#[derive(Debug)]
pub struct ExternalPublisher {
    link: Arc<Link>,
    port: Port<Publisher<Flavour, ExternalPosition, ()>>,
    sequence: u64,
}

impl ExternalPublisher {
    /// A publisher for this domain. Opens nothing yet.
    #[must_use]
    pub fn new(domain: &Domain) -> Self {
        Self {
            link: Link::new(domain),
            port: Port::default(),
            sequence: 0,
        }
    }

    /// Publishes one observation of unknown quality.
    ///
    /// - `stamp`: when the picture was taken, on the clock of [`crate::clock::now`].
    /// - `position`: pitch and yaw, rad (x, y, z, m).
    /// - `deviation`: standard deviation of every entry, 0 or an empty slice where unknown.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`] while nobody serves the domain, [`ClientError::Count`] for a
    /// wrong number of values, [`ClientError::Transport`] when iceoryx2 refuses.
    pub fn publish(
        &mut self,
        stamp: Nanos,
        position: &[f64],
        deviation: &[f64],
    ) -> Result<(), ClientError> {
        self.publish_judged(stamp, position, deviation, 0.0)
    }

    /// As [`ExternalPublisher::publish`], for a sensor that says how far it trusts what it saw:
    /// `quality` up to 1.
    ///
    /// # Errors
    ///
    /// As [`ExternalPublisher::publish`].
    pub fn publish_judged(
        &mut self,
        stamp: Nanos,
        position: &[f64],
        deviation: &[f64],
        quality: f64,
    ) -> Result<(), ClientError> {
        let (position, count) = padded(position)?;
        let deviation = if deviation.is_empty() {
            OutputVec::default()
        } else {
            padded(deviation)?.0
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

    /// Publishes that the sensor looked but saw nothing.
    ///
    /// # Errors
    ///
    /// As [`ExternalPublisher::publish`].
    pub fn publish_nothing(&mut self, stamp: Nanos) -> Result<(), ClientError> {
        self.send(ExternalPosition {
            stamp_ns: stamp.0,
            ..ExternalPosition::default()
        })
    }

    fn send(&mut self, message: ExternalPosition) -> Result<(), ClientError> {
        self.sequence += 1;
        let publisher = self.port.get(&self.link, clock::now(), |session| {
            open(session, service::EXTERNAL)
        })?;
        let message = ExternalPosition {
            sequence: self.sequence,
            ..message
        };
        send(publisher, message, &self.link, service::EXTERNAL)
    }
}
