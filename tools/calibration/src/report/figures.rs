//! Figures of the models: counts against angle, mixtures over the loop; names and numbers.

use i2ris::model::file::{Mixture, MixtureParameters};
use i2ris::units::MotorVec;
use i2ris_report::number::{MINUS, fixed, significant};
use i2ris_report::statistics::min_max;
use i2ris_report::{Axis, Color, Dash, Document, Figure, Mark, Marker, Panel, Stroke};

use super::fit::{CalibrationReport, FamilyResult, OutputFacts, PlanarMixture, Straight};

/// Minimum part of a motor's motion that is named.
const NEGLIGIBLE: f64 = 0.05;

/// The chosen model, lines at 0, and levels of noise.
const CHOSEN: Stroke = Stroke::new(Color::BLUE, 1.6);
const ZERO: Stroke = Stroke::new(Color::DARK, 0.6);
pub(super) const NOISE: Stroke = Stroke::new(Color::DARK, 0.8).dash(Dash::Dotted);

/// An error length, to three digits.
pub(super) fn error(value: f64) -> String {
    significant(value, 3)
}

pub(super) fn with_unit(output: &OutputFacts) -> String {
    format!("{} ({})", output.name, output.unit)
}

/// Label of an axis of counts along a direction: `q₀`, or `0.83 q₀ − 0.56 q₁`.
fn along(direction: &MotorVec, motors: usize) -> String {
    let named = direction.iter().zip(["₀", "₁"]).take(motors);
    let named: Vec<_> = named.filter(|(part, _)| part.abs() >= NEGLIGIBLE).collect();
    match named.as_slice() {
        [(part, index)] if **part > 0.0 => format!("q{index}"),
        [(_, index)] => format!("{MINUS}q{index}"),
        parts => {
            let term = |(i, (part, index)): (usize, &(&f64, &str))| match (i, **part < 0.0) {
                (0, _) => format!("{} q{index}", fixed(**part, 2)),
                (_, true) => format!(" {MINUS} {} q{index}", fixed(part.abs(), 2)),
                (_, false) => format!(" + {} q{index}", fixed(**part, 2)),
            };
            parts.iter().enumerate().map(term).collect()
        }
    }
}

/// A list of names: `a, b and c`.
pub(super) fn list(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [front @ .., last] => format!("{} and {last}", front.join(", ")),
    }
}

/// Heights of the two rows of panels.
const HEIGHTS: [f64; 2] = [250.0, 220.0];

/// Branches of the chosen model, and both of the reference model.
const FALLING: Stroke = Stroke::new(Color::VERMILION, 1.6).dash(Dash::Dashed);
const RISING: Stroke = Stroke::new(Color::BLUE, 1.6);
const OTHER: Stroke = Stroke::new(Color::BLACK, 1.2).dash(Dash::Dotted);

pub(super) fn write_loops(page: &mut Document, data: &CalibrationReport) {
    let panels = |deviation: bool| {
        let outputs = data.outputs.iter().enumerate();
        outputs.map(|(index, output)| loop_panel(data, index, output, deviation)).collect()
    };
    let figure = Figure::new(
        "loops",
        "Counts against angle",
        "For every output: the measured values against encoder counts, with the branches of the \
         chosen model for rising and for falling counts; above the output itself, below its \
         distance from the straight line.",
    )
    .row(HEIGHTS[0], panels(false))
    .row(HEIGHTS[1], panels(true));
    page.figure(
        figure,
        "Measured outputs against the counts along each of them: the counts, projected on the \
         direction in which the output changes most. Lines: predictions of the models on one sweep \
         back and forth through the middle of the calibrated region. Top: the output. Bottom: its \
         distance from the straight line, where the loop shows. Measured rows need not lie on that \
         loop: they come from other motion, with inner loops and with the other axis elsewhere.",
    );
}

fn loop_panel(
    data: &CalibrationReport,
    index: usize,
    output: &OutputFacts,
    deviation: bool,
) -> Panel {
    let OutputFacts { name, unit, straight, .. } = output;
    let direction = along(&straight.direction(), data.recording.motors);
    let (title, y) = match deviation {
        true => (format!("{name}, from the straight line"), format!("{name} − line ({unit})")),
        false => (name.clone(), with_unit(output)),
    };
    let mut panel =
        Panel::new(title, Axis::linear(format!("{direction} (counts)")), Axis::linear(y))
            .with(Mark::horizontal(0.0, ZERO));
    for (rising, ink, label) in
        [(true, Color::PALE, "measured, rising"), (false, Color::GREY, "measured, falling")]
    {
        let rows = measured(data, index, output, rising, deviation);
        panel = panel.with(Mark::dots(rows, ink, 1.5).label(label));
    }
    if let Some((family, branches)) =
        data.reference().and_then(|family| Some((family, family.branches.get(index)?)))
    {
        panel = panel.with(branch(&branches.rising, OTHER, deviation).label(&*family.name));
        // Without memory both branches are the same; drawn twice, dots would run together.
        let mut pairs = branches.rising.iter().zip(branches.falling.iter().rev());
        if !pairs.all(|(there, back)| (there[1] - back[1]).abs() <= 1e-9 * there[1].abs().max(1.0))
        {
            panel = panel.with(branch(&branches.falling, OTHER, deviation));
        }
    }
    if let Some((FamilyResult { name, .. }, branches)) =
        data.chosen().and_then(|family| Some((family, family.branches.get(index)?)))
    {
        let rising = branch(&branches.rising, RISING, deviation).marker(Marker::Triangle);
        let falling = branch(&branches.falling, FALLING, deviation).marker(Marker::Square);
        panel = panel.with(rising.label(format!("{name}, rising")));
        panel = panel.with(falling.label(format!("{name}, falling")));
    }
    panel
}

