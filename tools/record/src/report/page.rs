//! The results of a trial as an HTML page.

use hdrhistogram::Histogram;
use i2ris::ipc::payload::PeriodStatistics;
use i2ris_plot::number::{fixed, milliseconds};
use i2ris_plot::page::TableRow;
use i2ris_plot::{
    Axis, Color, Dash, Figure, Line, Marker, Page, Panel, ReferenceLine, Scatter, ShadedInterval,
    Stroke, Table,
};
use i2ris_statistics::TimeSeries;

use super::adaptation;
use super::hysteresis::HysteresisLoop;
use super::latency::logarithmic_bins;
use super::percentiles::Percentiles;
use super::reaches::ARRIVED_DEG;
use super::summary::TrialSummary;
use super::targets;
use super::tracking::{TimedError, tracking_errors};
use super::trial::Trial;

const GOAL: Stroke = Stroke::new(Color::BLACK, 1.6);
const ESTIMATE: Stroke = Stroke::new(Color::BLUE, 1.1).dash(Dash::Dashed);
const CAMERA: Stroke = Stroke::new(Color::VERMILION, 1.0);
const ZERO: Stroke = Stroke::new(Color::PALE, 0.8);
const TROUBLE: Stroke = Stroke::new(Color::VERMILION, 1.4).dash(Dash::Dotted);

/// Height of a panel over time.
const ROW_HEIGHT: f64 = 190.0;

/// The most events in the table. Further ones are only counted.
const MOST_EVENTS: usize = 200;

/// The most reaches in the table.
const MOST_REACHES: usize = 100;

/// Samples further apart than this are not connected, seconds.
const LINE_GAP_S: f64 = 0.25;

/// The page of a trial.
pub fn page(trial: &Trial, summary: &TrialSummary) -> Page {
    let mut page = Page::new(format!("Trial {}", summary.file));
    page.main_result(main_result(summary));
    let notices = notices(trial, summary);
    if !notices.is_empty() {
        page.notice("Note", notices);
    }
    page.facts(facts(summary));
    write_tracking(&mut page, trial, summary);
    write_reaches(&mut page, summary);
    targets::write(&mut page, summary);
    write_hysteresis(&mut page, summary);
    adaptation::write(&mut page, trial);
    write_latencies(&mut page, trial, summary);
    write_events(&mut page, summary);
    write_streams(&mut page, summary);
    let version = env!("CARGO_PKG_VERSION");
    page.footer(format!("Written by i2ris {version} from the recording alone."));
    page
}

fn main_result(summary: &TrialSummary) -> String {
    let length = format!("{:.1} s", summary.length_s);
    match (&summary.camera, &summary.estimate) {
        (Some(camera), _) => format!(
            "{length}. While it followed commands, the robot was {:.2} deg from its goal by the \
             camera (root mean square of the two-dimensional error), at most {:.2} deg.",
            camera.length_rms_deg, camera.length.max
        ),
        (None, Some(estimate)) => format!(
            "{length}, no camera. While it followed commands, the model's estimate was {:.2} deg \
             from the goal (root mean square of the two-dimensional error). This recording does \
             not contain how far the robot itself was.",
            estimate.length_rms_deg
        ),
        (None, None) => format!("{length}. The robot followed no commands in angles."),
    }
}

fn notices(trial: &Trial, summary: &TrialSummary) -> Vec<String> {
    let mut notices = Vec::new();
    if let Some(reason) = &summary.cut_off {
        notices.push(format!("The recording is cut off ({reason})."));
    } else if summary.outcome.is_empty() {
        notices.push("The recorder did not end in order: the recording has no outcome.".to_owned());
    }
    let missing: u64 = summary.streams.iter().map(|stream| stream.missing).sum();
    if missing > 0 {
        notices.push(format!("{missing} message(s) of the controller are missing."));
    }
    if trial.is_tip {
        let tip =
            "The outputs are positions of the tip, not angles: this report does not draw them.";
        notices.push(tip.to_owned());
    }
    let troubles = summary.events.iter().filter(|event| event.is_trouble).count();
    if troubles > 0 {
        notices.push(format!("{troubles} unintended event(s); see the list."));
    }
    notices
}

