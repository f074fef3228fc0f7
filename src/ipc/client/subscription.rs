//! Subscriptions to the streams of a controller.

use std::sync::Arc;

use iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use iceoryx2::service::port_factory::PortFactory;

use super::controller_link::{ClientService, ControllerLink, ControllerSession, SessionPort};
use super::error::ClientError;
use crate::clock;
use crate::ipc::domain::Domain;
use crate::ipc::payload::*;
use crate::ipc::service::{BUFFER, TransportError, failed};
use crate::ipc::streams::{Stream, StreamMessage, for_each_stream};
use crate::units::Nanos;

/// Creates subscriptions to the streams of a controller, and to the commands that it receives.
///
/// The controller may start later: until then subscriptions return [`ClientError::NoController`].
#[derive(Debug, Clone)]
pub struct Watcher {
    link: Arc<ControllerLink>,
}

impl Watcher {
    /// A watcher of this domain. Opens nothing yet.
    #[must_use]
    pub fn new(domain: &Domain) -> Self {
        Self::with_link(&ControllerLink::new(domain))
    }

    pub(super) fn with_link(link: &Arc<ControllerLink>) -> Self {
        Self { link: Arc::clone(link) }
    }

    fn subscription<T: Message>(&self, stream: Stream) -> Subscription<T> {
        Subscription {
            link: Arc::clone(&self.link),
            stream,
            port: SessionPort::default(),
            last: None,
            missed: 0,
            places: stream.places(false),
        }
    }

    /// The stream in which a client sees what its commands do, with a place that is kept for it.
    pub(super) fn own_state(&self) -> Subscription<OperatingStateMsg> {
        Subscription { places: Stream::State.places(true), ..self.operating_state() }
    }
}

