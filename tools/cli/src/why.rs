//! `i2ris why`: why the robot does not move, or not where it was sent, and what to do.

use i2ris::clock;
use i2ris::ipc::client::{Client, ClientError, Subscription};
use i2ris::ipc::payload::{OperatingStateMsg, ReasonMsg};
use i2ris::robot::Reason;
use i2ris::units::Nanos;
use i2ris_terminal::{DomainOption, Failure, Screen, until_closed};

/// Time to wait for a controller that is starting.
const CONNECT: Nanos = Nanos::from_millis(2000);
/// Time limit for the first state.
const FIRST_STATE: Nanos = Nanos::from_millis(1000);
/// Time for the last messages of `error` and `warning`, which a controller sends to new
/// subscribers every 50 ms.
const LAST_REASONS: Nanos = Nanos::from_millis(300);
/// Polling period for them.
const POLL_PERIOD: Nanos = Nanos::from_millis(5);

/// Arguments of `i2ris why`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris why

What keeps the robot from moving now comes first, then the last refusals, stops and clips with \
their age. Two lines each: code, sentence, measured value and limit; and what to do.")]
pub struct Arguments {
    #[command(flatten)]
    domain: DomainOption,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// One answer.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
struct Answer {
    /// `fault 3`, `refusal 9`, ...
    code: String,
    /// What it means.
    sentence: String,
    /// Measured value and limit; empty where they are not known.
    measured: String,
    /// What to do.
    advice: String,
    /// Age of a refusal, stop or clip; `None`: it keeps the robot from moving now.
    age_s: Option<f64>,
    /// Code, sentence, measured value and limit, as in every other outlet.
    text: String,
}

impl Answer {
    fn new(reason: &Reason, age_s: Option<f64>) -> Self {
        Self {
            code: reason.cause.to_string(),
            sentence: reason.cause.sentence().to_owned(),
            measured: reason.excess.map_or_else(String::new, |excess| excess.to_string()),
            advice: reason.cause.advice().to_owned(),
            age_s,
            text: reason.text(),
        }
    }

    fn line(&self) -> String {
        let Self { text, advice, .. } = self;
        match self.age_s {
            Some(age) => format!("{text}, {age:.1} s ago\n  do: {advice}"),
            None => format!("{text}\n  do: {advice}"),
        }
    }
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut client = Client::connect(&arguments.domain.domain()?, CONNECT)?;
    let watcher = client.watcher();
    let (mut error, mut warning) = (watcher.error(), watcher.warning());
    let (mut errors, mut warnings) = (Vec::new(), Vec::new());
    let start = clock::now();
    let state = client.wait_for(FIRST_STATE, |_| true)?;
    while clock::now().since(start) < LAST_REASONS {
        receive(&mut error, &mut errors)?;
        receive(&mut warning, &mut warnings)?;
        clock::sleep(POLL_PERIOD);
    }
    let answers = answers(&state, &errors, &warnings, clock::now());
    print(&answers, arguments.json)
}

fn receive(
    stream: &mut Subscription<ReasonMsg>,
    messages: &mut Vec<ReasonMsg>,
) -> Result<(), ClientError> {
    stream.drain(|message| messages.push(message)).map(drop)
}

fn print(answers: &[Answer], is_json: bool) -> Result<(), Failure> {
    let mut screen = Screen::stdout();
    if is_json {
        until_closed(screen.say(&serde_json::to_string(answers)?))?;
        return Ok(());
    }
    if answers.iter().all(|answer| answer.age_s.is_some()) {
        let ready = "nothing keeps the robot from moving: it waits for commands";
        if !until_closed(screen.say(ready))? {
            return Ok(());
        }
    }
    for answer in answers {
        if !until_closed(screen.say(&answer.line()))? {
            break;
        }
    }
    Ok(())
}

/// All answers: what keeps the robot from moving, then what happened, newest first.
fn answers(
    state: &OperatingStateMsg,
    errors: &[ReasonMsg],
    warnings: &[ReasonMsg],
    now: Nanos,
) -> Vec<Answer> {
    let present = state.causes().into_iter().map(|cause| {
        let is_same = |reason: &Reason| reason.cause == cause;
        let latched = errors.iter().rev().filter_map(ReasonMsg::reason);
        let reason = latched.take(1).find(is_same);
        Answer::new(&reason.unwrap_or(Reason::from(cause)), None)
    });
    let mut answers: Vec<Answer> = present.collect();
    let mut printed = Vec::new();
    for message in warnings.iter().rev() {
        // The last one of every cause; one of a later release has no texts here.
        if let Some(reason) = message.reason()
            && !printed.contains(&reason.cause)
        {
            printed.push(reason.cause);
            let age = now.since(Nanos(message.stamp_ns)).as_seconds();
            answers.push(Answer::new(&reason, Some(age)));
        }
    }
    answers
}

#[cfg(test)]
mod tests {
    use super::*;
    use i2ris::ipc::{Fault, OperatingState, Refusal};
    use i2ris::robot::{Cause, Excess, Quantity};

