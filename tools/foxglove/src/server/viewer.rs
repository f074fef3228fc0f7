//! One viewer.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::MutexGuard;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender};
use std::time::Duration;

use serde_json::{Value, json};
use tungstenite::handshake::server::{ErrorResponse, Request, Response};
use tungstenite::http::HeaderValue;
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error, Message, WebSocket, accept_hdr_with_config};

use super::{Data, Shared};

/// Names of the protocol, of Foxglove and of Lichtblick.
const PROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// Time that a viewer has to say what it wants.
const HANDSHAKE_TIMEOUT: Duration = Duration::from_secs(5);
/// Time that a message may take before the viewer counts as gone.
const WRITE_TIMEOUT: Duration = Duration::from_secs(2);
/// How long messages of the viewer wait while nothing is sent.
const READ_PERIOD: Duration = Duration::from_millis(20);
/// Longest wait for the rest of a message of the viewer, after which messages to it go on.
const READ_TIMEOUT: Duration = Duration::from_millis(1);
/// Longest message of a viewer, bytes.
const LONGEST: usize = 1 << 20;
/// First byte of a message of a channel.
const MESSAGE_DATA: u8 = 1;

pub struct Viewer<'a> {
    socket: WebSocket<TcpStream>,
    shared: &'a Shared,
    /// Its number of each channel that it wants.
    subscriptions: BTreeMap<u32, u32>,
}

impl<'a> Viewer<'a> {
    /// Agrees on the protocol and tells the channels; `None`: this is no viewer.
    pub fn greet(stream: TcpStream, shared: &'a Shared) -> Option<Self> {
        stream.set_nonblocking(false).ok()?;
        stream.set_nodelay(true).ok()?;
        stream.set_read_timeout(Some(HANDSHAKE_TIMEOUT)).ok()?;
        stream.set_write_timeout(Some(WRITE_TIMEOUT)).ok()?;
        let config = WebSocketConfig::default().max_message_size(Some(LONGEST));
        let socket = accept_hdr_with_config(stream, choose_protocol, Some(config)).ok()?;
        let mut viewer = Self {
            socket,
            shared,
            subscriptions: BTreeMap::new(),
        };
        for text in &shared.greeting {
            viewer.socket.send(Message::text(text.clone())).ok()?;
        }
        viewer
            .socket
            .get_ref()
            .set_read_timeout(Some(READ_TIMEOUT))
            .ok()?;
        Some(viewer)
    }

    /// The queues of all viewers.
    pub fn queues(&self) -> MutexGuard<'a, Vec<SyncSender<Arc<Data>>>> {
        self.shared.queues()
    }

    /// Sends what comes, and follows its wishes, until it goes or the server ends.
    pub fn serve(mut self, messages: &Receiver<Arc<Data>>) -> Result<(), Error> {
        while !self.shared.stop.load(Ordering::Acquire) {
            match messages.recv_timeout(READ_PERIOD) {
                Ok(first) => {
                    self.send(&first)?;
                    for data in messages.try_iter().take(super::QUEUE) {
                        self.send(&data)?;
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            self.read()?;
            self.socket.flush()?;
        }
        self.socket.close(None)?;
        self.socket.flush()
    }

    fn send(&mut self, data: &Data) -> Result<(), Error> {
        let Some(subscription) = self.subscriptions.get(&data.channel) else {
            return Ok(());
        };
        let mut bytes = Vec::with_capacity(13 + data.bytes.len());
        bytes.push(MESSAGE_DATA);
        bytes.extend(subscription.to_le_bytes());
        bytes.extend(data.unix_ns.to_le_bytes());
        bytes.extend(&data.bytes);
        self.socket.write(Message::binary(bytes))
    }

    /// Takes in what the viewer has said so far.
    fn read(&mut self) -> Result<(), Error> {
        loop {
            match self.socket.read() {
                Ok(Message::Text(text)) => self.follow(&text)?,
                Ok(Message::Binary(_)) => self.refuse("a message")?,
                Ok(_) => {}
                Err(Error::Io(error)) if is_timeout(error.kind()) => return Ok(()),
                Err(error) => return Err(error),
            }
        }
    }

    fn follow(&mut self, text: &str) -> Result<(), Error> {
        let wish: Value = serde_json::from_str(text).unwrap_or_default();
        let list = |name: &str| wish[name].as_array().cloned().unwrap_or_default();
        let number = |value: &Value| value.as_u64().and_then(|number| u32::try_from(number).ok());
        match wish["op"].as_str() {
            Some("subscribe") => {
                for wanted in list("subscriptions") {
                    let (id, channel) = (number(&wanted["id"]), number(&wanted["channelId"]));
                    if let (Some(id), Some(channel)) = (id, channel) {
                        self.subscriptions.insert(channel, id);
                    }
                }
                self.shared.has_newcomer.store(true, Ordering::Release);
                Ok(())
            }
            Some("unsubscribe") => {
                let ids: Vec<u32> = { list("subscriptionIds").iter() }
                    .filter_map(number)
                    .collect();
                self.subscriptions.retain(|_, id| !ids.contains(id));
                Ok(())
            }
            Some(other) => self.refuse(&format!("`{other}`")),
            None => self.refuse("what is no operation"),
        }
    }

    fn refuse(&mut self, what: &str) -> Result<(), Error> {
        let message = format!("this server only sends: it does not accept {what}");
        let status = json!({ "op": "status", "level": 2, "message": message });
        self.socket.send(Message::text(status.to_string()))
    }
}

fn is_timeout(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::WouldBlock | ErrorKind::TimedOut)
}

#[allow(clippy::result_large_err, reason = "the type that tungstenite wants")]
fn choose_protocol(request: &Request, mut response: Response) -> Result<Response, ErrorResponse> {
    let offered = request.headers().get_all("Sec-WebSocket-Protocol").iter();
    let offered: Vec<&str> = offered
        .filter_map(|header| header.to_str().ok())
        .flat_map(|header| header.split(','))
        .map(str::trim)
        .collect();
    let chosen = PROTOCOLS.into_iter().find(|name| offered.contains(name));
    let Some(chosen) = chosen else {
        let mut refusal = ErrorResponse::new(Some("offer the protocol foxglove.sdk.v1".to_owned()));
        *refusal.status_mut() = tungstenite::http::StatusCode::BAD_REQUEST;
        return Err(refusal);
    };
    let headers = response.headers_mut();
    headers.insert("Sec-WebSocket-Protocol", HeaderValue::from_static(chosen));
    Ok(response)
}
