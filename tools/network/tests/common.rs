//! Keys, servers, and a Zenoh client that knows only key expressions and payloads.

use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use i2ris::clock;
use i2ris::ipc::payload::StateCommandRequest;
use i2ris::ipc::ready::INTERFACE_VERSION;
use i2ris::ipc::{Domain, RequestService, StateCommand, Stream, random_id};
use i2ris::units::Nanos;
use i2ris_network::BridgeServer;
use i2ris_network::keys::{Access, Lifetime, PersonalKey, make_key};
use i2ris_network::message::{Alive, AliveReply, AnswerHeader, QuestionHeader};
use i2ris_network::names::{self, Source, What};
use i2ris_testing::{Background, Controller};
use serde_json::{Value, json};
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

/// A server on a thread, until dropped.
pub fn serve(domain: &Domain, address: &str, keys: &Path, lost_after: Nanos) -> Background {
    let server = BridgeServer {
        domain: domain.clone(),
        listen: address.to_owned(),
        keys: keys.to_owned(),
        commands: true,
        period: Nanos::from_millis(5),
        lost_after,
    };
    let server = server.open().unwrap();
    Background::start(move |stop| server.run(|| stop.load(Ordering::Relaxed), drop))
}

/// A server beside a controller, with the keys of a folder.
pub struct RunningServer {
    pub address: String,
    _running: Background,
}

impl RunningServer {
    pub fn start(controller: &Controller, keys: &Path) -> Self {
        let address = free_address();
        let running = serve(&controller.domain, &address, keys, LOST_AFTER);
        Self { address, _running: running }
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

/// `listen` or `connect`.
fn open((mode, verb): (&str, &str), address: &str, tls: &Value) -> Result<Session, zenoh::Error> {
    let config = json!({
        "mode": mode,
        "scouting": { "multicast": { "enabled": false } },
        verb: { "endpoints": [format!("quic/{address}?mixed_rel=1")], "timeout_ms": 3000 },
        "transport": { "link": { "tls": tls } },
    });
    zenoh::open(Config::from_json5(&config.to_string()).unwrap()).wait()
}

const CLIENT: (&str, &str) = ("client", "connect");

impl RawClient {
    pub fn connect(address: &str, key: &Path) -> Result<Self, zenoh::Error> {
        let tls = json!({
            "root_ca_certificate": key.join("ca.pem"),
            "connect_certificate": key.join("certificate.pem"),
            "connect_private_key": key.join("key.pem"),
            "enable_mtls": true,
        });
        let id = PersonalKey::load(key).map(|key| key.id().to_owned());
        Ok(Self {
            session: open(CLIENT, address, &tls)?,
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
            session: open(CLIENT, address, &tls).ok()?,
            id: "nobody".to_owned(),
            number: random_id(),
            reply: AliveReply::default(),
        };
        client.alive().is_some().then_some(client)
    }

    pub fn join(address: &str, key: &Path) -> Self {
        let client = Self::connect(address, key).unwrap();
        let reply = client.alive().expect("an answer");
        assert_eq!((reply.refusal, reply.interface), (0, INTERFACE_VERSION));
        Self { reply, ..client }
    }

    pub fn source(&self, what: What) -> String {
        let source = Source { id: &self.id, session: self.number, what };
        source.key()
    }

    pub fn alive(&self) -> Option<AliveReply> {
        self.alive_late(0)
    }

    /// A sign of life that says by how much streams are late here.
    pub fn alive_late(&self, lag_us: u32) -> Option<AliveReply> {
        let alive = Alive { interface: INTERFACE_VERSION, lag_us, ..Alive::default() };
        let bytes = self.get(&self.source(What::Alive), alive.as_bytes())?;
        AliveReply::read_from_bytes(&bytes).ok()
    }

    fn get(&self, key: &str, bytes: &[u8]) -> Option<Vec<u8>> {
        let replies = { self.session.get(key).payload(bytes) }.timeout(ANSWER).wait().unwrap();
        let reply = replies.recv().ok()?;
        reply.result().ok().map(|sample| sample.payload().to_bytes().into_owned())
    }

    pub fn ask(&self, question: (QuestionHeader, Vec<u8>)) -> Option<(AnswerHeader, Vec<u8>)> {
        let bytes = [question.0.as_bytes(), &question.1].concat();
        self.ask_bytes(RequestService::StateCommand, &bytes)
    }

    pub fn ask_bytes(
        &self,
        service: RequestService,
        bytes: &[u8],
    ) -> Option<(AnswerHeader, Vec<u8>)> {
        let answer = self.get(&self.source(What::Request(service)), bytes)?;
        let (header, payload) = AnswerHeader::read_from_prefix(&answer).unwrap();
        Some((header, payload.to_vec()))
    }

    pub fn put(&self, what: What, bytes: &[u8]) {
        self.put_as(&self.source(what), bytes);
    }

    pub fn put_as(&self, key: &str, bytes: &[u8]) {
        self.session.put(key, bytes).wait().unwrap();
    }

    /// What comes of a stream for this key.
    pub fn follow(&self, stream: Stream) -> Receiver<Sample> {
        self.listen(&names::to(&self.id, stream.name()))
    }

    /// Everything that comes from now on.
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

/// A server with a personal key, as a thief would run it.
pub fn serve_with(address: &str, key: &Path) -> Session {
    let tls = json!({
        "root_ca_certificate": key.join("ca.pem"),
        "listen_certificate": key.join("certificate.pem"),
        "listen_private_key": key.join("key.pem"),
        "enable_mtls": true,
    });
    open(("router", "listen"), address, &tls).unwrap()
}
