//! A trial as a page of HTML that needs nothing but itself.

use i2ris::ipc::payload::PeriodStatistics;
use i2ris_plot::page::TableRow;
use i2ris_plot::{
    Axis, Dash, Scatter, Figure, Color, Line, Marker, Page, Panel, ReferenceLine, ShadedInterval, Stroke, Table,
};

use super::hysteresis::Loop;
use super::latency::bins;
use super::summary::{Spread, Summary, Tracked};
use super::tracking::{Error, errors};
use super::trial::Trial;
use i2ris_plot::series::Series;

const GOAL: Stroke = Stroke::new(Color::BLACK, 1.6);
const ESTIMATE: Stroke = Stroke::new(Color::BLUE, 1.1).dash(Dash::Dashed);
const CAMERA: Stroke = Stroke::new(Color::VERMILION, 1.0);
const ZERO: Stroke = Stroke::new(Color::PALE, 0.8);
const TROUBLE: Stroke = Stroke::new(Color::VERMILION, 1.4).dash(Dash::Dotted);

const ROW: f64 = 190.0;

/// More events than this are counted, not listed.
const MOST_EVENTS: usize = 200;

/// What is shaded over time.
const AWAY: &str = "not following (off, holding, busy)";

/// The page of a trial.
pub fn page(trial: &Trial, summary: &Summary) -> Page {
    let mut page = Page::new(format!("Trial {}", summary.file));
    page.main_result(lead(summary));
    let troubles: Vec<String> = notices(trial, summary);
    if !troubles.is_empty() {
        page.notice("To keep in mind", troubles);
    }
    page.facts(facts(summary));
    tracking(&mut page, trial, summary);
    hysteresis(&mut page, summary);
    latency(&mut page, trial, summary);
    events(&mut page, summary);
    streams(&mut page, summary);
    page.footer(concat!(
        "Written by i2ris ",
        env!("CARGO_PKG_VERSION"),
        " from the recording alone."
    ));
    page
}

fn lead(summary: &Summary) -> String {
    let length = format!("{:.1} s", summary.length_s);
    match (&summary.camera, &summary.estimate) {
        (Some(camera), _) => format!(
            "{length}. While it followed commands, the camera saw the snake {:.2} deg from its goal (root mean square of the \
             two-dimensional error), at most {:.2} deg.",
            camera.length_rms_deg, camera.length.max
        ),
        (None, Some(estimate)) => format!(
            "{length}, no camera. While it followed commands, the model's estimate was {:.2} deg from the goal (root mean square \
             of the two-dimensional error); how far the snake itself was, this recording does not tell.",
            estimate.length_rms_deg
        ),
        (None, None) => format!("{length}. The robot followed no commands in angles."),
    }
}

fn notices(trial: &Trial, summary: &Summary) -> Vec<String> {
    let mut notices = Vec::new();
    if let Some(why) = &summary.cut_off {
        notices.push(format!(
            "The recording is cut off ({why}); what follows is what it has."
        ));
    } else if summary.outcome.is_empty() {
        notices.push("The recorder did not end in order: the recording has no outcome.".to_owned());
    }
    let missing: u64 = summary.streams.iter().map(|stream| stream.missing).sum();
    if missing > 0 {
        notices.push(format!(
            "{missing} message(s) are missing in the streams of the controller."
        ));
    }
    if trial.is_tip {
        notices.push(
            "The outputs are positions of the tip, not angles: this report does not draw them."
                .to_owned(),
        );
    }
    let troubles = summary
        .events
        .iter()
        .filter(|event| event.is_trouble)
        .count();
    if troubles > 0 {
        notices.push(format!(
            "{troubles} event(s) that were not meant to happen; see the list."
        ));
    }
    notices
}

fn facts(summary: &Summary) -> Vec<(String, String)> {
    // The offset of the clocks is for programs.
    let known = summary
        .about
        .iter()
        .filter(|(name, value)| !value.is_empty() && !name.ends_with("_ns"));
    let mut facts: Vec<(String, String)> = known
        .map(|(name, value)| (name.replace('_', " "), value.clone()))
        .collect();
    let attached: Vec<String> = summary
        .attached
        .iter()
        .map(|(name, bytes)| format!("{name} ({bytes} bytes)"))
        .collect();
    facts.push((
        "attached".to_owned(),
        if attached.is_empty() {
            "nothing".to_owned()
        } else {
            attached.join(", ")
        },
    ));
    facts
}

