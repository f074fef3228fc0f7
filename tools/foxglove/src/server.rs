//! The WebSocket server of Foxglove's library with the channels of a recording. It only sends.
//!
//! Every viewer has a queue there; one that is too slow misses the oldest messages.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use foxglove::websocket::{ChannelView, Client, ServerListener};
use foxglove::{
    Context, FoxgloveError, PartialMetadata, RawChannel, Schema, WebSocketServerHandle,
};

/// A channel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channel {
    /// Its topic.
    pub topic: String,
    /// Encoding of its messages.
    pub encoding: &'static str,
    /// Full name of its messages.
    pub schema_name: String,
    /// Language of the definition.
    pub schema_encoding: &'static str,
    /// Definition of its messages.
    pub schema: String,
}

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
    /// Listens, with these channels. The number of a channel is its place.
    ///
    /// # Errors
    ///
    /// When the address cannot be used.
    pub fn start(listen: SocketAddr, channels: Vec<Channel>) -> Result<Self, FoxgloveError> {
        let context = Context::new();
        let add = |channel: Channel| {
            let definition = channel.schema.into_bytes();
            let schema = Schema::new(channel.schema_name, channel.schema_encoding, definition);
            { context.channel_builder(channel.topic) }
                .message_encoding(channel.encoding)
                .schema(schema)
                .build_raw()
        };
        let channels = { channels.into_iter() }.map(add).collect::<Result<_, _>>()?;
        let newcomers = Arc::<Newcomers>::default();
        // A name resolves an IPv6 address only in brackets.
        let host = match listen {
            SocketAddr::V4(address) => address.ip().to_string(),
            SocketAddr::V6(address) => format!("[{}]", address.ip()),
        };
        let handle = { context.websocket_server() }
            .name("i2ris")
            // No capability: viewers can neither publish nor call anything.
            .capabilities([])
            .listener(Arc::clone(&newcomers) as Arc<dyn ServerListener>)
            .bind(host, listen.port())
            .start_blocking()?;
        Ok(Self {
            address: SocketAddr::new(listen.ip(), handle.port()),
            channels,
            newcomers,
            handle: Some(handle),
            _context: context,
        })
    }

    /// Where it listens, with the port if the system chose it.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Whether somebody has subscribed since the last call.
    #[must_use]
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
