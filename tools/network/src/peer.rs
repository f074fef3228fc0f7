//! The other end of one session: numbers, echoes, silence. Without I/O.

use i2ris::units::Nanos;

use crate::key::Key;
use crate::packet::{self, Header, Kind, Packet, Shift};

/// The other end of one session.
#[derive(Debug)]
pub(crate) struct Peer {
    key: Key,
    session: u64,
    sent: u64,
    received: u64,
    /// `now` of the newest packet, and when it arrived.
    newest: Option<(u64, Nanos)>,
    heard: Nanos,
}

impl Peer {
    /// Nothing sent, nothing received; silence counts from `now`.
    pub fn new(key: &Key, session: u64, now: Nanos) -> Self {
        Self {
            key: key.clone(),
            session,
            sent: 0,
            received: 0,
            newest: None,
            heard: now,
        }
    }

    /// The session.
    pub fn session(&self) -> u64 {
        self.session
    }

    /// The bytes of the next packet.
    pub fn write(&mut self, kind: Kind, body: &[u8], now: Nanos) -> Vec<u8> {
        self.sent += 1;
        let (echo, held) = self
            .newest
            .map_or((0, 0), |(theirs, at)| (theirs, now.since(at).0));
        let header = Header {
            kind,
            session: self.session,
            number: self.sent,
            now: now.0,
            echo,
            held,
        };
        packet::write(&header, body, &self.key)
    }

    /// Takes note of a packet of this session that arrived. `false`: it is of another one, or old,
    /// or was here before.
    pub fn accept(&mut self, packet: &Packet<'_>, now: Nanos) -> bool {
        let header = &packet.header;
        if header.session != self.session || header.number <= self.received {
            return false;
        }
        self.received = header.number;
        self.note(header, now);
        true
    }

    /// Takes note of the clock in a packet, of whichever session.
    pub fn note(&mut self, header: &Header, now: Nanos) {
        self.newest = Some((header.now, now));
        self.heard = now;
    }

    /// How long nothing has been heard.
    pub fn silence(&self, now: Nanos) -> Nanos {
        now.since(self.heard)
    }
}

/// How the sender's clock stands to ours, by a packet that was accepted.
pub(crate) fn shift(packet: &Packet<'_>, now: Nanos) -> Option<Shift> {
    Shift::of(&packet.header, now)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(milliseconds: u64) -> Nanos {
        Nanos::from_millis(1_000_000 + milliseconds)
    }

    #[test]
    fn a_packet_is_taken_once_and_in_order() {
        let key = Key::open();
        let (mut here, mut there) = (Peer::new(&key, 7, at(0)), Peer::new(&key, 7, at(0)));
        let packets: Vec<Vec<u8>> = (0..3)
            .map(|_| there.write(Kind::Heartbeat, &[], at(1)))
            .collect();
        let mut take =
            |number: usize| here.accept(&packet::read(&packets[number], &key).unwrap(), at(2));
        assert!(take(0) && !take(0), "not twice");
        assert!(take(2) && !take(1), "not behind a newer one");
        let mut stranger = Peer::new(&key, 8, at(0));
        let bytes = stranger.write(Kind::Heartbeat, &[], at(1));
        assert!(
            !here.accept(&packet::read(&bytes, &key).unwrap(), at(2)),
            "not of another session"
        );
    }

    #[test]
    fn echoes_carry_how_long_they_were_held() {
        let key = Key::open();
        let (mut here, mut there) = (Peer::new(&key, 7, at(0)), Peer::new(&key, 7, at(0)));
        let first = there.write(Kind::Heartbeat, &[], Nanos(500));
        assert_eq!(packet::read(&first, &key).unwrap().header.echo, 0);
        assert!(here.accept(&packet::read(&first, &key).unwrap(), at(0)));
        let answer = here.write(Kind::State, &[], at(30));
        let header = packet::read(&answer, &key).unwrap().header;
        assert_eq!((header.echo, header.held), (500, Nanos::from_millis(30).0));
        assert_eq!(here.silence(at(30)), Nanos::from_millis(30));
    }
}
