//! Sessions: who may move the snake.
//!
//! A client has a session or none. It begins by something deliberate:
//!
//! - the first command of an unknown client: a person has just started a program;
//! - an executed request that does more than stop. `hold` also counts if its client has sent no
//!   servo command for a second: it stops its own streams;
//! - an open clutch.
//!
//! It ends, for every client, when the robot leaves ENABLED (by `disable`, `pause`, a fault or the
//! end of the controller) and with a `hold`; for one client, when its stream falls silent in motion
//! or is ended by a limit, and when it sends a servo command to a robot that is off, paused or in
//! fault: a client that never stopped sending must not move the robot after another client has
//! enabled it.
//!
//! A client that was sending when another stopped the robot is *held*: it starts nothing until it
//! has been silent for a second, so that no program undoes a stop in a loop. After a `hold`, every
//! other client is held for a second.
//!
//! One client commands at a time: accepted commands take a free lease and renew it, until it
//! expires after `command.lease_timeout_ms` or is released.

use serde::{Deserialize, Serialize};

use crate::core::command::authority::Access;
use crate::core::command::client_stream::ClientStream;
use crate::core::inputs::ServoCommand;
use crate::robot::{Refusal, StateCommand};
use crate::units::{MotorVec, Nanos};

/// Clients that are remembered: twice as many as can send at a time.
const CLIENTS: usize = 16;

const STOPS: usize = 4;

/// Silence that shows a program that has stopped sending.
const BREAK: Nanos = Nanos::from_millis(1000);

/// Number of requests without a pause that only a loop sends, not a person.
const AGAIN: u32 = 3;

/// The two streams of a client: they overtake each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StreamOf {
    /// `servo_jp` and `actuators/servo_jp`.
    Joints,
    /// `jaw/servo_jp`.
    Jaw,
}

/// A servo command when it is read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Arrival<'a> {
    pub of: StreamOf,
    pub command: &'a ServoCommand,
    pub now: Nanos,
}

/// Run of messages without a pause of [`BREAK`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Run {
    since: Nanos,
    last: Nanos,
    count: u32,
}

impl Run {
    fn add(&mut self, now: Nanos) {
        if !self.goes_on(now) {
            *self = Self { since: now, ..Self::default() };
        }
        (self.last, self.count) = (now, self.count.saturating_add(1));
    }

    fn goes_on(&self, now: Nanos) -> bool {
        self.count > 0 && now.duration_since(self.last) < BREAK
    }

    /// The run continues and began before this time.
    fn goes_on_from(&self, before: Nanos, now: Nanos) -> bool {
        self.goes_on(now) && self.since < before
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Client {
    id: u64,
    /// Its session is over: it has to do something deliberate.
    has_ended: bool,
    /// Servo commands, but for an open clutch; the same, and requests that were refused.
    streaming: Run,
    sending: Run,
    /// `enable`, `resume`.
    asking: Run,
    streams: [Option<ClientStream>; 2],
    last_message: Nanos,
}

/// The last stop by a client (0: a fault), and its last `hold`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Stop {
    by: u64,
    at: Nanos,
    hold: Option<Nanos>,
}

impl Stop {
    /// Whether a client that sends so begins nothing.
    fn holds(&self, sending: Run, now: Nanos) -> bool {
        let hold = self.hold.map(|hold| hold + BREAK);
        sending.goes_on_from(self.at, now)
            || hold.is_some_and(|end| now < end || sending.goes_on_from(end, now))
    }
}

/// The sessions of all clients, and the lease.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(in crate::core) struct Sessions {
    clients: [Option<Client>; CLIENTS],
    /// Last message of a client that did not fit into the table: an unknown client may be that one.
    crowded: Option<Nanos>,
    /// Those of the clients that stopped it last, newest first.
    stops: [Option<Stop>; STOPS],
    pub lease_duration: Nanos,
    /// The client that commands, and when it took or last renewed the lease.
    lease: Option<(u64, Nanos)>,
}

impl Sessions {
    pub(crate) fn new(lease_duration: Nanos) -> Self {
        let (clients, stops) = ([None; CLIENTS], [None; STOPS]);
        Self { clients, crowded: None, stops, lease_duration, lease: None }
    }

    /// The client that holds the lease; 0: none.
    pub(crate) fn holder(&self) -> u64 {
        self.lease.map_or(0, |(client_id, _)| client_id)
    }

    /// Takes or renews the lease. Returns whether the holder changes.
    pub(crate) fn renew_lease(&mut self, client_id: u64, now: Nanos) -> bool {
        let is_new = self.holder() != client_id;
        self.lease = Some((client_id, now));
        is_new
    }

