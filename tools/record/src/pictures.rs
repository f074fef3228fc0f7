//! Pictures of cameras as messages, and the delay of their stamps relative to those of the
//! encoders, measured from the motion of the snake while it is recorded.

use i2ris::ipc::StreamMessage;
use i2ris::ipc::payload::ExternalPosition;
use i2ris::units::{MAX_MOTORS, MotorVec};
use i2ris_calibration::quality::latency::{Latency, TimedCounts, TimedOutputs, estimate_latency};

use crate::messages::cdr::{ENCAPSULATION, Encoder};
use crate::messages::standard::header;

/// A picture of a camera.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    /// Exposure, Unix time.
    pub unix_ns: u64,
    pub jpeg: Vec<u8>,
}

/// The topic of a view.
pub fn topic(view: &str) -> String {
    format!("/camera/{view}/compressed")
}

/// The view of a topic.
pub fn view(topic: &str) -> Option<&str> {
    topic.strip_prefix("/camera/")?.strip_suffix("/compressed")
}

impl Picture {
    pub fn encode(&self, view: &str) -> Vec<u8> {
        let mut encoder = Encoder::default();
        header(&mut encoder, self.unix_ns, view);
        encoder.string("jpeg");
        encoder.u8s(&self.jpeg);
        encoder.finish()
    }

    /// Decodes a message; `None` if it is not a picture.
    pub fn decode(message: &[u8]) -> Option<Self> {
        let body = message.strip_prefix(&ENCAPSULATION)?;
        let number = |at: usize| {
            let at = at.next_multiple_of(4);
            let bytes = body.get(at..at + 4)?.try_into().ok()?;
            Some((u32::from_le_bytes(bytes) as usize, at + 4))
        };
        let ((seconds, at), (nanos, _)) = (number(0)?, number(4)?);
        let mut at = at + 4;
        // Frame and format.
        for _ in 0..2 {
            let (length, begin) = number(at)?;
            at = begin.checked_add(length)?;
        }
        let (length, begin) = number(at)?;
        let jpeg = body.get(begin..begin.checked_add(length)?)?.to_vec();
        Some(Self { unix_ns: seconds as u64 * 1_000_000_000 + nanos as u64, jpeg })
    }
}

/// Encoder positions are kept at this distance.
const STEP_S: f64 = 0.005;
/// Time for which motion is kept: ten minutes.
const MAX_MOTION_S: f64 = 600.0;

/// The motion of a recording, by the encoders and by the camera.
#[derive(Debug, Default)]
pub struct Alignment {
    counts: Vec<TimedCounts>,
    angles: Vec<TimedOutputs>,
}

impl Alignment {
    pub fn add(&mut self, message: &StreamMessage) {
        let time_s = message.stamp().as_seconds();
        let first_s = self.counts.first().map_or(time_s, |first| first.time_s);
        if time_s - first_s > MAX_MOTION_S {
            return;
        }
        let has_room = self.counts.last().is_none_or(|last| time_s - last.time_s >= STEP_S);
        let is_later = self.angles.last().is_none_or(|last| time_s > last.time_s);
        match message {
            StreamMessage::Actuators(state) if has_room => {
                let counts: MotorVec = state.measured_counts.map(f64::from);
                self.counts.push(TimedCounts { time_s, counts });
            }
            StreamMessage::External(seen)
                if is_later && seen.flags & ExternalPosition::VALID != 0 =>
            {
                self.angles.push(TimedOutputs { time_s, outputs: seen.position });
            }
            _ => {}
        }
    }

    /// Returns the latency; `None` if the motion does not show it.
    pub fn measure(&self) -> Option<Latency> {
        let found = estimate_latency(&self.counts, &self.angles, MAX_MOTORS)?;
        found.helps.then_some(found)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn what_was_encoded_is_decoded(
            // ROS counts seconds in 31 bits: to 2038.
            unix_ns in 0..2_147_483_647_000_000_000_u64,
            jpeg in proptest::collection::vec(any::<u8>(), 0..200),
            view in "[a-z]{1,12}",
        ) {
            let picture = Picture { unix_ns, jpeg };
            let bytes = picture.encode(&view);
            prop_assert_eq!(Picture::decode(&bytes), Some(picture));
            for cut in 0..bytes.len() {
                prop_assert_eq!(Picture::decode(&bytes[..cut]), None);
            }
        }

        #[test]
        fn no_bytes_cause_a_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let _ = Picture::decode(&bytes);
        }
    }
}
