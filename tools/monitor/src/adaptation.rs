//! The adaptation in words and numbers. Pure.

use i2ris::core::adaptation::{Drift, Pauses};
use i2ris::ipc::payload::AdaptationMsg;
use serde_json::{Value, json};

/// From this share of the budget on it is marked.
const WARNING: f64 = 0.7;

/// Estimate, budget, and why nothing is learned; empty while it is off.
pub fn lines(message: &AdaptationMsg) -> Vec<String> {
    if message.flags & AdaptationMsg::ON == 0 {
        return Vec::new();
    }
    vec![
        format!("drift {}", drift_text(&Drift::from_array(message.estimate))),
        format!("{}, {}", budget_text(message), learning_text(message)),
    ]
}

/// The drift in one line.
pub fn drift_text(drift: &Drift) -> String {
    let [pitch, yaw] = drift.zero.map(f64::to_degrees);
    let [[a, b], [c, d]] = drift.gain.map(|row| row.map(|gain| 100.0 * gain));
    let [first, second] = drift.gap.map(|gap| 100.0 * gap);
    let latency = 1e3 * drift.latency_s;
    format!(
        "zero {pitch:+.2} {yaw:+.2} deg, gain {a:+.1} {b:+.1} {c:+.1} {d:+.1} %, gap {first:+.0} \
         {second:+.0} %, camera {latency:+.0} ms"
    )
}

/// The share of the budget; in capitals from the warning on.
fn budget_text(message: &AdaptationMsg) -> String {
    let used = largest_use(message);
    let name = if used >= 1.0 {
        "BUDGET USED UP"
    } else if used >= WARNING {
        "BUDGET"
    } else {
        "budget"
    };
    format!("{name} {:.0} %", 100.0 * used)
}

fn largest_use(message: &AdaptationMsg) -> f64 {
    let parameters = message.budget_used.iter().copied();
    parameters.fold(message.total_used, f64::max)
}

/// Why nothing is learned, or what the windows say.
fn learning_text(message: &AdaptationMsg) -> String {
    let reasons: Vec<&str> = Pauses(message.pauses).iter().map(|p| p.text()).collect();
    let errors = format!(
        "camera {:.2} deg from the calibrated, {:.2} deg from the adapted model",
        message.calibrated_error.to_degrees(),
        message.adapted_error.to_degrees()
    );
    if reasons.is_empty() {
        format!("learning; {errors}")
    } else {
        format!("nothing is learned: {}; {errors}", reasons.join(", "))
    }
}

/// For the page.
pub fn as_json(message: &AdaptationMsg) -> Value {
    let reasons: Vec<&str> = Pauses(message.pauses).iter().map(|p| p.text()).collect();
    let shown = |values: &[f64; 10]| values.map(|value| (1e6 * value).round() / 1e6);
    json!({
        "on": message.flags & AdaptationMsg::ON != 0,
        "estimate": shown(&message.estimate),
        "applied": shown(&message.applied),
        "budget_used": shown(&message.budget_used),
        "total_used": message.total_used,
        "excited": (0..10).map(|bit| message.excited >> bit & 1 == 1).collect::<Vec<_>>(),
        "pauses": reasons,
        "frames": {
            "used": message.frames_used,
            "refused": message.frames_refused,
            "paused": message.frames_paused,
            "dropped": message.frames_dropped.iter().sum::<u64>(),
        },
        "calibrated_error_deg": message.calibrated_error.to_degrees(),
        "adapted_error_deg": message.adapted_error.to_degrees(),
        "taken_back": message.taken_back,
    })
}

#[cfg(test)]
mod tests {
    use i2ris::core::adaptation::Pause;

    use super::*;

    fn message() -> AdaptationMsg {
        let drift = Drift {
            zero: [0.01, -0.02],
            gain: [[0.05, 0.0], [0.0, -0.1]],
            gap: [0.4, 0.0],
            latency_s: 0.012,
            slow: 0.0,
        };
        AdaptationMsg {
            estimate: drift.to_array(),
            budget_used: [0.2, 0.4, 0.3, 0.0, 0.0, 0.5, 0.8, 0.0, 0.2, 0.0],
            total_used: 0.6,
            flags: AdaptationMsg::ON,
            ..AdaptationMsg::default()
        }
    }

    #[test]
    fn estimate_budget_and_reasons_are_shown() {
        let [drift, state] = &lines(&message())[..] else {
            panic!("two lines");
        };
        assert!(drift.contains("zero +0.57 -1.15 deg"), "{drift}");
        assert!(drift.contains("gap +40 +0 %"), "{drift}");
        assert!(state.starts_with("BUDGET 80 %, learning"), "{state}");
        let paused = AdaptationMsg {
            pauses: Pause::NoMotion as u32 | Pause::BudgetUsed as u32,
            budget_used: [1.0; 10],
            ..message()
        };
        let state = &lines(&paused)[1];
        assert!(state.starts_with("BUDGET USED UP 100 %, nothing is learned"), "{state}");
        assert!(state.contains("too little motion"), "{state}");
    }

    #[test]
    fn nothing_is_shown_while_it_is_off() {
        assert_eq!(lines(&AdaptationMsg::default()), Vec::<String>::new());
        assert_eq!(as_json(&AdaptationMsg::default())["on"], false);
    }
}
