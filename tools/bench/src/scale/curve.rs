//! A curve of cost over size, and its exponent.

use serde::Serialize;

/// Cost over size.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Curve {
    /// Curves of one group share a panel.
    pub group: String,
    /// What is measured.
    pub name: String,
    /// What grows.
    pub size: String,
    /// Unit of the cost.
    pub unit: String,
    /// `[size, cost]`, in order of the sizes.
    pub points: Vec<[f64; 2]>,
    /// The slope of the logarithms; `None` with fewer than two sizes above 0.
    pub exponent: Option<f64>,
}

impl Curve {
    pub(super) fn new(group: &str, name: &str, size: &str, unit: &str) -> Self {
        Self {
            group: group.to_owned(),
            name: name.to_owned(),
            size: size.to_owned(),
            unit: unit.to_owned(),
            points: Vec::new(),
            exponent: None,
        }
    }

    pub(super) fn push(&mut self, size: f64, cost: f64) {
        self.points.push([size, cost]);
        self.exponent = exponent(&self.points);
    }
}

/// The slope of the straight line through the logarithms of cost and size, by least squares. Points
/// that have no logarithm are left out.
#[must_use]
pub fn exponent(points: &[[f64; 2]]) -> Option<f64> {
    let logs: Vec<[f64; 2]> = points
        .iter()
        .filter(|point| point.iter().all(|value| *value > 0.0))
        .map(|point| point.map(f64::ln))
        .collect();
    let count = logs.len() as f64;
    let mean = |axis: usize| logs.iter().map(|point| point[axis]).sum::<f64>() / count;
    let [x, y] = [mean(0), mean(1)];
    let spread: f64 = logs.iter().map(|point| (point[0] - x).powi(2)).sum();
    let product: f64 = logs.iter().map(|point| (point[0] - x) * (point[1] - y)).sum();
    (spread > 0.0).then(|| product / spread)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_has_its_exponent() {
        for power in [0.0, 0.5, 1.0, 2.0] {
            let mut curve = Curve::new("g", "n", "size", "s");
            for size in [1.0_f64, 3.0, 10.0, 200.0] {
                curve.push(size, 7.0 * size.powf(power));
            }
            let found = curve.exponent.unwrap();
            assert!((found - power).abs() < 1e-9, "{found} {power}");
        }
    }

    #[test]
    fn one_size_has_none_and_zero_is_left_out() {
        assert_eq!(exponent(&[[1.0, 2.0]]), None);
        assert_eq!(exponent(&[[0.0, 2.0], [4.0, 2.0]]), None);
        assert_eq!(exponent(&[[0.0, 2.0], [1.0, 2.0], [2.0, 4.0]]), Some(1.0));
    }
}
