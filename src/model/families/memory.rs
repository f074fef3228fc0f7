//! The hysteresis memory of a model, and its wear, which drift may change.

use serde::{Deserialize, Serialize};

use crate::model::families::hysteresis::force_balance::state::BalanceState;
use crate::model::families::network::layers::NetworkState;
use crate::units::{MAX_MOTORS, MotorVec};

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
    fn extend(&mut self, position: MotorVec) {
        self.position = position;
        for ((low, high), at) in self.low.iter_mut().zip(&mut self.high).zip(position) {
            *low = low.min(at);
            *high = high.max(at);
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "no heap in the control loop")]
pub(in crate::model) enum State {
    /// No state.
    #[default]
    None,
    Plays(PlayState),
    Balance(BalanceState),
    Network(NetworkState),
}

/// The most plays per motor, including the play of threshold 0, and the most planar plays.
pub(in crate::model) const MAX_PLAYS: usize = 13;

/// The positions of the motors and the outputs of the plays.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PlayState {
    pub(in crate::model) position: MotorVec,
    pub(in crate::model) outputs: [[f64; MAX_PLAYS]; MAX_MOTORS],
    pub(in crate::model) planar: [MotorVec; MAX_PLAYS],
    /// Factor on the thresholds of every motor: 1 as calibrated.
    pub(in crate::model) gap_scale: MotorVec,
}

impl Memory {
    /// Scales the gaps of every motor (the thresholds of plays; gap, slack and friction of a
    /// balance) from now on; 1 as calibrated, clamped to 0.2...3. Families without gaps ignore it,
    /// and so does a memory without any past motion.
    pub fn set_gap_scale(&mut self, scale: &MotorVec) {
        let clamp = |scale: f64| scale.clamp(MIN_SCALE, MAX_SCALE);
        let clamped = scale.map(|scale| if scale.is_nan() { 1.0 } else { clamp(scale) });
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
        let first = Seen { position, low: position, high: position };
        self.seen.get_or_insert(first).extend(position);
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

/// Limits of the gap scale.
const MIN_SCALE: f64 = 0.2;
const MAX_SCALE: f64 = 3.0;

/// How a snake differs from the calibrated one by wear, per motor; 0 as calibrated.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Wear {
    /// Growth of all lost motion, friction with it, as a share: see [`Memory::set_gap_scale`].
    ///
    /// [`Memory::set_gap_scale`]: crate::model::Memory::set_gap_scale
    pub gap: MotorVec,
    /// Preload that the wires have lost beyond that, as a share of half the calibrated range.
    pub slack: MotorVec,
    /// Growth of half the gear's play beyond that factor, as such a share: a fit may have put all
    /// the play of a new gear into the friction, and a factor on zero remains zero.
    pub play: MotorVec,
}
