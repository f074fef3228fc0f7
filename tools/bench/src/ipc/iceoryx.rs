//! iceoryx2 alone: a publish-subscribe service of 64 bytes, polled or with an event service that
//! wakes the receiver.

use std::os::fd::BorrowedFd;
use std::time::Duration;

use i2ris::ipc::{Domain, DomainLock, random_id};
use i2ris::units::Nanos;
use iceoryx2::node::Node;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{
    Config, FileDescriptorBased, FileName, NodeBuilder, Path, SemanticString, SignalHandlingMode,
    ipc,
};
use iceoryx2::service::port_factory::event::PortFactory as EventFactory;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, poll};

use super::pair::{BYTES, Turn, measure};
use crate::durations::Durations;
use crate::error::BenchError;

type Words = [u64; BYTES / 8];

/// The longest wait of a receiver.
const WAIT_TIMEOUT: Duration = Duration::from_millis(20);
const WAIT_TIMEOUT_MS: u16 = 20;

/// How a receiver waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Waiting {
    /// Not at all.
    Polled,
    /// [`receive_or_wait`].
    Woken,
    /// With the wait of iceoryx2.
    WokenByLibrary,
}

/// A domain for this run alone. Its guard removes the shared memory at the end.
pub fn domain() -> Result<Domain, BenchError> {
    Ok(Domain::new(&format!("bench-{:08x}", random_id() as u32))?)
}

pub fn failed<E: std::fmt::Debug>(step: &'static str) -> impl FnOnce(E) -> BenchError {
    move |error| BenchError::Transport { step, reason: format!("{error:?}") }
}

/// A node in a subfolder of a domain, apart from the services of the controller.
pub fn node(domain: &Domain) -> Result<Node<ipc::Service>, BenchError> {
    let mut config = Config::default();
    let root = domain.directory().join("bench");
    let path = Path::new(root.as_os_str().as_encoded_bytes()).map_err(failed("name a folder"))?;
    config.global.set_root_path(&path);
    let prefix = format!("{}bench_", domain.prefix());
    config.global.prefix =
        FileName::new(prefix.as_bytes()).map_err(failed("name shared memory"))?;
    let builder =
        NodeBuilder::new().config(&config).signal_handling_mode(SignalHandlingMode::Disabled);
    builder.create().map_err(failed("create a node"))
}

fn stream(node: &Node<ipc::Service>) -> Result<PortFactory<ipc::Service, Words, ()>, BenchError> {
    let name = "bench/words".try_into().map_err(failed("name a service"))?;
    let service = node.service_builder(&name).publish_subscribe::<Words>();
    service
        .subscriber_max_buffer_size(16)
        .open_or_create()
        .map_err(failed("open a publish-subscribe service"))
}

fn event_service(node: &Node<ipc::Service>) -> Result<EventFactory<ipc::Service>, BenchError> {
    let name = "bench/bell".try_into().map_err(failed("name a service"))?;
    let service = node.service_builder(&name).event();
    service.open_or_create().map_err(failed("open an event service"))
}

/// The sending end of the event service.
pub fn notifier(node: &Node<ipc::Service>) -> Result<Notifier<ipc::Service>, BenchError> {
    let service = event_service(node)?;
    service.notifier_builder().create().map_err(failed("create a notifier"))
}

/// The receiving end of the event service.
pub fn listener(node: &Node<ipc::Service>) -> Result<Listener<ipc::Service>, BenchError> {
    let service = event_service(node)?;
    service.listener_builder().create().map_err(failed("create a listener"))
}

/// Receives a message, or waits for an event if there is none, for a limited time.
///
/// The wait of iceoryx2 ([`Listener::timed_wait`]) makes three system calls before it sleeps and
/// three after it was woken, before it returns: it switches its socket between blocking and not
/// (`fcntl` twice each time), and empties it. So the socket is polled here. What was woken for is
/// received first; the socket is emptied before the next sleep.
pub fn receive_or_wait<T>(
    listener: &Listener<ipc::Service>,
    mut receive: impl FnMut() -> Result<Option<T>, BenchError>,
) -> Result<Option<T>, BenchError> {
    if let Some(message) = receive()? {
        return Ok(Some(message));
    }
    listener.try_wait(|_| {}).map_err(failed("take events"))?;
    // One may have come with the events that were just taken.
    if let Some(message) = receive()? {
        return Ok(Some(message));
    }
    // SAFETY: the descriptor is not closed, and not kept beyond the listener.
    let socket = unsafe { BorrowedFd::borrow_raw(listener.file_descriptor().native_handle()) };
    match poll(&mut [PollFd::new(socket, PollFlags::POLLIN)], WAIT_TIMEOUT_MS) {
        Ok(_) | Err(Errno::EINTR) => receive(),
        Err(error) => Err(failed("wait for an event")(error)),
    }
}

/// Waits for an event as iceoryx2 does it, for a limited time.
fn wait(listener: &Listener<ipc::Service>) -> Result<(), BenchError> {
    let waited = listener.timed_wait(|_| {}, WAIT_TIMEOUT);
    waited.map(drop).map_err(failed("wait for an event"))
}

pub fn polled(turn: Turn) -> Result<Durations, BenchError> {
    measure_service(turn, Waiting::Polled)
}

pub fn waiting(turn: Turn) -> Result<Durations, BenchError> {
    measure_service(turn, Waiting::Woken)
}

pub fn waiting_as_library(turn: Turn) -> Result<Durations, BenchError> {
    measure_service(turn, Waiting::WokenByLibrary)
}

fn measure_service(turn: Turn, waiting: Waiting) -> Result<Durations, BenchError> {
    let domain = domain()?;
    let _guard = DomainLock::acquire(&domain)?;
    let sender = || {
        let node = node(&domain)?;
        let publisher =
            stream(&node)?.publisher_builder().create().map_err(failed("create a publisher"))?;
        let notifier = if waiting != Waiting::Polled { Some(notifier(&node)?) } else { None };
        Ok(move |now: Nanos| {
            // The node must live as long as its ports.
            let _ = &node;
            publisher.send_copy([now.0; BYTES / 8]).map_err(failed("send"))?;
            notifier
                .as_ref()
                .map_or(Ok(()), |notifier| notifier.notify().map(drop).map_err(failed("notify")))
        })
    };
    let receiver = || {
        let node = node(&domain)?;
        let subscriber =
            stream(&node)?.subscriber_builder().create().map_err(failed("create a subscriber"))?;
        let listener = if waiting != Waiting::Polled { Some(listener(&node)?) } else { None };
        Ok(move || {
            let _ = &node;
            let receive = || -> Result<Option<Nanos>, BenchError> {
                let sample = subscriber.receive().map_err(failed("receive"))?;
                Ok(sample.map(|sample| Nanos(sample[0])))
            };
            match (&listener, waiting) {
                (Some(listener), Waiting::Woken) => receive_or_wait(listener, receive),
                (Some(listener), _) => match receive()? {
                    None => wait(listener).map(|()| None),
                    message => Ok(message),
                },
                (None, _) => receive(),
            }
        })
    };
    measure(turn, sender, receiver)
}