fn branch(branch: &[[f64; 3]], stroke: Stroke, deviation: bool) -> Mark {
    let point = |[along, value, straight]: &[f64; 3]| {
        [*along, if deviation { value - straight } else { *value }]
    };
    Mark::line(branch.iter().map(point).collect(), stroke)
}

fn measured(
    data: &CalibrationReport,
    index: usize,
    output: &OutputFacts,
    rising: bool,
    deviation: bool,
) -> Vec<[f64; 2]> {
    let track = &data.track;
    let rows = track.counts.iter().zip(&track.measured).zip(&track.rising);
    let rows = rows.filter(|(_, now)| now[index] == rising);
    let point = |((counts, measured), _): ((&[f64; 2], &[f64; 3]), &[bool; 3])| {
        let straight = if deviation { output.straight.at(counts) } else { 0.0 };
        [output.straight.along(counts), measured[index] - straight]
    };
    rows.map(point).collect()
}

const MIXTURE_HEIGHT: f64 = 250.0;

/// Size of the ellipses and of the band, standard deviations.
const DEVIATIONS: f64 = 2.0;

/// Points of an ellipse and of a mean, and the maximum number of drawn rows.
const POINTS: usize = 90;
const ROWS: usize = 3000;

const ELLIPSE: Stroke = Stroke::new(Color::VERMILION, 1.0);
const BAND: Stroke = Stroke::new(Color::BLUE, 1.0).dash(Dash::Dashed);

/// The mixtures of a family: along every output, or with one mixture per motor along every motor.
pub(super) fn planar(
    mixture: &Mixture,
    straight: &[Straight],
    motors: usize,
) -> Vec<PlanarMixture> {
    let each = |part: &MixtureParameters,
                direction: &MotorVec,
                counts: &MotorVec,
                output: usize| {
        let inputs = part.means.first().map_or(0, Vec::len).saturating_sub(straight.len());
        let along = |of: &dyn Fn(usize) -> f64| (0..inputs).map(|i| counts[i] * of(i)).sum::<f64>();
        let parts = part.weights.iter().zip(&part.means).zip(&part.covariances);
        let component = |((weight, mean), covariance): ((&f64, &Vec<f64>), &Vec<Vec<f64>>)| {
            let at = inputs + output;
            let across = along(&|i| along(&|j| covariance[i][j]));
            let between = along(&|i| covariance[i][at]);
            (*weight, [along(&|i| mean[i]), mean[at]], [across, between, covariance[at][at]])
        };
        PlanarMixture { output, direction: *direction, components: parts.map(component).collect() }
    };
    let mut found = Vec::new();
    for (output, line) in straight.iter().enumerate() {
        match mixture {
            Mixture::Joint(joint) => {
                found.push(each(joint, &line.direction(), &line.direction(), output));
            }
            Mixture::PerMotor(parts) => {
                found.extend(parts.iter().take(motors).enumerate().map(|(motor, part)| {
                    let mut direction = MotorVec::default();
                    direction[motor] = 1.0;
                    each(part, &direction, &[1.0, 0.0], output)
                }))
            }
        }
    }
    found
}

impl PlanarMixture {
    /// Mean and standard deviation of the output at counts in the direction.
    fn at(&self, counts: f64) -> [f64; 2] {
        let [mut total, mut mean, mut square] = [0.0; 3];
        let away = |of: &(f64, [f64; 2], [f64; 3])| (counts - of.1[0]).powi(2) / of.2[0];
        let nearest = self.components.iter().map(away).fold(f64::INFINITY, f64::min);
        for of @ (weight, centre, [across, between, output]) in &self.components {
            let share = weight * (0.5 * (nearest - away(of))).exp() / across.sqrt();
            let predicted = centre[1] + between / across * (counts - centre[0]);
            let variance = output - between * between / across;
            total += share;
            mean += share * predicted;
            square += share * (variance + predicted * predicted);
        }
        let mean = mean / total;
        [mean, (square / total - mean * mean).max(0.0).sqrt()]
    }

    fn along(&self, counts: &MotorVec) -> f64 {
        self.direction.iter().zip(counts).map(|(part, at)| part * at).sum()
    }
}

