//! The read-only page for a browser.
//!
//! The page cannot command anything by design, not by configuration. The server supports one
//! method, GET, and answers from a [`Dashboard`], which holds numbers;
//! it has no access to types of the client library. The thread that fills the dashboard subscribes
//! to streams and opens no publisher. It requests only the list of models, by a separate connection
//! that it closes again.
//!
//! A browser polls for new data ([`Source`]), so a slow one gets less and a vanished one costs
//! nothing: the server keeps no state about browsers. Ages refer to the time of the answer, because
//! a browser does not know the controller's clock.

mod http;
mod server;

use std::net::{IpAddr, Ipv4Addr, SocketAddr, TcpListener};
use std::str::FromStr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use i2ris::clock;
use i2ris::ipc::Domain;
use i2ris::model::kinematic::shape_mm;
use i2ris::units::Nanos;
use i2ris_report::model_poller::ModelPoller;
use i2ris_report::view::{Cue, Pair, Pose, View};
use i2ris_report::{Failure, Interrupt, Screen, until_closed};
use serde::Serialize;

use crate::dashboard::{Dashboard, READ_PERIOD, Subscriptions};
use crate::history::{CameraFrame, Sample};
use http::Since;

/// Serves until a signal or the end of `span`, also without a controller.
pub fn run(domain: &Domain, address: ListenAddress, span: Option<Nanos>) -> Result<(), Failure> {
    let interrupt = Interrupt::catch()?;
    let listener = TcpListener::bind(address.0).map_err(|error| {
        format!(
            "cannot serve at {}: {error}; is another monitor running there? choose a different \
             --web ADDRESS:PORT",
            address.0
        )
    })?;
    let address = listener.local_addr()?;
    if !address.ip().is_loopback() {
        eprintln!(
            "warning: {address} can be reached from other machines: everyone there can watch, \
             without a password and \
             without encryption. The page cannot command the robot."
        );
    }
    let source = Arc::new(Source::new(domain.name(), clock::now()));
    server::start(listener, Arc::clone(&source), address.ip().is_loopback())?;
    let outcome = Screen::stdout()
        .say(&format!("watch domain {} at http://{address}/ (read-only)", domain.name()));
    until_closed(outcome)?;
    let model_poller = ModelPoller::start(domain);
    let mut subscriptions = Subscriptions::new(domain);
    let start = clock::now();
    while !interrupt.came() && span.is_none_or(|span| clock::now().duration_since(start) < span) {
        let now = clock::now();
        let mut dashboard = source.dashboard();
        if subscriptions.refresh(&mut dashboard, now) {
            model_poller.poll_now();
        }
        dashboard.models = model_poller.known();
        drop(dashboard);
        clock::sleep(READ_PERIOD);
    }
    Ok(())
}

const DEFAULT_PORT: u16 = 8766;
/// The address for `--web` without a value.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:8766";

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ListenAddress(pub SocketAddr);

#[derive(Debug, thiserror::Error)]
#[error(
    "`{0}` is not PORT, ADDRESS or ADDRESS:PORT; for example 8080, 192.168.1.5 or 192.168.1.5:8080"
)]
pub struct InvalidAddress(String);

impl FromStr for ListenAddress {
    type Err = InvalidAddress;

    /// Resolves no names but `localhost`: an address names the network that gets access.
    fn from_str(text: &str) -> Result<Self, InvalidAddress> {
        let loopback = IpAddr::V4(Ipv4Addr::LOCALHOST);
        let local =
            text.strip_prefix("localhost").map(|rest| rest.strip_prefix(':').unwrap_or(rest));
        let text_or_port = local.filter(|port| !port.is_empty()).unwrap_or(text);
        if local == Some("") {
            return Ok(Self(SocketAddr::new(loopback, DEFAULT_PORT)));
        }
        if let Ok(port) = text_or_port.parse::<u16>() {
            return Ok(Self(SocketAddr::new(loopback, port)));
        }
        if let Ok(address) = text.parse::<SocketAddr>() {
            return Ok(Self(address));
        }
        let bare = text.trim_start_matches('[').trim_end_matches(']');
        let address = bare.parse::<IpAddr>().map_err(|_| InvalidAddress(text.to_owned()))?;
        Ok(Self(SocketAddr::new(address, DEFAULT_PORT)))
    }
}

