//! The numbers, in 40 columns.

use i2ris_report::view::{Age, LoadedModel, Motor, Pose, Span as TimeSpan, View};
use ratatui::style::Style;
use ratatui::text::{Line, Span};

use super::style::{CAMERA, ESTIMATE, GOAL, SETPOINT, alarm, faint, flow, warning};

/// The width that the tables need; more is left free.
pub const WIDTH: usize = 40;

/// Everything that is a number.
pub fn lines(view: &View, width: usize) -> Vec<Line<'static>> {
    let mut lines = joints(view, width);
    lines.push(Line::default());
    match &view.motors {
        None => lines.push(Line::from(Span::styled("motors NOT RECEIVED YET", alarm()))),
        Some(motors) => {
            lines.push(Line::from(Span::styled("motor setpt.  encoder   mA drive", faint())));
            let motors = motors.iter().enumerate();
            lines.extend(motors.flat_map(|(index, motor)| motor_lines(index, motor, width)));
        }
    }
    lines.push(Line::default());
    lines.extend(statistics(view, width));
    lines.push(Line::default());
    lines.extend(models(view, width));
    lines
}

fn joints(view: &View, width: usize) -> Vec<Line<'static>> {
    let header: [(&str, Style); 6] = [
        ("deg   ", faint()),
        ("   goal", GOAL.into()),
        (" setpt.", SETPOINT.into()),
        ("  estim", ESTIMATE.into()),
        ("    sd", ESTIMATE.into()),
        ("    cam", CAMERA.into()),
    ];
    let mut lines =
        vec![Line::from(header.map(|(text, style)| Span::styled(text, style)).to_vec())];
    for (axis, name) in ["pitch ", "yaw   "].into_iter().enumerate() {
        let cell = |pose: Option<Pose>| {
            let deg = pose.and_then(|pose| pose.deg);
            let text =
                deg.map_or_else(|| format!("{:>7}", "-"), |deg| format!("{:>+7.2}", deg[axis]));
            styled(text, pose.is_some_and(|pose| pose.age.stale))
        };
        let deviation = view.estimate.and_then(|it| it.deviation_deg);
        let deviation = deviation.map_or_else(|| "-".to_owned(), |deg| format!("{:.2}", deg[axis]));
        let is_old = view.estimate.is_some_and(|it| it.age.stale);
        lines.push(Line::from(vec![
            Span::styled(name, faint()),
            cell(view.goal),
            cell(view.setpoint),
            cell(view.estimate),
            styled(format!("{deviation:>6}"), is_old),
            cell(view.camera),
        ]));
    }
    let streams =
        [("goal", &view.goal), ("setpoint", &view.setpoint), ("estimate", &view.estimate)];
    let marks = streams.into_iter().filter_map(|(name, pose)| match pose {
        None => Some(format!("{name} NOT RECEIVED YET")),
        Some(pose) => mark(name, &pose.age),
    });
    let camera = view.camera.and_then(|camera| match camera.deg {
        Some(_) => mark("camera", &camera.age),
        None => Some("CAMERA SEES NOTHING".to_owned()),
    });
    lines.extend(flow(marks.chain(camera).map(|text| Span::styled(text, alarm())), width));
    lines
}

fn motor_lines(index: usize, motor: &Motor, width: usize) -> Vec<Line<'static>> {
    let Motor { setpoint_counts, measured_counts, current_ma, phase, .. } = motor;
    let numbers = format!("{setpoint_counts:>8} {measured_counts:>8} {current_ma:>4}");
    let rate = motor
        .exchanges_per_s
        .map_or_else(|| "bus not counted yet".to_owned(), |rate| format!("bus {rate:.0}/s"));
    let mut lines = vec![Line::from(vec![
        Span::styled(format!("  {index} "), faint()),
        styled(numbers, motor.age.stale),
        Span::styled(format!(" {phase}"), if motor.bad { alarm() } else { Style::new() }),
    ])];
    let mut items = vec![
        Span::styled(rate, faint()),
        Span::styled(format!("status {}", motor.status), faint()),
    ];
    items.extend(motor.error.iter().map(|code| Span::styled(format!("error {code}"), alarm())));
    let age = match motor.age.age {
        None => motor.age.mark(),
        Some(_) => mark("encoder", &motor.age),
    };
    items.extend(age.map(|age| Span::styled(age, alarm())));
    lines.extend(flow(items, width));
    lines
}

fn statistics(view: &View, width: usize) -> Vec<Line<'static>> {
    let Some(statistics) = &view.control_loop else {
        return vec![Line::from(Span::styled("loop NOT RECEIVED YET", alarm()))];
    };
    let is_old = statistics.age.stale;
    let spans = |span: &TimeSpan| {
        let [p50, p99, max] = span.texts();
        format!("p50 {p50} p99 {p99} max {max} us")
    };
    let missed = format!("missed {}", statistics.missed);
    let is_missed = statistics.missed_in_window > 0;
    let mut lines = vec![
        Line::from(vec![
            styled(format!("loop {:.0} Hz, ", statistics.hz), is_old),
            Span::styled(missed, if is_missed { warning() } else { Style::new() }),
        ]),
        Line::from(styled(format!("late    {}", spans(&statistics.late)), is_old)),
        Line::from(styled(format!("compute {}", spans(&statistics.compute)), is_old)),
    ];
    let adaptation = view.adaptation.iter().flat_map(|it| it.lines()).collect::<Vec<_>>();
    let loop_texts = [statistics.granted.clone(), format!("line {}", statistics.line)];
    for texts in [&loop_texts[..], view.health.as_slice(), &adaptation] {
        let parts = texts.iter().flat_map(|text| text.split(", "));
        lines.extend(flow(parts.map(|part| styled(part.to_owned(), is_old)), width));
    }
    let old = mark("loop", &statistics.age);
    lines.extend(old.map(|text| Line::from(Span::styled(text, alarm()))));
    lines
}

fn models(view: &View, width: usize) -> Vec<Line<'static>> {
    let models = &view.models;
    let name = |model: &Option<LoadedModel>| match model {
        None => "none".to_owned(),
        Some(model) if model.memory_known => model.name.clone(),
        Some(model) => format!("{}, memory unknown", model.name),
    };
    let slots =
        [("in use", &models.used), ("staged", &models.staged), ("previous", &models.previous)];
    let slots = slots.into_iter().filter(|_| models.known);
    let names = slots.map(|(title, model)| Span::raw(format!("{title} {}", name(model))));
    let problems = models.problem.iter().chain(&models.hull_problem);
    let problems = problems.map(|text| Span::styled(text.clone(), warning()));
    names.chain(problems).flat_map(|text| flow([text], width)).collect()
}

fn styled(text: String, old: bool) -> Span<'static> {
    Span::styled(text, if old { faint() } else { Style::new() })
}

fn mark(name: &str, age: &Age) -> Option<String> {
    age.mark().map(|mark| format!("{name} {mark}"))
}
