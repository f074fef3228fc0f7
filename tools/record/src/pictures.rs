//! Pictures of cameras in a recording, and the delay of their stamps relative to those of the
//! encoders, measured from the motion of the snake while it is recorded.

use std::collections::BTreeMap;

use i2ris::ipc::client::PictureSubscription;
use i2ris::ipc::payload::ExternalPosition;
use i2ris::ipc::{Domain, StreamMessage};
use i2ris::units::{MAX_MOTORS, MotorVec, Nanos};
use i2ris_calibration::quality::latency::{Latency, TimedCounts, TimedOutputs, estimate_latency};

use crate::recorder::{ALIGNMENT, ALIGNMENT_DEVIATION, MessageCounts, TrialRecorder};

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

#[derive(Debug)]
pub struct Cameras {
    pictures: PictureSubscription,
    pub alignment: Alignment,
    /// Last number of each camera, and how many pictures were not read in time.
    missed: BTreeMap<String, (u64, u64)>,
}

impl Cameras {
    pub fn new(domain: &Domain) -> Self {
        let (pictures, missed) = (PictureSubscription::new(domain), BTreeMap::new());
        Self { pictures, alignment: Alignment::default(), missed }
    }

    /// Passes on all new pictures. Without a controller there are none.
    pub fn record(&mut self, trial: &mut TrialRecorder, now: Nanos) {
        let missed = &mut self.missed;
        let _ = self.pictures.drain(|header, jpeg| {
            let view = header.view();
            let (last, missed) = missed.entry(view.clone()).or_insert((header.sequence, 0));
            // A restarted camera counts from the beginning.
            *missed += header.sequence.saturating_sub(*last + 1);
            *last = header.sequence;
            trial.record_picture(&view, Nanos(header.stamp_ns), jpeg, now);
        });
    }

    /// Entries for the metadata at the end of the recording.
    pub fn outcome(&self, counts: &MessageCounts) -> BTreeMap<String, String> {
        let mut outcome = BTreeMap::new();
        for (view, pictures) in &counts.pictures {
            let missed = self.missed.get(view).map_or(0, |(_, missed)| *missed);
            let lost = pictures.dropped + pictures.over_budget + missed;
            outcome.insert(format!("pictures {view}"), pictures.recorded.to_string());
            outcome.insert(format!("pictures {view} dropped"), lost.to_string());
        }
        if let Some(found) = self.alignment.measure() {
            outcome.insert(ALIGNMENT.to_owned(), found.seconds.to_string());
            outcome.insert(ALIGNMENT_DEVIATION.to_owned(), found.deviation_s.to_string());
        }
        outcome
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use crate::messages::Picture;

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