fn ellipse((_, mean, [across, between, output]): &(f64, [f64; 2], [f64; 3])) -> Mark {
    let width = across.sqrt();
    let (slope, left) = (between / width, (output - between * between / across).max(0.0).sqrt());
    let point = |step: usize| {
        let (sin, cos) = (std::f64::consts::TAU * step as f64 / POINTS as f64).sin_cos();
        let [x, y] = [width * cos, slope * cos + left * sin].map(|part| DEVIATIONS * part);
        [mean[0] + x, mean[1] + y]
    };
    Mark::line((0..=POINTS).map(point).collect(), ELLIPSE)
}

pub(super) fn write_mixtures(page: &mut Document, data: &CalibrationReport) {
    for family in data.families.iter().filter(|family| !family.mixtures.is_empty()) {
        let mut figure = Figure::new(
            &format!("mixture-{}", family.name),
            format!("The mixture of {}", family.title),
            "The components of the mixture as ellipses over the measured loop, with the mean of \
             the regression and its band.",
        );
        for (index, output) in data.outputs.iter().enumerate() {
            let of_output = |at: &&PlanarMixture| at.output == index;
            let panels = family.mixtures.iter().filter(of_output);
            let panels = panels.map(|mixture| mixture_panel(data, family, mixture, output));
            figure = figure.row(MIXTURE_HEIGHT, panels.collect());
        }
        let less = "With one mixture per motor, the contribution of the other motor is subtracted.";
        let caption = format!(
            "{}: components as ellipses of two standard deviations, the mean of the regression \
             (solid) and two standard deviations around it (dashed), over the measured rows. \
             {less} The mixture does not represent the width of the loop around the mean{}.",
            family.title,
            if family.name == "gmr" { "" } else { "; the plays before it do" }
        );
        page.figure(figure, caption);
    }
}

fn mixture_panel(
    data: &CalibrationReport,
    family: &FamilyResult,
    mixture: &PlanarMixture,
    output: &OutputFacts,
) -> Panel {
    let track = &data.track;
    let is_other = |other: &&PlanarMixture| {
        other.output == mixture.output && other.direction != mixture.direction
    };
    let others: Vec<_> = family.mixtures.iter().filter(is_other).collect();
    let step = track.counts.len().div_ceil(ROWS).max(1);
    let rows = track.counts.iter().zip(&track.measured).step_by(step);
    let rows: Vec<[f64; 2]> = rows
        .map(|(counts, measured)| {
            let less: f64 = others.iter().map(|other| other.at(other.along(counts))[0]).sum();
            [mixture.along(counts), measured[mixture.output] - less]
        })
        .collect();
    let (low, high) = min_max(rows.iter().map(|row| row[0]));
    let curve = |deviations: f64, stroke: Stroke| {
        let point = |step: usize| {
            let counts = low + (high - low) * step as f64 / POINTS as f64;
            let [mean, deviation] = mixture.at(counts);
            [counts, mean + deviations * deviation]
        };
        Mark::line((0..=POINTS).map(point).collect(), stroke)
    };
    let x = Axis::linear(format!("{} (counts)", along(&mixture.direction, data.recording.motors)));
    Panel::new("", x, Axis::linear(with_unit(output)))
        .with(Mark::dots(rows, Color::PALE, 1.5))
        .with_all(mixture.components.iter().map(ellipse))
        .with(curve(0.0, CHOSEN))
        .with_all([-DEVIATIONS, DEVIATIONS].map(|deviations| curve(deviations, BAND)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_named() {
        assert_eq!(along(&[1.0, 0.01], 2), "q₀");
        assert_eq!(along(&[0.0, -1.0], 2), "\u{2212}q₁");
        assert_eq!(along(&[0.8, -0.6], 2), "0.80 q₀ \u{2212} 0.60 q₁");
        assert_eq!(along(&[-0.6, 0.8], 2), "\u{2212}0.60 q₀ + 0.80 q₁");
        assert_eq!(along(&[1.0, 0.0], 1), "q₀");
    }

    #[test]
    fn names_are_joined() {
        let names = ["a", "b", "c"].map(str::to_owned);
        assert_eq!(
            [list(&names), list(&names[..2]), list(&names[..1]), list(&[])],
            ["a, b and c", "a and b", "a", ""]
        );
    }

    #[test]
    fn the_mean_and_its_band_are_those_of_the_gaussians() {
        let part = MixtureParameters {
            weights: vec![0.5, 0.5],
            means: vec![vec![-10.0, 0.0, -1.0], vec![10.0, 0.0, 1.0]],
            covariances: vec![
                vec![vec![4.0, 0.0, 0.8], vec![0.0, 1.0, 0.0], vec![0.8, 0.0, 0.25]];
                2
            ],
        };
        let straight = Straight { gain: [0.2, 0.0], offset: 0.0 };
        let found = planar(&Mixture::Joint(part), &[straight], 2);
        let [mean, deviation] = found[0].at(10.0);
        assert!((mean - 1.0).abs() < 1e-9, "{mean}");
        assert!((deviation - (0.25 - 0.8 * 0.8 / 4.0_f64).sqrt()).abs() < 1e-6, "{deviation}");
        let [middle, wide] = found[0].at(0.0);
        assert!(middle.abs() < 1e-9 && wide > deviation, "{middle} {wide}");
    }
}
