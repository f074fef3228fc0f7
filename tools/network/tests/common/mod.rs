//! Keys, servers, and a Zenoh client that knows only key expressions and payloads.
#![allow(dead_code, reason = "every test binary uses a part")]

use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use i2ris::clock;
use i2ris::ipc::payload::StateCommandRequest;
use i2ris::ipc::ready::INTERFACE_VERSION;
use i2ris::ipc::{StateCommand, random_id};
use i2ris::units::Nanos;
use i2ris_network::BridgeServer;
use i2ris_network::keys::{Access, Lifetime, PersonalKey, make_key};
use i2ris_network::message::{Alive, AliveReply, AnswerHeader, QuestionHeader};
use i2ris_network::names::{Source, What};
use i2ris_network::request::Service;
use i2ris_testing::Controller;
use serde_json::json;
use zenoh::bytes::ZBytes;
use zenoh::sample::Sample;
use zenoh::{Config, Session, Wait};
use zerocopy::{FromBytes, IntoBytes};

/// Long compared with stalls of the machine.
pub const LOST_AFTER: Nanos = Nanos::from_millis(3000);
/// Longer than an answer takes.
const ANSWER: Duration = Duration::from_secs(2);

pub fn hosts() -> Vec<String> {
    vec!["127.0.0.1".to_owned()]
}

/// The folder of a key for a day.
pub fn make(keys: &Path, name: &str, access: Access) -> PathBuf {
    // The certificate of the server is made once: it may be in use.
    let hosts = if keys.join("server.pem").exists() { Vec::new() } else { hosts() };
    make_key(keys, name, access, &hosts, Lifetime::days(1)).unwrap()
}

/// An address that nobody uses.
pub fn free_address() -> String {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.local_addr().unwrap().to_string()
}

/// Calls `attempt` until it returns a value.
pub fn eventually<T>(what: &str, mut attempt: impl FnMut() -> Option<T>) -> T {
    let end = clock::now() + Nanos::from_millis(20_000);
    loop {
        if let Some(value) = attempt() {
            return value;
        }
        assert!(clock::now() < end, "never: {what}");
        clock::sleep(Nanos::from_millis(2));
    }
}

/// A server on a thread, until dropped.
pub struct RunningServer {
    pub address: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl RunningServer {
    pub fn start(controller: &Controller, keys: &Path, commands: bool) -> Self {
        let address = free_address();
        let server = BridgeServer {
            domain: controller.domain.clone(),
            listen: address.clone(),
            keys: keys.to_owned(),
            commands,
            period: Nanos::from_millis(5),
            lost_after: LOST_AFTER,
        };
        let server = server.open().unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&stop);
        let run = move || server.run(|| flag.load(Ordering::Relaxed), drop);
        Self { address, stop, thread: Some(thread::spawn(run)) }
    }
}

impl Drop for RunningServer {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// A state command with this number, asked now.
pub fn state_command(number: u64, command: StateCommand) -> (QuestionHeader, Vec<u8>) {
    let header = QuestionHeader { number, asked_ns: clock::now().0 };
    let request = StateCommandRequest { client_id: 1, command: command.number(), reserved: 0 };
    (header, request.as_bytes().to_vec())
}

/// A Zenoh client with a key, as anyone can write it.
pub struct RawClient {
    session: Session,
    id: String,
    number: u64,
    /// The first answer to `alive`.
    pub reply: AliveReply,
}

fn config(address: &str, tls: &serde_json::Value) -> Config {
    let config = json!({
        "mode": "client",
        "scouting": { "multicast": { "enabled": false } },
        "connect": { "endpoints": [format!("quic/{address}?mixed_rel=1")], "timeout_ms": 3000 },
        "transport": { "link": { "tls": tls } },
    });
    Config::from_json5(&config.to_string()).unwrap()
}

impl RawClient {
    /// Connects, and asks for nothing.
    pub fn connect(address: &str, key: &Path) -> Result<Self, zenoh::Error> {
        let tls = json!({
            "root_ca_certificate": key.join("ca.pem"),
            "connect_certificate": key.join("certificate.pem"),
            "connect_private_key": key.join("key.pem"),
            "enable_mtls": true,
        });
        let id = PersonalKey::load(key).map(|key| key.id().to_owned());
        Ok(Self {
            session: zenoh::open(config(address, &tls)).wait()?,
            // An expired one is tried, too.
            id: id.unwrap_or_else(|_| key.file_name().unwrap().to_str().unwrap().to_owned()),
            number: random_id(),
            reply: AliveReply::default(),
        })
    }

