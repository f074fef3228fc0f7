//! Why the robot does not move, or not as asked, and what to do.

use i2ris::ipc::Message;
use i2ris::ipc::payload::{OperatingStateMsg, ReasonMsg, TeleopMsg, TrialMsg};
use i2ris::robot::Reason;
use i2ris::units::Nanos;
use serde::Serialize;

use super::{Hand, Trial};

/// What is said where there is no reason.
pub const NOTHING: &str = "nothing keeps the robot from moving: it waits for commands";

/// A reason with its advice.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Why {
    /// `fault 3`, `refusal 9`, ...; empty for one of a later release.
    pub code: String,
    /// What it means.
    pub sentence: String,
    /// Measured value and limit; empty where they are not known.
    pub measured: String,
    /// What to do.
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
            measured: reason
                .measurement
                .map_or_else(String::new, |measurement| measurement.to_string()),
            advice: reason.cause.advice().to_owned(),
            age_s,
            text: reason.text(),
        }
    }
}

/// What keeps the robot from moving now, then the last warning of every cause, newest first.
/// `error` is the last fault, `hand` what a person does with an input device, `trial` what is
/// recorded; `warnings` are in the order in which they came.
pub fn reasons(
    state: &OperatingStateMsg,
    error: Option<&ReasonMsg>,
    warnings: &[ReasonMsg],
    hand: Option<&TeleopMsg>,
    trial: Option<&TrialMsg>,
    now: Nanos,
) -> Vec<Why> {
    let latched = error.and_then(ReasonMsg::reason);
    let present = state.causes().into_iter().map(|cause| {
        let measured = latched.filter(|reason| reason.cause == cause);
        Why::new(&measured.unwrap_or(Reason::from(cause)), None)
    });
    let mut all: Vec<Why> = present.collect();
    let open = hand.and_then(|hand| Hand::new(hand, now)).and_then(|hand| hand.open);
    all.extend(open.map(|why| {
        // What is wrong, and after a colon what to do about it.
        let (sentence, advice) = why.split_once(": ").unwrap_or((&why, "press it, and steer"));
        let (text, advice) = (format!("the clutch is open: {sentence}"), advice.to_owned());
        Why { sentence: text.clone(), text, advice, ..Why::default() }
    }));
    all.extend(trial.and_then(|it| Trial::new(it, now)).and_then(|it| it.why()));
    let mut seen = Vec::new();
    for message in warnings.iter().rev() {
        let age_s = Some(message.age(now).as_seconds());
        if seen.contains(&(message.kind, message.number)) {
            continue;
        }
        seen.push((message.kind, message.number));
        all.push(match message.reason() {
            Some(reason) => Why::new(&reason, age_s),
            None => {
                let (text, advice) = (message.text(), message.advice());
                Why { text, advice, age_s, ..Why::default() }
            }
        });
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use i2ris::ipc::{Fault, OperatingState, Refusal};
    use i2ris::robot::{Cause, Measurement, Quantity};

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
    fn a_robot_that_is_ready_has_no_reason() {
        assert_eq!(reasons(&ready(), None, &[], None, None, Nanos::ZERO), []);
    }

    #[test]
    fn a_fault_shows_its_own_measurement_and_not_that_of_another_one() {
        let state = OperatingStateMsg {
            state: OperatingState::Fault.number(),
            fault: Fault::FollowingError.number(),
            ..ready()
        };
        let own = message(Cause::Fault(Fault::FollowingError), 5000);
        let other = message(Cause::Fault(Fault::Link), 4000);
        for (error, measured) in [(own, "5000 counts, limit 2000 counts"), (other, "")] {
            let [why] = &reasons(&state, Some(&error), &[], None, None, Nanos::ZERO)[..] else {
                panic!()
            };
            assert_eq!((why.code.as_str(), why.measured.as_str()), ("fault 3", measured));
            assert!(why.is_fault() && why.age_s.is_none());
        }
    }

    #[test]
    fn what_can_be_removed_first_comes_first() {
        let off = OperatingStateMsg { flags: OperatingStateMsg::MODEL, ..Default::default() };
        let codes: Vec<String> = reasons(&off, None, &[], None, None, Nanos::ZERO)
            .into_iter()
            .map(|why| why.code)
            .collect();
        assert_eq!(codes, ["refusal 6", "state DISABLED"], "enabling needs the zero");
    }

    #[test]
    fn the_last_message_of_every_cause_comes_newest_first_after_what_holds_now() {
        let state = OperatingStateMsg {
            state: OperatingState::Paused.number(),
            flags: OperatingStateMsg::BUSY,
            ..OperatingStateMsg::default()
        };
        let (step, lease) = (Refusal::Step, Refusal::Lease);
        let warnings = [(step, 1000), (lease, 2000), (step, 3000)];
        let warnings = warnings.map(|(cause, stamp)| message(Cause::Refusal(cause), stamp));
        let all = reasons(&state, None, &warnings, None, None, Nanos::from_millis(4000));
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
    fn an_open_clutch_is_a_reason_while_somebody_steers() {
        let why = "the dead-man is half pressed: let go of it, then press it well";
        let mut hand = TeleopMsg {
            flags: TeleopMsg::OPEN,
            why_open: i2ris::ipc::payload::padded_text(why),
            ..TeleopMsg::default()
        };
        let said = |hand: &TeleopMsg, ms| {
            let found = reasons(&ready(), None, &[], Some(hand), None, Nanos::from_millis(ms));
            found.into_iter().map(|why| (why.text, why.advice)).collect::<Vec<_>>()
        };
        let open = "the clutch is open: the dead-man is half pressed".to_owned();
        assert_eq!(said(&hand, 100), [(open, "let go of it, then press it well".to_owned())]);
        assert_eq!(said(&hand, 1000), [], "nobody steers any more");
        hand.flags = 0;
        assert_eq!(said(&hand, 100), []);
    }
}
