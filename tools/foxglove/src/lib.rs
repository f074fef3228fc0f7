//! Streams of a controller, live in Foxglove and Lichtblick: Foxglove's WebSocket server with the
//! topics of a recording ([`i2ris_record::topic`]). It only sends.

mod live;
pub mod server;

use std::net::SocketAddr;
use std::time::{SystemTime, UNIX_EPOCH};

use foxglove::FoxgloveError;
use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::client::{self, ClientError, Watcher};
use i2ris::units::Nanos;
use i2ris_record::joints;
use i2ris_record::subscriptions::Subscriptions;

use live::Live;
use server::Server;

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
        source: Box<FoxgloveError>,
    },
    /// The streams of the controller cannot be read.
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
        let server = Server::start(self.listen, live::channels()).map_err(|source| {
            LiveError::Listen { address: self.listen, source: Box::new(source) }
        })?;
        ready(server.address());
        let mut live = Live::new(server, unix_offset_ns(), self.period);
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
            live.repeat_for_newcomers();
            clock::sleep(READ_PERIOD);
        }
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
