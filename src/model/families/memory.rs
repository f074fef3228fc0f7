//! What a model remembers of the past motion of the motors.

use serde::{Deserialize, Serialize};

use crate::model::families::direction::travel::Travels;
use crate::model::families::hysteresis::play_state::PlayState;
use crate::model::families::hysteresis::stop::state::StopState;
use crate::units::MotorVec;

/// What a model remembers of the past motion of the motors. Fixed size, no heap; copying it forks
/// the past.
///
/// Models without hysteresis remember only where the motors have been. A memory belongs to the
/// model that made it: with that of another family a model answers as if it had seen nothing but
/// the present position.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Memory {
    pub(in crate::model) state: State,
    /// The range that the motors have covered, and where they are; `None` before the first
    /// position.
    pub(in crate::model) seen: Option<Seen>,
}

/// Where the motors are, and the range of counts that they have covered.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(in crate::model) struct Seen {
    pub position: MotorVec,
    pub low: MotorVec,
    pub high: MotorVec,
}

impl Seen {
    fn first(position: MotorVec) -> Self {
        Self {
            position,
            low: position,
            high: position,
        }
    }

    fn extend(&mut self, position: MotorVec) {
        self.position = position;
        for ((low, high), at) in self.low.iter_mut().zip(&mut self.high).zip(position) {
            *low = low.min(at);
            *high = high.max(at);
        }
    }
}

/// The inner state of a family.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "no heap in the control loop")]
pub(in crate::model) enum State {
    /// Nothing.
    #[default]
    None,
    /// Which way every motor travels.
    Travels(Travels),
    /// Of play operators.
    Plays(PlayState),
    /// Of stop operators.
    Stops(StopState),
}

impl Memory {
    /// Takes note of a position. The caller then brings the state to it.
    pub(in crate::model) fn note(&mut self, position: MotorVec) {
        match &mut self.seen {
            Some(seen) => seen.extend(position),
            None => self.seen = Some(Seen::first(position)),
        }
    }

    /// Every motor has covered a range of at least so many counts: whatever came before is wiped
    /// out.
    pub(in crate::model) fn covered(&self, ranges: &MotorVec) -> bool {
        self.seen.is_some_and(|seen| {
            let mut covered = seen
                .high
                .iter()
                .zip(seen.low)
                .map(|(high, low)| high - low)
                .zip(ranges);
            covered.all(|(covered, range)| covered >= *range)
        })
    }
}
