//! `i2ris status` as text: why the robot does not move, what to do, and everything else.

use std::fs;
use std::path::Path;

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::ipc::client::Client;
use i2ris::ipc::payload::Version;
use i2ris::model::ModelId;
use i2ris::process::run_log::FILE;
use i2ris::units::Nanos;
use i2ris_report::exit::Coded;
use i2ris_report::view::{View, reasons, short_id};
use i2ris_report::{Failure, Interrupt, Screen, until_closed};
use serde_json::Value;

use super::dashboard::{Dashboard, READ_PERIOD, Subscriptions};
use super::lines;

/// Time to wait for a controller that is starting, or that has gone while it is watched.
const CONNECT: Nanos = Nanos::from_millis(2000);
const CONNECT_AGAIN: Nanos = Nanos::from_millis(200);
/// Time limit for the first messages. Statistics come once a second.
const FIRST_MESSAGES: Nanos = Nanos::from_millis(1500);
/// Time for the last messages of `error` and `warning`, which a controller sends to new
/// subscribers every 50 ms, and for the trial that a recorder publishes, twice a second.
const LAST_REASONS: Nanos = Nanos::from_millis(700);
const PRINT_PERIOD: Nanos = Nanos::from_millis(1000);

/// Waits for a message of every stream that a controller always publishes, then prints.
pub fn once(domain: &Domain, is_json: bool) -> Result<(), Failure> {
    let title = title(domain, CONNECT)?;
    let mut status = Status::new(domain, title);
    let now = loop {
        let now = clock::now();
        status.refresh(now);
        if let Some(problem) = status.dashboard.problem {
            return Err(problem.into());
        }
        if status.is_ready(now) {
            break now;
        }
        clock::sleep(READ_PERIOD);
    };
    let lines =
        if is_json { vec![serde_json::to_string(&status.view(now))?] } else { status.lines(now) };
    until_closed(Screen::stdout().draw(&lines))?;
    Ok(())
}

/// Prints the same every second, until a signal, the end of `span`, or the end of its reader.
/// Without a controller, it prints the error of [`once`].
pub fn watch(domain: &Domain, span: Option<Nanos>) -> Result<(), Failure> {
    let interrupt = Interrupt::catch()?;
    let title = title(domain, CONNECT)?;
    let (mut status, mut screen) = (Status::new(domain, title), Screen::stdout());
    let start = clock::now();
    let mut next = start;
    while !interrupt.came() && span.is_none_or(|span| clock::now().duration_since(start) < span) {
        let now = clock::now();
        status.refresh(now);
        if now >= next && status.is_ready(now) {
            next = now + PRINT_PERIOD;
            if !until_closed(screen.clear_and_print(&status.lines(now)))? {
                break;
            }
        }
        clock::sleep(READ_PERIOD);
    }
    Ok(())
}

/// Software and process of the controller, and its model, in one line.
fn title(domain: &Domain, timeout: Nanos) -> Result<String, Failure> {
    let mut client = Client::connect(domain, timeout).map_err(|error| {
        let last = Some(domain).filter(|_| error.is_absent()).and_then(last_run);
        match last {
            Some(last) => Coded { code: 3, sentence: format!("{error}; {last}") }.into(),
            None => Failure::from(error),
        }
    })?;
    let Version { software: [major, minor, patch], pid, model_id, .. } = client.version()?;
    let model = match model_id {
        id if id == [0; 32] => "no model".to_owned(),
        id => format!("model {}", short_id(ModelId(id))),
    };
    let domain = domain.name();
    Ok(format!("i2ris {major}.{minor}.{patch}, domain {domain}, process {pid}, {model}"))
}

struct Status {
    domain: Domain,
    subscriptions: Subscriptions,
    dashboard: Dashboard,
    reachable_since: Nanos,
    /// Title line; `None`: the controller or its model has changed.
    title: Option<String>,
}

impl Status {
    fn new(domain: &Domain, title: String) -> Self {
        Self {
            domain: domain.clone(),
            subscriptions: Subscriptions::new(domain),
            dashboard: Dashboard::default(),
            reachable_since: clock::now(),
            title: Some(title),
        }
    }

    fn refresh(&mut self, now: Nanos) {
        let is_first = self.dashboard.messages.measured.is_none();
        let is_other = self.subscriptions.refresh(&mut self.dashboard, now);
        if self.dashboard.problem.is_some() {
            self.reachable_since = now;
        }
        if self.dashboard.problem.is_some() || (is_other && !is_first) {
            self.title = None;
        }
    }

    /// Whether the first messages have arrived, or will not come.
    fn is_ready(&self, now: Nanos) -> bool {
        let waited = now.duration_since(self.reachable_since);
        self.dashboard.problem.is_some()
            || waited > FIRST_MESSAGES
            || self.dashboard.messages.is_complete() && waited > LAST_REASONS
    }

    fn view(&self, now: Nanos) -> View {
        let Dashboard { messages, warnings, .. } = &self.dashboard;
        View { why: reasons(messages, warnings, now), ..self.dashboard.view(now) }
    }

    /// Returns everything, or the reason why nothing is known.
    fn lines(&mut self, now: Nanos) -> Vec<String> {
        let title = match self.title.take() {
            Some(title) => title,
            None => match title(&self.domain, CONNECT_AGAIN) {
                Ok(title) => title,
                Err(failure) => return vec![failure.to_string()],
            },
        };
        let view = self.view(now);
        let lines = match &view.problem {
            Some(problem) => vec![problem.clone()],
            None => [lines::reasons(&view), vec![String::new(), title.clone()], lines::page(&view)]
                .concat(),
        };
        self.title = Some(title);
        lines
    }
}

/// A sentence about the last run of a domain, if it has not ended cleanly.
fn last_run(domain: &Domain) -> Option<String> {
    let (boot_id, folder) = domain.last_run()?;
    let (run, log) = (format!("{boot_id:016x}"), folder.join(FILE));
    let text = fs::read_to_string(&log).ok()?;
    let lines = text.lines().rev().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let lines: Vec<Value> = lines.filter(|line| line["run"] == run.as_str()).collect();
    let field = |name: &str| lines.iter().find_map(|line| line[name].as_str());
    let time = field("time")?;
    let how = match field("outcome") {
        Some(outcome) => format!("ended at {time}: {outcome}"),
        None => format!("was killed or crashed after {time}"),
    };
    let reason = field("reason").map(|it| format!(", the last reason was `{it}`"));
    // Names begin with the time.
    let black_box = match newest(&folder) {
        Some(path) if field("outcome").is_some() => format!("black box {path}"),
        _ => "the next start after it writes its black box there".to_owned(),
    };
    let (reason, log) = (reason.unwrap_or_default(), log.display());
    Some(format!("the last one {how}{reason}; log {log}; {black_box}"))
}

fn newest(folder: &Path) -> Option<String> {
    let entries = fs::read_dir(folder).ok()?.flatten().map(|entry| entry.path());
    let boxes = entries.filter(|path| path.extension().is_some_and(|it| it == "box"));
    boxes.max().map(|path| path.display().to_string())
}
