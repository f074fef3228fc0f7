//! Straight lines through points, robust against outliers.
//!
//! Start: median of slopes between points half the stretch apart (after Theil and Sen). Then least
//! squares with Tukey's biweight, its scale from the median absolute deviation (Huber and
//! Ronchetti, Robust Statistics, chapters 5 and 7). Errors of neighbouring points are correlated
//! because they share pixels; the standard deviation is widened accordingly (a first-order
//! autoregressive process with correlation r is worth (1 - r) / (1 + r) of its points).

use i2ris_report::statistics::median;

use crate::image::{Px, across, advance, relative, step};

/// Tukey's constant: 95 % efficiency on normal errors.
const TUKEY: f64 = 4.685;
/// Ratio of the standard deviation to the median absolute deviation of a normal distribution.
const MAD: f64 = 1.4826;
/// Minimum error of an image, px: synthetic images without noise would have none.
const SIGMA_FLOOR: f64 = 0.01;
const ROUNDS: usize = 10;
const MIN_COUNT: usize = 8;

/// A straight line through a stretch of the trace.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FittedLine {
    pub middle: [f64; 2],
    /// Its direction, rad, counter-clockwise in the image.
    pub direction_rad: f64,
    pub std_rad: f64,
    /// Standard deviation of the points across the line, px.
    pub sigma_px: f64,
    /// Length from the first to the last point, px.
    pub length_px: f64,
    /// Change of direction from the middle to the end of a bent stretch, rad.
    pub bend_rad: f64,
    pub bend_std_rad: f64,
    /// Points that the line follows: the sum of their weights.
    pub followed: f64,
}

impl FittedLine {
    /// Point on the line `along` px from its middle.
    pub fn at(&self, along: f64) -> [f64; 2] {
        advance(self.middle, step(self.direction_rad), along)
    }

    /// Fits a line roughly in `direction_rad`. `None` for fewer than 8 points or no extent.
    pub(super) fn fit(points: &[Px], direction_rad: f64) -> Option<Self> {
        let origin = *points.first()?;
        if points.len() < MIN_COUNT {
            return None;
        }
        let (u, v): (Vec<f64>, Vec<f64>) =
            points.iter().map(|p| relative(*p, origin, direction_rad)).map(|[u, v]| (u, v)).unzip();
        let mut fit = WeightedFit::start(&u, &v)?;
        for _ in 0..ROUNDS {
            fit = fit.again(&u, &v)?;
        }
        let [slope_std, bend, bend_std] = fit.uncertainty(&u, &v)?;
        let along = advance(origin, step(direction_rad), fit.mean_u);
        let middle = advance(along, across(direction_rad), fit.mean_v);
        // In the turned frame a change of the slope turns a steep line by less.
        let turned = 1.0 / (1.0 + fit.slope * fit.slope);
        Some(Self {
            middle,
            direction_rad: direction_rad + fit.slope.atan(),
            std_rad: slope_std * turned,
            sigma_px: fit.sigma,
            length_px: (u.last()? - u.first()?).abs(),
            bend_rad: bend * turned,
            bend_std_rad: bend_std * turned,
            followed: fit.weights.iter().sum(),
        })
    }
}

/// A weighted least-squares line `v = mean_v + slope (u - mean_u)`.
struct WeightedFit {
    weights: Vec<f64>,
    mean_u: f64,
    mean_v: f64,
    slope: f64,
    sigma: f64,
}

impl WeightedFit {
    fn start(u: &[f64], v: &[f64]) -> Option<Self> {
        let half = u.len() / 2;
        let slopes = (0..u.len() - half).map(|i| (v[i + half] - v[i]) / (u[i + half] - u[i]));
        let slope = median(&mut slopes.filter(|s| s.is_finite()).collect::<Vec<_>>())?;
        let mut offsets: Vec<f64> = u.iter().zip(v).map(|(u, v)| v - slope * u).collect();
        let offset = median(&mut offsets)?;
        let mut start =
            Self { weights: Vec::new(), mean_u: 0.0, mean_v: offset, slope, sigma: 0.0 };
        start.sigma = start.scale(u, v)?;
        Some(start)
    }

    fn residual(&self, u: f64, v: f64) -> f64 {
        v - self.mean_v - self.slope * (u - self.mean_u)
    }

    fn scale(&self, u: &[f64], v: &[f64]) -> Option<f64> {
        let mut sizes: Vec<_> = u.iter().zip(v).map(|(u, v)| self.residual(*u, *v).abs()).collect();
        Some((MAD * median(&mut sizes)?).max(SIGMA_FLOOR))
    }

