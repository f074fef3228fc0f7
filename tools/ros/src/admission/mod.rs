//! Which commands of which client are passed on to the controller. Without I/O.
//!
//! | file | contains |
//! |---|---|
//! | `identity` | writers, the participants that they belong to, and the clients that these are |
//! | `sender_clock` | the age of a message by the smallest offset of the sender's clock seen |
//! | `flood` | how many messages a client sends |
//! | `stream` | whether a stream of servo commands goes on, or broke off |
//! | `reason` | why a command is not passed on |
//!
//! The controller itself checks lease, deadline, step and state. What it cannot know is checked
//! here: whether a message is one that somebody kept, whose clock its stamp is of, and whether a
//! stream is the same as before.

mod flood;
mod identity;
mod reason;
mod sender_clock;
mod stream;

use std::collections::BTreeMap;

use i2ris::ipc::random_id;
use i2ris::units::{MAX_OUTPUTS, Nanos, OutputVec};

pub use identity::{Participant, Writer};
pub use reason::Reason;

use flood::Flood;
use sender_clock::SenderClock;
use stream::Stream;

/// Participants that are remembered. A client that comes as another one with every message does
/// not fill the memory.
const PARTICIPANTS: usize = 64;

/// Clients in one participant: objects that publish the same topics beside each other.
const CLIENTS_PER_PARTICIPANT: usize = 4;

/// How old a command may be that is sent once: by its own stamp and by the one of its writer. The
/// clocks of two computers must agree this well.
pub const ONCE_LIMIT: Nanos = Nanos::from_millis(2000);

/// A topic with commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Topic {
    /// `servo_jp`.
    ServoJp,
    /// `servo_jr`.
    ServoJr,
    /// `move_jp`.
    MoveJp,
    /// `move_jr`.
    MoveJr,
    /// `state_command`.
    StateCommand,
    /// `hold`.
    Hold,
    /// `external/measured_jp`.
    External,
}

impl Topic {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 7] = [
        Self::ServoJp,
        Self::ServoJr,
        Self::MoveJp,
        Self::MoveJr,
        Self::StateCommand,
        Self::Hold,
        Self::External,
    ];

    /// Its name under the name of the robot.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::ServoJp => "servo_jp",
            Self::ServoJr => "servo_jr",
            Self::MoveJp => "move_jp",
            Self::MoveJr => "move_jr",
            Self::StateCommand => "state_command",
            Self::Hold => "hold",
            Self::External => "external/measured_jp",
        }
    }
}

/// When a message was sent and when it arrived.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Times {
    /// Arrival, monotonic.
    pub arrived: Nanos,
    /// Arrival, Unix time.
    pub arrived_unix_ns: u64,
    /// When its writer sent it, by its own wall clock; `None`: it does not say.
    pub sent_unix_ns: Option<u64>,
}

/// Values of the right number, all finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// rad; 0 beyond `count`.
    pub position: OutputVec,
    /// Number of joints.
    pub count: u32,
}

/// Checks the number of values, and that they are finite.
///
/// # Errors
///
/// [`Reason::Length`], [`Reason::NotFinite`].
pub fn checked(values: &[f64], joints: usize) -> Result<Pose, Reason> {
    if values.len() != joints || joints == 0 || joints > MAX_OUTPUTS {
        let given = values.len();
        return Err(Reason::Length { given, joints });
    }
    if values.iter().any(|value| !value.is_finite()) {
        return Err(Reason::NotFinite);
    }
    let mut position = [0.0; MAX_OUTPUTS];
    for (to, from) in position.iter_mut().zip(values) {
        *to = *from;
    }
    let count = joints as u32;
    Ok(Pose { position, count })
}

/// One commander as the controller sees it.
#[derive(Debug)]
struct Client {
    id: u64,
    /// Its writer on every topic.
    writers: [Option<Writer>; Topic::ALL.len()],
    flood: Flood,
    stream: Stream,
}

impl Client {
    fn new() -> Self {
        Self {
            id: random_id(),
            writers: [None; Topic::ALL.len()],
            flood: Flood::default(),
            stream: Stream::default(),
        }
    }
}

/// Everything of one process that takes part.
#[derive(Debug, Default)]
struct Peer {
    clients: Vec<Client>,
    clock: SenderClock,
    heard: Nanos,
}

impl Peer {
    /// The client that a writer belongs to: the first that has this writer on the topic, or has
    /// none there yet.
    fn client(&mut self, writer: Writer, topic: Topic) -> Result<&mut Client, Reason> {
        let place = topic as usize;
        let own = |client: &Client| client.writers[place] == Some(writer);
        let free = |client: &Client| client.writers[place].is_none();
        let found =
            { self.clients.iter() }.position(own).or_else(|| self.clients.iter().position(free));
        let found = match found {
            Some(found) => found,
            None if self.clients.len() < CLIENTS_PER_PARTICIPANT => {
                self.clients.push(Client::new());
                self.clients.len() - 1
            }
            None => return Err(Reason::TooManyWriters),
        };
        let client = &mut self.clients[found];
        client.writers[place] = Some(writer);
        Ok(client)
    }
}