    /// Frees the lease if it has expired. Returns whether it has.
    pub(crate) fn expire_lease(&mut self, now: Nanos) -> bool {
        let duration = self.lease_duration;
        self.lease.take_if(|(_, renewed)| now.duration_since(*renewed) >= duration).is_some()
    }

    /// Gives the lease of a client back. Returns whether the client had it.
    pub(crate) fn release_lease(&mut self, client_id: u64) -> bool {
        self.lease.take_if(|(holder, _)| *holder == client_id).is_some()
    }

    /// The table of `authority`. `commander`: the commanding client; 0: none.
    pub(crate) fn require(
        &self,
        access: Access,
        client_id: u64,
        commander: u64,
        now: Nanos,
    ) -> Result<(), Refusal> {
        let is_free = [0, client_id].contains(&commander);
        match access {
            Access::Own | Access::Alone if !is_free => Err(Refusal::Lease),
            Access::Alone if self.is_held(|_| true, client_id, now) => {
                Err(Refusal::StreamInterrupted)
            }
            Access::Power if self.undoes_a_stop(client_id, now) => Err(Refusal::StreamInterrupted),
            Access::AnyClient | Access::Power | Access::Own | Access::Alone => Ok(()),
        }
    }

    /// Refuses a servo command of a client without a session, and one that is not newer than the
    /// last one of its stream.
    pub(crate) fn require_stream(
        &self,
        Arrival { of, command, now }: Arrival<'_>,
    ) -> Result<(), Refusal> {
        let client = self.client(command.client_id);
        let stream = client.and_then(|client| client.streams[of as usize]);
        let has_session = match client {
            Some(client) => !client.has_ended && !stream.is_some_and(|it| it.is_broken_off(now)),
            None => !self.is_crowded(now) && self.place(now, false).is_some(),
        };
        if !has_session && !command.clutched {
            return Err(Refusal::StreamInterrupted);
        }
        stream.map_or(Ok(()), |it| it.require_newer(command.sequence, command.stamp))
    }

    /// Sequence and stamp of the last accepted command of the joints.
    pub(crate) fn last(&self, client_id: u64) -> Option<(u64, Nanos)> {
        let stream = self.client(client_id)?.streams[StreamOf::Joints as usize]?;
        Some((stream.sequence, stream.stamp))
    }

    /// A servo command was accepted, with the setpoints where they are.
    pub(crate) fn accepted(
        &mut self,
        Arrival { of, command, now }: Arrival<'_>,
        setpoints: &MotorVec,
        deadline: Nanos,
    ) {
        let Some(client) = self.remember(command.client_id, now, true) else { return };
        client.has_ended = false;
        if !command.clutched {
            client.streaming.add(now);
            client.sending.add(now);
        }
        let stream = client.streams[of as usize].get_or_insert(ClientStream::new(setpoints));
        (stream.sequence, stream.stamp) = (command.sequence, command.stamp);
        stream.accepted(setpoints, deadline, now);
    }

    /// Records a refused servo command. Late commands do not keep a stream alive, and malformed
    /// ones are not recorded.
    pub(crate) fn refused(&mut self, arrival: Arrival<'_>, refusal: Refusal) {
        let Arrival { of, command, now } = arrival;
        let no_command = [Refusal::Malformed, Refusal::NotFinite, Refusal::Stamp, Refusal::Stale];
        if no_command.contains(&refusal) && self.client(command.client_id).is_none() {
            return;
        }
        let is_late = self.is_crowded(now) && self.client(command.client_id).is_none();
        let Some(client) = self.remember(command.client_id, now, false) else {
            self.crowded = Some(now);
            return;
        };
        client.has_ended |= is_late;
        if !command.clutched {
            client.streaming.add(now);
            client.sending.add(now);
        }
        if let Some(stream) = &mut client.streams[of as usize]
            && refusal != Refusal::Stale
        {
            stream.refused(now);
        }
        let of_state = [Refusal::NotEnabled, Refusal::Paused, Refusal::InFault];
        client.has_ended |= of_state.contains(&refusal);
    }

    pub(crate) fn record_request(&mut self, command: StateCommand, client_id: u64, now: Nanos) {
        if matches!(command, StateCommand::Enable | StateCommand::Resume)
            && let Some(client) = self.remember(client_id, now, true)
        {
            client.asking.add(now);
        }
    }

    pub(crate) fn carried_out(&mut self, command: StateCommand, client_id: u64, now: Nanos) {
        let is_held = self.is_held(|stop| stop.by != 0, client_id, now);
        let Some(client) = self.remember(client_id, now, true) else { return };
        let begins = match command {
            StateCommand::Disable | StateCommand::Pause => false,
            StateCommand::Hold => !client.streaming.goes_on(now),
            _ => true,
        };
        client.has_ended = !begins || client.has_ended && is_held;
        if begins && !is_held {
            // No earlier stream continues.
            client.sending = Run::default();
        }
        if !client.has_ended {
            client.streams.iter_mut().flatten().for_each(ClientStream::reset);
        }
    }

