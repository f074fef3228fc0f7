//! The V1 frame of EPOS2 on RS232 with its handshake bytes (reference, section 2.1).

use crc::{CRC_16_XMODEM, Crc};

use crate::drive::frame::{Incoming, Request};

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_XMODEM);

/// Ready, or: the CRC was good.
pub(super) const OKAY: u8 = 0x4F;
/// Not ready, or: the CRC was wrong.
pub(super) const FAILED: u8 = 0x46;

/// Opcodes that the drive is ready for.
const OPCODES: [u8; 9] = [0x0E, 0x10, 0x11, 0x12, 0x13, 0x14, 0x15, 0x20, 0x21];

#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) enum Handshake {
    /// The next byte is an opcode.
    #[default]
    Idle,
    /// Length, data and CRC follow.
    Body { opcode: u8, held: Vec<u8> },
    /// The reply is ready; the host must acknowledge.
    Ready { reply: Vec<u8> },
    /// The reply is sent; the host must confirm its CRC.
    Sent,
}

/// What the port does after a byte.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Action {
    /// Waits for more bytes.
    Wait,
    /// Acknowledges with this byte.
    Acknowledge(u8),
    /// Acknowledges with `OKAY`, then executes the complete request.
    Execute(Incoming),
    /// Sends these bytes: the host is ready.
    Send(Vec<u8>),
    /// Discards the exchange: the host sent an unexpected byte.
    Discard,
}

impl Handshake {
    /// Takes the next byte.
    pub(super) fn push(&mut self, byte: u8) -> Action {
        match std::mem::take(self) {
            Self::Idle if OPCODES.contains(&byte) => {
                let (opcode, held) = (byte, Vec::new());
                *self = Self::Body { opcode, held };
                Action::Acknowledge(OKAY)
            }
            // A late handshake byte, or an unknown opcode.
            Self::Idle if byte == OKAY || byte == FAILED => Action::Wait,
            Self::Idle => Action::Acknowledge(FAILED),
            Self::Body { opcode, mut held } => {
                held.push(byte);
                if held.len() < 1 + 2 * (usize::from(held[0]) + 1) + 2 {
                    *self = Self::Body { opcode, held };
                    return Action::Wait;
                }
                if checksum(opcode, &held) != 0 {
                    return Action::Acknowledge(FAILED);
                }
                let data = held[1..held.len() - 2].to_vec();
                Action::Execute(Incoming::Request(Request { opcode, data }))
            }
            Self::Ready { reply } if byte == OKAY => {
                *self = Self::Sent;
                Action::Send(reply)
            }
            Self::Ready { .. } if byte == FAILED => Action::Wait,
            Self::Sent if byte == OKAY || byte == FAILED => Action::Wait,
            Self::Ready { .. } | Self::Sent => Action::Discard,
        }
    }

    /// Offers the reply to the request.
    pub(super) fn offer(&mut self, data: &[u8]) {
        let reply = encode(data);
        *self = Self::Ready { reply };
    }
}

/// Length, data and CRC of a reply.
fn encode(data: &[u8]) -> Vec<u8> {
    let mut body = vec![(data.len().div_ceil(2).max(1) - 1) as u8];
    body.extend_from_slice(data);
    if data.len() % 2 == 1 {
        body.push(0);
    }
    let crc = checksum(0, &body);
    body.extend_from_slice(&crc.to_le_bytes());
    body
}

/// CRC over opcode and length in the order of the wire, then each pair of data swapped.
fn checksum(opcode: u8, body: &[u8]) -> u16 {
    let mut digest = CRC.digest();
    digest.update(&[opcode, body[0]]);
    for pair in body[1..].chunks(2) {
        for byte in pair.iter().rev() {
            digest.update(&[*byte]);
        }
    }
    digest.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exchange_of_the_reference_completes() {
        let mut handshake = Handshake::default();
        assert_eq!(handshake.push(0x10), Action::Acknowledge(OKAY));
        let body = [0x01, 0x03, 0x20, 0x01, 0x02, 0x88, 0xA8];
        let actions = body.map(|byte| handshake.push(byte));
        let (opcode, data) = (0x10, vec![0x03, 0x20, 0x01, 0x02]);
        let request = Incoming::Request(Request { opcode, data });
        assert_eq!(actions.last(), Some(&Action::Execute(request)));
        handshake.offer(&[0, 0, 0, 0, 0x10, 0x20, 0x10, 0x62]);
        let reply = vec![0x03, 0, 0, 0, 0, 0x10, 0x20, 0x10, 0x62, 0x10, 0x26];
        assert_eq!(handshake.push(OKAY), Action::Send(reply));
        assert_eq!(handshake.push(OKAY), Action::Wait);
        assert_eq!(handshake, Handshake::Idle);
    }
}
