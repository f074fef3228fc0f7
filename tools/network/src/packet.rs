//! Packets: bytes in, bytes out. The layout stands in the root of the crate.

use i2ris::units::Nanos;

use crate::key::{Key, MAC_LENGTH};

/// Bytes of a packet at most: less than what an Ethernet carries in one piece, with room for
/// tunnels.
pub const LONGEST: usize = 1420;
/// Bytes before the body.
pub const HEADER: usize = 48;
const MAGIC: [u8; 4] = *b"I2N1";

/// What a packet is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Kind {
    /// A client wants to join.
    Hello = 1,
    /// It may.
    Welcome = 2,
    /// It may not.
    Refused = 3,
    /// The client lives.
    Heartbeat = 4,
    /// The newest of every stream.
    State = 5,
    /// A command in angles.
    ServoJp = 6,
    /// A command in counts.
    ServoActuator = 7,
    /// A request.
    Request = 8,
    /// What became of one.
    Reply = 9,
    /// The sender ends.
    End = 10,
}

impl Kind {
    const ALL: [Self; 10] = [
        Self::Hello,
        Self::Welcome,
        Self::Refused,
        Self::Heartbeat,
        Self::State,
        Self::ServoJp,
        Self::ServoActuator,
        Self::Request,
        Self::Reply,
        Self::End,
    ];

    fn of(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u8 == number)
    }
}

/// What stands before the body.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// What follows.
    pub kind: Kind,
    /// Which session it belongs to.
    pub session: u64,
    /// Rises by one per packet.
    pub number: u64,
    /// The sender's clock.
    pub now: u64,
    /// `now` of the newest packet that the sender had received; 0: none.
    pub echo: u64,
    /// How long ago that was, ns.
    pub held: u64,
}

/// A packet whose mac is right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Packet<'a> {
    /// What it says of itself.
    pub header: Header,
    /// What it carries.
    pub body: &'a [u8],
}

/// The bytes of a packet.
#[must_use]
pub fn write(header: &Header, body: &[u8], key: &Key) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER + body.len() + MAC_LENGTH);
    bytes.extend(MAGIC);
    bytes.extend([header.kind as u8, 0, 0, 0]);
    for number in [
        header.session,
        header.number,
        header.now,
        header.echo,
        header.held,
    ] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(body);
    bytes.extend(key.mac(&bytes));
    bytes
}

/// The packet that these bytes are; `None` for everything else.
#[must_use]
pub fn read<'a>(bytes: &'a [u8], key: &Key) -> Option<Packet<'a>> {
    let (rest, mac) = bytes.split_at_checked(bytes.len().checked_sub(MAC_LENGTH)?)?;
    let (head, body) = rest.split_at_checked(HEADER)?;
    let known = head.starts_with(&MAGIC) && head[5..8] == [0; 3] && bytes.len() <= LONGEST;
    if !known || !key.verify_mac(rest, mac) {
        return None;
    }
    let mut numbers = head[8..]
        .chunks_exact(8)
        .map(|chunk| chunk.try_into().map_or(0, u64::from_le_bytes));
    let mut next = || numbers.next().unwrap_or(0);
    let kind = Kind::of(head[4])?;
    let header = Header {
        kind,
        session: next(),
        number: next(),
        now: next(),
        echo: next(),
        held: next(),
    };
    Some(Packet { header, body })
}

/// How the clock of the sender stands to ours, as far as one packet shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shift {
    /// Our clock, before which the packet was not sent.
    sent: Nanos,
    /// The sender's clock when it was.
    theirs: u64,
}

impl Shift {
    /// From a packet that arrived at `now`; `None` while it echoes nothing, or what we cannot have
    /// sent.
    #[must_use]
    pub fn of(header: &Header, now: Nanos) -> Option<Self> {
        if header.echo == 0 || header.echo > now.0 {
            return None;
        }
        // Clocks that run at different speeds may put it a little later than now, which cannot be.
        let sent = header.echo.saturating_add(header.held).min(now.0);
        Some(Self {
            sent: Nanos(sent),
            theirs: header.now,
        })
    }

