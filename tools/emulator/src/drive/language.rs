//! What a request asks for: opcodes and parameters of the two families.
//!
//! EPOS4: Communication Guide, chapter on the serial line. EPOS2: that of the first EPOS; its
//! parameters come in another order (reference, section 2.1).

use super::Family;
use super::code::Abort;
use crate::frame::Request;

/// What a request asks for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Command {
    /// The value of an object.
    Read { index: u16, sub: u8 },
    /// Set an object.
    Write { index: u16, sub: u8, raw: u32 },
    /// Open a segmented read.
    StartReading { index: u16, sub: u8 },
    /// The next segment.
    ReadSegment { toggle: bool },
    /// Open a segmented write.
    StartWriting { index: u16, sub: u8, length: usize },
    /// The next segment.
    WriteSegment {
        length: u8,
        toggle: bool,
        last: bool,
        bytes: Vec<u8>,
    },
    /// Network management of a node; 0: all.
    Manage { node: u8, command: u8 },
}

impl Command {
    /// Longer than one exchange: a gateway does not carry it.
    pub(crate) const fn is_segmented(&self) -> bool {
        !matches!(
            self,
            Self::Read { .. } | Self::Write { .. } | Self::Manage { .. }
        )
    }

    /// An EPOS2 does not answer network management.
    pub(crate) fn is_answered(&self, family: Family) -> bool {
        family == Family::Epos4 || !matches!(self, Self::Manage { .. })
    }
}

/// A command, and the node that it is for where it names one.
pub(crate) type Addressed = (Option<u8>, Command);

/// Understands a request.
///
/// # Errors
///
/// When there is no such opcode, or its data have the wrong length.
pub(crate) fn understand(family: Family, request: &Request) -> Result<Addressed, Abort> {
    match family {
        Family::Epos4 => epos4(request),
        Family::Epos2 => epos2(request),
    }
}

fn epos4(request: &Request) -> Result<Addressed, Abort> {
    const KNOWN: [u8; 7] = [0x60, 0x62, 0x68, 0x69, 0x6A, 0x70, 0x81];
    Ok(match (request.opcode, &request.data[..]) {
        (0x60, &[node, low, high, sub]) => (
            Some(node),
            Command::Read {
                index: word(low, high),
                sub,
            },
        ),
        (0x68, &[node, low, high, sub, a, b, c, d]) => (
            Some(node),
            Command::Write {
                index: word(low, high),
                sub,
                raw: u32::from_le_bytes([a, b, c, d]),
            },
        ),
        (0x81, &[node, low, high, sub]) => (
            Some(node),
            Command::StartReading {
                index: word(low, high),
                sub,
            },
        ),
        (0x62, &[control, _]) => (
            None,
            Command::ReadSegment {
                toggle: control & 1 != 0,
            },
        ),
        (0x69, &[node, low, high, sub, a, b, c, d]) => {
            let length = u32::from_le_bytes([a, b, c, d]) as usize;
            (
                Some(node),
                Command::StartWriting {
                    index: word(low, high),
                    sub,
                    length,
                },
            )
        }
        (0x6A, &[length, control, ref bytes @ ..]) => {
            let (toggle, last) = (control & 1 != 0, control & 2 != 0);
            (
                None,
                Command::WriteSegment {
                    length,
                    toggle,
                    last,
                    bytes: bytes.to_vec(),
                },
            )
        }
        (0x70, &[node, 0, command, 0]) => (None, Command::Manage { node, command }),
        (0x7A | 0x7B, _) => return Err(Abort::UnsupportedAccess),
        (opcode, _) => {
            return Err(if KNOWN.contains(&opcode) {
                Abort::Length
            } else {
                Abort::IllegalCommand
            });
        }
    })
}

fn epos2(request: &Request) -> Result<Addressed, Abort> {
    const KNOWN: [u8; 7] = [0x0E, 0x10, 0x11, 0x12, 0x13, 0x14, 0x15];
    Ok(match (request.opcode, &request.data[..]) {
        (0x10, &[low, high, sub, node]) => (
            Some(node),
            Command::Read {
                index: word(low, high),
                sub,
            },
        ),
        (0x11, &[low, high, sub, node, a, b, c, d]) => (
            Some(node),
            Command::Write {
                index: word(low, high),
                sub,
                raw: u32::from_le_bytes([a, b, c, d]),
            },
        ),
        (0x12, &[low, high, sub, node]) => (
            Some(node),
            Command::StartReading {
                index: word(low, high),
                sub,
            },
        ),
        (0x14, &[control, _]) => (
            None,
            Command::ReadSegment {
                toggle: control & 1 << 6 != 0,
            },
        ),
        (0x0E, &[node, 0, command, 0]) => (None, Command::Manage { node, command }),
        (0x13 | 0x15 | 0x20 | 0x21, _) => return Err(Abort::UnsupportedAccess),
        (opcode, _) => {
            return Err(if KNOWN.contains(&opcode) {
                Abort::Length
            } else {
                Abort::IllegalCommand
            });
        }
    })
}

const fn word(low: u8, high: u8) -> u16 {
    u16::from_le_bytes([low, high])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(opcode: u8, data: &[u8]) -> Request {
        Request {
            opcode,
            data: data.to_vec(),
        }
    }

    #[test]
    fn the_families_order_their_parameters_differently() {
        let command = Command::Write {
            index: 0x2062,
            sub: 0,
            raw: 1000,
        };
        let data = [0x62, 0x20, 0x00, 0x02, 0xE8, 0x03, 0, 0];
        assert_eq!(
            understand(Family::Epos2, &request(0x11, &data)),
            Ok((Some(2), command))
        );
        let command = Command::Read {
            index: 0x6041,
            sub: 0,
        };
        assert_eq!(
            understand(Family::Epos4, &request(0x60, &[2, 0x41, 0x60, 0])),
            Ok((Some(2), command))
        );
    }

    #[test]
    fn neither_speaks_the_language_of_the_other() {
        assert_eq!(
            understand(Family::Epos4, &request(0x10, &[0x41, 0x60, 0, 1])),
            Err(Abort::IllegalCommand)
        );
        assert_eq!(
            understand(Family::Epos2, &request(0x60, &[1, 0x41, 0x60, 0])),
            Err(Abort::IllegalCommand)
        );
        assert_eq!(
            understand(Family::Epos2, &request(0x10, &[0x41, 0x60])),
            Err(Abort::Length)
        );
    }

    #[test]
    fn only_the_epos4_answers_network_management() {
        let command = Command::Manage {
            node: 0,
            command: 1,
        };
        assert!(command.is_answered(Family::Epos4) && !command.is_answered(Family::Epos2));
    }
}
