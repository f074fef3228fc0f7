//! The adaptation in words and numbers.

use i2ris::core::adaptation::{PARAMETERS, Pauses};
use i2ris::ipc::payload::AdaptationMsg;
use serde::{Serialize, Serializer};

/// Share of the budget from which it is marked.
const WARNING: f64 = 0.7;

/// Estimate, budget, and why learning is paused.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Adaptation {
    pub on: bool,
    /// In the order of [`AdaptationMsg`].
    #[serde(serialize_with = "drift")]
    pub estimate: [f64; PARAMETERS],
    #[serde(serialize_with = "drift")]
    pub applied: [f64; PARAMETERS],
    #[serde(serialize_with = "drift")]
    pub budget_used: [f64; PARAMETERS],
    pub total_used: f64,
    /// Whether the motion excites the parameter.
    pub excited: [bool; PARAMETERS],
    pub pauses: Vec<&'static str>,
    pub frames: Frames,
    pub calibrated_error_deg: f64,
    pub adapted_error_deg: f64,
    pub taken_back: u32,
}

/// Six digits.
fn drift<S: Serializer>(values: &[f64; PARAMETERS], serializer: S) -> Result<S::Ok, S::Error> {
    values.map(|value| (1e6 * value).round() / 1e6).serialize(serializer)
}

/// Camera frames by their use.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Frames {
    pub used: u64,
    pub refused: u64,
    pub paused: u64,
    pub dropped: u64,
}

impl Adaptation {
    pub(super) fn new(message: &AdaptationMsg) -> Self {
        Self {
            on: message.flags & AdaptationMsg::ON != 0,
            estimate: message.estimate,
            applied: message.applied,
            budget_used: message.budget_used,
            total_used: message.total_used,
            excited: std::array::from_fn(|bit| message.excited >> bit & 1 == 1),
            pauses: Pauses(message.pauses).iter().map(|pause| pause.text()).collect(),
            frames: Frames {
                used: message.frames_used,
                refused: message.frames_refused,
                paused: message.frames_paused,
                dropped: message.frames_dropped.iter().sum(),
            },
            calibrated_error_deg: message.calibrated_error.to_degrees(),
            adapted_error_deg: message.adapted_error.to_degrees(),
            taken_back: message.taken_back,
        }
    }

    /// Two lines; none while it is off.
    pub fn lines(&self) -> Vec<String> {
        if !self.on {
            return Vec::new();
        }
        let [pitch, yaw] = [self.estimate[0], self.estimate[1]].map(f64::to_degrees);
        let [_, _, a, b, c, d, first, second, _, _, slack, other, play, loose] =
            self.estimate.map(|share| 100.0 * share);
        let latency = 1e3 * self.estimate[8];
        let drift = format!(
            "drift zero {pitch:+.2} {yaw:+.2} deg, gain {a:+.1} {b:+.1} {c:+.1} {d:+.1} %, gap \
             {first:+.0} {second:+.0} %, slack {slack:+.1} {other:+.1} %, play {play:+.1} \
             {loose:+.1} %, camera {latency:+.0} ms"
        );
        let used = self.budget_used.iter().copied().fold(self.total_used, f64::max);
        let budget = match used {
            1.0.. => "BUDGET USED UP",
            WARNING.. => "BUDGET",
            _ => "budget",
        };
        let learning = match self.pauses.join(", ") {
            pauses if pauses.is_empty() => "learning".to_owned(),
            pauses => format!("learning paused: {pauses}"),
        };
        let state = format!(
            "{budget} {:.0} %, {learning}; camera {:.2} deg from the calibrated model, {:.2} deg \
             from the adapted one",
            100.0 * used,
            self.calibrated_error_deg,
            self.adapted_error_deg
        );
        vec![drift, state]
    }
}

#[cfg(test)]
mod tests {
    use i2ris::core::adaptation::Pause;

    use super::*;

    #[test]
    fn estimate_budget_and_reasons_are_shown_while_active() {
        let message = AdaptationMsg {
            estimate: [
                0.01, -0.02, 0.05, 0.0, 0.0, -0.1, 0.4, 0.0, 0.012, 0.0, 0.021, 0.0, 0.0, -0.003,
            ],
            budget_used: [0.2, 0.4, 0.3, 0.0, 0.0, 0.5, 0.8, 0.0, 0.2, 0.0, 0.7, 0.0, 0.0, 0.15],
            total_used: 0.6,
            flags: AdaptationMsg::ON,
            ..AdaptationMsg::default()
        };
        let [drift, state] = &Adaptation::new(&message).lines()[..] else { panic!("two lines") };
        assert!(drift.contains("zero +0.57 -1.15 deg"), "{drift}");
        let worn = "gap +40 +0 %, slack +2.1 +0.0 %, play +0.0 -0.3 %, camera +12 ms";
        assert!(drift.contains(worn), "{drift}");
        assert!(state.starts_with("BUDGET 80 %, learning"), "{state}");
        let paused = AdaptationMsg {
            pauses: Pause::NoMotion as u32 | Pause::BudgetUsed as u32,
            budget_used: [1.0; PARAMETERS],
            ..message
        };
        let state = &Adaptation::new(&paused).lines()[1];
        assert!(state.starts_with("BUDGET USED UP 100 %, learning paused"), "{state}");
        assert!(state.contains("too little motion"), "{state}");
        let off = Adaptation::new(&AdaptationMsg::default());
        assert!(!off.on && off.lines().is_empty());
    }
}
