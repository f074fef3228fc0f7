//! Admission of commands to the controller, by sender and age. Without I/O.
//!
//! The controller itself checks lease, deadline, step and state of every command. This module
//! checks the rest: the sender, the age by clocks that differ, and whether the message was stored
//! on the way. ROS 2 has neither keys nor sessions, so the message is the only evidence.

use std::collections::BTreeMap;
use std::fmt;

use i2ris::ipc::random_id;
use i2ris::units::{MAX_OUTPUTS, Nanos, OutputVec};

use crate::clock::SenderClock;
use crate::event::Reason;

const PARTICIPANTS: usize = 64;
/// Age from which nothing is passed on, so that a stream in motion is interrupted. The controller
/// refuses commands older than its own deadline, which is shorter.
const LATE: Nanos = Nanos::from_millis(250);
/// Maximum number of clients in one participant: objects that publish the same topics.
const CLIENTS_PER_PARTICIPANT: usize = 4;

/// Maximum age of a command that is sent once, by its stamp.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ages {
    pub oldest: Nanos,
    /// Maximum time in the future: the clock of its sender may be ahead.
    pub ahead: Nanos,
    /// Start of the subscription, by the same clock. Earlier commands are for a different reader:
    /// implementations of DDS deliver stored messages also to readers that do not request them.
    pub since_ns: u64,
}

impl Ages {
    pub fn check(&self, stamp_ns: u64, now_ns: u64) -> Result<(), Reason> {
        let (apart, future) = (Nanos(stamp_ns.abs_diff(now_ns)), stamp_ns > now_ns);
        let limit = if future { self.ahead } else { self.oldest };
        if apart <= limit && stamp_ns >= self.since_ns {
            return Ok(());
        }
        Err(Reason::Old { apart, future })
    }
}

/// The writer of a message, as DDS names it: unique in the world while it lives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Writer(pub [u8; 16]);

/// The process, or context of ROS, that a writer belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Participant(pub [u8; 12]);

impl Writer {
    pub fn participant(&self) -> Participant {
        Participant(std::array::from_fn(|i| self.0[i]))
    }
}

impl fmt::Display for Participant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

macro_rules! topics {
    ($($topic:ident $name:literal,)*) => {
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Topic { $($topic,)* }

        impl Topic {
            pub const ALL: &'static [Self] = &[$(Self::$topic,)*];

            pub const fn name(self) -> &'static str {
                match self { $(Self::$topic => $name,)* }
            }
        }
    };
}

topics! {
    ServoJp "servo_jp",
    ServoJr "servo_jr",
    ServoJv "servo_jv",
    InterpolateJp "interpolate_jp",
    ServoCp "servo_cp",
    ServoCv "servo_cv",
    MoveJp "move_jp",
    MoveJr "move_jr",
    MoveCp "move_cp",
    Jaw "jaw/servo_jp",
    StateCommand "state_command",
    Hold "hold",
    Free "free",
    External "external/measured_jp",
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Times {
    pub arrived: Nanos,
    pub arrived_unix_ns: u64,
    /// Time of sending, by the wall clock of its writer; `None`: not given.
    pub sent_unix_ns: Option<u64>,
}

/// Values of the right number, all finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// rad, or rad/s, m or m/s as the topic says; 0 beyond `count`.
    pub position: OutputVec,
    pub count: u32,
}

impl Pose {
    /// The pose at this distance from another.
    pub fn from(&self, start: &OutputVec) -> Self {
        Self { position: std::array::from_fn(|i| self.position[i] + start[i]), ..*self }
    }
}

pub fn checked(values: &[f64], joints: usize) -> Result<Pose, Reason> {
    if values.len() != joints || joints == 0 || joints > MAX_OUTPUTS {
        let given = values.len();
        return Err(Reason::Length { given, joints });
    }
    if values.iter().any(|value| !value.is_finite()) {
        return Err(Reason::NotFinite);
    }
    let mut position = [0.0; MAX_OUTPUTS];
    position[..joints].copy_from_slice(values);
    Ok(Pose { position, count: joints as u32 })
}

/// A commander in the view of the controller.
#[derive(Debug, Default)]
struct Client {
    id: u64,
    writers: [Option<Writer>; Topic::ALL.len()],
    flood: Flood,
    /// Whether the first message of its stream has arrived, and of that of the auxiliary axis.
    has_begun: [bool; 2],
}

#[derive(Debug, Default)]
struct Peer {
    clients: Vec<Client>,
    clock: SenderClock,
}

