//! The figures of the page.

use hdrhistogram::Histogram;
use i2ris::ipc::payload::{AdaptationMsg, PeriodStatistics};
use i2ris_report::{Axis, Color, Dash, Figure, Mark, Marker, Panel, Stroke};

use super::TrialReport;
use super::hysteresis::HysteresisLoop;
use super::latency::logarithmic_bins;
use super::tracking::{TimedError, tracking_errors};
use super::trial::Trial;

const GOAL: Stroke = Stroke::new(Color::BLACK, 1.6);
const ESTIMATE: Stroke = Stroke::new(Color::BLUE, 1.1).dash(Dash::Dashed);
const CAMERA: Stroke = Stroke::new(Color::VERMILION, 1.0);
const ZERO: Stroke = Stroke::new(Color::PALE, 0.8);
const TROUBLE: Stroke = Stroke::new(Color::VERMILION, 1.4).dash(Dash::Dotted);
const BUDGET: Stroke = Stroke::new(Color::VERMILION, 1.0);
const DRIFT: [Stroke; 4] = [
    Stroke::new(Color::BLUE, 1.3),
    Stroke::new(Color::VERMILION, 1.3),
    Stroke::new(Color::GREEN, 1.1),
    Stroke::new(Color::ORANGE, 1.1),
];

const ROW_HEIGHT: f64 = 190.0;

/// Samples further apart than this are not connected, seconds.
const LINE_GAP_S: f64 = 0.25;

fn time_axis(trial: &Trial) -> Axis {
    Axis::linear("time (s)").range(0.0, trial.length_s().max(1e-3))
}

fn trouble_lines(report: &TrialReport) -> impl Iterator<Item = Mark> {
    report.troubles().map(|event| Mark::vertical(event.t_s, TROUBLE))
}

pub fn angles(report: &TrialReport) -> Figure {
    let trial = &report.trial;
    let mut figure = Figure::new(
        "angles",
        "Goal, estimate and camera over time",
        "Pitch and yaw over time: goal, the model's estimate, angles by the camera; below, the \
         error of each.",
    );
    let observed = [("estimate", ESTIMATE, &trial.measured), ("camera", CAMERA, &trial.camera)];
    let observed = observed.into_iter().filter(|(.., series)| !series.is_empty());
    for (axis, name) in ["pitch", "yaw"].into_iter().enumerate() {
        let lines = observed.clone().chain([("goal", GOAL, &trial.goal)]);
        let lines = lines.map(|(label, stroke, series)| {
            let points = series.iter().map(|(stamp, value)| (trial.seconds(*stamp), *value));
            Mark::line(with_gaps(points, axis), stroke).label(label)
        });
        let panel = over_time(report, name, &format!("{name} (deg)")).with_all(lines);
        figure = figure.row(ROW_HEIGHT, vec![panel]);
    }
    for (axis, name) in ["pitch", "yaw"].into_iter().enumerate() {
        let lines = observed.clone().map(|(_, stroke, series)| {
            Mark::line(with_gaps(tracking_errors(trial, series), axis), stroke)
        });
        let panel = over_time(report, &format!("error in {name}"), "observed − goal (deg)")
            .with(Mark::horizontal(0.0, ZERO))
            .with_all(lines);
        figure = figure.row(0.8 * ROW_HEIGHT, vec![panel]);
    }
    figure
}

/// An empty panel with shaded intervals without following and a line for every trouble.
fn over_time(report: &TrialReport, title: &str, y: &str) -> Panel {
    let shaded = report.trial.intervals_without_following().into_iter().map(|[from, to]| {
        Mark::interval(from, to, Color::FAINT).label("not following (off, holding, busy)")
    });
    Panel::new(title, time_axis(&report.trial), Axis::linear(y))
        .with_all(shaded)
        .with_all(trouble_lines(report))
}

fn with_gaps(points: impl IntoIterator<Item = TimedError>, axis: usize) -> Vec<[f64; 2]> {
    let (mut line, mut before) = (Vec::new(), f64::NEG_INFINITY);
    for (t, values) in points {
        if t - before > LINE_GAP_S {
            line.push([t, f64::NAN]);
        }
        line.push([t, values[axis]]);
        before = t;
    }
    line
}

pub fn loops(loops: &[HysteresisLoop]) -> Figure {
    let panels = |is_distance| loops.iter().map(|found| loop_panel(found, is_distance)).collect();
    Figure::new(
        "loops",
        "Counts against angle",
        "For pitch and yaw: angle over the counts along the direction in which it changes most, \
         with rising and with falling counts; below, the distance from the best plane.",
    )
    .row(250.0, panels(false))
    .row(220.0, panels(true))
}

fn loop_panel(found: &HysteresisLoop, is_distance: bool) -> Panel {
    let output = found.output;
    let (title, y, column) = match is_distance {
        true => (format!("{output}, from the plane"), "deg".to_owned(), 2),
        false => (output.to_owned(), format!("{output} (deg)"), 1),
    };
    let points = |rows: &[[f64; 3]]| rows.iter().map(|row| [row[0], row[column]]).collect();
    Panel::new(title, Axis::linear("counts along the direction"), Axis::linear(y))
        .with(Mark::dots(points(&found.rising), Color::BLUE, 1.6).label("counts rising"))
        .with(Mark::dots(points(&found.falling), Color::ORANGE, 1.6).label("counts falling"))
        .with(Mark::horizontal(0.0, ZERO))
}