fn tracking(page: &mut Page, trial: &Trial, summary: &Summary) {
    page.section("Tracking");
    if trial.goal.is_empty() && trial.measured.is_empty() {
        page.paragraph("There are no angles: no model was in use.");
        return;
    }
    let mut figure = Figure::new(
        "angles",
        "Goal, estimate and camera over time",
        "Pitch and yaw over time: goal, the model's estimate, what a camera saw; below, the error of each.",
    );
    let seen = [
        ("estimate", ESTIMATE, &trial.measured),
        ("camera", CAMERA, &trial.camera),
    ];
    for (axis, name) in ["pitch", "yaw"].into_iter().enumerate() {
        let mut panel = timeline(trial, summary, name, &format!("{name} (deg)"));
        for (label, stroke, series) in seen {
            if !series.is_empty() {
                panel = panel.with(over_time(trial, series, axis, stroke).label(label));
            }
        }
        figure = figure.row(
            ROW,
            vec![panel.with(over_time(trial, &trial.goal, axis, GOAL).label("goal"))],
        );
    }
    let both = [
        ("estimate", ESTIMATE, errors(trial, &trial.measured)),
        ("camera", CAMERA, errors(trial, &trial.camera)),
    ];
    for (axis, name) in ["pitch", "yaw"].into_iter().enumerate() {
        let panel = timeline(
            trial,
            summary,
            &format!("error in {name}"),
            "seen − goal (deg)",
        )
        .with(ReferenceLine::horizontal(0.0, ZERO));
        let lines = both.iter().filter(|(.., errors)| !errors.is_empty());
        let lines = lines.map(|(_, stroke, errors)| Line::new(with_gaps(errors, axis), *stroke));
        figure = figure.row(0.8 * ROW, vec![panel.with_all(lines)]);
    }
    page.figure(
        &figure,
        "Angles over time, and how far they were from the goal while commands were followed. The estimate is the model's, from \
         the encoders: it is right only where the model is.",
    );
    errors_table(page, summary);
}

/// An empty panel over the time of the trial: shaded where nothing was followed, with a line for
/// every trouble.
fn timeline(trial: &Trial, summary: &Summary, title: &str, y: &str) -> Panel {
    let x = Axis::linear("time (s)").range(0.0, trial.length_s().max(1e-3));
    let mut panel = Panel::new(title, x, Axis::linear(y));
    for [from, to] in trial.away() {
        panel = panel.with(ShadedInterval::new(from, to, Color::FAINT).label(AWAY));
    }
    panel.with_all(
        summary
            .events
            .iter()
            .filter(|event| event.is_trouble)
            .map(|event| ReferenceLine::vertical(event.t_s, TROUBLE)),
    )
}

/// Where samples are further apart than this, seconds, the line is broken.
const BREAK_S: f64 = 0.25;

fn over_time(trial: &Trial, series: &Series<2>, axis: usize, stroke: Stroke) -> Line {
    let points: Vec<Error> = series
        .iter()
        .map(|(stamp, value)| (trial.seconds(*stamp), *value))
        .collect();
    Line::new(with_gaps(&points, axis), stroke)
}

fn with_gaps(points: &[Error], axis: usize) -> Vec<[f64; 2]> {
    let mut line = Vec::with_capacity(points.len());
    let mut before = f64::NEG_INFINITY;
    for (t, values) in points {
        if t - before > BREAK_S {
            line.push([*t, f64::NAN]);
        }
        line.push([*t, values[axis]]);
        before = *t;
    }
    line
}

fn errors_table(page: &mut Page, summary: &Summary) {
    let header = [
        "against",
        "samples",
        "pitch RMS",
        "yaw RMS",
        "length RMS",
        "p50",
        "p90",
        "p99",
        "max",
    ];
    let mut table = Table::new(
        "Error while commands were followed, degrees; length: of the two-dimensional error.",
        header,
    );
    for (name, tracked, strong) in [
        ("what the camera saw", &summary.camera, true),
        ("the model's estimate", &summary.estimate, false),
    ] {
        if let Some(Tracked {
            samples,
            pitch_rms_deg,
            yaw_rms_deg,
            length_rms_deg,
            length,
        }) = tracked
        {
            let degrees = [
                *pitch_rms_deg,
                *yaw_rms_deg,
                *length_rms_deg,
                length.p50,
                length.p90,
                length.p99,
                length.max,
            ];
            let cells = [name.to_owned(), samples.to_string()].into_iter();
            let cells = cells
                .chain(degrees.iter().map(|value| format!("{value:.3}")))
                .collect();
            table.row(TableRow {
                cells,
                strong,
                rule: false,
            });
        }
    }
    page.table(&table);
}