fn facts(summary: &TrialSummary) -> Vec<(String, String)> {
    // The offset of the clocks is for programs.
    let is_shown = |(name, value): &(&String, &String)| !value.is_empty() && !name.ends_with("_ns");
    let about = summary.about.iter().filter(is_shown);
    let mut facts: Vec<(String, String)> =
        about.map(|(name, value)| (name.replace('_', " "), value.clone())).collect();
    let attached = summary.attached.iter().map(|(name, size)| format!("{name} ({size} bytes)"));
    let attached: Vec<String> = attached.collect();
    let attached = if attached.is_empty() { "nothing".to_owned() } else { attached.join(", ") };
    facts.push(("attached".to_owned(), attached));
    facts
}

fn write_tracking(page: &mut Page, trial: &Trial, summary: &TrialSummary) {
    page.section("Tracking");
    if trial.goal.is_empty() && trial.measured.is_empty() {
        page.paragraph("There are no angles: no model was in use.");
        return;
    }
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
            Line::new(with_gaps(&timed(trial, series), axis), stroke).label(label)
        });
        let panel = over_time(trial, summary, name, &format!("{name} (deg)")).with_all(lines);
        figure = figure.row(ROW_HEIGHT, vec![panel]);
    }
    for (axis, name) in ["pitch", "yaw"].into_iter().enumerate() {
        let lines = observed.clone().map(|(_, stroke, series)| {
            Line::new(with_gaps(&tracking_errors(trial, series), axis), stroke)
        });
        let panel = over_time(trial, summary, &format!("error in {name}"), "observed − goal (deg)")
            .with(ReferenceLine::horizontal(0.0, ZERO))
            .with_all(lines);
        figure = figure.row(0.8 * ROW_HEIGHT, vec![panel]);
    }
    page.figure(
        &figure,
        "Angles over time, and the error while commands were followed. The estimate is the \
         model's, from the encoders: it is only as right as the model.",
    );
    write_tracking_table(page, summary);
}

/// An empty panel over the time of the trial. It has shaded intervals without following and a line
/// for every unintended event.
fn over_time(trial: &Trial, summary: &TrialSummary, title: &str, y: &str) -> Panel {
    let shaded = trial.intervals_without_following().into_iter().map(|[from, to]| {
        let interval = ShadedInterval::new(from, to, Color::FAINT);
        interval.label("not following (off, holding, busy)")
    });
    Panel::new(title, time_axis(trial), Axis::linear(y))
        .with_all(shaded)
        .with_all(trouble_lines(summary))
}

fn time_axis(trial: &Trial) -> Axis {
    Axis::linear("time (s)").range(0.0, trial.length_s().max(1e-3))
}

fn trouble_lines(summary: &TrialSummary) -> impl Iterator<Item = ReferenceLine> {
    let troubles = summary.events.iter().filter(|event| event.is_trouble);
    troubles.map(|event| ReferenceLine::vertical(event.t_s, TROUBLE))
}

fn timed(trial: &Trial, series: &TimeSeries<2>) -> Vec<TimedError> {
    series.iter().map(|(stamp, value)| (trial.seconds(*stamp), *value)).collect()
}

fn with_gaps(points: &[TimedError], axis: usize) -> Vec<[f64; 2]> {
    let mut line = Vec::with_capacity(points.len());
    let mut before = f64::NEG_INFINITY;
    for (t, values) in points {
        if t - before > LINE_GAP_S {
            line.push([*t, f64::NAN]);
        }
        line.push([*t, values[axis]]);
        before = *t;
    }
    line
}

fn write_tracking_table(page: &mut Page, summary: &TrialSummary) {
    let header = "against/samples/pitch RMS/yaw RMS/length RMS/p50/p90/p99/max".split('/');
    let caption = "Error while commands were followed, degrees; length: of the two-dimensional \
                   error.";
    let mut table = Table::new(caption, header);
    let sources = [
        ("angles by the camera", &summary.camera, true),
        ("the model's estimate", &summary.estimate, false),
    ];
    for (name, tracking, strong) in sources {
        if let Some(tracking) = tracking {
            let Percentiles { p50, p90, p99, max } = tracking.length;
            let (pitch, yaw) = (tracking.pitch_rms_deg, tracking.yaw_rms_deg);
            let degrees = [pitch, yaw, tracking.length_rms_deg, p50, p90, p99, max];
            let cells = [name.to_owned(), tracking.samples.to_string()].into_iter();
            let cells = cells.chain(degrees.map(|value| fixed(value, 3)));
            table.row(TableRow::new(cells).strong(strong));
        }
    }
    page.table(&table);
}

