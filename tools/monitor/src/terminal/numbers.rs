//! The numbers, in 40 columns.

use i2ris::ipc::Message;
use i2ris::ipc::drive_phase::phase_text;
use i2ris::ipc::payload::{ActuatorState, JointState, PeriodStatistics, SpanSummary};
use i2ris::units::Nanos;
use ratatui::style::Style;
use ratatui::text::{Line, Span};

use super::style::{CAMERA, ESTIMATE, GOAL, SETPOINT, alarm, faint, flow, warning};
use crate::adaptation;
use crate::dashboard::Dashboard;
use crate::latest_messages::{
    CAMERA_STALE, STALE, STATISTICS_STALE, angles, count, granted, health_text, microseconds,
};
use crate::model_poller::LoadedModel;

/// The width that the tables need; more is left free.
pub const WIDTH: usize = 40;

/// Everything that is a number.
pub fn lines(dashboard: &Dashboard, width: usize, now: Nanos) -> Vec<Line<'static>> {
    let mut lines = joints(dashboard, width, now);
    lines.push(Line::default());
    lines.extend(motors(dashboard, width, now));
    lines.push(Line::default());
    lines.extend(statistics(dashboard, width, now));
    lines.push(Line::default());
    lines.extend(models(dashboard, width));
    lines
}

fn joints(dashboard: &Dashboard, width: usize, now: Nanos) -> Vec<Line<'static>> {
    let view = &dashboard.view;
    let head = [("deg   ", faint()), ("   goal", GOAL.into()), (" set-pt", SETPOINT.into())];
    let tail =
        [("  estim", ESTIMATE.into()), ("    sd", ESTIMATE.into()), ("    cam", CAMERA.into())];
    let header = head
        .into_iter()
        .chain(tail)
        .map(|(text, style): (&str, Style)| Span::styled(text.to_owned(), style));
    let mut lines = vec![header.collect()];
    let deviation =
        view.measured.filter(|joint| angles(Some(joint)).is_some()).map(|joint| joint.deviation);
    let columns = [
        (angles(view.goal.as_ref()), old(view.goal.as_ref(), now)),
        (angles(view.setpoint.as_ref()), old(view.setpoint.as_ref(), now)),
        (angles(view.measured.as_ref()), old(view.measured.as_ref(), now)),
    ];
    let camera_old = view.camera.is_some_and(|camera| camera.age(now) > CAMERA_STALE);
    for (axis, name) in ["pitch ", "yaw   "].into_iter().enumerate() {
        let cell = |(value, old): &(Option<[f64; 2]>, bool)| {
            let text = value.and_then(|value| value.get(axis).copied());
            styled(
                text.map_or_else(|| format!("{:>7}", "-"), |value| format!("{value:>+7.2}")),
                *old,
            )
        };
        let deviation = deviation.and_then(|value| value.get(axis).copied());
        let deviation =
            deviation.map_or_else(|| "-".to_owned(), |value| format!("{:.2}", value.to_degrees()));
        let mut line = Line::from(Span::styled(name, faint()));
        line.extend(columns.iter().map(cell));
        line.push_span(styled(format!("{deviation:>6}"), columns[2].1));
        line.push_span(cell(&(view.camera_angles(), camera_old)));
        lines.push(line);
    }
    lines.extend(flow(
        joint_marks(dashboard, now).into_iter().map(|text| Span::styled(text, alarm())),
        width,
    ));
    lines
}

fn joint_marks(dashboard: &Dashboard, now: Nanos) -> Vec<String> {
    let view = &dashboard.view;
    let joint = |name: &str, joint: Option<&JointState>| match joint {
        None => Some(format!("{name} NOT RECEIVED YET")),
        Some(joint) => mark(name, joint.age(now), STALE),
    };
    let camera = view.camera.and_then(|camera| match view.camera_angles() {
        Some(_) => mark("camera", camera.age(now), CAMERA_STALE),
        None => Some("CAMERA SEES NOTHING".to_owned()),
    });
    let streams =
        [("goal", &view.goal), ("set-point", &view.setpoint), ("estimate", &view.measured)];
    streams
        .into_iter()
        .filter_map(|(name, message)| joint(name, message.as_ref()))
        .chain(camera)
        .collect()
}

fn motors(dashboard: &Dashboard, width: usize, now: Nanos) -> Vec<Line<'static>> {
    let Some(motors) = &dashboard.view.actuators else {
        return vec![Line::from(Span::styled("motors NOT RECEIVED YET", alarm()))];
    };
    let mut lines = vec![Line::from(Span::styled("motor set-pt  encoder   mA drive", faint()))];
    for motor in 0..count(motors.count) {
        lines.extend(motor_lines(dashboard, motors, motor, width, now));
    }
    lines
}

