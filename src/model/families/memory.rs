//! The hysteresis memory of a model.

use serde::{Deserialize, Serialize};

use crate::model::families::gap_scale::{self, Wear};
use crate::model::families::hysteresis::force_balance::state::BalanceState;
use crate::model::families::hysteresis::play_state::PlayState;
use crate::model::families::network::layers::NetworkState;
use crate::units::MotorVec;

/// The state that a model keeps of the past motion of the motors. It has a fixed size and uses no
/// heap. A copy is an independent memory.
///
/// Models without hysteresis keep only the range of the motors. A memory belongs to the model that
/// made it. With the memory of another family a model predicts from the present position alone.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Memory {
    pub(in crate::model) state: State,
    /// The range that the motors have covered and their present position; `None` before the first
    /// position.
    pub(in crate::model) seen: Option<Seen>,
}

/// The present position of the motors, and the range of counts that they have covered.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(in crate::model) struct Seen {
    pub position: MotorVec,
    pub low: MotorVec,
    pub high: MotorVec,
}

impl Seen {
    fn first(position: MotorVec) -> Self {
        Self { position, low: position, high: position }
    }

    fn extend(&mut self, position: MotorVec) {
        self.position = position;
        for ((low, high), at) in self.low.iter_mut().zip(&mut self.high).zip(position) {
            *low = low.min(at);
            *high = high.max(at);
        }
    }
}

/// The state of a family.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "no heap in the control loop")]
pub(in crate::model) enum State {
    /// No state.
    #[default]
    None,
    /// The state of play operators.
    Plays(PlayState),
    /// State of a force balance.
    Balance(BalanceState),
    /// The hidden state of a network.
    Network(NetworkState),
}

impl Memory {
    /// Scales the gaps of every motor (the thresholds of plays; gap, slack and friction of a
    /// balance) from now on; 1 as calibrated, clamped to 0.2...3. Families without gaps ignore it,
    /// and so does a memory without any past motion.
    pub fn set_gap_scale(&mut self, scale: &MotorVec) {
        let clamped = gap_scale::clamp(scale);
        match &mut self.state {
            State::None | State::Network(_) => {}
            State::Plays(state) => state.gap_scale = clamped,
            State::Balance(state) => state.gap_scale = clamped,
        }
    }

    /// How the snake of this memory differs from the calibrated one, from now on. Families without
    /// gaps ignore it, those without wires all but the gaps.
    pub fn set_wear(&mut self, wear: &Wear) {
        self.set_gap_scale(&wear.gap.map(|growth| 1.0 + growth));
        if let State::Balance(state) = &mut self.state {
            state.set_lost_travel(&wear.slack, &wear.play);
        }
    }

    /// Whether the model has a gear and preloaded wires, so that all of [`Wear`] acts on it.
    pub(crate) fn has_wires(&self) -> bool {
        matches!(self.state, State::Balance(_))
    }

    /// Adds a position. The caller then advances the state to it.
    pub(in crate::model) fn note(&mut self, position: MotorVec) {
        match &mut self.seen {
            Some(seen) => seen.extend(position),
            None => self.seen = Some(Seen::first(position)),
        }
    }

    /// Whether every motor has covered the given range, counts. All earlier motion is then
    /// forgotten.
    pub(in crate::model) fn covered(&self, ranges: &MotorVec) -> bool {
        self.seen.is_some_and(|seen| {
            let mut covered =
                seen.high.iter().zip(seen.low).map(|(high, low)| high - low).zip(ranges);
            covered.all(|(covered, range)| covered >= *range)
        })
    }
}
