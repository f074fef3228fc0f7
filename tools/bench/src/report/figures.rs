//! Curves of percentiles.

use i2ris_report::{Axis, Color, Dash, Figure, Mark, Marker, Panel, Stroke};

use crate::outcome::{Durations, Outcome, Role, Variant};

/// Height of a panel.
const HEIGHT: f64 = 260.0;

/// Points of a curve per factor of ten.
const POINTS_PER_DECADE: usize = 40;

/// Ticks of the horizontal axis: 1 / (1 - share), and the label.
const TICKS: [(f64, &str); 7] = [
    (1.0, "0 %"),
    (2.0, "50 %"),
    (10.0, "90 %"),
    (100.0, "99 %"),
    (1e3, "99.9 %"),
    (1e4, "99.99 %"),
    (1e5, "99.999 %"),
];

/// A curve ends where fewer durations than this remain.
const MIN_DURATIONS: f64 = 3.0;

/// Colors, dashes and markers of our own variants.
const OURS: [(Color, Dash, Marker); 8] = [
    (Color::BLUE, Dash::Solid, Marker::Circle),
    (Color::VERMILION, Dash::Solid, Marker::Square),
    (Color::GREEN, Dash::Solid, Marker::Triangle),
    (Color::SKY, Dash::Solid, Marker::Diamond),
    (Color::ORANGE, Dash::Solid, Marker::Cross),
    (Color::BLUE, Dash::Long, Marker::Square),
    (Color::VERMILION, Dash::Long, Marker::Triangle),
    (Color::GREEN, Dash::Long, Marker::Circle),
];
/// Dashes of floors, which are black and without markers.
const FLOORS: [Dash; 2] = [Dash::Dashed, Dash::Dotted];
/// Colors, dashes and markers of peers.
const PEERS: [(Color, Dash, Marker); 3] = [
    (Color::GREY, Dash::Dashed, Marker::Cross),
    (Color::ORANGE, Dash::Long, Marker::Diamond),
    (Color::BLACK, Dash::Dotted, Marker::Square),
];

/// Percentiles from the median to one in ten thousand, one panel for each group.
///
/// The horizontal axis is the logarithm of 1 / (1 - share), as in the plots of HdrHistogram: with
/// every step to the right a tenth of the durations is left. It shows a tail that a histogram would
/// hide.
pub fn percentile_curves(outcome: &Outcome) -> Figure {
    let figure = Figure::new(
        outcome.bench,
        outcome.about,
        "Curves of percentiles, one panel for each group: share of all durations to the right, \
         time upwards, both logarithmic. Floors are black lines without markers.",
    );
    let groups = outcome.groups().into_iter();
    // One legend for all panels: no sign twice.
    let mut used = [0; 3];
    groups.fold(figure, |figure, (name, variants)| {
        figure.row(HEIGHT, vec![panel(name, &variants, &mut used)])
    })
}

fn panel(group: &str, variants: &[&Variant], used: &mut [usize; 3]) -> Panel {
    let ticks = TICKS.map(|(value, label)| (value, label.to_owned())).to_vec();
    let x = Axis::log("share of all that took at most this long").marks(ticks);
    let mut panel = Panel::new(group, x, Axis::log("time (µs)"));
    for variant in variants.iter().filter(|variant| !variant.durations.is_empty()) {
        let points = curve(&variant.durations);
        let index = &mut used[variant.role as usize];
        let line = match variant.role {
            Role::Floor => {
                let dash = FLOORS[*index % FLOORS.len()];
                Mark::line(points, Stroke::new(Color::BLACK, 1.8).dash(dash))
            }
            Role::Ours => marked(points, OURS[*index % OURS.len()]),
            Role::Peer => marked(points, PEERS[*index % PEERS.len()]),
        };
        *index += 1;
        panel = panel.with(line.label(variant.display_name()));
    }
    panel
}

fn marked(points: Vec<[f64; 2]>, (color, dash, marker): (Color, Dash, Marker)) -> Mark {
    Mark::line(points, Stroke::new(color, 1.4).dash(dash)).marker(marker)
}

/// `[1 / (1 - share), us]`.
fn curve(durations: &Durations) -> Vec<[f64; 2]> {
    let histogram = durations.histogram();
    let decades = (histogram.len() as f64 / MIN_DURATIONS).max(1.0).log10();
    let last = (decades * POINTS_PER_DECADE as f64).ceil() as usize;
    let point = |index: usize| {
        let left = 10f64.powf(decades * index as f64 / last.max(1) as f64);
        [left, histogram.value_at_quantile(1.0 - 1.0 / left) as f64 / 1e3]
    };
    (0..=last).map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::tests::variant;

    #[test]
    fn a_curve_rises_from_the_least_to_the_tail() {
        let curve = curve(&variant("any", "group", Role::Ours, 1000).durations);
        assert_eq!(curve[0], [1.0, 1.0]);
        for pair in curve.windows(2) {
            assert!(pair[0][0] < pair[1][0] && pair[0][1] <= pair[1][1], "{pair:?}");
        }
        let median = curve.iter().find(|point| point[0] >= 2.0).unwrap();
        assert!((1.49..1.53).contains(&median[1]), "{median:?}");
        let [left, us] = curve[curve.len() - 1];
        assert!((left - 1000.0 / MIN_DURATIONS).abs() < 1e-6 && us > 1.99, "{left} {us}");
    }
}
