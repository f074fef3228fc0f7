//! The straight pose: reference of the angles.

use i2ris_report::statistics;

use crate::fibre::Reading;

/// Minimum number of good frames at rest.
const MIN_COUNT: usize = 5;
/// Maximum spread, deg; more means that it moved or cannot be measured.
const MAX_SPREAD_DEG: f64 = 0.3;
/// Ratio of the standard deviation to the median absolute deviation of a normal distribution.
const MAD: f64 = 1.4826;

/// Straight pose in one view: medians over some frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestPose {
    /// Angle between base and tip, deg: offset of fibre and joint zero.
    pub angle_deg: f64,
    /// Standard deviation of a single frame, deg.
    pub spread_deg: f64,
    /// Length from the border of the frame along the fibre to its end, px.
    pub length_px: f64,
    /// End of the fibre, px.
    pub tip_px: [f64; 2],
}

/// Reason why there is no rest reference.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RestPoseError {
    #[error(
        "view {view}: only {good} of {frames} frames at rest can be measured, \
         {MIN_COUNT} are needed; look at them with --overlays"
    )]
    TooFew { view: String, good: usize, frames: usize },
    #[error(
        "view {view}: the angle spreads by {spread_deg:.2} deg at rest, \
         more than {MAX_SPREAD_DEG}: hold the snake straight and still, or shorten --rest-s"
    )]
    Moving { view: String, spread_deg: f64 },
}

/// Collects frames at rest.
#[derive(Debug, Clone, Default)]
pub struct RestPoseEstimator {
    frames: usize,
    angles: Vec<f64>,
    lengths: Vec<f64>,
    tips: [Vec<f64>; 2],
}

impl RestPoseEstimator {
    /// Takes one frame's reading; `None` or one of low quality counts as a frame only.
    pub fn add(&mut self, reading: Option<&Reading>) {
        self.frames += 1;
        if let Some(reading) = reading.filter(|reading| reading.is_good()) {
            self.angles.push(reading.angle_rad.to_degrees());
            self.lengths.push(reading.length_px);
            self.tips[0].push(reading.tip_px[0]);
            self.tips[1].push(reading.tip_px[1]);
        }
    }

    pub fn finish(&self, view: &str) -> Result<RestPose, RestPoseError> {
        let good = self.angles.len();
        if good < MIN_COUNT {
            return Err(RestPoseError::TooFew { view: view.to_owned(), good, frames: self.frames });
        }
        let angle_deg = median(&self.angles);
        let deviations: Vec<f64> = self.angles.iter().map(|a| (a - angle_deg).abs()).collect();
        // This detects a slow drift over the whole time, which the median deviation does not.
        let half = good / 2;
        let drift = (median(&self.angles[..half]) - median(&self.angles[half..])).abs();
        let spread_deg = (MAD * median(&deviations)).max(drift);
        if spread_deg > MAX_SPREAD_DEG {
            return Err(RestPoseError::Moving { view: view.to_owned(), spread_deg });
        }
        let tip_px = [median(&self.tips[0]), median(&self.tips[1])];
        Ok(RestPose { angle_deg, spread_deg, length_px: median(&self.lengths), tip_px })
    }
}

/// The middle value of at least one.
fn median(values: &[f64]) -> f64 {
    statistics::median(&mut values.to_vec()).unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fibre::FittedLine;

    fn reading(angle_deg: f64, quality: f64) -> Reading {
        let line = FittedLine { length_px: 1.0, followed: 1.0, ..FittedLine::default() };
        Reading {
            angle_rad: angle_deg.to_radians(),
            std_rad: 0.001,
            tip_px: [600.0, 300.0 + angle_deg],
            base: line,
            tip: line,
            length_px: 900.0,
            quality,
            issue: None,
            trace: Vec::new(),
        }
    }

    fn estimator(angles: impl IntoIterator<Item = f64>) -> RestPoseEstimator {
        let mut estimator = RestPoseEstimator::default();
        angles.into_iter().for_each(|angle| estimator.add(Some(&reading(angle, 0.9))));
        estimator
    }

    #[test]
    fn reference_ignores_outliers_and_reports_its_spread() {
        let rest = estimator(
            (0..40).map(|i| if i % 10 == 0 { 20.0 } else { 1.5 + 0.02 * f64::from(i % 3 - 1) }),
        );
        let rest = rest.finish("top").unwrap();
        assert!((rest.angle_deg - 1.5).abs() < 0.021 && rest.spread_deg < 0.05, "{rest:?}");
        assert!((rest.length_px, rest.tip_px[0]) == (900.0, 600.0));
    }
}