fn hysteresis(page: &mut Page, summary: &Summary) {
    if summary.hysteresis.is_empty() {
        return;
    }
    page.section("Hysteresis");
    let panels = |deviation: bool| {
        summary
            .hysteresis
            .iter()
            .map(|own| loop_panel(own, deviation))
            .collect()
    };
    let figure = Figure::new(
        "loops",
        "Counts against angle",
        "For pitch and yaw: angle over the counts along the direction in which it changes most, on the way up and on the way \
         down; below, the distance from the plane that fits best.",
    )
    .row(250.0, panels(false))
    .row(220.0, panels(true));
    let from = summary.hysteresis[0].from;
    page.figure(
        &figure,
        &format!(
            "Angle (by {from}) against the counts along the direction in which it changes most. Below: its distance from the \
             plane through all counts, where the loop shows. Inner loops and the other axis spread the samples."
        ),
    );
    let width = |own: &Loop| {
        let width = own.width_deg.map_or_else(
            || "cannot be told".to_owned(),
            |deg| format!("{deg:.2} deg"),
        );
        (
            format!("{}: width of the loop", own.output),
            format!("{width}; {:.4} deg per count", own.slope_deg_per_count),
        )
    };
    page.facts(summary.hysteresis.iter().map(width));
}

fn loop_panel(own: &Loop, deviation: bool) -> Panel {
    let (title, y) = if deviation {
        (format!("{}, from the plane", own.output), "deg".to_owned())
    } else {
        (own.output.to_owned(), format!("{} (deg)", own.output))
    };
    let points = |rows: &[[f64; 3]]| {
        rows.iter()
            .map(|row| [row[0], row[if deviation { 2 } else { 1 }]])
            .collect()
    };
    Panel::new(
        title,
        Axis::linear("counts along the direction"),
        Axis::linear(y),
    )
    .with(Scatter::new(points(&own.rising), Color::BLUE, 1.6).label("counts rising"))
    .with(Scatter::new(points(&own.falling), Color::ORANGE, 1.6).label("counts falling"))
    .with(ReferenceLine::horizontal(0.0, ZERO))
}

fn latency(page: &mut Page, trial: &Trial, summary: &Summary) {
    page.section("Latencies");
    let mut table = Table::new("Percentiles.", ["", "p50", "p90", "p99", "max"]);
    let mut row = |name: &str, spread: Option<&Spread>, factor: f64| {
        if let Some(Spread { p50, p90, p99, max }) = spread {
            let numbers = [p50, p90, p99, max].map(|value| span(value * factor));
            let cells = std::iter::once(name.to_owned()).chain(numbers).collect();
            table.row(TableRow {
                cells,
                ..TableRow::default()
            });
        }
    };
    row(
        "command published to its set-point handed to the line",
        summary.command_to_line_ms.as_ref(),
        1.0,
    );
    row(
        "age of the encoder position in a tick",
        summary.reading_age_ms.as_ref(),
        1.0,
    );
    row(
        "loop: tick begins late (typical second)",
        summary.control_loop.as_ref().map(|own| &own.lateness_us),
        1e-3,
    );
    row(
        "loop: time a tick computes (typical second)",
        summary.control_loop.as_ref().map(|own| &own.compute_us),
        1e-3,
    );
    let histograms = [
        ("command to line", &trial.latencies.to_line, Color::BLUE),
        ("age of encoder positions", &trial.latencies.age, Color::GREEN),
    ];
    let drawn = histograms
        .into_iter()
        .filter(|(_, histogram, _)| !histogram.is_empty());
    let panel = |(name, histogram, ink): (&str, &hdrhistogram::Histogram<u64>, Color)| {
        let (edges, heights) = bins(histogram);
        let x = Axis::log("time (ms)");
        Panel::new(name, x, Axis::linear("share (%)").including(0.0)).with(Line::steps(
            &edges,
            &heights,
            Stroke::new(ink, 1.4),
        ))
    };
    let panels: Vec<Panel> = drawn.map(panel).collect();
    let mut figure = Figure::new(
        "latencies",
        "Latencies",
        "Histograms of the time from a command to the line and of the age of encoder positions; below, lateness and computing time \
         of the control loop over time.",
    )
    .row(210.0, panels);
    if !trial.windows.is_empty() {
        figure = figure.row(230.0, vec![windows(trial, summary)]);
    }
    page.figure(
        &figure,
        "Histograms with bins that are even on a logarithmic axis; the control loop as it tells of itself, a point for every \
         second. On a virtual or shared machine maxima belong to the machine.",
    );
    page.table(&table);
    if let Some(own) = &summary.control_loop {
        page.paragraph(format!(
            "The loop ran {} ticks, skipped {}, under {}.",
            own.ticks,
            own.missed,
            if own.priority > 0 {
                format!("SCHED_FIFO {}", own.priority)
            } else {
                "normal scheduling".to_owned()
            }
        ));
    }
}

