//! Events in words, from the streams and from the run log if it is attached.

use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{Fault, MaskedClientId, OperatingState, Refusal};
use serde::Serialize;
use serde_json::Value;

use super::trial::Trial;

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrialEvent {
    pub t_s: f64,
    pub what: String,
    /// Unintended event: a fault, a stop, a refusal.
    pub is_trouble: bool,
}

/// A description, and whether the event was not intended.
type Description = (String, bool);

/// Descriptions of flags that are set and cleared.
const FLAGS: [(u32, &str, &str); 5] = [
    (OperatingStateMsg::HOMED, "homed", "no longer homed"),
    (OperatingStateMsg::MEMORY_KNOWN, "hysteresis memory known", "hysteresis memory unknown"),
    (OperatingStateMsg::HOLDING, "holds: no fresh command", "follows commands"),
    (
        OperatingStateMsg::CLIPPED,
        "goal outside the calibrated hull, clipped",
        "goal inside the calibrated hull again",
    ),
    (OperatingStateMsg::FIFO, "loop under SCHED_FIFO", "loop without SCHED_FIFO"),
];

/// All events, sorted by time.
pub fn trial_events(trial: &Trial) -> Vec<TrialEvent> {
    let event = |stamp, (what, is_trouble): Description| TrialEvent {
        t_s: trial.seconds(stamp),
        what,
        is_trouble,
    };
    let mut events = Vec::new();
    if let Some(first) = trial.states.first() {
        let what = format!("{} when the recording begins", state_text(first.state));
        events.push(event(first.stamp_ns, (what, false)));
    }
    for pair in trial.states.windows(2) {
        let changes = state_changes(&pair[0], &pair[1]).into_iter();
        events.extend(changes.map(|change| event(pair[1].stamp_ns, change)));
    }
    for (stamp, id) in trial.models.iter().skip(1) {
        let name: String = id[..4].iter().map(|byte| format!("{byte:02x}")).collect();
        events.push(event(*stamp, (format!("model {name}… takes over"), false)));
    }
    for line in trial.run_log.lines() {
        let logged = logged_event(line);
        let logged = logged.filter(|(stamp, _)| (trial.start_ns..=trial.end_ns).contains(stamp));
        events.extend(logged.map(|(stamp, description)| event(stamp, description)));
    }
    events.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
    events
}

fn state_text(number: u32) -> &'static str {
    OperatingState::from_number(number).map_or("unknown state", OperatingState::text)
}

fn state_changes(before: &OperatingStateMsg, now: &OperatingStateMsg) -> Vec<Description> {
    let mut changes = Vec::new();
    if before.boot_id != now.boot_id {
        changes.push(("the controller was restarted".to_owned(), true));
    }
    if before.state != now.state {
        let is_fault = now.state == OperatingState::Fault.number();
        let cause = Fault::from_number(now.fault).filter(|_| is_fault);
        let cause = cause.map_or(String::new(), |fault| format!(": {}", fault.text()));
        let [from, to] = [before.state, now.state].map(state_text);
        changes.push((format!("{from} → {to}{cause}"), is_fault));
    }
    for (flag, set, cleared) in FLAGS {
        match (before.flags & flag != 0, now.flags & flag != 0) {
            (false, true) => changes.push((set.to_owned(), false)),
            (true, false) => changes.push((cleared.to_owned(), false)),
            _ => {}
        }
    }
    if before.stale_stops != now.stale_stops {
        changes.push(("commands stopped arriving: stop".to_owned(), true));
    }
    if before.lease_client_id != now.lease_client_id {
        let what = match now.lease_client_id {
            0 => "no client commands".to_owned(),
            client => format!("{} commands", MaskedClientId(client)),
        };
        changes.push((what, false));
    }
    let refused = now.refused.saturating_sub(before.refused);
    if refused > 0 {
        let reason = Refusal::from_number(now.last_refusal).map_or("unknown reason", Refusal::text);
        changes.push((format!("{refused} command(s) refused, the last one: {reason}"), true));
    }
    changes
}

/// Stamp and description of a line of the run log that has more than the streams.
fn logged_event(line: &str) -> Option<(u64, Description)> {
    let entry: Value = serde_json::from_str(line).ok()?;
    let text = |name: &str| entry[name].as_str().unwrap_or_default().to_owned();
    let (what, is_trouble) = match entry["event"].as_str()? {
        "state" if entry["command"].is_string() => {
            let [command, from, to] = ["command", "from", "to"].map(text);
            (format!("`{command}` brought {from} to {to}"), false)
        }
        "lease" if entry["caller"].is_string() => {
            (format!("{} takes the lease", text("caller")), false)
        }
        "stop" => {
            let silent_ms = entry["silent_ms"].as_f64().unwrap_or(0.0);
            (format!("stop after {silent_ms:.0} ms without commands"), true)
        }
        "drive" => {
            let motor = entry["motor"].as_u64().unwrap_or(0);
            let [phase, code] = ["phase", "error_code"].map(text);
            (format!("drive {motor}, {phase}, error 0x{code}"), true)
        }
        _ => return None,
    };
    Some((entry["monotonic_ns"].as_u64()?, (format!("log: {what}"), is_trouble)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(ms: u64, state: OperatingState, flags: u32) -> OperatingStateMsg {
        OperatingStateMsg {
            stamp_ns: ms * 1_000_000,
            state: state.number(),
            flags,
            ..OperatingStateMsg::default()
        }
    }

    #[test]
    fn every_change_is_one_event_with_its_cause() {
        let holding = OperatingStateMsg::HOLDING;
        let fault = OperatingStateMsg {
            fault: Fault::Link.number(),
            refused: 3,
            last_refusal: Refusal::NotEnabled.number(),
            ..state(300, OperatingState::Fault, 0)
        };
        let command = serde_json::json!({"monotonic_ns": 250_000_000, "event": "state",
            "from": "DISABLED", "to": "ENABLED", "command": "enable"});
        let later = serde_json::json!({"monotonic_ns": 900_000_000, "event": "stop"});
        let trial = Trial {
            states: vec![
                state(100, OperatingState::Disabled, holding),
                state(200, OperatingState::Enabled, holding),
                state(250, OperatingState::Enabled, 0),
                fault,
            ],
            start_ns: 100_000_000,
            end_ns: 400_000_000,
            run_log: format!("{command}\n{later}\nnonsense\n"),
            ..Trial::default()
        };
        let events = trial_events(&trial);
        let ms = |event: &TrialEvent| (event.t_s * 1e3).round();
        let found: Vec<_> = events.iter().map(|event| (ms(event), event.what.as_str())).collect();
        let expected = [
            (0.0, "DISABLED when the recording begins"),
            (100.0, "DISABLED → ENABLED"),
            (150.0, "follows commands"),
            (150.0, "log: `enable` brought DISABLED to ENABLED"),
            (200.0, "ENABLED → FAULT: a drive does not answer"),
            (200.0, "3 command(s) refused, the last one: the drives are off"),
        ];
        assert_eq!(found, expected);
        assert!(events[4].is_trouble && !events[2].is_trouble);
    }
}
