//! The data for a browser: the view of the robot, and the new part of the history. Pure. Ages refer
//! to the time of the answer, because a browser does not know the controller's clock.

use i2ris::model::kinematic::shape_mm;
use i2ris::units::Nanos;
use i2ris_report::view::{Cue, Pair, Pose, View};
use serde::Serialize;

use super::route::Since;
use crate::dashboard::Dashboard;
use crate::history::{CameraFrame, Sample};

/// Everything that the page shows.
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

/// Time, then pairs: goal, setpoint, estimate, standard deviation, setpoint counts, counts,
/// currents. `null`: a gap.
fn sample_row(sample: &Sample, origin: Nanos) -> Vec<Option<f64>> {
    let Sample { goal, setpoint, estimate, deviation, setpoint_counts, counts, current, .. } =
        *sample;
    row(
        seconds(sample.stamp, origin),
        &[goal, setpoint, estimate, deviation, setpoint_counts, counts, current],
    )
}

/// Time, pitch, yaw, counts of both motors.
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
        assert_eq!(
            (&state["stale"], &state["fault"]),
            (&json!(true), &json!("a drive does not answer"))
        );
        for missing in [&value["goal"]["deg"], &value["camera"], &value["motors"]] {
            assert_eq!(missing, &Value::Null);
        }
    }

    #[test]
    fn a_row_holds_the_data_and_null_for_gaps() {
        let value = snapshot(NOW, Since::default());
        let row = value["samples"][0].as_array().unwrap();
        assert_eq!(row.len(), 15);
        assert_eq!(
            (&row[0], &row[1], &row[5], &row[11]),
            (&json!(0.0), &Value::Null, &json!(5.73), &Value::Null)
        );
        let nothing = snapshot(NOW, Since { sample: 1, ..Since::default() });
        assert_eq!(nothing["samples"], json!([]));
    }
}