    fn ready() -> OperatingStateMsg {
        OperatingStateMsg {
            state: OperatingState::Enabled.number(),
            flags: OperatingStateMsg::HOMED | OperatingStateMsg::MODEL,
            ..OperatingStateMsg::default()
        }
    }

    fn message(cause: Cause, stamp: u64) -> ReasonMsg {
        let excess = Some(Excess::new(Quantity::Counts, stamp as f64, Some(2000.0)));
        ReasonMsg::new(&Reason { cause, excess }, 0, Nanos::from_millis(stamp))
    }

    #[test]
    fn a_robot_that_is_ready_has_no_reason() {
        assert_eq!(answers(&ready(), &[], &[], Nanos::ZERO), []);
    }

    #[test]
    fn a_fault_shows_its_own_measurement_and_not_that_of_another_one() {
        let state = OperatingStateMsg {
            state: OperatingState::Fault.number(),
            fault: Fault::FollowingError.number(),
            ..ready()
        };
        let own = Cause::Fault(Fault::FollowingError);
        let other = message(Cause::Fault(Fault::Link), 4000);
        let errors = [other, message(own, 5000)];
        let [answer] = &answers(&state, &errors, &[], Nanos::ZERO)[..] else { panic!() };
        assert_eq!(answer.measured, "5000 counts, limit 2000 counts");
        let [answer] = &answers(&state, &[message(own, 5000), other], &[], Nanos::ZERO)[..] else {
            panic!()
        };
        assert_eq!((answer.code.as_str(), answer.measured.as_str()), ("fault 3", ""));
    }

    #[test]
    fn the_last_message_of_every_cause_comes_newest_first_after_what_holds_now() {
        let state = OperatingStateMsg {
            state: OperatingState::Paused.number(),
            flags: OperatingStateMsg::BUSY,
            ..OperatingStateMsg::default()
        };
        let (step, lease) = (Refusal::Step, Refusal::Lease);
        let warnings = [step, lease, step].map(Cause::Refusal);
        let warnings: Vec<ReasonMsg> = { warnings.iter().zip([1000, 2000, 3000]) }
            .map(|(cause, stamp)| message(*cause, stamp))
            .collect();
        let answers = answers(&state, &[], &warnings, Nanos::from_millis(4000));
        let codes: Vec<(&str, Option<f64>)> =
            { answers.iter() }.map(|answer| (answer.code.as_str(), answer.age_s)).collect();
        let expected = [
            ("state PAUSED", None),
            ("refusal 6", None),
            ("refusal 7", None),
            ("refusal 11", None),
            ("refusal 3", Some(1.0)),
            ("refusal 4", Some(2.0)),
        ];
        assert_eq!(codes, expected);
        assert!(answers[4].line().contains("3000 counts, limit 2000 counts), 1.0 s ago"));
    }
}
