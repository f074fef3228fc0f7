//! How late the stamps of a camera are against those of the encoders, measured by the motion of the
//! snake while it is recorded.

use i2ris::ipc::StreamMessage;
use i2ris::ipc::payload::ExternalPosition;
use i2ris::units::{MAX_MOTORS, MotorVec};
use i2ris_calibration::quality::latency::{Latency, TimedCounts, TimedOutputs, estimate_latency};

/// Encoder positions are kept at this distance.
const STEP_S: f64 = 0.005;
/// As long as motion is kept: ten minutes.
const LONGEST_S: f64 = 600.0;

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
        if time_s - first_s > LONGEST_S {
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

    /// `None`: the motion does not show it.
    pub fn measure(&self) -> Option<Latency> {
        let found = estimate_latency(&self.counts, &self.angles, MAX_MOTORS)?;
        found.helps.then_some(found)
    }
}
