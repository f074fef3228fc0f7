//! The V1 frame of EPOS2 on RS232: a byte of hand-shake for every part (reference, section 2.1).

use crc::{CRC_16_XMODEM, Crc};

use crate::frame::{Incoming, Request};

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_XMODEM);

/// Ready, or: the CRC was good.
pub(super) const OKAY: u8 = 0x4F;
/// Not ready, or: the CRC was wrong.
pub(super) const FAILED: u8 = 0x46;

/// Opcodes that the drive is ready for.
const OPCODES: [u8; 9] = [0x0E, 0x10, 0x11, 0x12, 0x13, 0x14, 0x15, 0x20, 0x21];

/// Where an exchange stands.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) enum Shake {
    /// The next byte is an opcode.
    #[default]
    Idle,
    /// Length, data and CRC follow.
    Rest { opcode: u8, held: Vec<u8> },
    /// The reply is ready; the host must say that it is.
    Ready { reply: Vec<u8> },
    /// The reply is out; the host must say how it came.
    Out,
}

/// What a byte led to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Heard {
    /// More bytes are needed.
    Nothing,
    /// This byte answers it.
    Say(u8),
    /// A request is complete. `OKAY` answers it, then it is carried out.
    Request(Incoming),
    /// The host is ready: these bytes follow.
    Send(Vec<u8>),
    /// The host sent what no one asked for. The exchange is forgotten.
    Unasked,
}

impl Shake {
    /// Takes the next byte.
    pub(super) fn push(&mut self, byte: u8) -> Heard {
        match std::mem::take(self) {
            Self::Idle if OPCODES.contains(&byte) => {
                *self = Self::Rest {
                    opcode: byte,
                    held: Vec::new(),
                };
                Heard::Say(OKAY)
            }
            // A byte of hand-shake that came late, or an opcode that there is not.
            Self::Idle if byte == OKAY || byte == FAILED => Heard::Nothing,
            Self::Idle => Heard::Say(FAILED),
            Self::Rest { opcode, mut held } => {
                held.push(byte);
                if held.len() < 1 + 2 * (usize::from(held[0]) + 1) + 2 {
                    *self = Self::Rest { opcode, held };
                    return Heard::Nothing;
                }
                if checksum(opcode, &held) != 0 {
                    return Heard::Say(FAILED);
                }
                let data = held[1..held.len() - 2].to_vec();
                Heard::Request(Incoming::Request(Request { opcode, data }))
            }
            Self::Ready { reply } if byte == OKAY => {
                *self = Self::Out;
                Heard::Send(reply)
            }
            Self::Ready { .. } if byte == FAILED => Heard::Nothing,
            Self::Out if byte == OKAY || byte == FAILED => Heard::Nothing,
            Self::Ready { .. } | Self::Out => Heard::Unasked,
        }
    }

    /// The reply to the request is ready.
    pub(super) fn offer(&mut self, data: &[u8]) {
        *self = Self::Ready {
            reply: encode(data),
        };
    }
}

/// Length, data and CRC of a reply.
fn encode(data: &[u8]) -> Vec<u8> {
    let mut rest = vec![(data.len().div_ceil(2).max(1) - 1) as u8];
    rest.extend_from_slice(data);
    if data.len() % 2 == 1 {
        rest.push(0);
    }
    let crc = checksum(0, &rest);
    rest.extend_from_slice(&crc.to_le_bytes());
    rest
}

/// CRC over opcode and length in the order of the wire, then each pair of data swapped.
fn checksum(opcode: u8, rest: &[u8]) -> u16 {
    let mut digest = CRC.digest();
    digest.update(&[opcode, rest[0]]);
    for pair in rest[1..].chunks(2) {
        pair.iter().rev().for_each(|byte| digest.update(&[*byte]));
    }
    digest.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exchange_of_the_reference_goes_through() {
        let mut shake = Shake::default();
        assert_eq!(shake.push(0x10), Heard::Say(OKAY));
        let rest = [0x01, 0x03, 0x20, 0x01, 0x02, 0x88, 0xA8];
        let heard: Vec<Heard> = rest.iter().map(|byte| shake.push(*byte)).collect();
        let request = Request {
            opcode: 0x10,
            data: vec![0x03, 0x20, 0x01, 0x02],
        };
        assert_eq!(
            heard.last(),
            Some(&Heard::Request(Incoming::Request(request)))
        );
        shake.offer(&[0, 0, 0, 0, 0x10, 0x20, 0x10, 0x62]);
        let reply = vec![0x03, 0, 0, 0, 0, 0x10, 0x20, 0x10, 0x62, 0x10, 0x26];
        assert_eq!(shake.push(OKAY), Heard::Send(reply));
        assert_eq!(shake.push(OKAY), Heard::Nothing);
        assert_eq!(shake, Shake::Idle);
    }

    #[test]
    fn damage_and_impatience_are_noticed() {
        let mut shake = Shake::default();
        assert_eq!(
            shake.push(0x60),
            Heard::Say(FAILED),
            "an opcode of the EPOS4"
        );
        shake.push(0x10);
        let heard: Vec<Heard> = [0x01, 0x41, 0x60, 0, 1, 0xAB, 0xF1]
            .iter()
            .map(|byte| shake.push(*byte))
            .collect();
        assert_eq!(heard.last(), Some(&Heard::Say(FAILED)));
        assert_eq!(shake, Shake::Idle);
        shake.offer(&[0; 4]);
        assert_eq!(shake.push(0x10), Heard::Unasked);
    }
}
