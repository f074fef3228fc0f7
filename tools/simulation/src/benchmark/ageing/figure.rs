//! Error over time, and what the adaptation believes.

use i2ris::core::adaptation::AdaptationReport;
use i2ris_report::{Axis, Color, Dash, Figure, Line, Panel, Stroke};

use super::bench::Run;
use super::measures::windows;
use crate::physics::DrawnSnake;

/// Length of the windows of the error, s.
const WINDOW_S: f64 = 5.0;

const HEIGHT: f64 = 190.0;

/// Without and with adaptation.
pub fn figure(snake: DrawnSnake, [without, with]: &[Run; 2]) -> Figure {
    let error = |run: &Run, stroke: Stroke, label: &str| {
        let windows = windows(&run.errors, WINDOW_S);
        let time = |index: usize| (index as f64 + 0.5) * WINDOW_S / 60.0;
        let points = windows.iter().enumerate();
        Line::new(points.map(|(index, rms)| [time(index), *rms]).collect(), stroke).label(label)
    };
    let errors = Panel::new(
        format!("{snake}: error of the tip, RMS over {WINDOW_S} s"),
        Axis::linear("time (min)"),
        Axis::linear("error (deg)").including(0.0),
    )
    .with(error(without, THIN, "without adaptation"))
    .with(error(with, BOLD, "with adaptation"));
    let zero = |report: &AdaptationReport| {
        let [pitch, yaw] = report.applied.zero.map(f64::to_degrees);
        pitch.hypot(yaw)
    };
    let gap = |report: &AdaptationReport| report.applied.gap.iter().sum::<f64>() / 2.0;
    let applied = |title: &str, unit: &str, of: &dyn Fn(&AdaptationReport) -> f64, end: f64| {
        let points = with.reports.iter().enumerate();
        let points = points.map(|(second, report)| [second as f64 / 60.0, of(report)]);
        let minutes = with.reports.len() as f64 / 60.0;
        let truth = vec![[0.0, 0.0], [minutes, end]];
        Panel::new(title, Axis::linear("time (min)"), Axis::linear(unit))
            .with(Line::new(truth, THIN.dash(Dash::Dotted)).label("of the snake"))
            .with(Line::new(points.collect(), BOLD).label("with adaptation"))
    };
    Figure::new(
        "ageing",
        "Ten minutes of ageing",
        "Error of the tip over time without and with adaptation, while gaps and friction grow, \
         preload is lost and the zero drifts; and zero and gaps as the adaptation applies them.",
    )
    .row(HEIGHT, vec![errors])
    .row(
        HEIGHT,
        vec![
            applied("length of the zero", "zero (deg)", &zero, 1.0),
            applied("growth of the gap, mean", "gap", &gap, 0.4),
        ],
    )
}

/// The error of the last minute.
pub fn summary([without, with]: &[Run; 2]) -> String {
    let last = |run: &Run| windows(&run.errors, 60.0).last().copied().unwrap_or(f64::NAN);
    format!(
        "error of the tip in the last minute: {:.3} deg without adaptation, {:.3} deg with it",
        last(without),
        last(with)
    )
}

const BOLD: Stroke = Stroke::new(Color::BLUE, 1.4);
const THIN: Stroke = Stroke::new(Color::DARK, 0.9);