macro_rules! subscriptions {
    (controller { $($controller:tt)* } clients { $($clients:tt)* }) => {
        subscriptions! { $($controller)* $($clients)* }
    };
    ($($(#[$doc:meta])* $stream:ident $function:ident $name:literal $payload:ident
        $direction:ident $publishers:tt $subscribers:tt $history:tt;)*) => {
        impl Watcher {
            $($(#[$doc])*
            #[must_use]
            pub fn $function(&self) -> Subscription<$payload> {
                self.subscription(Stream::$stream)
            })*
        }

        #[derive(Debug)]
        enum AnySubscription {
            $($stream(Subscription<$payload>),)*
        }

        impl AnySubscription {
            fn new(watcher: &Watcher, stream: Stream) -> Self {
                match stream {
                    $(Stream::$stream => Self::$stream(watcher.$function()),)*
                }
            }

            fn drain(&mut self, mut take: impl FnMut(StreamMessage)) -> Result<usize, ClientError> {
                match self {
                    $(Self::$stream(of) => of.drain(|it| take(StreamMessage::$stream(it))),)*
                }
            }

            fn missed(&self) -> u64 {
                match self {
                    $(Self::$stream(of) => of.missed(),)*
                }
            }
        }
    };
}

for_each_stream!(subscriptions);

/// Subscriptions to several streams, which are read one after the other.
#[derive(Debug)]
pub struct Subscriptions(Vec<(Stream, AnySubscription)>);

impl Subscriptions {
    /// Subscribes to these streams, which are read in this order.
    #[must_use]
    pub fn new(watcher: &Watcher, streams: &[Stream]) -> Self {
        let streams = streams.iter();
        Self(streams.map(|stream| (*stream, AnySubscription::new(watcher, *stream))).collect())
    }

    /// Passes every unread message to `take`, those of one stream oldest first. Does not wait.
    ///
    /// # Errors
    ///
    /// See [`Subscription::read`]; the streams after the one that failed are not read.
    pub fn drain(&mut self, mut take: impl FnMut(StreamMessage)) -> Result<(), ClientError> {
        self.0.iter_mut().try_for_each(|(_, subscription)| subscription.drain(&mut take).map(drop))
    }

    /// Messages that were lost because they were not read in time, of every stream with one sender.
    pub fn missed(&self) -> impl Iterator<Item = (Stream, u64)> {
        let one_sender = self.0.iter().filter(|(stream, _)| stream.has_one_sender());
        one_sender.map(|(stream, subscription)| (*stream, subscription.missed()))
    }
}

/// A subscription to one stream.
///
/// A new subscription receives the last message of the controller within 50 ms, even if no new one
/// is sent. Up to 128 unread messages are kept, then the oldest are lost; [`Subscription::missed`]
/// counts them.
#[derive(Debug)]
pub struct Subscription<T: Message> {
    link: Arc<ControllerLink>,
    stream: Stream,
    port: SessionPort<Subscriber<ClientService, T, ()>>,
    last: Option<u64>,
    missed: u64,
    /// Subscribers that there may be with this one.
    places: usize,
}

impl<T: Message> Subscription<T> {
    /// The oldest unread message, if there is one. Does not wait.
    ///
    /// # Errors
    ///
    /// [`ClientError::NoController`] while no controller serves the domain,
    /// [`ClientError::Interface`] when the controller has another version,
    /// [`ClientError::Transport`] when iceoryx2 fails.
    pub fn read(&mut self) -> Result<Option<T>, ClientError> {
        self.read_at(clock::now())
    }

    /// The newest unread message, if there is one; older ones are dropped. Does not wait.
    ///
    /// # Errors
    ///
    /// See [`Subscription::read`].
    pub fn newest(&mut self) -> Result<Option<T>, ClientError> {
        let mut newest = None;
        self.drain(|message| newest = Some(message))?;
        Ok(newest)
    }

    /// Passes every unread message to `take`, oldest first, and returns their number. Does not
    /// wait.
    ///
    /// # Errors
    ///
    /// See [`Subscription::read`].
    pub fn drain(&mut self, mut take: impl FnMut(T)) -> Result<usize, ClientError> {
        let now = clock::now();
        let mut count = 0;
        // Bounded, because a sender may be as fast as we are.
        while count < BUFFER
            && let Some(message) = self.read_at(now)?
        {
            take(message);
            count += 1;
        }
        Ok(count)
    }

    /// Number of messages not read in time and lost. Valid only for streams with one sender.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.missed
    }

    /// Boot id of the controller that sent the messages; `None` before the first successful call.
    #[must_use]
    pub fn boot_id(&self) -> Option<u64> {
        self.port.boot_id()
    }

    fn read_at(&mut self, now: Nanos) -> Result<Option<T>, ClientError> {
        let (stream, places, previous) = (self.stream, self.places, self.port.boot_id());
        let port = self.port.get(&self.link, now, |session| open(session, stream, places))?;
        let received = port.receive().map_err(failed("receive", stream.properties().service))?;
        let message = received.map(|sample| *sample);
        if self.port.boot_id() != previous {
            self.last = None;
        }
        if let Some(message) = &message {
            self.count_missed(message.sequence());
        }
        Ok(message)
    }

    /// A number that does not rise comes from another sender, for example a restarted camera.
    fn count_missed(&mut self, sequence: u64) {
        if let Some(last) = self.last.filter(|last| sequence > *last) {
            self.missed += sequence - last - 1;
        }
        self.last = Some(sequence);
    }
}

fn open<T: Message>(
    session: &ControllerSession,
    stream: Stream,
    places: usize,
) -> Result<Subscriber<ClientService, T, ()>, TransportError> {
    let (step, service) = ("subscribe to", stream.properties().service);
    let factory = stream.open::<ClientService, T>(&session.node)?;
    if factory.dynamic_config().number_of_subscribers() >= places {
        let full = SubscriberCreateError::ExceedsMaxSupportedSubscribers;
        return Err(failed(step, service)(full));
    }
    factory.subscriber_builder().create().map_err(failed(step, service))
}

/// Keeps the last message of a stream.
#[derive(Debug)]
pub struct Latest<T: Message> {
    subscription: Subscription<T>,
    value: Option<T>,
}

impl<T: Message> Latest<T> {
    /// Keeps the last message of this subscription.
    #[must_use]
    pub fn new(subscription: Subscription<T>) -> Self {
        Self { subscription, value: None }
    }

    /// Receives new messages. The message of a controller that has ended is dropped.
    ///
    /// # Errors
    ///
    /// See [`Subscription::read`].
    pub fn refresh(&mut self) -> Result<Option<&T>, ClientError> {
        let previous = self.subscription.boot_id();
        let newest = self.subscription.newest().inspect_err(|_| self.value = None)?;
        if newest.is_some() || self.subscription.boot_id() != previous {
            self.value = newest;
        }
        Ok(self.value.as_ref())
    }

    /// The last message, as of the last [`Latest::refresh`].
    #[must_use]
    pub fn value(&self) -> Option<&T> {
        self.value.as_ref()
    }
}