    /// A stamp of the sender's clock on ours, never later than it was. 0 means never and stays 0.
    #[must_use]
    pub fn here(&self, stamp: u64) -> u64 {
        if stamp == 0 {
            return 0;
        }
        let difference = i128::from(stamp) - i128::from(self.theirs);
        let here = (i128::from(self.sent.0) + difference).clamp(1, i128::from(u64::MAX));
        u64::try_from(here).unwrap_or(u64::MAX)
    }

    /// The time there and back, without the time that the other end held the echo.
    #[must_use]
    pub fn round_trip(&self, now: Nanos) -> Nanos {
        now.since(self.sent)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn header() -> Header {
        Header {
            kind: Kind::ServoJp,
            session: 1,
            number: 2,
            now: 3,
            echo: 4,
            held: 5,
        }
    }

    #[test]
    fn the_layout_is_the_one_that_is_told() {
        let bytes = write(&header(), &[9, 8], &Key::open());
        assert_eq!(
            bytes[..16],
            [b'I', b'2', b'N', b'1', 6, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0]
        );
        assert_eq!((bytes[24], bytes[32], bytes[40]), (3, 4, 5));
        assert_eq!((&bytes[48..50], bytes.len()), (&[9_u8, 8][..], 66));
    }

    #[test]
    fn no_bit_may_change() {
        let key = Key::of(b"0123456789abcdef");
        let bytes = write(&header(), b"body", &key);
        assert!(read(&bytes, &key).is_some() && read(&bytes, &Key::open()).is_none());
        for bit in 0..bytes.len() * 8 {
            let mut changed = bytes.clone();
            changed[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(read(&changed, &key), None, "bit {bit}");
        }
    }

    proptest! {
        #[test]
        fn what_is_written_is_read(
            kind in 1_u8..=10,
            numbers: [u64; 5],
            body in prop::collection::vec(any::<u8>(), 0..1300),
        ) {
            let [session, number, now, echo, held] = numbers;
            let header = Header { kind: Kind::of(kind).unwrap(), session, number, now, echo, held };
            let bytes = write(&header, &body, &Key::open());
            prop_assert_eq!(read(&bytes, &Key::open()), Some(Packet { header, body: &body }));
        }

        #[test]
        fn whatever_arrives_nothing_panics(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let _ = read(&bytes, &Key::open());
        }

        /// Two clocks that differ by anything; ways of any length; the age is never too small, nor
        /// too large by more than the way of the echo.
        #[test]
        fn a_stamp_is_never_made_younger(
            ours in 1_u64 << 40..1 << 60, theirs in 1_u64 << 40..1 << 60,
            there in 0_u64..1 << 34,
            held in 0_u64..1 << 34,
            back in 0_u64..1 << 34,
            before in 0_u64..1 << 34,
        ) {
            // We send at `ours`; it arrives `there` later, when their clock says `theirs`; they
            // send `held` later.
            let header = Header {
                kind: Kind::ServoJp,
                session: 0,
                number: 0,
                now: theirs + held,
                echo: ours,
                held,
            };
            let now = Nanos(ours + there + held + back);
            let shift = Shift::of(&header, now).unwrap();
            // A command that was stamped `before` it was sent has this age when it arrives.
            let age = before + back;
            let counted = now.0 - shift.here(theirs + held - before);
            prop_assert!(counted >= age && counted <= age + there);
            prop_assert_eq!(shift.round_trip(now).0, there + back);
        }
    }

    #[test]
    fn what_never_was_stays_so_and_nonsense_has_no_shift() {
        let shift = Shift::of(
            &Header {
                echo: 10,
                ..header()
            },
            Nanos(100),
        )
        .unwrap();
        assert_eq!(shift.here(0), 0);
        assert_eq!(
            Shift::of(
                &Header {
                    echo: 0,
                    ..header()
                },
                Nanos(100)
            ),
            None
        );
        assert_eq!(
            Shift::of(
                &Header {
                    echo: 101,
                    ..header()
                },
                Nanos(100)
            ),
            None
        );
        let late = Shift::of(
            &Header {
                echo: 10,
                held: u64::MAX,
                now: 50,
                ..header()
            },
            Nanos(100),
        )
        .unwrap();
        assert_eq!(late.here(50), 100, "nothing was sent after it arrived");
    }
}
