//! Ellipses of Gaussians.

use std::f64::consts::TAU;

use super::{Extent, LegendEntry, Mark, PlotArea, Symbol};
use crate::markup::Element;
use crate::path::Path;
use crate::style::Stroke;

/// Corners of the outline.
const CORNERS: u32 = 72;

/// The line of equal density of a Gaussian in the plane, `deviations` standard deviations from its
/// mean: `mean + deviations * L [cos t; sin t]` with the Cholesky factor `L` of the covariance.
#[derive(Debug, Clone, PartialEq)]
pub struct Ellipse {
    mean: [f64; 2],
    covariance: [[f64; 2]; 2],
    deviations: f64,
    stroke: Stroke,
    label: Option<String>,
}

labelled!(Ellipse);

impl Ellipse {
    /// An ellipse. If rounding made the covariance indefinite, it is the nearest line or point.
    #[must_use]
    pub const fn new(
        mean: [f64; 2],
        covariance: [[f64; 2]; 2],
        deviations: f64,
        stroke: Stroke,
    ) -> Self {
        Self { mean, covariance, deviations, stroke, label: None }
    }

    fn outline(&self) -> impl Iterator<Item = [f64; 2]> {
        let [[xx, xy], [_, yy]] = self.covariance;
        let a = xx.max(0.0).sqrt();
        let b = if a > 0.0 { xy / a } else { 0.0 };
        let c = (yy - b * b).max(0.0).sqrt();
        let ([x, y], n) = (self.mean, self.deviations);
        (0..CORNERS).map(move |i| {
            let (sin, cos) = (TAU * f64::from(i) / f64::from(CORNERS)).sin_cos();
            [x + n * a * cos, y + n * (b * cos + c * sin)]
        })
    }
}

impl Mark for Ellipse {
    fn extent(&self) -> Extent {
        Extent::of(self.outline())
    }

    fn draw(&self, area: &PlotArea) -> Element {
        let positions: Option<Vec<_>> = self.outline().map(|point| area.position(point)).collect();
        let mut path = Path::default();
        path.polygon(positions.unwrap_or_default());
        path.draw(self.stroke)
    }

    fn legend(&self) -> Vec<LegendEntry> {
        LegendEntry::of(&self.label, Symbol::Line(self.stroke, None))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::style::Color;

    proptest! {
        #[test]
        fn the_outline_has_one_mahalanobis_distance(
            a in 0.1..5.0_f64, b in -3.0..3.0_f64, c in 0.1..5.0_f64, n in 0.5..3.0_f64
        ) {
            let [xx, xy, yy] = [a * a, a * b, b * b + c * c];
            let stroke = Stroke::new(Color::BLACK, 1.0);
            let ellipse = Ellipse::new([1.0, -2.0], [[xx, xy], [xy, yy]], n, stroke);
            for [x, y] in ellipse.outline() {
                let (dx, dy) = (x - 1.0, y + 2.0);
                let form = yy * dx * dx - 2.0 * xy * dx * dy + xx * dy * dy;
                let distance = (form / (xx * yy - xy * xy)).sqrt();
                prop_assert!((distance - n).abs() < 1e-6, "{distance}");
            }
        }
    }
}