/// Milliseconds, in the unit that suits them.
fn span(ms: f64) -> String {
    if ms < 0.1 {
        format!("{:.2} µs", 1e3 * ms)
    } else {
        format!("{ms:.2} ms")
    }
}

fn windows(trial: &Trial, summary: &Summary) -> Panel {
    let line = |pick: fn(&PeriodStatistics) -> u64, stroke: Stroke| {
        // A logarithmic axis has no place for nothing.
        let point = |window: &PeriodStatistics| {
            [
                trial.seconds(window.stamp_ns),
                (pick(window) as f64 * 1e-3).max(0.01),
            ]
        };
        Line::new(trial.windows.iter().map(point).collect(), stroke)
    };
    let x = Axis::linear("time (s)").range(0.0, trial.length_s().max(1e-3));
    let troubles = summary.events.iter().filter(|event| event.is_trouble);
    Panel::new("control loop, second by second", x, Axis::log("time (µs)"))
        .with_all(troubles.map(|event| ReferenceLine::vertical(event.t_s, TROUBLE)))
        .with(line(|w| w.lateness.p50_ns, Stroke::new(Color::BLUE, 1.4)).label("late, p50"))
        .with(
            line(
                |w| w.lateness.p99_ns,
                Stroke::new(Color::BLUE, 1.4).dash(Dash::Dashed),
            )
            .label("late, p99"),
        )
        .with(
            line(
                |w| w.lateness.max_ns,
                Stroke::new(Color::BLUE, 1.0).dash(Dash::Dotted),
            )
            .label("late, max"),
        )
        .with(
            line(|w| w.compute.p50_ns, Stroke::new(Color::GREEN, 1.4))
                .marker(Marker::Square)
                .label("computes, p50"),
        )
        .with(
            line(
                |w| w.compute.p99_ns,
                Stroke::new(Color::GREEN, 1.4).dash(Dash::Dashed),
            )
            .marker(Marker::Square)
            .label("computes, p99"),
        )
}

fn events(page: &mut Page, summary: &Summary) {
    page.section("Events");
    if summary.events.is_empty() {
        page.paragraph("Nothing was told.");
        return;
    }
    let mut table = Table::new(
        "In bold what was not meant to happen.",
        ["time (s)", "what"],
    )
    .text_column(1);
    for event in summary.events.iter().take(MOST_EVENTS) {
        let cells = vec![format!("{:.3}", event.t_s), event.what.clone()];
        table.row(TableRow {
            cells,
            strong: event.is_trouble,
            rule: false,
        });
    }
    page.table(&table);
    if summary.events.len() > MOST_EVENTS {
        page.paragraph(format!(
            "And {} more, which `i2ris report --json` lists.",
            summary.events.len() - MOST_EVENTS
        ));
    }
}

fn streams(page: &mut Page, summary: &Summary) {
    page.section("Streams");
    let header = ["stream", "messages", "per second", "missing"];
    let mut table = Table::new(
        "What was recorded. Missing: by the numbers that messages of one sender carry.",
        header,
    );
    for stream in &summary.streams {
        let cells = vec![
            stream.name.to_owned(),
            stream.messages.to_string(),
            format!("{:.1}", stream.rate_hz),
            stream.missing.to_string(),
        ];
        table.row(TableRow {
            cells,
            ..TableRow::default()
        });
    }
    page.table(&table);
}
