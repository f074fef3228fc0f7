//! `i2ris why`: why the robot does not move, or not where it was sent, and what to do.

use i2ris::clock;
use i2ris::ipc::client::{Client, ClientError, Latest, Subscription};
use i2ris::ipc::payload::ReasonMsg;
use i2ris::ipc::{Refusal, find_client_process};
use i2ris::robot::Cause;
use i2ris::units::Nanos;
use i2ris_report::view::{NOTHING, Why, reasons};
use i2ris_report::{DomainOption, Failure, Screen, until_closed};

/// Time to wait for a controller that is starting.
const CONNECT: Nanos = Nanos::from_millis(2000);
/// Time limit for the first state.
const FIRST_STATE: Nanos = Nanos::from_millis(1000);
/// Time for the last messages of `error` and `warning`, which a controller sends to new
/// subscribers every 50 ms, and for what a recorder tells of its trial, twice a second.
const LAST_REASONS: Nanos = Nanos::from_millis(700);
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

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let domain = arguments.domain.domain()?;
    let mut client = Client::connect(&domain, CONNECT)?;
    let watcher = client.watcher();
    let (mut error, mut warning) = (watcher.error(), watcher.warning());
    let (mut hand, mut trial) = (Latest::new(watcher.teleop()), Latest::new(watcher.trial()));
    let (mut errors, mut warnings) = (Vec::new(), Vec::new());
    let start = clock::now();
    let state = client.wait_for(FIRST_STATE, |_| true)?;
    while clock::now().since(start) < LAST_REASONS {
        receive(&mut error, &mut errors)?;
        receive(&mut warning, &mut warnings)?;
        hand.refresh()?;
        trial.refresh()?;
        clock::sleep(POLL_PERIOD);
    }
    let hand = hand.refresh()?.copied();
    let trial = trial.refresh()?.copied();
    let (hand, trial) = (hand.as_ref(), trial.as_ref());
    let found = reasons(&state, errors.last(), &warnings, hand, trial, clock::now());
    let holder = find_client_process(&domain, state.boot_id, state.lease_client_id);
    let holder = match holder {
        Some(process) => format!("; now {process} holds it"),
        None if state.lease_client_id == 0 => "; now nobody holds it".to_owned(),
        None => String::new(),
    };
    print(&found, &holder, arguments.json)
}

fn receive(
    stream: &mut Subscription<ReasonMsg>,
    messages: &mut Vec<ReasonMsg>,
) -> Result<(), ClientError> {
    stream.drain(|message| messages.push(message)).map(drop)
}

/// `holder`: of the lease, behind a refusal for its sake.
fn print(reasons: &[Why], holder: &str, is_json: bool) -> Result<(), Failure> {
    let mut lines = Vec::new();
    if is_json {
        lines.push(serde_json::to_string(reasons)?);
    } else {
        if reasons.iter().all(|why| why.age_s.is_some()) {
            lines.push(NOTHING.to_owned());
        }
        let lease = Cause::Refusal(Refusal::Lease).to_string();
        lines.extend(reasons.iter().map(|Why { code, text, advice, age_s, .. }| match age_s {
            Some(age) => {
                let holder = if *code == lease { holder } else { "" };
                format!("{text}, {age:.1} s ago{holder}\n  do: {advice}")
            }
            None => format!("{text}\n  do: {advice}"),
        }));
    }
    let mut screen = Screen::stdout();
    for line in lines {
        if !until_closed(screen.say(&line))? {
            break;
        }
    }
    Ok(())
}
