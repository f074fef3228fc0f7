//! Ellipses of Gaussians.

use std::f64::consts::TAU;

use super::{Bounds, Frame, Key, Mark, Sample};
use crate::path::Path;
use crate::style::Stroke;
use crate::xml::Element;

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

impl Ellipse {
    /// An ellipse. A covariance that is none, because rounding made it so, gives the nearest line
    /// or point.
    #[must_use]
    pub const fn new(
        mean: [f64; 2],
        covariance: [[f64; 2]; 2],
        deviations: f64,
        stroke: Stroke,
    ) -> Self {
        Self {
            mean,
            covariance,
            deviations,
            stroke,
            label: None,
        }
    }

    /// With a word in the legend.
    #[must_use]
    pub fn label(self, label: impl Into<String>) -> Self {
        Self {
            label: Some(label.into()),
            ..self
        }
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
    fn bounds(&self) -> Bounds {
        Bounds::of(self.outline())
    }

    fn draw(&self, frame: &Frame) -> Element {
        let places: Option<Vec<_>> = self.outline().map(|point| frame.place(point)).collect();
        let mut path = Path::default();
        if let Some((first, rest)) = places.as_deref().and_then(<[_]>::split_first) {
            path.move_to(*first);
            rest.iter().for_each(|point| path.line_to(*point));
            path.close();
        }
        self.stroke
            .on(Element::new("path"))
            .with("d", path.into_text())
    }

    fn keys(&self) -> Vec<Key> {
        let key = |label: &String| Key {
            label: label.clone(),
            sample: Sample::Line(self.stroke, None),
        };
        self.label.iter().map(key).collect()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::style::Ink;

    proptest! {
        /// Every point of the outline is as far from the mean as asked, by the distance that the
        /// covariance defines.
        #[test]
        fn the_outline_has_one_distance(a in 0.1..5.0_f64, b in -3.0..3.0_f64, c in 0.1..5.0_f64, n in 0.5..3.0_f64) {
            let covariance = [[a * a, a * b], [a * b, b * b + c * c]];
            let ellipse = Ellipse::new([1.0, -2.0], covariance, n, Stroke::new(Ink::BLACK, 1.0));
            let determinant = covariance[0][0] * covariance[1][1] - covariance[0][1] * covariance[1][0];
            for [x, y] in ellipse.outline() {
                let (dx, dy) = (x - 1.0, y + 2.0);
                let squared = (covariance[1][1] * dx * dx - 2.0 * covariance[0][1] * dx * dy
                    + covariance[0][0] * dy * dy) / determinant;
                prop_assert!((squared.sqrt() - n).abs() < 1e-6, "{squared}");
            }
        }
    }
}
