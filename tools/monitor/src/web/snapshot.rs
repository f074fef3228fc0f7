//! The data for a browser, as JSON. Pure. Degrees, counts, seconds; ages in milliseconds at the
//! moment of the answer, because a browser knows nothing of the controller's clock.

use i2ris::ipc::drive_phase::phase_text;
use i2ris::ipc::payload::{
    ActuatorState, ExternalPosition, JointState, OperatingStateMsg, PeriodStatistics, ReasonMsg,
    SpanSummary,
};
use i2ris::ipc::{Message, Refusal};
use i2ris::model::kinematic::shape_mm;
use i2ris::robot::Reason;
use i2ris::units::Nanos;
use serde_json::{Value, json};

use super::cursor::Since;
use crate::dashboard::Dashboard;
use crate::event_log::Severity;
use crate::history::{CameraFrame, Pair, Sample};
use crate::latest_messages::{
    CAMERA_STALE, LatestMessages, STALE, STATISTICS_STALE, angles, count, granted, health_text,
    state_name,
};
use crate::model_poller::LoadedModel;
use crate::{adaptation, fixtures, reach_target};

/// Events in the answer.
const EVENTS: usize = 30;
/// Faults in the answer.
const ALARMS: usize = 8;

/// Everything that the page shows; of the history the new part.
pub fn snapshot(
    dashboard: &Dashboard,
    domain: &str,
    run: u64,
    origin: Nanos,
    since: &Since,
    now: Nanos,
) -> Value {
    let view = &dashboard.view;
    let (samples, next_sample) = dashboard.history.samples(since.sample);
    let (frames, next_frame) = dashboard.history.frames(since.frame);
    let points = dashboard.models.outline.points.iter();
    let hull: Vec<[f64; 2]> = points.map(|point| point.map(short)).collect();
    json!({
        "run": run,
        "domain": domain,
        "version": env!("CARGO_PKG_VERSION"),
        "now_s": seconds(now, origin),
        "problem": dashboard.problem,
        "state": view.state.as_ref().map(|state| operating(dashboard, state, now)),
        "error": view.present_error().as_ref().map(|error| reason(error, now)),
        "warning": view.recent_warning(now).as_ref().map(|warning| reason(warning, now)),
        "why": view.state.as_ref().map_or(json!([]), why),
        "snake": snake(view, now),
        "goal": view.goal.as_ref().map(|joint| joint_state(joint, now)),
        "setpoint": view.setpoint.as_ref().map(|joint| joint_state(joint, now)),
        "estimate": view.measured.as_ref().map(|joint| joint_state(joint, now)),
        "camera": view.camera.as_ref().map(|camera| seen(view, camera, now)),
        "motors": view.actuators.as_ref().map(|motors| actuators(view, motors, now)),
        "fixtures": view.fixtures.as_ref().map(fixtures::as_json),
        "target": view.target.as_ref().and_then(|target| reach_target::as_json(target, now)),
        "adaptation": view.adaptation.as_ref().map(adaptation::as_json),
        "health": view.health.as_ref().map(health_text),
        "loop": view.statistics.as_ref().map(|statistics| loop_statistics(statistics, now)),
        "models": models(dashboard),
        "hull": hull,
        "along": dashboard.models.outline.along,
        "along_names": [dashboard.models.outline.name(0), dashboard.models.outline.name(1)],
        "alarms": events(dashboard, now, true).take(ALARMS).collect::<Vec<_>>(),
        "events": events(dashboard, now, false).take(EVENTS).collect::<Vec<_>>(),
        "samples": samples.map(|sample| sample_row(sample, origin)).collect::<Vec<_>>(),
        "next_sample": next_sample,
        "frames": frames.map(|frame| frame_row(frame, origin)).collect::<Vec<_>>(),
        "next_frame": next_frame,
    })
}

/// Why the robot does not move as asked.
fn reason(reason: &ReasonMsg, now: Nanos) -> Value {
    json!({
        "text": reason.text(),
        "advice": reason.advice(),
        "age_ms": milliseconds(reason.age(now)),
    })
}

/// What keeps the robot from moving now.
fn why(state: &OperatingStateMsg) -> Value {
    let causes = state.causes().into_iter();
    causes
        .map(|cause| json!({ "text": Reason::from(cause).text(), "advice": cause.advice() }))
        .collect()
}

/// Base, joints and tip of the snake, mm, for every stream with fresh angles.
fn snake(view: &LatestMessages, now: Nanos) -> Value {
    let shape = |pair: [f64; 2]| {
        let [pitch, yaw] = pair.map(f64::to_radians);
        shape_mm(pitch, yaw).map(|at| at.map(short))
    };
    let joints = |joint: Option<&JointState>| angles(joint.filter(|it| it.age(now) <= STALE));
    let is_seen = view.camera.is_some_and(|camera| camera.age(now) <= CAMERA_STALE);
    json!({
        "estimate": joints(view.measured.as_ref()).map(shape),
        "goal": joints(view.goal.as_ref()).map(shape),
        "camera": view.camera_angles().filter(|_| is_seen).map(shape),
    })
}