    fn again(&self, u: &[f64], v: &[f64]) -> Option<Self> {
        let limit = TUKEY * self.sigma;
        let weight = |r: f64| {
            if r.abs() < limit { (1.0 - (r / limit).powi(2)).powi(2) } else { 0.0 }
        };
        let weights: Vec<_> = u.iter().zip(v).map(|(u, v)| weight(self.residual(*u, *v))).collect();
        let sum: f64 = weights.iter().sum();
        let mean_u = u.iter().zip(&weights).map(|(u, w)| w * u).sum::<f64>() / sum;
        let mean_v = v.iter().zip(&weights).map(|(v, w)| w * v).sum::<f64>() / sum;
        let (mut uu, mut uv) = (0.0, 0.0);
        for ((u, v), w) in u.iter().zip(v).zip(&weights) {
            uu += w * (u - mean_u).powi(2);
            uv += w * (u - mean_u) * (v - mean_v);
        }
        let slope = uv / uu;
        let mut next = Self { weights, mean_u, mean_v, slope, sigma: 0.0 };
        next.sigma = next.scale(u, v)?;
        slope.is_finite().then_some(next)
    }

    /// By the residuals: standard deviation of the slope, and the bend with its own.
    fn uncertainty(&self, u: &[f64], v: &[f64]) -> Option<[f64; 3]> {
        let weights = &self.weights;
        let sum: f64 = weights.iter().sum();
        let centred: Vec<f64> = u.iter().map(|u| u - self.mean_u).collect();
        let moment =
            |power| centred.iter().zip(weights).map(|(u, w)| w * u.powi(power)).sum::<f64>();
        let (m2, m3) = (moment(2), moment(3));
        // The part of u^2 that line and mean do not explain.
        let curved: Vec<f64> = centred.iter().map(|u| u * u - m2 / sum - m3 / m2 * u).collect();
        let cc: f64 = curved.iter().zip(weights).map(|(c, w)| w * c * c).sum();
        let residuals: Vec<f64> = u.iter().zip(v).map(|(u, v)| self.residual(*u, *v)).collect();
        let cr: f64 = curved.iter().zip(&residuals).zip(weights).map(|((c, r), w)| w * c * r).sum();
        let length = (u.last()? - u.first()?).abs();
        let widened = self.sigma * inflation(&residuals, weights).sqrt();
        // A bent stretch scatters around its bend, not around the line.
        let bend = cr / cc;
        let left: Vec<f64> = residuals.iter().zip(&curved).map(|(r, c)| r - bend * c).collect();
        let left_squares: f64 = left.iter().zip(weights).map(|(r, w)| w * r * r).sum();
        let left_sigma = (left_squares / sum * inflation(&left, weights)).sqrt().max(SIGMA_FLOOR);
        // v = ... + bend u^2 turns by twice that per pixel, over half the length.
        Some([widened / m2.sqrt(), bend * length, left_sigma / cc.sqrt() * length])
    }
}

/// Factor by which correlated neighbours increase the variance of a mean.
fn inflation(residuals: &[f64], weights: &[f64]) -> f64 {
    let (mut same, mut next) = (0.0, 0.0);
    for i in 1..residuals.len() {
        same += weights[i] * residuals[i].powi(2);
        next += (weights[i] * weights[i - 1]).sqrt() * residuals[i] * residuals[i - 1];
    }
    let correlation = if same > 0.0 { (next / same).clamp(0.0, 0.9) } else { 0.0 };
    (1.0 + correlation) / (1.0 - correlation)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn points(direction: f64, count: usize, error: impl Fn(usize) -> f64) -> Vec<Px> {
        let along = |i: usize| advance([300.0, 200.0], step(direction), 2.0 * i as f64);
        (0..count).map(|i| advance(along(i), across(direction), error(i))).collect()
    }

    proptest! {
        #[test]
        fn finds_the_direction_of_clean_points(direction in -3.0..3.0_f64, rough in -0.3..0.3_f64) {
            let line = FittedLine::fit(&points(direction, 60, |_| 0.0), direction + rough).unwrap();
            prop_assert!((line.direction_rad - direction).abs() < 1e-9);
            prop_assert!(line.bend_rad.abs() < 1e-6);
        }
    }

    #[test]
    fn a_bent_stretch_shows_its_bend() {
        // A circle of radius 1000 over 198 px turns by 0.099 rad from the middle to the end.
        let line =
            FittedLine::fit(&points(0.4, 100, |i| (2.0 * i as f64).powi(2) / 2000.0), 0.4).unwrap();
        assert!((line.bend_rad - 0.099).abs() < 0.003, "{}", line.bend_rad);
        assert!(line.bend_std_rad < 0.02);
    }

    #[test]
    fn too_few_points_make_no_line() {
        assert!(FittedLine::fit(&points(0.0, 7, |_| 0.0), 0.0).is_none());
        assert!(FittedLine::fit(&[[5.0, 5.0]; 20], 0.0).is_none(), "all in one place");
    }
}
