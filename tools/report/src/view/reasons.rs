//! Why the robot does not move as commanded, with the recommended action.

use i2ris::drive::drive_fault::DriveFault;
use i2ris::ipc::Message;
use i2ris::ipc::payload::{OperatingStateMsg, ReasonMsg};
use i2ris::robot::{Cause, Reason, Stop};
use i2ris::units::Nanos;
use serde::Serialize;

use super::{Hand, LatestMessages, STALE, Trial};

pub const NOTHING: &str = "nothing keeps the robot from moving: it waits for commands";

#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Why {
    /// `fault 3`, `refusal 9`, ...; empty for a reason of a later release.
    pub code: String,
    pub sentence: String,
    /// Measured value and limit; empty where they are not known.
    pub measured: String,
    pub advice: String,
    /// Age of a refusal, stop or clip; `None`: it keeps the robot from moving now.
    pub age_s: Option<f64>,
    /// Code, sentence, measured value and limit.
    pub text: String,
}

impl Why {
    /// Whether it is a fault: everything else is a warning.
    pub fn is_fault(&self) -> bool {
        self.code.starts_with("fault")
    }

    fn new(reason: &Reason, age_s: Option<f64>) -> Self {
        Self {
            code: reason.cause.to_string(),
            sentence: reason.cause.sentence().to_owned(),
            measured: reason.measurement.map_or_else(String::new, |it| it.to_string()),
            advice: reason.cause.advice().to_owned(),
            age_s,
            text: reason.text(),
        }
    }
}

/// Present reasons, then the last one of every cause in `warnings`, which are by arrival.
pub fn reasons(messages: &LatestMessages, warnings: &[ReasonMsg], now: Nanos) -> Vec<Why> {
    let LatestMessages { state: Some(state), error, hand, trial, .. } = messages else {
        return Vec::new();
    };
    let latched = error.as_ref().and_then(ReasonMsg::reason);
    let present = state.causes().into_iter().map(|cause| {
        let measured = latched.filter(|reason| reason.cause == cause);
        Why::new(&measured.unwrap_or(Reason::from(cause)), None)
    });
    let mut all: Vec<Why> = present.collect();
    let open = hand.as_ref().and_then(|hand| Hand::new(hand, now)).and_then(|hand| hand.open);
    all.extend(open.map(|why| {
        // The text before the colon is the reason, the text after it the action.
        let (sentence, advice) = why.split_once(": ").unwrap_or((&why, "press it and steer"));
        let (text, advice) = (format!("the clutch is open: {sentence}"), advice.to_owned());
        Why { sentence: text.clone(), text, advice, ..Why::default() }
    }));
    all.extend(trial.as_ref().and_then(|it| Trial::new(it, now)).and_then(|it| it.why()));
    all.extend(silent_camera(messages, now));
    let mut seen = Vec::new();
    for message in warnings.iter().rev() {
        let age_s = Some(message.age(now).as_seconds());
        if seen.contains(&(message.kind, message.number)) {
            continue;
        }
        seen.push((message.kind, message.number));
        all.push(match message.reason() {
            // The watchdog is running again: there is nothing to start.
            Some(Reason { cause: Cause::Stop(Stop::Watchdog), .. })
                if state.flags & OperatingStateMsg::WATCHED != 0 =>
            {
                continue;
            }
            Some(reason) => Why::new(&reason, age_s),
            None => {
                let (text, advice) = (message.text(), message.advice());
                Why { text, advice, age_s, ..Why::default() }
            }
        });
    }
    if let Some(actuators) = &messages.actuators
        && let Some(code) = actuators.error_code.into_iter().find(|code| *code != 0)
    {
        let own = all.iter_mut().filter(|why| why.code == "fault 1");
        let advice =
            format!("{}: `i2ris command state acknowledge`", DriveFault::look_up_any(code));
        own.for_each(|why| why.advice.clone_from(&advice));
    }
    if let Some(missed) = missed_ticks(messages) {
        // If the computer is late, reads and writes are late: the line is not at fault.
        let late = |why: &&mut Why| ["fault 2", "stop 2"].contains(&&*why.code);
        all.iter_mut().filter(late).for_each(|why| {
            why.text += &format!("; the loop has {missed}");
            why.advice =
                "reduce the load on the computer, or grant real-time permission; if it happens \
                          again without missed ticks, check cable and supply (`i2ris doctor`)"
                    .to_owned();
        });
    }
    all
}

