//! The mixture of the chosen model: its components, its regression, and how sure it is.

use i2ris_report::{
    Axis, Band, Color, Ellipse, Figure, Line, Page, Panel, ReferenceLine, Scatter, Stroke,
};

use super::fit::{CalibrationReport, OutputFacts, ProjectedComponent, ReadOutView, SectionPoint};
use super::labels::{CHOSEN, ZERO};

/// Heights of the two rows of panels.
const HEIGHTS: [f64; 2] = [230.0, 220.0];

/// Components: the line of equal density at so many standard deviations.
const DEVIATIONS: f64 = 2.0;

/// The thinnest and the thickest outline of a component: by its weight.
const WIDTHS: [f64; 2] = [0.6, 1.8];

pub(super) fn write(page: &mut Page, data: &CalibrationReport) {
    if data.read_out.is_empty() {
        return;
    }
    let views = || data.outputs.iter().zip(&data.read_out);
    let whole = views().map(|(output, view)| panel(output, view, false)).collect();
    let tilted = views().map(|(output, view)| panel(output, &level(view), true)).collect();
    let figure = Figure::new(
        "mixture",
        "The mixture",
        "For every output: measured values against the input of the mixture, the ellipses of its \
         components, and the regression through them with a band of two standard deviations; above \
         as they are, below without the straight line through them.",
    )
    .row(HEIGHTS[0], whole)
    .row(HEIGHTS[1], tilted);
    let family = data.chosen().map_or("the model", |family| family.name.as_str());
    let caption = format!(
        "The mixture of {family} along each output. Scatter: what the mixture has to explain at \
         the \
         rows used for training, which is what was measured less what a residual takes. Ellipses: \
         components at two standard deviations, projected on this plane; the heavier the line, the \
         larger the share. Line and band: the regression on the path through the middle of the \
         region that was visited, with two standard deviations (law of total covariance). Bottom: \
         the same without the straight line through the dots. Scatter beside the band are off that \
         path."
    );
    page.figure(&figure, &caption);
}

fn panel(output: &OutputFacts, view: &ReadOutView, levelled: bool) -> Panel {
    let band = view.section.iter().map(|point| {
        let reach = 2.0 * point.deviation;
        [point.along, point.mean - reach, point.mean + reach]
    });
    let mean = view.section.iter().map(|point| [point.along, point.mean]).collect();
    let heaviest =
        view.components.iter().map(|component| component.weight).fold(f64::MIN_POSITIVE, f64::max);
    let ellipses = view.components.iter().enumerate().map(|(index, component)| {
        let width = WIDTHS[0] + (WIDTHS[1] - WIDTHS[0]) * component.weight / heaviest;
        let ellipse = Ellipse::new(
            component.mean,
            component.covariance,
            DEVIATIONS,
            Stroke::new(Color::VERMILION, width),
        );
        if index == 0 { ellipse.label("component, 2σ") } else { ellipse }
    });
    let (title, label) = match levelled {
        true => (
            format!("{}, from the straight line", output.name),
            format!("{} − line ({})", output.name, output.unit),
        ),
        false => (output.name.clone(), format!("{} ({})", output.name, output.unit)),
    };
    Panel::new(title, Axis::linear(&*view.input), Axis::linear(label))
        .with(ReferenceLine::horizontal(0.0, ZERO))
        .with(Scatter::new(view.points.clone(), Color::PALE, 1.5).label("measured"))
        .with(Band::new(band.collect(), Color::SKY).label("regression ± 2σ"))
        .with_all(ellipses)
        .with(Line::new(mean, CHOSEN).label("regression"))
}

/// A view without the straight line through its points. Of a Gaussian this is a shear:
/// `y - slope x - offset` has the covariance `xy - slope xx` with `x` and the variance
/// `yy - 2 slope xy + slope^2 xx`.
fn level(view: &ReadOutView) -> ReadOutView {
    let (slope, offset) = line(&view.points);
    let left = |[x, y]: [f64; 2]| [x, y - slope * x - offset];
    let component = |component: &ProjectedComponent| {
        let [[xx, xy], [_, yy]] = component.covariance;
        let cross = xy - slope * xx;
        let own = yy - 2.0 * slope * xy + slope * slope * xx;
        ProjectedComponent {
            mean: left(component.mean),
            covariance: [[xx, cross], [cross, own]],
            ..*component
        }
    };
    let section =
        |point: &SectionPoint| SectionPoint { mean: left([point.along, point.mean])[1], ..*point };
    ReadOutView {
        input: view.input.clone(),
        points: view.points.iter().map(|point| left(*point)).collect(),
        components: view.components.iter().map(component).collect(),
        section: view.section.iter().map(section).collect(),
    }
}

/// Slope and offset of the least-squares line through points; level if they do not determine one.
fn line(points: &[[f64; 2]]) -> (f64, f64) {
    let rows = points.len().max(1) as f64;
    let mean = [0, 1].map(|i| points.iter().map(|point| point[i]).sum::<f64>() / rows);
    let product = |i: usize| {
        points.iter().map(|point| (point[0] - mean[0]) * (point[i] - mean[i])).sum::<f64>()
    };
    let slope = if product(0) > 0.0 { product(1) / product(0) } else { 0.0 };
    (slope, mean[1] - slope * mean[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_on_a_line_is_level() {
        let points: Vec<[f64; 2]> =
            (0..20).map(|i| [f64::from(i), 3.0 * f64::from(i) - 7.0]).collect();
        let component = ProjectedComponent {
            weight: 1.0,
            mean: [2.0, -1.0],
            covariance: [[4.0, 12.0], [12.0, 37.0]],
        };
        let section = vec![SectionPoint { along: 1.0, mean: -3.5, deviation: 0.2 }];
        let view =
            ReadOutView { input: String::new(), points, components: vec![component], section };
        let level = level(&view);
        assert!(level.points.iter().all(|point| point[1].abs() < 1e-9));
        let found = level.components[0];
        assert!(found.mean[1].abs() < 1e-9 && found.covariance[0][1].abs() < 1e-9);
        // What is left is the variance across the line: 37 - 12^2 / 4.
        assert!((found.covariance[1][1] - 1.0).abs() < 1e-9);
        assert!((level.section[0].mean - 0.5).abs() < 1e-9);
    }
}