#[derive(Debug)]
pub struct Source {
    dashboard: Mutex<Dashboard>,
    domain: String,
    /// When this monitor was started: names it, and is where its seconds begin.
    origin: Nanos,
}

impl Source {
    pub fn new(domain: &str, origin: Nanos) -> Self {
        Self { dashboard: Mutex::default(), domain: domain.to_owned(), origin }
    }

    /// The dashboard, to be filled. Held for microseconds, on either side.
    pub fn dashboard(&self) -> MutexGuard<'_, Dashboard> {
        self.dashboard.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub fn live(&self, since: &Since) -> String {
        // Milliseconds: a browser cannot count to the nanoseconds of an uptime.
        let run = self.origin.0 / 1_000_000;
        let since = if since.run == run { *since } else { Since { run, ..Since::default() } };
        // Copied, so that the thread that fills the dashboard never waits for the formatting.
        let dashboard = self.dashboard().clone();
        let snapshot = Snapshot::new(&dashboard, &self.domain, self.origin, &since, clock::now());
        serde_json::to_string(&snapshot).unwrap_or_default()
    }
}

#[derive(Debug, Serialize)]
pub struct Snapshot<'a> {
    /// Start of the monitor that the numbers belong to.
    run: u64,
    domain: &'a str,
    version: &'static str,
    now_s: f64,
    #[serde(flatten)]
    view: View,
    snake: Snake,
    cue: Option<Cue>,
    /// Pitch and yaw, degrees.
    hull: Vec<[f64; 2]>,
    along: [[f64; 2]; 2],
    along_names: [&'static str; 2],
    samples: Vec<Vec<Option<f64>>>,
    next_sample: u64,
    frames: Vec<Vec<Option<f64>>>,
    next_frame: u64,
}

/// Base, joints and tip of the snake, mm, for every stream with fresh angles.
#[derive(Debug, Serialize)]
struct Snake {
    estimate: Option<Vec<[f64; 3]>>,
    goal: Option<Vec<[f64; 3]>>,
    camera: Option<Vec<[f64; 3]>>,
}

impl<'a> Snapshot<'a> {
    pub fn new(
        dashboard: &Dashboard,
        domain: &'a str,
        origin: Nanos,
        since: &Since,
        now: Nanos,
    ) -> Self {
        let view = dashboard.view(now);
        let outline = &dashboard.models.outline;
        let (samples, next_sample) = dashboard.history.samples(since.sample);
        let (frames, next_frame) = dashboard.history.frames(since.frame);
        let shape = |pose: Option<Pose>| {
            let [pitch, yaw] = pose?.fresh()?.map(f64::to_radians);
            Some(shape_mm(pitch, yaw).iter().map(|at| at.map(short)).collect())
        };
        Self {
            run: since.run,
            domain,
            version: env!("CARGO_PKG_VERSION"),
            now_s: seconds(now, origin),
            snake: Snake {
                estimate: shape(view.estimate),
                goal: shape(view.goal),
                camera: shape(view.camera),
            },
            cue: view.cue(&outline.points),
            view,
            hull: outline.points.iter().map(|point| point.map(short)).collect(),
            along: outline.along,
            along_names: [outline.name(0), outline.name(1)],
            samples: samples.map(|sample| sample_row(sample, origin)).collect(),
            next_sample,
            frames: frames.map(|frame| frame_row(frame, origin)).collect(),
            next_frame,
        }
    }
}

/// Time, then pairs: goal, setpoint, estimate, deviation, setpoint counts, counts, currents.
fn sample_row(sample: &Sample, origin: Nanos) -> Vec<Option<f64>> {
    let Sample { goal, setpoint, estimate, deviation, setpoint_counts, counts, current, .. } =
        *sample;
    let pairs = [goal, setpoint, estimate, deviation, setpoint_counts, counts, current];
    row(seconds(sample.stamp, origin), &pairs)
}

fn frame_row(frame: &CameraFrame, origin: Nanos) -> Vec<Option<f64>> {
    row(seconds(frame.stamp, origin), &[Some(frame.angles), frame.counts])
}

fn row(stamp: f64, pairs: &[Pair]) -> Vec<Option<f64>> {
    let values = |pair: &Pair| pair.map_or([None; 2], |pair| pair.map(|it| Some(short(it))));
    std::iter::once(Some(stamp)).chain(pairs.iter().flat_map(values)).collect()
}

/// Three digits are a thousandth of a degree: more is noise, and bytes.
fn short(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0
}

