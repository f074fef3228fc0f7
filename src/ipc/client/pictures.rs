//! Pictures of cameras, from the program that takes them to those that record them. The controller
//! does not see them: the service is made by whoever comes first, and lives as long as the
//! controller's shared memory.

use std::sync::Arc;

use iceoryx2::node::Node;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{AllocationStrategy, ServiceName, ZeroCopySend};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::controller_link::{ClientService, ControllerLink, SessionPort};
use super::error::ClientError;
use crate::clock;
use crate::ipc::domain::Domain;
use crate::ipc::payload::{padded_text, unpadded_text};
use crate::ipc::service::{TransportError, failed};
use crate::units::Nanos;

const SERVICE: &str = "i2ris/picture";
/// Cameras at the same time.
const CAMERAS: usize = 4;
/// Unread pictures of a recorder before the oldest are overwritten: half a second.
const BUFFER: usize = 16;
/// Room that a camera begins with; a larger picture makes more.
const FIRST_LENGTH: usize = 1 << 18;

/// Header before the bytes of a picture.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ZeroCopySend)]
#[type_name("I2risPictureV1")]
#[repr(C)]
pub struct PictureHeader {
    /// Counts up by one per picture of one camera.
    pub sequence: u64,
    /// Exposure.
    pub stamp_ns: u64,
    /// Name of the camera, UTF-8, padded with 0.
    pub view: [u8; 24],
}

impl PictureHeader {
    /// Name of the camera.
    #[must_use]
    pub fn view(&self) -> String {
        unpadded_text(&self.view)
    }
}

type Service = PortFactory<ClientService, [u8], PictureHeader>;

fn service(node: &Node<ClientService>) -> Result<Service, TransportError> {
    let name = ServiceName::new(SERVICE).map_err(failed("name", SERVICE))?;
    node.service_builder(&name)
        .publish_subscribe::<[u8]>()
        .user_header::<PictureHeader>()
        .max_publishers(CAMERAS)
        .subscriber_max_buffer_size(BUFFER)
        .enable_safe_overflow(true)
        .open_or_create()
        .map_err(failed("open", SERVICE))
}

/// Hands on the pictures of one camera.
#[derive(Debug)]
pub struct PicturePublisher {
    link: Arc<ControllerLink>,
    port: SessionPort<Publisher<ClientService, [u8], PictureHeader>>,
    header: PictureHeader,
}

impl PicturePublisher {
    /// A publisher of this camera. Opens nothing yet.
    #[must_use]
    pub fn new(domain: &Domain, view: &str) -> Self {
        let header = PictureHeader { view: padded_text(view), ..PictureHeader::default() };
        Self { link: ControllerLink::new(domain), port: SessionPort::default(), header }
    }

    /// Hands on a JPEG, exposed at `stamp`. Does not wait: who reads too slowly loses the oldest.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`] while no controller serves the domain,
    /// [`ClientError::Transport`] when iceoryx2 fails.
    pub fn publish(&mut self, stamp: Nanos, jpeg: &[u8]) -> Result<(), ClientError> {
        self.header.sequence += 1;
        self.header.stamp_ns = stamp.0;
        let port = self.port.get(&self.link, clock::now(), |session| {
            let service = service(&session.node)?;
            let publisher = service.publisher_builder().initial_max_slice_len(FIRST_LENGTH);
            let publisher = publisher.allocation_strategy(AllocationStrategy::PowerOfTwo);
            publisher.create().map_err(failed("publish", SERVICE))
        })?;
        let loan = port.loan_slice_uninit(jpeg.len()).map_err(failed("loan", SERVICE))?;
        let mut picture = loan.write_from_slice(jpeg);
        *picture.user_header_mut() = self.header;
        picture.send().map_err(failed("send", SERVICE))?;
        Ok(())
    }
}

/// Receives the pictures of all cameras.
#[derive(Debug)]
pub struct PictureSubscription {
    link: Arc<ControllerLink>,
    port: SessionPort<Subscriber<ClientService, [u8], PictureHeader>>,
}

impl PictureSubscription {
    /// A subscription in this domain. Opens nothing yet.
    #[must_use]
    pub fn new(domain: &Domain) -> Self {
        Self { link: ControllerLink::new(domain), port: SessionPort::default() }
    }

    /// Passes every unread picture to `take`, oldest first. Does not wait.
    ///
    /// # Errors
    ///
    /// See [`PicturePublisher::publish`].
    pub fn drain(
        &mut self,
        mut take: impl FnMut(&PictureHeader, &[u8]),
    ) -> Result<(), ClientError> {
        let port = self.port.get(&self.link, clock::now(), |session| {
            let service = service(&session.node)?;
            let subscriber = service.subscriber_builder().buffer_size(BUFFER);
            subscriber.create().map_err(failed("subscribe to", SERVICE))
        })?;
        // Bounded, because a camera may be as fast as we are.
        for _ in 0..BUFFER * CAMERAS {
            let Some(picture) = port.receive().map_err(failed("receive", SERVICE))? else { break };
            take(picture.user_header(), picture.payload());
        }
        Ok(())
    }
}
