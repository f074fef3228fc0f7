//! The WebSocket server of Foxglove's library with the channels of a recording. It only sends.
//!
//! Every viewer has a queue there; one that is too slow misses the oldest messages.

use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use foxglove::websocket::{ChannelView, Client, ServerListener};
use foxglove::{Context, PartialMetadata, RawChannel, Schema, WebSocketServerHandle};
use i2ris::ipc::random_id;
use i2ris_record::{cdr, schema};
use i2ris_report::Failure;

use crate::door;

/// Whether somebody has subscribed since the last look.
#[derive(Debug, Default)]
struct Newcomers(AtomicBool);

impl ServerListener for Newcomers {
    fn on_subscribe(&self, _: Client, _: ChannelView) {
        self.0.store(true, Ordering::Release);
    }
}

/// A server that listens, until dropped.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    channels: Vec<Arc<RawChannel>>,
    newcomers: Arc<Newcomers>,
    handle: Option<WebSocketServerHandle>,
    // Channels are closed when it is dropped.
    _context: Arc<Context>,
}

impl Server {
    /// Listens, also for these pages, with these channels: topic, name and definition of the messages. The number of a
    /// channel is its place.
    pub fn start(
        listen: SocketAddr,
        channels: Vec<[String; 3]>,
        origins: Vec<String>,
    ) -> Result<Self, Failure> {
        let context = Context::new();
        let add = |[topic, name, definition]: [String; 3]| {
            let schema = Schema::new(name, schema::ENCODING, definition.into_bytes());
            { context.channel_builder(topic) }
                .message_encoding(cdr::ENCODING)
                .schema(schema)
                .build_raw()
        };
        let channels = { channels.into_iter() }.map(add).collect::<Result<_, _>>()?;
        let newcomers = Arc::<Newcomers>::default();
        // Reached by nobody but the door: pages can try all ports of 127.0.0.1, and not all
        // addresses of the loopback interface.
        let [a, b, c, ..] = random_id().to_le_bytes();
        let inner = Ipv4Addr::new(127, a.max(1), b, c.clamp(1, 254));
        let handle = { context.websocket_server() }
            .name("i2ris")
            // No capability: viewers can neither publish nor call anything.
            .capabilities([])
            .listener(Arc::clone(&newcomers) as Arc<dyn ServerListener>)
            .bind(inner.to_string(), 0)
            .start_blocking()?;
        let listener = TcpListener::bind(listen)?;
        let address = listener.local_addr()?;
        door::open(listener, SocketAddr::new(inner.into(), handle.port()), origins)?;
        Ok(Self { address, channels, newcomers, handle: Some(handle), _context: context })
    }

    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Whether somebody has subscribed since the last call.
    pub fn has_newcomer(&self) -> bool {
        self.newcomers.0.swap(false, Ordering::AcqRel)
    }

    /// Sends a message to everyone who has subscribed to the channel. Does not wait.
    pub fn send(&self, channel: usize, unix_ns: u64, bytes: &[u8]) {
        if let Some(channel) = self.channels.get(channel) {
            channel.log_with_meta(bytes, PartialMetadata::with_log_time(unix_ns));
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        if let Some(handle) = self.handle.take() {
            handle.stop().wait_blocking();
        }
    }
}