/// Seconds since the monitor started; a frame may be from before.
fn seconds(instant: Nanos, origin: Nanos) -> f64 {
    short(instant.as_seconds() - origin.as_seconds())
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::OperatingState;
    use i2ris::ipc::payload::{JointState, OperatingStateMsg};
    use i2ris_report::view::LatestMessages;
    use serde_json::{Value, json};

    use super::*;

    #[test]
    fn a_port_alone_is_local_and_names_are_refused() {
        for (text, wanted) in [
            (DEFAULT_ADDRESS, "127.0.0.1:8766"),
            ("8080", "127.0.0.1:8080"),
            ("localhost", "127.0.0.1:8766"),
            ("localhost:81", "127.0.0.1:81"),
            ("0.0.0.0", "0.0.0.0:8766"),
            ("192.168.1.5:80", "192.168.1.5:80"),
            ("::1", "[::1]:8766"),
            ("[::1]:9", "[::1]:9"),
        ] {
            assert_eq!(text.parse::<ListenAddress>().unwrap().0.to_string(), wanted, "{text}");
        }
        for text in ["", "example.org", "1.2.3", "70000", "localhost:x", "-1"] {
            let error = text.parse::<ListenAddress>().unwrap_err().to_string();
            assert!(error.contains("ADDRESS:PORT"), "{text}: {error}");
        }
    }

    #[test]
    fn another_start_of_the_monitor_gives_everything_again() {
        let source = Source::new("test", Nanos::from_millis(9000));
        for step in 0..10 {
            let mut dashboard = source.dashboard();
            let Dashboard { history, messages, .. } = &mut *dashboard;
            history.sample(messages, Nanos::from_millis(10_000 + 100 * step));
        }
        let samples = |query: &str| {
            let value: Value = serde_json::from_str(&source.live(&Since::parse(query))).unwrap();
            (value["samples"].as_array().unwrap().len(), value["next_sample"].as_u64().unwrap())
        };
        assert_eq!(samples("run=9000&sample=7"), (3, 10));
        assert_eq!(samples("run=8000&sample=7"), (10, 10));
    }

    const NOW: Nanos = Nanos(100_000_000_000);

    fn snapshot(origin: Nanos, since: Since) -> Value {
        let joint = JointState {
            stamp_ns: NOW.0 - 2_000_000,
            position: [0.1, -0.2, 0.0],
            deviation: [0.01, 0.02, 0.0],
            count: 2,
            flags: JointState::VALID,
            ..JointState::default()
        };
        let state = OperatingStateMsg {
            stamp_ns: NOW.0 - 600_000_000,
            state: OperatingState::Fault.number(),
            fault: 2,
            ..OperatingStateMsg::default()
        };
        let messages = LatestMessages {
            state: Some(state),
            measured: Some(joint),
            goal: Some(JointState { flags: 0, ..joint }),
            ..LatestMessages::default()
        };
        let mut dashboard = Dashboard { messages, ..Dashboard::default() };
        dashboard.history.sample(&dashboard.messages, NOW);
        serde_json::to_value(Snapshot::new(&dashboard, "test", origin, &since, NOW)).unwrap()
    }

    #[test]
    fn angles_are_degrees_and_ages_are_included() {
        let value = snapshot(Nanos::ZERO, Since::default());
        let estimate = &value["estimate"];
        assert_eq!(estimate["deg"], json!([5.73, -11.459]));
        assert_eq!((&estimate["age_ms"], &estimate["stale"]), (&json!(2), &json!(false)));
        let state = &value["state"];
        let shown = (&state["stale"], &state["fault"]);
        assert_eq!(shown, (&json!(true), &json!("a drive does not answer")));
        for missing in [&value["goal"]["deg"], &value["camera"], &value["motors"]] {
            assert_eq!(missing, &Value::Null);
        }
    }

    #[test]
    fn a_row_holds_the_data_and_null_for_gaps() {
        let value = snapshot(NOW, Since::default());
        let row = value["samples"][0].as_array().unwrap();
        assert_eq!(row.len(), 15);
        let found = [0, 1, 5, 11].map(|at: usize| &row[at]);
        assert_eq!(found, [&json!(0.0), &Value::Null, &json!(5.73), &Value::Null]);
        let nothing = snapshot(NOW, Since { sample: 1, ..Since::default() });
        assert_eq!(nothing["samples"], json!([]));
    }
}
