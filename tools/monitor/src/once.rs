//! `i2ris status` without more: why the robot does not move, what to do, and everything else once.

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::client::{ClientError, Subscription, Watcher};
use i2ris::ipc::payload::ReasonMsg;
use i2ris::units::Nanos;
use i2ris_report::view::{LatestMessages, View, reasons};
use i2ris_report::{Failure, Screen, until_closed};

use super::dashboard::Dashboard;
use super::lines;
use super::subscriptions::Subscriptions;

/// Time limit for the first messages. Statistics come once a second.
const FIRST_MESSAGES: Nanos = Nanos::from_millis(1500);
/// Time for the last messages of `error` and `warning`, which a controller sends to new
/// subscribers every 50 ms, and for what a recorder says of its trial, twice a second.
const LAST_REASONS: Nanos = Nanos::from_millis(700);
const POLL_PERIOD: Nanos = Nanos::from_millis(5);

/// Waits for a message of every stream that a controller always publishes, then prints.
pub fn run(
    domain: &Domain,
    subscriptions: &mut Subscriptions,
    title: &str,
    is_json: bool,
) -> Result<(), Failure> {
    let watcher = Watcher::new(domain);
    let (mut error, mut warning) = (watcher.error(), watcher.warning());
    let (mut errors, mut warnings) = (Vec::new(), Vec::new());
    let (start, mut dashboard) = (clock::now(), Dashboard::default());
    let now = loop {
        let now = clock::now();
        subscriptions.refresh(&mut dashboard, now);
        if let Some(problem) = dashboard.problem {
            return Err(problem.into());
        }
        receive(&mut error, &mut errors)?;
        receive(&mut warning, &mut warnings)?;
        let waited = now.duration_since(start);
        if waited > FIRST_MESSAGES || dashboard.messages.is_complete() && waited > LAST_REASONS {
            break now;
        }
        clock::sleep(POLL_PERIOD);
    };
    let view = dashboard.view(now);
    let messages = LatestMessages { error: errors.last().copied(), ..dashboard.messages };
    let view = View { why: reasons(&messages, &warnings, now), ..view };
    let lines = if is_json {
        vec![serde_json::to_string(&view)?]
    } else {
        let rest = [vec![String::new(), title.to_owned()], lines::page(&view)].concat();
        [lines::reasons(&view), rest].concat()
    };
    until_closed(Screen::stdout().draw(&lines))?;
    Ok(())
}

fn receive(
    stream: &mut Subscription<ReasonMsg>,
    messages: &mut Vec<ReasonMsg>,
) -> Result<(), ClientError> {
    stream.drain(|message| messages.push(message)).map(drop)
}
