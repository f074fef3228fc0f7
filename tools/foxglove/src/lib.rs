//! Streams of a controller, live in Foxglove and Lichtblick: a server of Foxglove's protocol over
//! WebSocket with the topics of a recording ([`i2ris_record::topic`]), which only sends.

mod live;

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};

use foxglove::websocket::{ChannelView, Client, ServerListener};
use foxglove::{Context, FoxgloveError};
use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::client::{self, ClientError, Watcher};
use i2ris::units::Nanos;
use i2ris_record::joints;
use i2ris_record::subscriptions::Subscriptions;

use live::Live;

/// The layout: angles, error, plane, loops, state and the snake.
pub const LAYOUT: &str = include_str!("../layout.json");

/// Time between two reads. Buffers hold an eighth of a second.
const READ_PERIOD: Nanos = Nanos::from_millis(4);
/// Waiting time for a controller, after which `stop` is looked at.
const CONNECT_TIMEOUT: Nanos = Nanos::from_millis(200);

/// Why it cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// The address cannot be used.
    #[error("cannot listen at {address}: {source}; another program may, choose another port")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// The reason.
        source: FoxgloveError,
    },
    /// A topic cannot be offered.
    #[error("cannot offer a topic: {0}")]
    Topic(#[from] FoxgloveError),
    /// The controller cannot be heard.
    #[error(transparent)]
    Controller(#[from] ClientError),
}

/// How a server is run.
#[derive(Debug, Clone)]
pub struct LiveServer {
    /// The controller's domain.
    pub domain: Domain,
    /// Where to listen.
    pub listen: SocketAddr,
    /// The time between two messages of a stream at least; changes of state and the log pass all.
    pub period: Nanos,
}

/// Remembers that somebody has come who wants what is sent once.
#[derive(Debug, Default)]
struct Newcomers(AtomicBool);

impl ServerListener for Newcomers {
    fn on_subscribe(&self, _client: Client, _channel: ChannelView) {
        self.0.store(true, Ordering::Release);
    }
}

impl LiveServer {
    /// Serves until `stop`. A controller that is not there, or no longer, is waited for. `ready`
    /// gets the address, with the port if the system chose it.
    ///
    /// # Errors
    ///
    /// When the address cannot be used, or the controller has another version.
    pub fn run(
        &self,
        stop: impl Fn() -> bool,
        ready: impl FnOnce(SocketAddr),
    ) -> Result<(), LiveError> {
        let (context, newcomers) = (Context::new(), Arc::new(Newcomers::default()));
        let mut live = Live::new(&context, unix_offset_ns(), self.period)?;
        let server = { context.websocket_server() }
            .name("i2ris")
            .bind(self.listen.ip().to_string(), self.listen.port())
            .listener(Arc::clone(&newcomers) as Arc<dyn ServerListener>)
            .start_blocking()
            .map_err(|source| LiveError::Listen {
                address: self.listen,
                source,
            })?;
        ready(SocketAddr::new(self.listen.ip(), server.port()));
        let mut subscriptions = Subscriptions::new(&Watcher::new(&self.domain));
        let mut named = None;
        while !stop() {
            match subscriptions.read(&mut live, clock::now()) {
                Ok(()) => {}
                Err(error) if error.is_absent() => clock::sleep(CONNECT_TIMEOUT),
                Err(error) => return Err(error.into()),
            }
            if named != live.boot_id() {
                named = self.name_joints(&mut live);
            }
            if newcomers.0.swap(false, Ordering::AcqRel) {
                live.repeat();
            }
            clock::sleep(READ_PERIOD);
        }
        server.stop();
        Ok(())
    }

    /// Takes the names of the joints from the controller, once per start of it.
    fn name_joints(&self, live: &mut Live) -> Option<u64> {
        let mut client = client::Client::connect(&self.domain, CONNECT_TIMEOUT).ok()?;
        let version = client.version().ok()?;
        live.name_joints(joints::names(&version));
        live.boot_id()
    }
}

/// Unix time minus monotonic time. A step of the wall clock later shifts the display only.
fn unix_offset_ns() -> u64 {
    let unix = SystemTime::now().duration_since(UNIX_EPOCH);
    let unix_ns = unix.map_or(0, |unix| unix.as_nanos() as u64);
    unix_ns.wrapping_sub(clock::now().0)
}
