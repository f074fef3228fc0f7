//! The adaptation over the time of a trial.

use i2ris::ipc::payload::AdaptationMsg;
use i2ris_plot::{Axis, Color, Figure, Line, Page, Panel, ReferenceLine, Stroke};

use super::trial::Trial;

const ESTIMATES: [Stroke; 4] = [
    Stroke::new(Color::BLUE, 1.3),
    Stroke::new(Color::VERMILION, 1.3),
    Stroke::new(Color::GREEN, 1.1),
    Stroke::new(Color::ORANGE, 1.1),
];
const LIMIT: Stroke = Stroke::new(Color::VERMILION, 1.0);
const ZERO: Stroke = Stroke::new(Color::PALE, 0.8);

/// Height of a panel.
const ROW_HEIGHT: f64 = 170.0;

/// A curve: its name, the index of its parameter, and the factor to its unit.
type Curve = (&'static str, usize, f64);

const DEG: f64 = 180.0 / std::f64::consts::PI;

const GROUPS: [(&str, &str, &[Curve]); 4] = [
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
    ("latency of the camera", "estimate (ms)", &[("beyond its stamps", 8, 1000.0)]),
];

/// Adds the section; nothing if the adaptation was off all the time.
pub(super) fn write(page: &mut Page, trial: &Trial) {
    let Some(last) = trial.adaptation.last() else {
        return;
    };
    page.section("Adaptation");
    let mut figure = Figure::new(
        "adaptation",
        "Drift over time",
        "What was applied of the drift that the camera showed, parameter by parameter, and below \
         the share of the budget.",
    );
    for (name, unit, curves) in GROUPS {
        let panel = Panel::new(name, time_axis(trial), Axis::linear(unit))
            .with(ReferenceLine::horizontal(0.0, ZERO));
        let lines = curves.iter().zip(ESTIMATES);
        let lines = lines.map(|((label, index, factor), stroke)| {
            // The latency is not applied.
            let value = |message: &AdaptationMsg| match *index {
                8 => factor * message.estimate[*index],
                _ => factor * message.applied[*index],
            };
            Line::new(over_time(trial, value), stroke).label(*label)
        });
        figure = figure.row(ROW_HEIGHT, vec![panel.with_all(lines)]);
    }
    let used = |message: &AdaptationMsg| {
        let parameters = message.budget_used.iter().copied();
        100.0 * parameters.fold(message.total_used, f64::max)
    };
    let budget = Panel::new(
        "budget",
        time_axis(trial),
        Axis::linear("largest share used (%)").range(0.0, 110.0),
    )
    .with(ReferenceLine::horizontal(70.0, ZERO))
    .with(ReferenceLine::horizontal(100.0, LIMIT))
    .with(Line::new(over_time(trial, used), ESTIMATES[0]));
    page.figure(
        &figure.row(ROW_HEIGHT, vec![budget]),
        "What was applied of the drift, and the share of the budget: a warning at 70 %; at 100 % \
         nothing more is learned.",
    );
    page.facts(facts(last));
}

fn facts(last: &AdaptationMsg) -> Vec<(String, String)> {
    let dropped: u64 = last.frames_dropped.iter().sum();
    let frames = format!(
        "{} learned from, {} refused, {} while nothing was learned, {dropped} dropped",
        last.frames_used, last.frames_refused, last.frames_paused
    );
    let errors = format!(
        "{:.3} deg from the calibrated model, {:.3} deg from the adapted one",
        last.calibrated_error.to_degrees(),
        last.adapted_error.to_degrees()
    );
    vec![
        ("frames".to_owned(), frames),
        ("camera, last window of 10 s".to_owned(), errors),
        ("taken back".to_owned(), last.taken_back.to_string()),
    ]
}

fn time_axis(trial: &Trial) -> Axis {
    Axis::linear("time (s)").range(0.0, trial.length_s().max(1e-3))
}

fn over_time(trial: &Trial, value: impl Fn(&AdaptationMsg) -> f64) -> Vec<[f64; 2]> {
    let messages = trial.adaptation.iter();
    messages.map(|message| [trial.seconds(message.stamp_ns), value(message)]).collect()
}