    /// Connects without a certificate; `None`: kept out.
    pub fn without_certificate(address: &str, keys: &Path) -> Option<Self> {
        let tls = json!({ "root_ca_certificate": keys.join("authority.pem") });
        let client = Self {
            session: zenoh::open(config(address, &tls)).wait().ok()?,
            id: "nobody".to_owned(),
            number: random_id(),
            reply: AliveReply::default(),
        };
        client.alive().is_some().then_some(client)
    }

    /// Connects and begins a session.
    pub fn join(address: &str, key: &Path) -> Self {
        let client = Self::connect(address, key).unwrap();
        let reply = client.alive().expect("an answer");
        assert_eq!((reply.refusal, reply.interface), (0, INTERFACE_VERSION));
        Self { reply, ..client }
    }

    /// A key expression of this client.
    pub fn source(&self, what: What) -> String {
        let source = Source { id: &self.id, session: self.number, what };
        source.key()
    }

    /// A sign of life.
    pub fn alive(&self) -> Option<AliveReply> {
        let alive = Alive { interface: INTERFACE_VERSION, ..Alive::default() };
        let bytes = self.get(&self.source(What::Alive), alive.as_bytes())?;
        AliveReply::read_from_bytes(&bytes).ok()
    }

    fn get(&self, key: &str, bytes: &[u8]) -> Option<Vec<u8>> {
        let replies = { self.session.get(key).payload(bytes) }.timeout(ANSWER).wait().unwrap();
        let reply = replies.recv().ok()?;
        reply.result().ok().map(|sample| bytes_of(sample.payload()))
    }

    /// Sends a request; its answer.
    pub fn ask(&self, question: (QuestionHeader, Vec<u8>)) -> Option<(AnswerHeader, Vec<u8>)> {
        let bytes = [question.0.as_bytes(), &question.1].concat();
        self.ask_bytes(Service::StateCommand, &bytes)
    }

    /// Sends a request; its answer.
    pub fn ask_bytes(&self, service: Service, bytes: &[u8]) -> Option<(AnswerHeader, Vec<u8>)> {
        let answer = self.get(&self.source(What::Request(service)), bytes)?;
        let (header, payload) = AnswerHeader::read_from_prefix(&answer).unwrap();
        Some((header, payload.to_vec()))
    }

    pub fn put(&self, what: What, bytes: &[u8]) {
        self.put_as(&self.source(what), bytes);
    }

    /// Puts under any key expression.
    pub fn put_as(&self, key: &str, bytes: &[u8]) {
        self.session.put(key, bytes).wait().unwrap();
    }

    /// Everything that comes under a key expression from now on.
    pub fn listen(&self, key: &str) -> Receiver<Sample> {
        let (sender, samples) = channel();
        let take = move |sample| drop(sender.send(sample));
        let subscriber = self.session.declare_subscriber(key).callback(take);
        subscriber.background().wait().unwrap();
        samples
    }

    /// The key expressions of all streams of which something is known.
    pub fn states(&self) -> Vec<String> {
        let replies = self.session.get("i2ris/state/**").timeout(ANSWER).wait();
        let replies = replies.unwrap();
        let mut keys = Vec::new();
        while let Ok(reply) = replies.recv() {
            keys.extend(reply.result().ok().map(|it| it.key_expr().to_string()));
        }
        keys
    }
}

fn bytes_of(payload: &ZBytes) -> Vec<u8> {
    payload.to_bytes().into_owned()
}

/// A server with a personal key, as a thief would run it.
pub fn serve_with(address: &str, key: &Path) -> Session {
    let config = json!({
        "mode": "router",
        "scouting": { "multicast": { "enabled": false } },
        "listen": { "endpoints": [format!("quic/{address}?mixed_rel=1")] },
        "transport": { "link": { "tls": {
            "root_ca_certificate": key.join("ca.pem"),
            "listen_certificate": key.join("certificate.pem"),
            "listen_private_key": key.join("key.pem"),
            "enable_mtls": true,
        } } },
    });
    let config = Config::from_json5(&config.to_string()).unwrap();
    zenoh::open(config).wait().unwrap()
}
