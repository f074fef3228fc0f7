//! The target of a reach-and-hold task. Pure.

use i2ris::ipc::Message;
use i2ris::ipc::payload::ReachTarget;
use i2ris::units::Nanos;
use serde_json::{Value, json};

/// Age at which the task counts as over: its messages come 20 times a second.
const OVER: Nanos = Nanos::from_millis(1000);

/// The target that a person shall reach; `None`: there is none.
pub fn as_json(message: &ReachTarget, now: Nanos) -> Option<Value> {
    let is_last = message.flags & ReachTarget::ENDED != 0 && message.number >= message.total;
    if is_last || message.age(now) > OVER {
        return None;
    }
    let [pitch, yaw, _] = message.position.map(f64::to_degrees);
    let seconds = |nanos: u64| Nanos(nanos).as_seconds();
    Some(json!({
        "deg": [pitch, yaw],
        "tolerance_deg": message.tolerance.to_degrees(),
        "number": message.number,
        "total": message.total,
        "hold_s": seconds(message.hold_ns),
        "held_s": seconds(message.held_ns.min(message.hold_ns)),
        "by": if message.flags & ReachTarget::BY_CAMERA != 0 { "camera" } else { "estimate" },
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_shown_until_the_task_is_over() {
        let now = Nanos::from_millis(5000);
        let message = ReachTarget {
            stamp_ns: now.0,
            position: [0.1, -0.2, 0.0],
            number: 2,
            total: 2,
            held_ns: 500_000_000,
            hold_ns: 1_000_000_000,
            ..ReachTarget::default()
        };
        let value = as_json(&message, now).unwrap();
        assert_eq!(
            (&value["number"], &value["held_s"], &value["by"]),
            (&json!(2), &json!(0.5), &json!("estimate"))
        );
        assert!((value["deg"][1].as_f64().unwrap() + 11.459).abs() < 1e-3);
        let ended = ReachTarget { flags: ReachTarget::ENDED | ReachTarget::HELD, ..message };
        assert_eq!(as_json(&ended, now), None);
        assert!(as_json(&ReachTarget { number: 1, ..ended }, now).is_some());
        assert_eq!(as_json(&message, now + Nanos::from_millis(1001)), None);
    }
}