/// A servo command that is passed on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Admitted {
    /// The client's identity for the controller.
    pub client_id: u64,
    /// When it was sent, at the latest; monotonic.
    pub stamp: Nanos,
}

/// All clients.
#[derive(Debug)]
pub struct Admission {
    peers: BTreeMap<Participant, Peer>,
    /// Since when commands are listened to.
    since_unix_ns: u64,
}

impl Admission {
    /// Listens since this Unix time. Commands that were sent once and earlier are for somebody
    /// else: implementations of DDS deliver what they keep also to readers that do not ask for it.
    #[must_use]
    pub fn new(since_unix_ns: u64) -> Self {
        Self { peers: BTreeMap::new(), since_unix_ns }
    }

    /// Counts `count` servo commands that arrived together, and judges the newest of them, which
    /// asks for `goal`.
    ///
    /// # Errors
    ///
    /// Why it is not passed on. A client that was never heard has the reason
    /// [`Reason::FirstOfStream`] once: it may be a message that was kept for late joiners.
    pub fn servo(
        &mut self,
        writer: Writer,
        topic: Topic,
        goal: &Pose,
        count: u32,
        times: &Times,
    ) -> Result<Admitted, Reason> {
        let now = times.arrived;
        let peer = self.peer(writer.participant(), now);
        let sent = times.sent_unix_ns.ok_or(Reason::NoStamp)?;
        let age = peer.clock.age(sent, now);
        let client = peer.client(writer, topic)?;
        client.flood.check(count, now)?;
        client.stream.check(&goal.position, now)?;
        Ok(Admitted { client_id: client.id, stamp: now - age })
    }

    /// Judges a command that is sent once. One that is passed on ends the client's stream, and lets
    /// one that broke off begin anew.
    ///
    /// # Errors
    ///
    /// Why it is not passed on. `hold` is, whatever its age and however many came.
    pub fn once(
        &mut self,
        writer: Writer,
        topic: Topic,
        header_unix_ns: Option<u64>,
        times: &Times,
    ) -> Result<u64, Reason> {
        let since_unix_ns = self.since_unix_ns;
        let peer = self.peer(writer.participant(), times.arrived);
        let client = peer.client(writer, topic)?;
        if topic == Topic::Hold {
            // Always right, also in a flood, which it does not end.
            if client.flood.check(1, times.arrived).is_ok() {
                client.stream.begin_anew();
            }
            return Ok(client.id);
        }
        let sent = times.sent_unix_ns.ok_or(Reason::NoStamp)?;
        for stamp in [Some(sent), header_unix_ns].into_iter().flatten() {
            require_recent(stamp, times.arrived_unix_ns, since_unix_ns)?;
        }
        client.flood.check(1, times.arrived)?;
        client.stream.begin_anew();
        Ok(client.id)
    }

    /// Counts what a camera sees.
    ///
    /// # Errors
    ///
    /// [`Reason::Flood`], [`Reason::TooManyWriters`].
    pub fn camera(&mut self, writer: Writer, count: u32, times: &Times) -> Result<(), Reason> {
        let now = times.arrived;
        let client = self.peer(writer.participant(), now);
        client.client(writer, Topic::External)?.flood.check(count, now)
    }

    /// The identity of the client that a writer belongs to.
    #[must_use]
    pub fn client_id(&mut self, writer: Writer, topic: Topic, now: Nanos) -> Option<u64> {
        let peer = self.peer(writer.participant(), now);
        peer.client(writer, topic).ok().map(|client| client.id)
    }

    /// A participant is gone, or was silent for so long that it counts as gone: if it comes back
    /// its streams do not go on by themselves.
    pub fn lost(&mut self, participant: Participant) {
        if let Some(peer) = self.peers.get_mut(&participant) {
            for client in &mut peer.clients {
                client.stream.break_off();
            }
        }
    }

    fn peer(&mut self, participant: Participant, now: Nanos) -> &mut Peer {
        if !self.peers.contains_key(&participant) && self.peers.len() >= PARTICIPANTS {
            let oldest = self.peers.iter().min_by_key(|(_, peer)| peer.heard);
            if let Some(oldest) = oldest.map(|(participant, _)| *participant) {
                self.peers.remove(&oldest);
            }
        }
        let peer = self.peers.entry(participant).or_default();
        peer.heard = now;
        peer
    }
}

fn require_recent(stamp_unix_ns: u64, now_unix_ns: u64, since_unix_ns: u64) -> Result<(), Reason> {
    let apart = Nanos(stamp_unix_ns.abs_diff(now_unix_ns));
    if apart <= ONCE_LIMIT && stamp_unix_ns >= since_unix_ns {
        return Ok(());
    }
    Err(Reason::Old { apart, future: stamp_unix_ns > now_unix_ns })
}

#[cfg(test)]
mod tests;