fn motor_lines(
    dashboard: &Dashboard,
    motors: &ActuatorState,
    motor: usize,
    width: usize,
    now: Nanos,
) -> Vec<Line<'static>> {
    let value = |values: &[i32; 2]| values.get(motor).copied().unwrap_or_default();
    let read = Nanos(motors.measured_stamp_ns.get(motor).copied().unwrap_or_default());
    let old = motors.age(now) > STALE || now.since(read) > STALE;
    let phase = motors.phase.get(motor).copied().map_or("unknown", phase_text);
    let numbers = format!(
        "{:>8} {:>8} {:>4}",
        value(&motors.setpoint_counts),
        value(&motors.measured_counts),
        value(&motors.current_ma)
    );
    let bad = matches!(phase, "lost" | "at fault" | "unknown");
    let phase = Span::styled(format!(" {phase}"), if bad { alarm() } else { Style::new() });
    let mut lines = vec![Line::from(vec![
        Span::styled(format!("  {motor} "), faint()),
        styled(numbers, old),
        phase,
    ])];
    let rate = dashboard.view.exchange_rates.and_then(|rates| rates.get(motor).copied());
    let rate =
        rate.map_or_else(|| "bus not counted yet".to_owned(), |rate| format!("bus {rate:.0}/s"));
    let word =
        format!("status 0x{:04X}", motors.statusword.get(motor).copied().unwrap_or_default());
    let mut items = vec![Span::styled(rate, faint()), Span::styled(word, faint())];
    if let Some(code) = motors.error_code.get(motor).copied().filter(|code| *code != 0) {
        items.push(Span::styled(format!("error 0x{code:04X}"), alarm()));
    }
    let age = if read == Nanos::ZERO {
        Some("NEVER READ".to_owned())
    } else {
        mark("encoder", now.since(read), STALE)
    };
    items.extend(age.map(|age| Span::styled(age, alarm())));
    lines.extend(flow(items, width));
    lines
}

fn statistics(dashboard: &Dashboard, width: usize, now: Nanos) -> Vec<Line<'static>> {
    let Some(statistics) = &dashboard.view.statistics else {
        return vec![Line::from(Span::styled("loop NOT RECEIVED YET", alarm()))];
    };
    let old = statistics.age(now) > STATISTICS_STALE;
    let text = |text: String| Line::from(styled(text, old));
    let missed = format!("missed {}", statistics.total_missed);
    let missed = Span::styled(missed, if statistics.missed > 0 { warning() } else { Style::new() });
    let mut lines =
        vec![Line::from(vec![styled(format!("loop {:.0} Hz, ", hertz(statistics)), old), missed])];
    lines.push(text(format!("late    {}", spans(&statistics.lateness))));
    lines.push(text(format!("compute {}", spans(&statistics.compute))));
    lines.extend(flow(
        granted(statistics).split(", ").map(|part| styled(part.to_owned(), old)),
        width,
    ));
    lines.extend(dashboard.view.health.iter().flat_map(|health| {
        let text = health_text(health);
        flow(text.split(", ").map(|part| styled(part.to_owned(), old)), width)
    }));
    lines.extend(dashboard.view.adaptation.iter().flat_map(|message| {
        let texts = adaptation::lines(message);
        let parts = texts.iter().flat_map(|text| text.split(", "));
        let parts: Vec<_> = parts.map(|part| styled(part.to_owned(), old)).collect();
        flow(parts, width)
    }));
    lines.extend(
        mark("loop", statistics.age(now), STATISTICS_STALE)
            .map(|text| Line::from(Span::styled(text, alarm()))),
    );
    lines
}

fn models(dashboard: &Dashboard, width: usize) -> Vec<Line<'static>> {
    let models = &dashboard.models;
    let name = |named: Option<LoadedModel>| {
        let memory = |named: &LoadedModel| {
            if named.memory_known { "" } else { ", memory unknown" }
        };
        named.map_or_else(|| "none".to_owned(), |named| format!("{}{}", named.name, memory(&named)))
    };
    let mut lines = Vec::new();
    if models.slots.is_some() {
        for (title, named) in [
            ("in use", models.used()),
            ("staged", models.staged()),
            ("previous", models.previous()),
        ] {
            lines.extend(flow([Span::raw(format!("{title} {}", name(named)))], width));
        }
    }
    let problems = models.problem.iter().chain(&models.hull_problem);
    lines.extend(problems.flat_map(|text| flow([Span::styled(text.clone(), warning())], width)));
    lines
}

/// Ticks per second in the last window.
fn hertz(statistics: &PeriodStatistics) -> f64 {
    match statistics.window_ns {
        0 => 0.0,
        window => statistics.ticks as f64 / Nanos(window).as_seconds(),
    }
}

fn spans(span: &SpanSummary) -> String {
    let [p50, p99, max] = [span.p50_ns, span.p99_ns, span.max_ns].map(microseconds);
    format!("p50 {p50} p99 {p99} max {max} us")
}

fn old<T: Message>(message: Option<&T>, now: Nanos) -> bool {
    message.is_some_and(|message| message.age(now) > STALE)
}

fn styled(text: String, old: bool) -> Span<'static> {
    Span::styled(text, if old { faint() } else { Style::new() })
}

fn mark(name: &str, age: Nanos, limit: Nanos) -> Option<String> {
    (age > limit).then(|| format!("{name} STALE {:.1} s", age.as_seconds()))
}
