//! iceoryx2 as such: a publish-subscribe service of 64 bytes, polled or with an event service
//! beside it that wakes.

use std::time::Duration;

use i2ris::ipc::{Domain, DomainLock, random_id};
use i2ris::units::Nanos;
use iceoryx2::node::Node;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{
    Config, FileName, NodeBuilder, Path, SemanticString, SignalHandlingMode, ipc,
};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::BYTES;
use super::pair::{Run, measure};
use crate::error::BenchError;
use crate::spans::Spans;

type Words = [u64; BYTES / 8];

/// How long a receiver sleeps at most.
const NAP: Duration = Duration::from_millis(20);

/// A domain of this run alone. Its guard removes everything in the end.
pub fn domain() -> Result<Domain, BenchError> {
    Ok(Domain::new(&format!("bench-{:08x}", random_id() as u32))?)
}

pub fn refused<E: std::fmt::Debug>(step: &'static str) -> impl FnOnce(E) -> BenchError {
    move |error| BenchError::Transport {
        step,
        reason: format!("{error:?}"),
    }
}

/// A node in the folder of a domain, beside whatever the controller would put there.
pub fn node(domain: &Domain) -> Result<Node<ipc::Service>, BenchError> {
    let mut config = Config::default();
    let root = domain.directory().join("bench");
    let path = Path::new(root.as_os_str().as_encoded_bytes()).map_err(refused("name a folder"))?;
    config.global.set_root_path(&path);
    let prefix = format!("{}bench_", domain.prefix());
    config.global.prefix =
        FileName::new(prefix.as_bytes()).map_err(refused("name shared memory"))?;
    let builder = NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled);
    builder.create().map_err(refused("create a node"))
}

fn stream(node: &Node<ipc::Service>) -> Result<PortFactory<ipc::Service, Words, ()>, BenchError> {
    let name = "bench/words"
        .try_into()
        .map_err(refused("name a service"))?;
    let service = node.service_builder(&name).publish_subscribe::<Words>();
    service
        .subscriber_max_buffer_size(16)
        .open_or_create()
        .map_err(refused("open a publish-subscribe service"))
}

/// The ends of an event service.
pub fn notifier(node: &Node<ipc::Service>) -> Result<Notifier<ipc::Service>, BenchError> {
    let name = "bench/bell".try_into().map_err(refused("name a service"))?;
    let service = node
        .service_builder(&name)
        .event()
        .open_or_create()
        .map_err(refused("open an event service"))?;
    service
        .notifier_builder()
        .create()
        .map_err(refused("create a notifier"))
}

/// See [`notifier`].
pub fn listener(node: &Node<ipc::Service>) -> Result<Listener<ipc::Service>, BenchError> {
    let name = "bench/bell".try_into().map_err(refused("name a service"))?;
    let service = node
        .service_builder(&name)
        .event()
        .open_or_create()
        .map_err(refused("open an event service"))?;
    service
        .listener_builder()
        .create()
        .map_err(refused("create a listener"))
}

/// Sleeps until somebody notifies, and not for long.
pub fn wait(listener: &Listener<ipc::Service>) -> Result<(), BenchError> {
    listener
        .timed_wait(|_| {}, NAP)
        .map(drop)
        .map_err(refused("wait for an event"))
}

pub fn polled(run: Run) -> Result<Spans, BenchError> {
    either(run, false)
}

pub fn waiting(run: Run) -> Result<Spans, BenchError> {
    either(run, true)
}

fn either(run: Run, woken: bool) -> Result<Spans, BenchError> {
    let domain = domain()?;
    let _guard = DomainLock::acquire(&domain)?;
    let sender = || {
        let node = node(&domain)?;
        let publisher = stream(&node)?
            .publisher_builder()
            .create()
            .map_err(refused("create a publisher"))?;
        let bell = if woken { Some(notifier(&node)?) } else { None };
        Ok(move |now: Nanos| {
            // The node must live as long as its ports.
            let _ = &node;
            publisher
                .send_copy([now.0; BYTES / 8])
                .map_err(refused("send"))?;
            bell.as_ref().map_or(Ok(()), |bell| {
                bell.notify().map(drop).map_err(refused("notify"))
            })
        })
    };
    let receiver = || {
        let node = node(&domain)?;
        let subscriber = stream(&node)?
            .subscriber_builder()
            .create()
            .map_err(refused("create a subscriber"))?;
        let ear = if woken { Some(listener(&node)?) } else { None };
        Ok(move || {
            let _ = &node;
            if let Some(sample) = subscriber.receive().map_err(refused("receive"))? {
                return Ok(Some(Nanos(sample[0])));
            }
            ear.as_ref().map_or(Ok(()), wait).map(|()| None)
        })
    };
    measure(run, sender, receiver)
}