fn operating(dashboard: &Dashboard, state: &OperatingStateMsg, now: Nanos) -> Value {
    let view = &dashboard.view;
    let has = |flag: u32| state.flags & flag != 0;
    let last = Refusal::from_number(state.last_refusal).filter(|reason| *reason != Refusal::None);
    json!({
        "name": state_name(state),
        "fault": view.fault().map(|fault| fault.text()),
        "for_s": state.stamp().since(Nanos(state.since_ns)).as_seconds().round(),
        "homed": has(OperatingStateMsg::HOMED),
        "busy": has(OperatingStateMsg::BUSY),
        "holding": has(OperatingStateMsg::HOLDING),
        "clipped": has(OperatingStateMsg::CLIPPED),
        "at_fixture": has(OperatingStateMsg::FIXTURE),
        "model": has(OperatingStateMsg::MODEL),
        "memory_known": has(OperatingStateMsg::MEMORY_KNOWN),
        "watched": has(OperatingStateMsg::WATCHED),
        "compared": has(OperatingStateMsg::COMPARED),
        "commander": dashboard.commander,
        "lease": (state.lease_client_id != 0).then(|| format!("{:016x}", state.lease_client_id)),
        "accepted": state.accepted,
        "refused": state.refused,
        "last_refusal": last.map(Refusal::text),
        "stale_stops": state.stale_stops,
        "age_ms": milliseconds(state.age(now)),
        "stale": state.age(now) > STALE,
    })
}

fn joint_state(joint: &JointState, now: Nanos) -> Value {
    let deviation = [joint.deviation[0], joint.deviation[1]].map(|d| short(d.to_degrees()));
    json!({
        "deg": angles(Some(joint)).map(|pair| pair.map(short)),
        "deviation_deg": angles(Some(joint)).map(|_| deviation),
        "memory_known": joint.flags & JointState::MEMORY_KNOWN != 0,
        "is_position": joint.count == 3,
        "age_ms": milliseconds(joint.age(now)),
        "stale": joint.age(now) > STALE,
    })
}

fn seen(view: &LatestMessages, camera: &ExternalPosition, now: Nanos) -> Value {
    json!({
        "deg": view.camera_angles().map(|pair| pair.map(short)),
        "age_ms": milliseconds(camera.age(now)),
        "stale": camera.age(now) > CAMERA_STALE,
    })
}

fn actuators(view: &LatestMessages, motors: &ActuatorState, now: Nanos) -> Value {
    let motor = |motor: usize| {
        let value = |values: &[i32; 2]| values.get(motor).copied().unwrap_or_default();
        let word =
            |values: &[u16; 2]| format!("0x{:04X}", values.get(motor).copied().unwrap_or_default());
        let read = motors
            .measured_stamp_ns
            .get(motor)
            .map(|stamp| Nanos(*stamp))
            .filter(|stamp| *stamp != Nanos::ZERO);
        let phase = motors.phase.get(motor).copied().map_or("unknown", phase_text);
        let error = motors.error_code.get(motor).filter(|code| **code != 0);
        let rate = view.exchange_rates.and_then(|rates| rates.get(motor).copied());
        json!({
            "setpoint_counts": value(&motors.setpoint_counts),
            "measured_counts": value(&motors.measured_counts),
            "current_ma": value(&motors.current_ma),
            "phase": phase,
            "bad": matches!(phase, "lost" | "at fault" | "unknown"),
            "status": word(&motors.statusword),
            "error": error.map(|_| word(&motors.error_code)),
            "exchanges_per_s": rate.map(|rate| rate.round()),
            "age_ms": read.map(|read| milliseconds(now.since(read))),
            "stale": read.is_none_or(|read| now.since(read) > STALE) || motors.age(now) > STALE,
        })
    };
    (0..count(motors.count)).map(motor).collect()
}

fn loop_statistics(statistics: &PeriodStatistics, now: Nanos) -> Value {
    let us = |nanos: u64| (nanos as f64 / 100.0).round() / 10.0;
    let spans = |span: &SpanSummary| {
        let [p50, p99, max] = [span.p50_ns, span.p99_ns, span.max_ns].map(us);
        json!({ "p50_us": p50, "p99_us": p99, "max_us": max })
    };
    let window = Nanos(statistics.window_ns).as_seconds();
    json!({
        "hz": if window > 0.0 { (statistics.ticks as f64 / window).round() } else { 0.0 },
        "late": spans(&statistics.lateness),
        "compute": spans(&statistics.compute),
        "missed": statistics.total_missed,
        "missed_in_window": statistics.missed,
        "ticks": statistics.total_ticks,
        "granted": granted(statistics),
        "real_time": statistics.priority > 0,
        "age_ms": milliseconds(statistics.age(now)),
        "stale": statistics.age(now) > STATISTICS_STALE,
    })
}

