//! Why the robot does not move, or not as commanded: one text for every output.
//!
//! The log, the streams `error` and `warning`, the recording, `i2ris status`, the monitor and the
//! exceptions of the client libraries all show a [`Reason`]: code, sentence, measured value and
//! limit, and recommended action.

use std::fmt;

use super::{Clip, Fault, Measurement, OperatingState, Refusal, Stop};

/// Cause of not moving, or of not moving as commanded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Cause {
    /// The state FAULT.
    Fault(Fault),
    /// A refused command.
    Refusal(Refusal),
    /// An uncommanded stop.
    Stop(Stop),
    /// A goal that is only partly followed.
    Clip(Clip),
    /// A state in which the robot follows no servo command.
    State(OperatingState),
}

impl Cause {
    /// Every cause, by kind and number, without the two that mean "none".
    pub fn all() -> impl Iterator<Item = Self> {
        let faults = Fault::ALL.iter().filter(|it| **it != Fault::None);
        let refusals = Refusal::ALL.iter().filter(|it| **it != Refusal::None);
        faults
            .map(|it| Self::Fault(*it))
            .chain(refusals.map(|it| Self::Refusal(*it)))
            .chain(Stop::ALL.iter().map(|it| Self::Stop(*it)))
            .chain(Clip::ALL.iter().map(|it| Self::Clip(*it)))
            .chain(OperatingState::ALL.iter().map(|it| Self::State(*it)))
    }

    /// The cause of a kind ([`Cause::kind`]) with a number ([`Cause::number`]).
    #[must_use]
    pub fn from_numbers(kind: u32, number: u32) -> Option<Self> {
        Self::all().find(|cause| (cause.kind(), cause.number()) == (kind, number))
    }

    /// Number of the kind in payloads: 1 fault, 2 refusal, 3 stop, 4 clip, 5 state.
    #[must_use]
    pub const fn kind(self) -> u32 {
        match self {
            Self::Fault(_) => 1,
            Self::Refusal(_) => 2,
            Self::Stop(_) => 3,
            Self::Clip(_) => 4,
            Self::State(_) => 5,
        }
    }

    /// Number within its kind.
    #[must_use]
    pub const fn number(self) -> u32 {
        self.parts().0
    }

    /// Number, sentence and recommended action.
    const fn parts(self) -> (u32, &'static str, &'static str) {
        match self {
            Self::Fault(it) => (it.number(), it.text(), it.advice()),
            Self::Refusal(it) => (it.number(), it.text(), it.advice()),
            Self::Stop(it) => (it.number(), it.text(), it.advice()),
            Self::Clip(it) => (it.number(), it.text(), it.advice()),
            Self::State(it) => {
                let [sentence, advice] = of_state(it);
                (it.number(), sentence, advice)
            }
        }
    }

    /// Whether it belongs to the stream `error`; all others belong to `warning`.
    #[must_use]
    pub const fn is_error(self) -> bool {
        matches!(self, Self::Fault(_))
    }

    /// Describes the event in one sentence.
    #[must_use]
    pub fn sentence(self) -> &'static str {
        self.parts().1
    }

    /// Recommended action, in one sentence.
    #[must_use]
    pub fn advice(self) -> &'static str {
        self.parts().2
    }
}

/// Sentence and recommended action of a state.
const fn of_state(state: OperatingState) -> [&'static str; 2] {
    match state {
        OperatingState::Disabled => ["the drives are off", "`i2ris enable`"],
        OperatingState::Enabled => ["the robot waits for commands", "send commands"],
        OperatingState::Paused => {
            ["the robot holds, and servo commands are refused", "`i2ris command state resume`"]
        }
        OperatingState::Fault => {
            ["a fault is latched", "remove the cause, then `i2ris command state acknowledge`"]
        }
    }
}

/// The code: `fault 3`, `refusal 9`, `stop 1`, `clip 1`, `state PAUSED`.
impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fault(it) => write!(f, "fault {}", it.number()),
            Self::Refusal(it) => write!(f, "refusal {}", it.number()),
            Self::Stop(it) => write!(f, "stop {}", it.number()),
            Self::Clip(it) => write!(f, "clip {}", it.number()),
            Self::State(it) => write!(f, "state {it}"),
        }
    }
}

/// A cause and its measured value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reason {
    /// The cause.
    pub cause: Cause,
    /// The measured value and the limit that it broke, where they are known.
    pub measurement: Option<Measurement>,
}

impl Reason {
    /// The line without the advice: `fault 3: SENTENCE (MEASURED, limit LIMIT)`.
    #[must_use]
    pub fn text(&self) -> String {
        let Self { cause, measurement } = self;
        let sentence = cause.sentence();
        match measurement {
            Some(measurement) => format!("{cause}: {sentence} ({measurement})"),
            None => format!("{cause}: {sentence}"),
        }
    }
}

impl From<Cause> for Reason {
    fn from(cause: Cause) -> Self {
        Self { cause, measurement: None }
    }
}

/// [`Reason::text`] and the recommended action.
impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; action: {}", self.text(), self.cause.advice())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Quantity;

    #[test]
    fn every_cause_has_a_unique_code_a_sentence_and_advice() {
        let mut codes: Vec<String> = Cause::all().map(|cause| cause.to_string()).collect();
        let all = codes.len();
        codes.sort();
        codes.dedup();
        assert_eq!(codes.len(), all);
        for cause in Cause::all() {
            assert_eq!(Cause::from_numbers(cause.kind(), cause.number()), Some(cause));
            assert!(cause.sentence().len() > 3 && cause.advice().len() > 3, "{cause}");
        }
        assert_eq!(Cause::from_numbers(9, 1), None);
        assert_eq!(Cause::from_numbers(2, 99), None);
    }

    #[test]
    fn text_shows_measurement_and_limit() {
        let error = Measurement::new(Quantity::Counts, 2314.0, Some(2000.0)).of_motor(1);
        let reason =
            Reason { cause: Cause::Fault(Fault::FollowingError), measurement: Some(error) };
        assert_eq!(
            reason.text(),
            "fault 3: following error too large (motor 1: 2314 counts, limit 2000 \
             counts)"
        );
        let code = Measurement::new(Quantity::ErrorCode, f64::from(0x8611), None);
        assert_eq!(code.to_string(), "error code 0x8611");
        let age = Measurement::new(Quantity::Milliseconds, 62.25, Some(50.0));
        assert_eq!(age.to_string(), "62.2 ms, limit 50.0 ms");
        let reason = Reason::from(Cause::State(OperatingState::Paused));
        assert_eq!(
            reason.to_string(),
            "state PAUSED: the robot holds, and servo commands are refused; action: `i2ris command \
             state resume`"
        );
    }
}
