//! Percentile curves: how long the slowest part of all spans took, from the median to one in ten
//! thousand.
//!
//! The horizontal axis is the logarithm of 1 / (1 - share), as HdrHistogram draws it: every step to
//! the right is a tenth of the spans that are left, so that a tail shows that a histogram would
//! hide.

use i2ris_plot::{Axis, Dash, Figure, Color, Line, Marker, Panel, Stroke};

use crate::outcome::{Outcome, Role, Way};
use crate::spans::Spans;

const HEIGHT: f64 = 270.0;

/// Points of a curve for every factor of ten.
const POINTS_PER_DECADE: usize = 40;

/// Where the horizontal axis is marked: spans that are left, and what is written.
const MARKS: [(f64, &str); 7] = [
    (1.0, "0 %"),
    (2.0, "50 %"),
    (10.0, "90 %"),
    (100.0, "99 %"),
    (1e3, "99.9 %"),
    (1e4, "99.99 %"),
    (1e5, "99.999 %"),
];

/// A curve further right than so many spans would be drawn from less than this many.
const FEWEST: f64 = 3.0;

/// Inks, dashes and markers of ways that are ours, in this order, and of peers.
const OURS: [(Color, Dash, Marker); 4] = [
    (Color::BLUE, Dash::Solid, Marker::Circle),
    (Color::VERMILION, Dash::Solid, Marker::Square),
    (Color::GREEN, Dash::Solid, Marker::Triangle),
    (Color::SKY, Dash::Solid, Marker::Diamond),
];
const PEERS: [(Color, Dash, Marker); 3] = [
    (Color::GREY, Dash::Dashed, Marker::Cross),
    (Color::ORANGE, Dash::DashDot, Marker::Diamond),
    (Color::BLACK, Dash::Dotted, Marker::Square),
];

/// A panel for every group.
#[must_use]
pub fn figure(outcome: &Outcome) -> Figure {
    let mut figure = Figure::new(
        outcome.bench,
        outcome.about,
        "Curves of percentiles, one panel for each group: share of all spans to the right, time upwards, both \
         logarithmic. Floors are dashed black lines.",
    );
    for group in outcome.groups() {
        let ways: Vec<&Way> = outcome
            .ways
            .iter()
            .filter(|way| way.group == group && !way.spans.is_empty())
            .collect();
        figure = figure.row(HEIGHT, vec![panel(group, &ways)]);
    }
    figure
}

fn panel(group: &str, ways: &[&Way]) -> Panel {
    let marks = MARKS
        .iter()
        .map(|(value, label)| (*value, (*label).to_owned()))
        .collect();
    let x = Axis::log("share of all that took at most this long").marks(marks);
    let mut panel = Panel::new(group, x, Axis::log("time (µs)"));
    let (mut ours, mut peers) = (OURS.iter().cycle(), PEERS.iter().cycle());
    for way in ways {
        let line = match way.role {
            Role::Floor => Line::new(
                curve(&way.spans),
                Stroke::new(Color::BLACK, 1.8).dash(Dash::Dashed),
            ),
            Role::Ours => marked(way, ours.next()),
            Role::Peer => marked(way, peers.next()),
        };
        let name = if way.role == Role::Floor {
            format!("{} (floor)", way.name)
        } else {
            way.name.clone()
        };
        panel = panel.with(line.label(name));
    }
    panel
}

fn marked(way: &Way, look: Option<&(Color, Dash, Marker)>) -> Line {
    let (ink, dash, marker) = *look.unwrap_or(&OURS[0]);
    Line::new(curve(&way.spans), Stroke::new(ink, 1.4).dash(dash)).marker(marker)
}

/// `[1 / (1 - share), us]`.
fn curve(spans: &Spans) -> Vec<[f64; 2]> {
    let most = (spans.summary().count as f64 / FEWEST).max(1.0);
    let decades = most.log10();
    let points = (decades * POINTS_PER_DECADE as f64).ceil() as usize;
    (0..=points)
        .map(|point| {
            let left = 10f64.powf(decades * point as f64 / points.max(1) as f64);
            [
                left,
                spans.histogram().value_at_quantile(1.0 - 1.0 / left) as f64 / 1e3,
            ]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::tests::way;

    #[test]
    fn a_curve_rises_from_the_least_to_the_tail() {
        let way = way("any", "group", Role::Ours, 1000);
        let curve = curve(&way.spans);
        assert_eq!((curve[0][0], curve[0][1]), (1.0, 1.0));
        assert!(
            curve
                .windows(2)
                .all(|pair| pair[0][0] < pair[1][0] && pair[0][1] <= pair[1][1])
        );
        let median = curve.iter().find(|point| point[0] >= 2.0).unwrap();
        assert!((1.49..1.53).contains(&median[1]), "{median:?}");
        let last = curve[curve.len() - 1];
        assert!(
            (last[0] - 1000.0 / FEWEST).abs() < 1e-6 && last[1] > 1.99,
            "{last:?}"
        );
    }
}