/// Time from a command to the line and age of encoder positions; below, lateness and computing time
/// of the control loop over time.
pub fn latencies(report: &TrialReport) -> Figure {
    let trial = &report.trial;
    let histogram = |name, histogram: &Histogram<u64>, color| {
        let (edges, shares) = logarithmic_bins(histogram);
        let line = Mark::steps(&edges, &shares, Stroke::new(color, 1.4));
        let share = Axis::linear("share (%)").including(0.0);
        let panel = Panel::new(name, Axis::log("time (ms)"), share).with(line);
        (!histogram.is_empty()).then_some(panel)
    };
    let to_line = histogram("command to line", &trial.latencies.to_line, Color::BLUE);
    let age = histogram("age of encoder positions", &trial.latencies.age, Color::GREEN);
    let figure = Figure::new(
        "latencies",
        "Latencies",
        "Histograms of the time from a command to the line and of the age of encoder positions; \
         below, lateness and computing time of the control loop over time.",
    );
    let figure = figure.row(210.0, to_line.into_iter().chain(age).collect());
    let timing = (!trial.windows.is_empty()).then(|| loop_timing(report));
    figure.row(230.0, Vec::from_iter(timing))
}

fn loop_timing(report: &TrialReport) -> Panel {
    let trial = &report.trial;
    let line = |label, pick: fn(&PeriodStatistics) -> u64, color, dash| {
        // A logarithmic axis has no 0.
        let us = |window: &PeriodStatistics| (pick(window) as f64 * 1e-3).max(0.01);
        let windows = trial.windows.iter();
        let points = windows.map(|window| [trial.seconds(window.stamp_ns), us(window)]).collect();
        Mark::line(points, Stroke::new(color, 1.4).dash(dash)).label(label)
    };
    let late = [
        line("late, p50", |w| w.lateness.p50_ns, Color::BLUE, Dash::Solid),
        line("late, p99", |w| w.lateness.p99_ns, Color::BLUE, Dash::Dashed),
        line("late, max", |w| w.lateness.max_ns, Color::BLUE, Dash::Dotted),
    ];
    let compute = [
        line("computes, p50", |w| w.compute.p50_ns, Color::GREEN, Dash::Solid),
        line("computes, p99", |w| w.compute.p99_ns, Color::GREEN, Dash::Dashed),
    ];
    Panel::new("control loop, second by second", time_axis(trial), Axis::log("time (µs)"))
        .with_all(trouble_lines(report))
        .with_all(late)
        .with_all(compute.map(|line| line.marker(Marker::Square)))
}

/// A curve: its name, the index of its parameter, and the factor to its unit.
type Curve = (&'static str, usize, f64);

const DEG: f64 = 180.0 / std::f64::consts::PI;
/// Index of the latency, which is estimated but not applied.
const LATENCY: usize = 8;

const GROUPS: [(&str, &str, &[Curve]); 5] = [
    ("zero", "applied shift (deg)", &[("pitch", 0, DEG), ("yaw", 1, DEG)]),
    (
        "gain",
        "applied change (%)",
        &[
            ("pitch", 2, 100.0),
            ("yaw", 5, 100.0),
            ("pitch by yaw", 3, 100.0),
            ("yaw by pitch", 4, 100.0),
        ],
    ),
    ("gap", "applied growth (%)", &[("motor 0", 6, 100.0), ("motor 1", 7, 100.0)]),
    (
        "slack and play, of half the range",
        "applied growth (%)",
        &[
            ("slack, motor 0", 10, 100.0),
            ("slack, motor 1", 11, 100.0),
            ("play, motor 0", 12, 100.0),
            ("play, motor 1", 13, 100.0),
        ],
    ),
    ("latency of the camera", "estimate (ms)", &[("beyond its stamps", LATENCY, 1000.0)]),
];

pub fn adaptation(trial: &Trial) -> Figure {
    const HEIGHT: f64 = 170.0;
    let line = |stroke, value: &dyn Fn(&AdaptationMsg) -> f64| {
        let points = trial.adaptation.iter();
        let points = points.map(|message| [trial.seconds(message.stamp_ns), value(message)]);
        Mark::line(points.collect(), stroke)
    };
    let mut figure = Figure::new(
        "adaptation",
        "Drift over time",
        "The applied correction of the drift that the camera showed, by parameter, and below the \
         share of the budget.",
    );
    for (name, unit, curves) in GROUPS {
        let lines = curves.iter().zip(DRIFT).map(|((label, index, factor), stroke)| {
            let value = |message: &AdaptationMsg| match *index {
                LATENCY => factor * message.estimate[LATENCY],
                index => factor * message.applied[index],
            };
            line(stroke, &value).label(*label)
        });
        let panel = Panel::new(name, time_axis(trial), Axis::linear(unit))
            .with(Mark::horizontal(0.0, ZERO))
            .with_all(lines);
        figure = figure.row(HEIGHT, vec![panel]);
    }
    let used = |message: &AdaptationMsg| {
        let parameters = message.budget_used.iter().copied();
        100.0 * parameters.fold(message.total_used, f64::max)
    };
    let share = Axis::linear("largest share used (%)").range(0.0, 110.0);
    let budget = Panel::new("budget", time_axis(trial), share)
        .with(Mark::horizontal(70.0, ZERO))
        .with(Mark::horizontal(100.0, BUDGET))
        .with(line(DRIFT[0], &used));
    figure.row(HEIGHT, vec![budget])
}