fn models(dashboard: &Dashboard) -> Value {
    let models = &dashboard.models;
    let named = |named: Option<LoadedModel>| {
        named.map(|named| {
            json!({
                "name": named.name,
                "file": named.file,
                "memory_known": named.memory_known,
            })
        })
    };
    json!({
        "known": models.slots.is_some(),
        "used": named(models.used()),
        "staged": named(models.staged()),
        "previous": named(models.previous()),
        "problem": models.problem,
        "hull_problem": models.hull_problem,
    })
}

/// Faults, or everything else, the newest first.
fn events(dashboard: &Dashboard, now: Nanos, is_alarm: bool) -> impl Iterator<Item = Value> {
    let severity = |severity| match severity {
        Severity::Info => "info",
        Severity::Warning => "warning",
        Severity::Alarm => "alarm",
    };
    let event = move |event: &crate::event_log::Event| {
        json!({
            "age_ms": milliseconds(now.since(event.stamp)),
            "severity": severity(event.severity),
            "text": event.text,
            "advice": event.advice,
            "count": event.count,
        })
    };
    dashboard
        .event_log
        .newest()
        .filter(move |event| (event.severity == Severity::Alarm) == is_alarm)
        .map(event)
}

/// Time, then pairs: goal, set-point, estimate, standard deviation, set-point counts, counts,
/// currents. `null`: a gap.
fn sample_row(sample: &Sample, origin: Nanos) -> Value {
    let pair = |pair: Pair| pair.map_or([None, None], |pair| pair.map(|value| Some(short(value))));
    let Sample { goal, setpoint, estimate, deviation, setpoint_counts, counts, current, .. } =
        *sample;
    let pairs = [goal, setpoint, estimate, deviation, setpoint_counts, counts, current];
    let values = pairs.into_iter().flat_map(pair);
    std::iter::once(Some(seconds(sample.stamp, origin))).chain(values).collect::<Vec<_>>().into()
}

/// Time, pitch, yaw, counts of both motors.
fn frame_row(frame: &CameraFrame, origin: Nanos) -> Value {
    let [pitch, yaw] = frame.angles.map(|value| Some(short(value)));
    let [first, second] =
        frame.counts.map_or([None, None], |counts| counts.map(|value| Some(short(value))));
    vec![Some(seconds(frame.stamp, origin)), pitch, yaw, first, second].into()
}

/// Three digits are a thousandth of a degree: more is noise, and bytes.
fn short(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0
}

/// Seconds since the monitor started; a frame may be from before.
fn seconds(instant: Nanos, origin: Nanos) -> f64 {
    short(instant.as_seconds() - origin.as_seconds())
}

fn milliseconds(span: Nanos) -> u64 {
    span.0 / 1_000_000
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::OperatingState;

    use super::*;

    const NOW: Nanos = Nanos(100_000_000_000);

    fn dashboard() -> Dashboard {
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
        let view = LatestMessages {
            state: Some(state),
            measured: Some(joint),
            goal: Some(JointState { flags: 0, ..joint }),
            ..LatestMessages::default()
        };
        let mut dashboard = Dashboard { view, ..Dashboard::default() };
        dashboard.history.sample(&dashboard.view, NOW);
        dashboard
    }

    #[test]
    fn angles_are_degrees_and_ages_are_included() {
        let value = snapshot(&dashboard(), "test", 7, Nanos::ZERO, &Since::default(), NOW);
        assert_eq!(value["estimate"]["deg"], json!([5.73, -11.459]));
        assert_eq!(
            (&value["estimate"]["age_ms"], &value["estimate"]["stale"]),
            (&json!(2), &json!(false))
        );
        assert_eq!(
            (&value["state"]["stale"], &value["state"]["fault"]),
            (&json!(true), &json!("a drive does not answer"))
        );
        assert_eq!(
            (&value["goal"]["deg"], &value["camera"], &value["motors"]),
            (&Value::Null, &Value::Null, &Value::Null)
        );
    }

    #[test]
    fn a_row_holds_the_data_and_null_for_gaps() {
        let value = snapshot(&dashboard(), "test", 7, NOW, &Since::default(), NOW);
        let row = value["samples"][0].as_array().unwrap();
        assert_eq!(row.len(), 15);
        assert_eq!(
            (&row[0], &row[1], &row[5], &row[11]),
            (&json!(0.0), &Value::Null, &json!(5.73), &Value::Null)
        );
        let nothing =
            snapshot(&dashboard(), "test", 7, NOW, &Since { sample: 1, ..Since::default() }, NOW);
        assert_eq!(nothing["samples"], json!([]));
    }
}