/// Missed ticks of the loop, if they are more than a hundredth.
fn missed_ticks(messages: &LatestMessages) -> Option<String> {
    let it = messages.statistics.as_ref()?;
    let all = [(it.missed, it.ticks), (it.total_missed, it.total_ticks)];
    let is_late = all.iter().any(|(missed, ticks)| 100 * missed > missed + ticks);
    let (missed, ticks) = (it.total_missed, it.total_ticks + it.total_missed);
    is_late.then(|| format!("{missed} missed ticks of {ticks}"))
}

/// A camera that sent frames after the start of the controller and has stopped.
fn silent_camera(messages: &LatestMessages, now: Nanos) -> Option<Why> {
    let age = messages.camera.map(|camera| camera.age(now));
    let frames = messages.adaptation.map_or(0, |it| {
        let kinds = [it.frames_used, it.frames_refused, it.frames_paused];
        kinds.iter().chain(&it.frames_dropped).sum::<u64>()
    });
    let is_silent = age.map_or(frames > 0, |age| age > STALE);
    is_silent.then(|| {
        let text = "the camera is silent: the pose is not checked, and drift is not corrected";
        let advice = "check its cable, and restart `i2ris vision`";
        let age_s = Some(age.unwrap_or(STALE).as_seconds());
        let (text, advice) = (text.to_owned(), advice.to_owned());
        Why { sentence: text.clone(), text, advice, age_s, ..Why::default() }
    })
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::{ActuatorState, AdaptationMsg, ExternalPosition, TeleopMsg};
    use i2ris::ipc::{Fault, OperatingState, Refusal};
    use i2ris::robot::{Measurement, Quantity};

    use super::*;

    fn all(state: OperatingStateMsg) -> LatestMessages {
        LatestMessages { state: Some(state), ..LatestMessages::default() }
    }

    fn ready() -> OperatingStateMsg {
        OperatingStateMsg {
            state: OperatingState::Enabled.number(),
            flags: OperatingStateMsg::HOMED | OperatingStateMsg::MODEL,
            ..OperatingStateMsg::default()
        }
    }

    fn message(cause: Cause, stamp: u64) -> ReasonMsg {
        let measurement = Some(Measurement::new(Quantity::Counts, stamp as f64, Some(2000.0)));
        ReasonMsg::new(&Reason { cause, measurement }, 0, Nanos::from_millis(stamp))
    }

    #[test]
    fn a_fault_shows_only_its_own_measurement() {
        let state = OperatingStateMsg {
            state: OperatingState::Fault.number(),
            fault: Fault::FollowingError.number(),
            ..ready()
        };
        let own = message(Cause::Fault(Fault::FollowingError), 5000);
        let other = message(Cause::Fault(Fault::Link), 4000);
        for (error, measured) in [(own, "5000 counts, limit 2000 counts"), (other, "")] {
            let messages = LatestMessages { error: Some(error), ..all(state) };
            let [why] = &reasons(&messages, &[], Nanos::ZERO)[..] else { panic!() };
            assert_eq!((why.code.as_str(), why.measured.as_str()), ("fault 3", measured));
            assert!(why.is_fault() && why.age_s.is_none());
        }
    }

    #[test]
    fn the_code_of_a_drive_is_explained() {
        let (fault, state) = (Fault::Drive.number(), OperatingState::Fault.number());
        let actuators = Some(ActuatorState { error_code: [0, 0x2310], ..Default::default() });
        let state = OperatingStateMsg { state, fault, ..ready() };
        let found = reasons(&LatestMessages { actuators, ..all(state) }, &[], Nanos::ZERO);
        assert!(found[0].advice.contains("overcurrent") && !found[0].advice.contains("manual"));
    }

    #[test]
    fn what_can_be_removed_first_comes_first() {
        let off = OperatingStateMsg { flags: OperatingStateMsg::MODEL, ..Default::default() };
        let codes: Vec<String> =
            reasons(&all(off), &[], Nanos::ZERO).into_iter().map(|why| why.code).collect();
        assert_eq!(codes, ["refusal 6", "state DISABLED"], "enabling needs the zero");
    }

    #[test]
    fn last_warning_of_every_cause_follows_present_reasons_newest_first() {
        let state = OperatingStateMsg {
            state: OperatingState::Paused.number(),
            flags: OperatingStateMsg::BUSY,
            ..OperatingStateMsg::default()
        };
        let (step, lease) = (Refusal::StepTooLarge, Refusal::Lease);
        let warnings = [(step, 1000), (lease, 2000), (step, 3000)];
        let warnings = warnings.map(|(cause, stamp)| message(Cause::Refusal(cause), stamp));
        let all = reasons(&all(state), &warnings, Nanos::from_millis(4000));
        let codes: Vec<(&str, Option<f64>)> =
            { all.iter() }.map(|why| (why.code.as_str(), why.age_s)).collect();
        let expected = [
            ("state PAUSED", None),
            ("refusal 6", None),
            ("refusal 7", None),
            ("refusal 11", None),
            ("refusal 3", Some(1.0)),
            ("refusal 4", Some(2.0)),
        ];
        assert_eq!(codes, expected);
        assert!(all[4].text.ends_with("(3000 counts, limit 2000 counts)"), "{}", all[4].text);
    }

    #[test]
    fn an_open_clutch_is_a_reason_while_teleop_runs() {
        let why = "the dead-man is half pressed: release it, then press it fully";
        let mut hand = TeleopMsg {
            flags: TeleopMsg::OPEN,
            why_open: i2ris::ipc::payload::padded_text(why),
            ..TeleopMsg::default()
        };
        let shown = |hand: &TeleopMsg, ms| {
            let messages = LatestMessages { hand: Some(*hand), ..all(ready()) };
            let found = reasons(&messages, &[], Nanos::from_millis(ms));
            found.into_iter().map(|why| (why.text, why.advice)).collect::<Vec<_>>()
        };
        let open = "the clutch is open: the dead-man is half pressed".to_owned();
        assert_eq!(shown(&hand, 100), [(open, "release it, then press it fully".to_owned())]);
        assert_eq!(shown(&hand, 1000), [], "teleop has ended");
        hand.flags = 0;
        assert_eq!(shown(&hand, 100), []);
    }

    #[test]
    fn silent_camera_is_a_reason_but_missing_camera_is_not() {
        let camera = Some(ExternalPosition { stamp_ns: 1_000_000_000, ..Default::default() });
        let adaptation = Some(AdaptationMsg { frames_used: 3, ..Default::default() });
        let ages = |messages: LatestMessages, ms| {
            let found = reasons(&messages, &[], Nanos::from_millis(ms));
            assert!(found.iter().all(|why| why.text.starts_with("the camera is silent")));
            found.into_iter().map(|why| why.age_s).collect::<Vec<_>>()
        };
        let seen = LatestMessages { camera, ..all(ready()) };
        assert_eq!(ages(seen, 1100), []);
        assert_eq!(ages(seen, 4000), [Some(3.0)]);
        // A later reader has received no frame.
        assert_eq!(ages(LatestMessages { adaptation, ..all(ready()) }, 4000), [Some(0.5)]);
    }
}
