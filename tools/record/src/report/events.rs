//! What happened, in words: from the streams, and from the controller's log of runs where it is
//! attached.

use i2ris::ipc::payload::OperatingStateMsg;
use i2ris::ipc::{Fault, OperatingState, Refusal};
use serde::Serialize;
use serde_json::Value;

use super::trial::Trial;

/// Something that happened.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Happening {
    /// Seconds since the start of the recording.
    pub t_s: f64,
    /// What.
    pub what: String,
    /// It was not meant to: a fault, a stop.
    pub is_trouble: bool,
}

/// Flags that are told when they come and go.
const FLAGS: [(u32, &str, &str); 5] = [
    (OperatingStateMsg::HOMED, "homed", "no longer homed"),
    (
        OperatingStateMsg::MEMORY_KNOWN,
        "hysteresis memory known",
        "hysteresis memory unknown",
    ),
    (
        OperatingStateMsg::HOLDING,
        "holds: no fresh command",
        "follows commands",
    ),
    (
        OperatingStateMsg::CLIPPED,
        "goal outside the calibrated hull, clipped",
        "goal inside the calibrated hull again",
    ),
    (
        OperatingStateMsg::FIFO,
        "loop under SCHED_FIFO",
        "loop without SCHED_FIFO",
    ),
];

/// Everything in the order of time.
pub fn happenings(trial: &Trial) -> Vec<Happening> {
    let mut all = Vec::new();
    for (before, now) in std::iter::once(None)
        .chain(trial.states.iter().map(Some))
        .zip(&trial.states)
    {
        changes(before, now, &mut |what, is_trouble| {
            all.push(Happening {
                t_s: trial.seconds(now.stamp_ns),
                what,
                is_trouble,
            });
        });
    }
    for (stamp, id) in trial.models.iter().skip(1) {
        let name: String = id[..4].iter().map(|byte| format!("{byte:02x}")).collect();
        all.push(Happening {
            t_s: trial.seconds(*stamp),
            what: format!("model {name}… takes over"),
            is_trouble: false,
        });
    }
    all.extend(trial.audit.lines().filter_map(|line| logged(trial, line)));
    all.sort_by(|a, b| a.t_s.total_cmp(&b.t_s));
    all
}

fn changes(
    before: Option<&OperatingStateMsg>,
    now: &OperatingStateMsg,
    say: &mut impl FnMut(String, bool),
) {
    let state =
        |number| OperatingState::from_number(number).map_or("unknown state", OperatingState::text);
    let Some(before) = before else {
        say(
            format!("{} when the recording begins", state(now.state)),
            false,
        );
        return;
    };
    if before.boot_id != now.boot_id {
        say("the controller was started anew".to_owned(), true);
    }
    if before.state != now.state {
        let fault = now.state == OperatingState::Fault.number();
        let cause = Fault::from_number(now.fault)
            .filter(|_| fault)
            .map_or(String::new(), |f| format!(": {}", f.text()));
        say(
            format!("{} → {}{cause}", state(before.state), state(now.state)),
            fault,
        );
    }
    for (flag, comes, goes) in FLAGS {
        match (before.flags & flag != 0, now.flags & flag != 0) {
            (false, true) => say(comes.to_owned(), false),
            (true, false) => say(goes.to_owned(), false),
            _ => {}
        }
    }
    if before.stale_stops != now.stale_stops {
        say("the commander fell silent: stop".to_owned(), true);
    }
    if before.lease_client_id != now.lease_client_id {
        let who = now.lease_client_id;
        say(
            if who == 0 {
                "nobody commands".to_owned()
            } else {
                format!("client {who:016x} commands")
            },
            false,
        );
    }
    let refused = now.refused.saturating_sub(before.refused);
    if refused > 0 {
        let why = Refusal::from_number(now.last_refusal).map_or("unknown reason", Refusal::text);
        say(
            format!("{refused} command(s) refused, the last one: {why}"),
            true,
        );
    }
}

/// What the log of runs tells and the streams do not: causes, callers, drives. Lines from before
/// the recording are left out.
fn logged(trial: &Trial, line: &str) -> Option<Happening> {
    let entry: Value = serde_json::from_str(line).ok()?;
    let stamp = entry["monotonic_ns"]
        .as_u64()
        .filter(|stamp| (trial.start_ns..=trial.end_ns).contains(stamp))?;
    let text = |name: &str| entry[name].as_str().unwrap_or_default().to_owned();
    let (what, is_trouble) = match entry["event"].as_str()? {
        "state" if entry["command"].is_string() => (
            format!(
                "log: `{}` brought {} to {}",
                text("command"),
                text("from"),
                text("to")
            ),
            false,
        ),
        "lease" if entry["caller"].is_string() => {
            (format!("log: {} takes the lease", text("caller")), false)
        }
        "stop" => (
            format!(
                "log: stop after {:.0} ms of silence",
                entry["silent_ms"].as_f64().unwrap_or(0.0)
            ),
            true,
        ),
        "drive" => {
            let (motor, phase) = (entry["motor"].as_u64().unwrap_or(0), text("phase"));
            (
                format!(
                    "log: drive {motor}, {phase}, error 0x{}",
                    text("error_code")
                ),
                true,
            )
        }
        _ => return None,
    };
    Some(Happening {
        t_s: trial.seconds(stamp),
        what,
        is_trouble,
    })
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
    fn changes_are_told_once_with_their_cause() {
        let holding = OperatingStateMsg::HOLDING;
        let fault = OperatingStateMsg {
            fault: Fault::Link.number(),
            refused: 3,
            last_refusal: Refusal::NotEnabled.number(),
            ..state(300, OperatingState::Fault, 0)
        };
        let audit = "{\"monotonic_ns\":250000000,\"event\":\"state\",\"from\":\"DISABLED\",\"to\":\"ENABLED\",\"command\":\"enable\"}\n\
                     {\"monotonic_ns\":900000000,\"event\":\"stop\",\"silent_ms\":51.0}\nnonsense\n";
        let trial = Trial {
            states: vec![
                state(100, OperatingState::Disabled, holding),
                state(200, OperatingState::Enabled, holding),
                state(250, OperatingState::Enabled, 0),
                fault,
            ],
            start_ns: 100_000_000,
            end_ns: 400_000_000,
            audit: audit.to_owned(),
            ..Trial::default()
        };
        let all = happenings(&trial);
        let told: Vec<(f64, &str)> = all
            .iter()
            .map(|own| ((own.t_s * 1e3).round(), own.what.as_str()))
            .collect();
        assert_eq!(
            told,
            [
                (0.0, "DISABLED when the recording begins"),
                (100.0, "DISABLED → ENABLED"),
                (150.0, "follows commands"),
                (150.0, "log: `enable` brought DISABLED to ENABLED"),
                (200.0, "ENABLED → FAULT: a drive does not answer"),
                (200.0, "3 command(s) refused, the last one: not enabled"),
            ]
        );
        assert!(all[4].is_trouble && !all[2].is_trouble);
    }
}