fn write_reaches(page: &mut Page, summary: &TrialSummary) {
    let Some(score) = &summary.reaches else {
        return;
    };
    page.section("Reaches");
    let arrived = (score.arrived * score.reaches.len() as f64).round();
    let times = score
        .arrived_s
        .map(|[median, p95]| format!(" Time until then: median {median:.2} s, 95 % {p95:.2} s."));
    page.paragraph(format!(
        "{} point-to-point motions by the {}; in {arrived} of them the snake came within \
         {ARRIVED_DEG} deg of the end and stayed.{} Overshoot: median {:.2} deg, 95 % {:.2} deg.",
        score.reaches.len(),
        score.by,
        times.unwrap_or_default(),
        score.overshoot_deg[0],
        score.overshoot_deg[1]
    ));
    let header = "at (s)/from (deg)/to (deg)/goal moves (s)/arrived (s)/overshoot (deg)/detour";
    let mut table = Table::new(
        "Every reach; detour: path of the goal divided by the distance.",
        header.split('/'),
    );
    for reach in score.reaches.iter().take(MOST_REACHES) {
        let pose = |[pitch, yaw]: [f64; 2]| format!("{pitch:+.2} {yaw:+.2}");
        let arrived = reach.arrived_s.map(|time| fixed(time, 2));
        table.row(TableRow::new([
            fixed(reach.t_s, 2),
            pose(reach.from_deg),
            pose(reach.to_deg),
            fixed(reach.goal_s, 2),
            arrived.unwrap_or_else(|| "no".to_owned()),
            fixed(reach.overshoot_deg, 2),
            fixed(reach.detour, 2),
        ]));
    }
    page.table(&table);
}

fn write_hysteresis(page: &mut Page, summary: &TrialSummary) {
    let Some(first) = summary.hysteresis.first() else {
        return;
    };
    page.section("Hysteresis");
    let panels = |is_distance| {
        let loops = summary.hysteresis.iter();
        loops.map(|found| loop_panel(found, is_distance)).collect()
    };
    let figure = Figure::new(
        "loops",
        "Counts against angle",
        "For pitch and yaw: angle over the counts along the direction in which it changes most, \
         with rising and with falling counts; below, the distance from the best plane.",
    );
    let figure = figure.row(250.0, panels(false)).row(220.0, panels(true));
    let caption = format!(
        "Angle (by {}) against the counts along the direction in which it changes most. Below: its \
         distance from the plane through all counts, where the loop shows. Inner loops and the \
         other axis spread the samples.",
        first.from
    );
    page.figure(&figure, &caption);
    page.facts(summary.hysteresis.iter().map(|found| {
        let width = found.width_deg.map(|width| format!("{width:.2} deg"));
        let width = width.unwrap_or_else(|| "not known".to_owned());
        let slope = found.slope_deg_per_count;
        let name = format!("{}: width of the loop", found.output);
        (name, format!("{width}; {slope:.4} deg per count"))
    }));
}

fn loop_panel(found: &HysteresisLoop, is_distance: bool) -> Panel {
    let output = found.output;
    let (title, y, column) = if is_distance {
        (format!("{output}, from the plane"), "deg".to_owned(), 2)
    } else {
        (output.to_owned(), format!("{output} (deg)"), 1)
    };
    let points = |rows: &[[f64; 3]]| rows.iter().map(|row| [row[0], row[column]]).collect();
    Panel::new(title, Axis::linear("counts along the direction"), Axis::linear(y))
        .with(Scatter::new(points(&found.rising), Color::BLUE, 1.6).label("counts rising"))
        .with(Scatter::new(points(&found.falling), Color::ORANGE, 1.6).label("counts falling"))
        .with(ReferenceLine::horizontal(0.0, ZERO))
}

