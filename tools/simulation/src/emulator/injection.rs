//! Faults that can be injected into drives, lines and wires; damage to the bytes of one exchange.

use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantNames};

/// A fault of an axis, its line or its wire. Offsets, bytes or bits, wrap at the end of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, IntoStaticStr, VariantNames)]
#[serde(tag = "kind", rename_all = "kebab-case", rename_all_fields = "snake_case")]
#[serde(deny_unknown_fields)]
#[strum(serialize_all = "kebab-case")]
pub enum Injection {
    /// The next request is lost.
    LoseRequest,
    /// A byte of the next request is lost.
    DropRequest { offset: usize },
    /// A bit of the next request is flipped.
    FlipRequest { offset: usize },
    /// A byte of the next request is sent twice.
    DoubleRequest { offset: usize },
    /// The next request ends before this byte.
    CutRequest { offset: usize },
    /// The next reply is lost.
    LoseReply,
    /// A byte of the next reply is lost.
    DropReply { offset: usize },
    /// A bit of the next reply is flipped.
    FlipReply { offset: usize },
    /// A byte of the next reply is sent twice.
    DoubleReply { offset: usize },
    /// The next reply ends before this byte.
    CutReply { offset: usize },
    /// The next reply ends between the halves of a doubled byte.
    CutReplyInPair,
    /// The next reply is late.
    LateReply { delay_ms: u64 },
    /// The next reply is an error of an invalid length.
    WrongLength,
    /// An unsolicited reply comes before the next one.
    StrayReply,
    /// The port disappears and comes back.
    HangUp { for_ms: u64 },
    /// The drive does not reply, but executes everything.
    Mute { for_ms: u64 },
    /// The node is reset: parameters as stored, position lost.
    Reset,
    /// A fault is raised.
    Fault { code: u16 },
    /// The encoder stops counting.
    FreezeEncoder { for_ms: u64 },
    /// The encoder loses or gains counts at once.
    SlipEncoder { counts: i32 },
    /// The wire has play.
    SlackWire { counts: u32 },
    /// The wire breaks.
    BreakWire,
    /// The wire is repaired.
    MendWire,
}

impl Injection {
    /// The names of all kinds, as in files.
    pub const NAMES: &'static [&'static str] = <Self as VariantNames>::VARIANTS;

    /// Every kind, with random values.
    pub fn all(random: &mut impl Rng) -> Vec<Self> {
        let offset = random.random_range(0..64);
        let bit = random.random_range(0..192);
        let codes = [0x2310, 0x3210, 0x3220, 0x8611, 0x4210];
        vec![
            Self::LoseRequest,
            Self::DropRequest { offset },
            Self::FlipRequest { offset: bit },
            Self::DoubleRequest { offset },
            Self::CutRequest { offset },
            Self::LoseReply,
            Self::DropReply { offset },
            Self::FlipReply { offset: bit },
            Self::DoubleReply { offset },
            Self::CutReply { offset },
            Self::CutReplyInPair,
            Self::LateReply { delay_ms: random.random_range(1..300) },
            Self::WrongLength,
            Self::StrayReply,
            Self::HangUp { for_ms: random.random_range(50..400) },
            Self::Mute { for_ms: random.random_range(20..600) },
            Self::Reset,
            Self::Fault { code: codes[random.random_range(0..5)] },
            Self::FreezeEncoder { for_ms: random.random_range(50..500) },
            Self::SlipEncoder { counts: random.random_range(-300..300) },
            Self::SlackWire { counts: random.random_range(20..200) },
            Self::BreakWire,
            Self::MendWire,
        ]
    }

    /// The same from a seed.
    pub fn all_of(seed: u64) -> Vec<Self> {
        Self::all(&mut Pcg64Mcg::seed_from_u64(seed))
    }

    /// The name of its kind, as in files.
    pub fn name(&self) -> &'static str {
        self.into()
    }

    /// Damages a request or a reply on the line.
    pub(crate) fn damage(self, bytes: &mut Vec<u8>, is_reply: bool) {
        use Injection::*;
        match (self, is_reply) {
            _ if bytes.is_empty() => {}
            (LoseRequest, false) | (LoseReply, true) => bytes.clear(),
            (DropRequest { offset }, false) | (DropReply { offset }, true) => {
                bytes.remove(offset % bytes.len());
            }
            (FlipRequest { offset }, false) | (FlipReply { offset }, true) => {
                let bit = offset % (8 * bytes.len());
                bytes[bit / 8] ^= 1 << (bit % 8);
            }
            (DoubleRequest { offset }, false) | (DoubleReply { offset }, true) => {
                let index = offset % bytes.len();
                bytes.insert(index, bytes[index]);
            }
            (CutRequest { offset }, false) | (CutReply { offset }, true) => {
                bytes.truncate(offset % bytes.len());
            }
            (CutReplyInPair, true) => truncate_in_pair(bytes),
            _ => {}
        }
    }
}

/// An injection and its axis: a line of the control socket.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AxisInjection {
    /// Axis number.
    #[serde(default)]
    pub axis: usize,
    #[serde(flatten)]
    pub injection: Injection,
}

/// The first byte of a frame, which is doubled inside.
const DLE: u8 = 0x90;

/// Truncates after the first half of a doubled byte, or with a DLE instead of the last two bytes.
fn truncate_in_pair(bytes: &mut Vec<u8>) {
    match bytes.windows(2).skip(2).position(|pair| pair == [DLE, DLE]) {
        Some(index) => bytes.truncate(index + 3),
        None => {
            bytes.truncate(bytes.len().saturating_sub(2));
            bytes.push(DLE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_have_the_same_name_in_files_and_log() {
        let axis = 0;
        let all = Injection::all_of(3);
        assert_eq!(all.len(), Injection::NAMES.len());
        for injection in all {
            let text = toml::to_string(&AxisInjection { axis, injection }).unwrap();
            let kind = format!("kind = \"{}\"", injection.name());
            assert!(text.contains(&kind), "{text}");
            let parsed: AxisInjection = toml::from_str(&text).unwrap();
            assert_eq!(parsed.injection, injection);
        }
    }

    #[test]
    fn replies_lose_flip_double_and_truncate_bytes() {
        let doubled_inside: &[u8] = &[0x90, 2, 0, 4, 0, 0x90, 0x90, 0, 0, 0x9A, 0x5C];
        for (injection, bytes, expected) in [
            (Injection::LoseReply, &[1, 2, 3, 4][..], &[][..]),
            (Injection::DropReply { offset: 5 }, &[1, 2, 3, 4], &[1, 3, 4]),
            (Injection::FlipReply { offset: 9 }, &[1, 2, 3, 4], &[1, 0, 3, 4]),
            (Injection::DoubleReply { offset: 2 }, &[1, 2, 3, 4], &[1, 2, 3, 3, 4]),
            (Injection::CutReply { offset: 3 }, &[1, 2, 3, 4], &[1, 2, 3]),
            // A fault of a request does not damage the reply.
            (Injection::LoseRequest, &[1, 2, 3, 4], &[1, 2, 3, 4]),
            (Injection::CutReplyInPair, doubled_inside, &[0x90, 2, 0, 4, 0, 0x90]),
            (Injection::CutReplyInPair, &[0x90, 2, 0, 2, 7, 8], &[0x90, 2, 0, 2, 0x90]),
        ] {
            let mut reply = bytes.to_vec();
            injection.damage(&mut reply, true);
            assert_eq!(reply, expected, "{injection:?}");
        }
    }
}
