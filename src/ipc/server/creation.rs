//! Creation of node and services, with a timeout.
//!
//! iceoryx2 0.10 can loop endlessly on the leftovers of a killed process. The clean-up before
//! should remove all of them. If creation hangs nevertheless, a second clean-up and a second
//! attempt follow.

use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use iceoryx2::node::Node;
use iceoryx2::prelude::ipc;
use iceoryx2::service::port_factory::{publish_subscribe, request_response};

use crate::ipc::domain::{Domain, DomainError, SHARED_MEMORY};
use crate::ipc::domain_lock::DomainLock;
use crate::ipc::payload::*;
use crate::ipc::service::{TransportError, create_node, free_memory};
use crate::ipc::streams::{RequestService, Stream, for_each_request, for_each_stream};

/// Creation takes 10 to 20 ms; a loaded machine may need fifty times as long.
const TIMEOUT: Duration = Duration::from_secs(1);

pub(super) type StreamFactory<T> = publish_subscribe::PortFactory<ipc::Service, T, ()>;
pub(super) type RequestFactory<Q, R> = request_response::PortFactory<ipc::Service, Q, (), R, ()>;

macro_rules! stream_factories {
    (controller { $($controller:tt)* } clients { $($clients:tt)* }) => {
        stream_factories! { $($controller)* $($clients)* }
    };
    ($($(#[$doc:meta])* $stream:ident $function:ident $name:literal $payload:ident
        $direction:ident $publishers:tt $subscribers:tt $history:tt;)*) => {
        pub(super) struct StreamFactories {
            $(pub $function: StreamFactory<$payload>,)*
        }

        impl StreamFactories {
            fn create(node: &Node<ipc::Service>) -> Result<Self, TransportError> {
                Ok(Self { $($function: Stream::$stream.create(node)?,)* })
            }
        }
    };
}

for_each_stream!(stream_factories);

macro_rules! request_factories {
    (user { $($user:tt)* } server { $($server:tt)* }) => {
        request_factories! { $($user)* $($server)* }
    };
    ($($(#[$doc:meta])* $service:ident $function:ident $name:literal
        $request:ident $reply:ident $speed:ident;)*) => {
        pub(super) struct RequestFactories {
            $(pub $function: RequestFactory<$request, $reply>,)*
        }

        impl RequestFactories {
            fn create(node: &Node<ipc::Service>) -> Result<Self, TransportError> {
                Ok(Self { $($function: RequestService::$service.create(node)?,)* })
            }
        }
    };
}

for_each_request!(request_factories);

/// Node and services. Unlike ports they can change threads.
pub(super) struct Services {
    pub node: Node<ipc::Service>,
    pub streams: StreamFactories,
    pub requests: RequestFactories,
}

/// Shared memory of a controller, bytes: alone it takes 27 MB.
const NEEDED: u64 = 32 << 20;

/// Refuses to start where the shared memory is too small.
///
/// # Errors
///
/// [`IpcError::Memory`].
pub fn check_memory() -> Result<(), IpcError> {
    let free = free_memory().filter(|free| *free < NEEDED);
    free.map_or(Ok(()), |free| Err(IpcError::Memory(free)))
}

/// Creates node and services; cleans up and tries once more if that fails or hangs.
pub(super) fn create(lock: &mut DomainLock) -> Result<Services, IpcError> {
    if let Ok(services) = attempt(lock) {
        return Ok(services);
    }
    lock.renew()?;
    attempt(lock)
}

fn attempt(lock: &DomainLock) -> Result<Services, IpcError> {
    let (domain, boot_id) = (lock.domain().clone(), lock.boot_id());
    let hangs = IpcError::Hangs { domain: domain.name().to_owned(), seconds: TIMEOUT.as_secs() };
    run_with_timeout(TIMEOUT, move || Services::create(&domain, boot_id)).unwrap_or(Err(hangs))
}

/// Runs `work` in its own thread and waits for the result. A thread that does not return in time
/// cannot be stopped; it continues with a boot id that nothing else uses.
fn run_with_timeout<T: Send + 'static>(
    timeout: Duration,
    work: impl FnOnce() -> T + Send + 'static,
) -> Option<T> {
    let (sender, receiver) = mpsc::sync_channel(1);
    let thread = thread::Builder::new().name("ipc-create".to_owned());
    let spawned = thread.spawn(move || {
        let _ = sender.send(work());
    });
    spawned.ok().and_then(|_| receiver.recv_timeout(timeout).ok())
}

impl Services {
    fn create(domain: &Domain, boot_id: u64) -> Result<Self, IpcError> {
        let node = create_node(domain, boot_id)?;
        let streams = StreamFactories::create(&node)?;
        let requests = RequestFactories::create(&node)?;
        Ok(Self { node, streams, requests })
    }
}

/// Why the controller has no shared memory.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages say it")]
pub enum IpcError {
    #[error(transparent)]
    Domain(#[from] DomainError),
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// Bytes that are free: use of unavailable memory ends the process by a signal.
    #[error(
        "{SHARED_MEMORY} has {} MB free, and {} MB are needed: delete unused files there, or \
         enlarge it (`mount -o remount,size=256M {SHARED_MEMORY}`; `--shm-size=256m` of a \
         container)",
        .0 >> 20, NEEDED >> 20
    )]
    Memory(u64),
    #[error(
        "creating the shared memory of domain `{domain}` did not finish within {seconds} s, even \
         after a clean-up"
    )]
    Hangs {
        domain: String,
        /// Time limit of one attempt, s.
        seconds: u64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_that_ends_returns_its_value() {
        assert_eq!(run_with_timeout(Duration::from_secs(10), || 7), Some(7));
    }

    #[test]
    fn work_that_hangs_is_abandoned() {
        let (release, released) = mpsc::channel::<()>();
        let work = move || released.recv().is_ok();
        assert_eq!(run_with_timeout(Duration::from_millis(20), work), None);
        release.send(()).unwrap();
    }

    #[test]
    fn work_that_panics_returns_nothing() {
        let work = || -> u8 { panic!("on purpose") };
        assert_eq!(run_with_timeout(Duration::from_secs(10), work), None);
    }
}