fn write_latencies(page: &mut Page, trial: &Trial, summary: &TrialSummary) {
    page.section("Latencies");
    let histogram = |name, histogram: &Histogram<u64>, color| {
        let (edges, shares) = logarithmic_bins(histogram);
        let line = Line::steps(&edges, &shares, Stroke::new(color, 1.4));
        let share = Axis::linear("share (%)").including(0.0);
        let panel = Panel::new(name, Axis::log("time (ms)"), share).with(line);
        (!histogram.is_empty()).then_some(panel)
    };
    let to_line = histogram("command to line", &trial.latencies.to_line, Color::BLUE);
    let age = histogram("age of encoder positions", &trial.latencies.age, Color::GREEN);
    let mut figure = Figure::new(
        "latencies",
        "Latencies",
        "Histograms of the time from a command to the line and of the age of encoder positions; \
         below, lateness and computing time of the control loop over time.",
    )
    .row(210.0, to_line.into_iter().chain(age).collect());
    if !trial.windows.is_empty() {
        figure = figure.row(230.0, vec![loop_timing_panel(trial, summary)]);
    }
    page.figure(
        &figure,
        "Histograms with bins of equal width on a logarithmic axis; the control loop by its own \
         statistics, a point per second. On a virtual or shared machine the machine itself causes \
         the maxima.",
    );
    let mut table = Table::new("Percentiles.", ["", "p50", "p90", "p99", "max"]);
    let timing = summary.control_loop.as_ref();
    let rows = [
        ("command published to its set-point on the line", summary.command_to_line_ms, 1.0),
        ("age of the encoder position in a tick", summary.reading_age_ms, 1.0),
        ("loop: lateness of a tick (typical second)", timing.map(|t| t.lateness_us), 1e-3),
        ("loop: computing time of a tick (typical second)", timing.map(|t| t.compute_us), 1e-3),
    ];
    for (name, percentiles, ms) in rows {
        if let Some(Percentiles { p50, p90, p99, max }) = percentiles {
            let numbers = [p50, p90, p99, max].map(|value| milliseconds(value * ms));
            table.row(TableRow::new([name.to_owned()].into_iter().chain(numbers)));
        }
    }
    page.table(&table);
    if let Some(timing) = timing {
        let scheduling = match timing.priority {
            0 => "normal scheduling".to_owned(),
            priority => format!("SCHED_FIFO {priority}"),
        };
        page.paragraph(format!(
            "The loop ran {} ticks, skipped {}, under {scheduling}.",
            timing.ticks, timing.missed
        ));
    }
}

fn loop_timing_panel(trial: &Trial, summary: &TrialSummary) -> Panel {
    let line = |label, pick: fn(&PeriodStatistics) -> u64, color, dash| {
        // A logarithmic axis has no 0.
        let us = |window: &PeriodStatistics| (pick(window) as f64 * 1e-3).max(0.01);
        let windows = trial.windows.iter();
        let points = windows.map(|window| [trial.seconds(window.stamp_ns), us(window)]).collect();
        Line::new(points, Stroke::new(color, 1.4).dash(dash)).label(label)
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
        .with_all(trouble_lines(summary))
        .with_all(late)
        .with_all(compute.map(|line| line.marker(Marker::Square)))
}

fn write_events(page: &mut Page, summary: &TrialSummary) {
    page.section("Events");
    if summary.events.is_empty() {
        page.paragraph("There are no events.");
        return;
    }
    let mut table = Table::new("Unintended events are bold.", ["time (s)", "what"]).text_column(1);
    for event in summary.events.iter().take(MOST_EVENTS) {
        let cells = [fixed(event.t_s, 3), event.what.clone()];
        table.row(TableRow::new(cells).strong(event.is_trouble));
    }
    page.table(&table);
    if summary.events.len() > MOST_EVENTS {
        let more = summary.events.len() - MOST_EVENTS;
        page.paragraph(format!("And {more} more, which `i2ris report --json` lists."));
    }
}

fn write_streams(page: &mut Page, summary: &TrialSummary) {
    page.section("Streams");
    let caption = "Recorded messages. Missing: by the sequence numbers of messages of one sender.";
    let mut table = Table::new(caption, ["stream", "messages", "per second", "missing"]);
    for stream in &summary.streams {
        table.row(TableRow::new([
            stream.name.to_owned(),
            stream.messages.to_string(),
            fixed(stream.rate_hz, 1),
            stream.missing.to_string(),
        ]));
    }
    page.table(&table);
}