    /// A request was refused: its client is not silent.
    pub(crate) fn request_refused(&mut self, client_id: u64, now: Nanos) {
        if let Some(client) = self.remember(client_id, now, false) {
            client.sending.add(now);
        }
    }

    /// The robot was stopped by a client; 0: by a fault.
    pub(crate) fn stopped(&mut self, by: u64, is_hold: bool, now: Nanos) {
        let own = self.stops.iter().position(|stop| stop.is_some_and(|stop| stop.by == by));
        let before = own.and_then(|index| self.stops.get(index).copied().flatten());
        // Who was held, and then stops, does not free itself.
        if let Some(stops) = self.stops.get_mut(..=own.unwrap_or(STOPS - 1)) {
            stops.rotate_right(1);
        }
        let hold = if is_hold { Some(now) } else { before.and_then(|stop| stop.hold) };
        let [first, ..] = &mut self.stops;
        *first = Some(Stop { by, at: now, hold });
        self.end_all();
    }

    pub(crate) fn end_all(&mut self) {
        self.clients.iter_mut().flatten().for_each(|client| client.has_ended = true);
    }

    /// A stream was stopped as stale while the setpoints moved.
    pub(crate) fn stopped_moving(
        &mut self,
        of: StreamOf,
        client_id: u64,
        at: &MotorVec,
        now: Nanos,
    ) {
        self.stream_mut(of, client_id).into_iter().for_each(|it| it.stopped_moving(at, now));
    }

    /// A limit ended the stream of the joints.
    pub(crate) fn blocked(&mut self, client_id: u64) {
        let stream = self.stream_mut(StreamOf::Joints, client_id);
        stream.into_iter().for_each(ClientStream::break_off);
    }

    fn stream_mut(&mut self, of: StreamOf, client_id: u64) -> Option<&mut ClientStream> {
        let mut clients = self.clients.iter_mut().flatten();
        clients.find(|client| client.id == client_id)?.streams[of as usize].as_mut()
    }

    /// Whether a stop holds the client, of those that count.
    fn is_held(&self, counts: impl Fn(&Stop) -> bool, client_id: u64, now: Nanos) -> bool {
        let sending = self.client(client_id).map(|client| client.sending).unwrap_or_default();
        let mut stops = self.stops_of_others(client_id).filter(|stop| counts(stop));
        stops.any(|stop| stop.holds(sending, now))
    }

    fn is_crowded(&self, now: Nanos) -> bool {
        self.crowded.is_some_and(|last_message| now.duration_since(last_message) < BREAK)
    }

    fn undoes_a_stop(&self, client_id: u64, now: Nanos) -> bool {
        let asking = self.client(client_id).map(|client| client.asking).unwrap_or_default();
        let mut stops = self.stops_of_others(client_id).filter(|_| asking.count >= AGAIN);
        stops.any(|stop| {
            stop.by != 0 && stop.hold != Some(stop.at) && asking.goes_on_from(stop.at, now)
        })
    }

    fn stops_of_others(&self, client_id: u64) -> impl Iterator<Item = &Stop> {
        self.stops.iter().flatten().filter(move |stop| stop.by != client_id)
    }

    fn client(&self, client_id: u64) -> Option<&Client> {
        self.clients.iter().flatten().find(|client| client.id == client_id)
    }

    /// Where the next client is remembered: in place of the one that was silent for longest, for at
    /// least [`BREAK`] unless it has to be.
    fn place(&self, now: Nanos, has_to_be: bool) -> Option<usize> {
        let age = |client: &Option<Client>| client.map(|client| client.last_message);
        let (index, oldest) = self.clients.iter().map(age).enumerate().min_by_key(|it| it.1)?;
        let is_silent = |last_message| now.duration_since(last_message) >= BREAK;
        (has_to_be || oldest.is_none_or(is_silent)).then_some(index)
    }

    fn remember(&mut self, id: u64, now: Nanos, has_to_be: bool) -> Option<&mut Client> {
        let known = self.clients.iter().position(|it| it.is_some_and(|client| client.id == id));
        let index = known.or_else(|| self.place(now, has_to_be))?;
        let slot = self.clients.get_mut(index)?;
        if known.is_none() {
            let (has_ended, streams, last_message) = (false, [None; 2], now);
            let [streaming, sending, asking] = [Run::default(); 3];
            *slot =
                Some(Client { id, has_ended, streaming, sending, asking, streams, last_message });
        }
        let client = slot.as_mut()?;
        client.last_message = now;
        Some(client)
    }
}
