//! A server of Foxglove's protocol over WebSocket, which only sends.
//!
//! Written after the specification (github.com/foxglove/ws-protocol, `docs/spec.md`). The server
//! says what it is (`serverInfo`) and which channels it has (`advertise`), a viewer says which of
//! them it wants (`subscribe`), and gets their messages as bytes. The same protocol has two names:
//! `foxglove.sdk.v1` in Foxglove, `foxglove.websocket.v1` in Lichtblick.
//!
//! Every viewer has a thread and a queue. A viewer that is too slow misses messages.

mod viewer;

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use serde_json::json;

use viewer::Viewer;

/// Viewers at the same time.
const VIEWERS: usize = 8;
/// Messages that wait for a viewer: a second of all streams.
const QUEUE: usize = 1024;
/// How often new viewers are looked for.
const ACCEPT_PERIOD: Duration = Duration::from_millis(20);

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

/// A message on its way to a viewer.
#[derive(Debug)]
struct Data {
    channel: u32,
    unix_ns: u64,
    bytes: Vec<u8>,
}

#[derive(Debug)]
struct Shared {
    /// What every viewer receives first.
    greeting: [String; 2],
    stop: AtomicBool,
    /// Somebody has subscribed since the last look.
    has_newcomer: AtomicBool,
    queues: Mutex<Vec<SyncSender<Arc<Data>>>>,
}

impl Shared {
    fn queues(&self) -> MutexGuard<'_, Vec<SyncSender<Arc<Data>>>> {
        self.queues.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A server that listens, until dropped.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Listens, with these channels. The number of a channel is its place.
    ///
    /// # Errors
    ///
    /// When the address cannot be used, or no thread can be started.
    pub fn start(listen: SocketAddr, channels: &[Channel]) -> io::Result<Self> {
        let listener = TcpListener::bind(listen)?;
        listener.set_nonblocking(true)?;
        let address = listener.local_addr()?;
        let shared = Arc::new(Shared {
            greeting: [server_info(), advertisement(channels)],
            stop: AtomicBool::new(false),
            has_newcomer: AtomicBool::new(false),
            queues: Mutex::default(),
        });
        let viewers = Arc::clone(&shared);
        let thread = thread::Builder::new()
            .name("foxglove".to_owned())
            .spawn(move || accept(&listener, &viewers))?;
        Ok(Self {
            address,
            shared,
            thread: Some(thread),
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
        self.shared.has_newcomer.swap(false, Ordering::AcqRel)
    }

    /// Sends a message to everyone who wants it. Does not wait.
    pub fn send(&self, channel: usize, unix_ns: u64, bytes: Vec<u8>) {
        let data = Arc::new(Data {
            channel: channel as u32,
            unix_ns,
            bytes,
        });
        self.shared.queues().retain(|queue| {
            let sent = queue.try_send(Arc::clone(&data));
            !matches!(sent, Err(TrySendError::Disconnected(_)))
        });
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Release);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn server_info() -> String {
    let info = json!({
        "op": "serverInfo", "name": "i2ris", "capabilities": [], "supportedEncodings": [],
        "metadata": {}, "sessionId": format!("{:016x}", i2ris::ipc::random_id()),
    });
    info.to_string()
}

fn advertisement(channels: &[Channel]) -> String {
    let channels: Vec<_> = { channels.iter().enumerate() }
        .map(|(id, channel)| {
            json!({
                "id": id, "topic": channel.topic, "encoding": channel.encoding,
                "schemaName": channel.schema_name, "schema": channel.schema,
                "schemaEncoding": channel.schema_encoding,
            })
        })
        .collect();
    json!({ "op": "advertise", "channels": channels }).to_string()
}

/// Takes viewers in until `stop`. Their threads end then, too.
fn accept(listener: &TcpListener, shared: &Arc<Shared>) {
    let mut threads: Vec<JoinHandle<()>> = Vec::new();
    while !shared.stop.load(Ordering::Acquire) {
        threads.retain(|thread| !thread.is_finished());
        match listener.accept() {
            // The connection is closed: there are enough viewers.
            Ok(_) if threads.len() >= VIEWERS => {}
            Ok((stream, _)) => {
                let (queue, messages) = sync_channel(QUEUE);
                let viewer = Arc::clone(shared);
                let work = move || {
                    if let Some(viewer) = Viewer::greet(stream, &viewer) {
                        viewer.queues().push(queue);
                        // An error is a viewer that is gone.
                        let _ = viewer.serve(&messages);
                    }
                };
                threads.extend(thread::Builder::new().spawn(work));
            }
            Err(_) => thread::sleep(ACCEPT_PERIOD),
        }
    }
    for thread in threads {
        let _ = thread.join();
    }
}