impl Peer {
    /// The client of a writer: the first that has this writer on the topic, or none there yet.
    fn client(&mut self, writer: Writer, topic: Topic) -> Result<&mut Client, Reason> {
        let place = topic as usize;
        let own = |client: &Client| client.writers[place] == Some(writer);
        let free = |client: &Client| client.writers[place].is_none();
        let found =
            { self.clients.iter() }.position(own).or_else(|| self.clients.iter().position(free));
        let found = match found {
            Some(found) => found,
            None if self.clients.len() < CLIENTS_PER_PARTICIPANT => {
                self.clients.push(Client { id: random_id(), ..Client::default() });
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
    pub client_id: u64,
    /// Latest possible time of sending; monotonic.
    pub stamp: Nanos,
}

/// Judges every message of ROS by its writer and its times.
#[derive(Debug)]
pub struct Admission {
    /// Known participants, at most [`PARTICIPANTS`], with the time of their last message.
    peers: BTreeMap<Participant, (Nanos, Peer)>,
    /// Age limits of commands that are sent once, by their own stamp and by that of their writer.
    ages: Ages,
}

impl Admission {
    pub const fn new(ages: Ages) -> Self {
        Self { peers: BTreeMap::new(), ages }
    }

    /// Notes a message of a participant. A new one replaces the one that has been silent for
    /// longest: a sender that changes its identity with every message does not fill the memory.
    fn peer(&mut self, participant: Participant, now: Nanos) -> &mut Peer {
        if !self.peers.contains_key(&participant) && self.peers.len() >= PARTICIPANTS {
            let oldest = self.peers.iter().min_by_key(|(_, (last_seen, _))| *last_seen);
            if let Some(oldest) = oldest.map(|(oldest, _)| *oldest) {
                self.peers.remove(&oldest);
            }
        }
        let (last_seen, peer) = self.peers.entry(participant).or_default();
        *last_seen = now;
        peer
    }

    /// Counts `count` servo commands that arrived together, and judges the newest. The first of a
    /// client is refused ([`Reason::FirstOfStream`]): it may have been stored for late joiners.
    pub fn servo(
        &mut self,
        writer: Writer,
        topic: Topic,
        count: u32,
        times: &Times,
    ) -> Result<Admitted, Reason> {
        let now = times.arrived;
        let peer = self.peer(writer.participant(), now);
        let sent = times.sent_unix_ns.ok_or(Reason::NoStamp)?;
        let age = peer.clock.age(sent, now);
        let client = peer.client(writer, topic)?;
        client.flood.check(count, now)?;
        if age > LATE {
            return Err(Reason::Late(age));
        }
        let [of_joints, of_jaw] = &mut client.has_begun;
        let has_begun = if topic == Topic::Jaw { of_jaw } else { of_joints };
        if !std::mem::replace(has_begun, true) {
            return Err(Reason::FirstOfStream);
        }
        Ok(Admitted { client_id: client.id, stamp: now - age })
    }

    /// Returns the client that stops the robot. A stop always passes, at any age and rate, and from
    /// any publisher. It ends the client's stream unless it is a flood.
    pub fn stop(&mut self, writer: Writer, topic: Topic, times: &Times) -> u64 {
        let peer = self.peer(writer.participant(), times.arrived);
        match peer.client(writer, topic) {
            Ok(client) => {
                if client.flood.check(1, times.arrived).is_ok() {
                    client.has_begun = [false; 2];
                }
                client.id
            }
            // One of too many publishers: any identity will do.
            Err(_) => peer.clients.first().map_or_else(random_id, |client| client.id),
        }
    }

    /// Judges a command that is sent once. One that is passed on ends the client's stream.
    pub fn once(
        &mut self,
        writer: Writer,
        topic: Topic,
        header_unix_ns: Option<u64>,
        times: &Times,
    ) -> Result<u64, Reason> {
        let ages = self.ages;
        let client = self.peer(writer.participant(), times.arrived).client(writer, topic)?;
        let sent = times.sent_unix_ns.ok_or(Reason::NoStamp)?;
        for stamp in [Some(sent), header_unix_ns].into_iter().flatten() {
            ages.check(stamp, times.arrived_unix_ns)?;
        }
        client.flood.check(1, times.arrived)?;
        client.has_begun = [false; 2];
        Ok(client.id)
    }

    pub fn camera(&mut self, writer: Writer, count: u32, times: &Times) -> Result<(), Reason> {
        let peer = self.peer(writer.participant(), times.arrived);
        peer.client(writer, Topic::External)?.flood.check(count, times.arrived)
    }

    pub fn client_id(&mut self, writer: Writer, topic: Topic, now: Nanos) -> Option<u64> {
        let peer = self.peer(writer.participant(), now);
        peer.client(writer, topic).ok().map(|client| client.id)
    }

    /// Forgets a participant that is gone or was silent for long: its next message may be stored.
    pub fn lost(&mut self, participant: Participant) {
        let Some((_, peer)) = self.peers.get_mut(&participant) else { return };
        peer.clients.iter_mut().for_each(|client| client.has_begun = [false; 2]);
    }

    /// Frees the places of a closed publisher; the first message of the next one may be stored.
    pub fn closed(&mut self, writer: Writer) {
        let Some((_, peer)) = self.peers.get_mut(&writer.participant()) else { return };
        for client in &mut peer.clients {
            for place in client.writers.iter_mut().filter(|place| **place == Some(writer)) {
                (*place, client.has_begun) = (None, [false; 2]);
            }
        }
    }
}

/// Maximum message rate of one client, 1/s: twice the rate of the loop.
const PER_SECOND: u32 = 2000;
/// Long enough for a client that catches up after a stall of the machine.
const WINDOW: Nanos = Nanos::from_millis(1000);

#[derive(Debug, Default)]
struct Flood {
    start: Nanos,
    count: u32,
    flooding: bool,
}

impl Flood {
    /// Refuses too many in this window or in the previous one: a flood never gets through.
    fn check(&mut self, count: u32, now: Nanos) -> Result<(), Reason> {
        let elapsed = now.duration_since(self.start);
        if elapsed >= WINDOW {
            self.flooding = self.count > PER_SECOND && elapsed < WINDOW + WINDOW;
            (self.start, self.count) = (now, 0);
        }
        self.count = self.count.saturating_add(count);
        if self.flooding || self.count > PER_SECOND {
            return Err(Reason::Flood { per_second: PER_SECOND });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
