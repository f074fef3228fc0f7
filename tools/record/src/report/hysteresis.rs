//! Hysteresis loops: counts against angle.
//!
//! Every output is drawn over the counts along the direction in which it changes most. This is the
//! gradient of the plane that fits the output best (least squares). The distance from the plane
//! shows the loop. Its two branches are the samples with rising and with falling counts.

use i2ris_report::statistics::{mean, min_max, quantile_of_unsorted};
use serde::Serialize;

use super::trial::Trial;

/// Minimum motion that has a direction, counts.
const TURN_COUNTS: f64 = 3.0;
/// Bins along the stroke for the width of the loop.
const BINS: usize = 24;
/// Minimum number of samples of a branch in a bin.
const MIN_SAMPLES: usize = 5;
/// Counts further apart in time than this are not interpolated, ns.
const GAP_NS: u64 = 20_000_000;

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HysteresisLoop {
    pub output: &'static str,
    /// Source of the angles: `camera` or `estimate`.
    pub from: &'static str,
    /// Degrees per count along the direction in which the output changes most.
    pub slope_deg_per_count: f64,
    /// Median of falling less rising branch, degrees; positive: the output lags behind the motors.
    pub width_deg: Option<f64>,
    /// Counts along the direction, angle, distance from the plane, in the order of time.
    #[serde(skip)]
    pub rising: Vec<[f64; 3]>,
    #[serde(skip)]
    pub falling: Vec<[f64; 3]>,
}

pub fn hysteresis_loops(trial: &Trial) -> Vec<HysteresisLoop> {
    let (from, angles) = trial.observed();
    let mut loops = Vec::new();
    for (axis, output) in ["pitch", "yaw"].into_iter().enumerate() {
        let row = |(stamp, angles): &(u64, [f64; 2])| {
            Some((trial.counts.value_at(*stamp, GAP_NS)?, angles[axis]))
        };
        let rows: Vec<Row> = angles.iter().filter_map(row).collect();
        loops.extend(hysteresis_loop(&rows, output, from));
    }
    loops
}

/// Counts, and the angle there.
type Row = ([f64; 2], f64);

fn hysteresis_loop(
    rows: &[Row],
    output: &'static str,
    from: &'static str,
) -> Option<HysteresisLoop> {
    let plane = Plane::fit(rows)?;
    let (mut rising, mut falling) = (Vec::new(), Vec::new());
    let (mut turn, mut is_rising) = (plane.along(&rows.first()?.0), None);
    for (counts, angle) in rows {
        let along = plane.along(counts);
        // The direction changes when the motors have moved by more than noise.
        if (along - turn).abs() > TURN_COUNTS {
            is_rising = Some(along > turn);
            turn = along;
        }
        let row = [along, *angle, angle - plane.value(counts)];
        match is_rising {
            Some(true) => rising.push(row),
            Some(false) => falling.push(row),
            None => {}
        }
    }
    Some(HysteresisLoop {
        output,
        from,
        slope_deg_per_count: plane.slope(),
        width_deg: loop_width(&rising, &falling),
        rising,
        falling,
    })
}

/// An angle as an affine function of the counts.
struct Plane {
    center: [f64; 2],
    center_value: f64,
    gain: [f64; 2],
}

impl Plane {
    /// The least-squares plane; `None` if the motors did not move enough.
    fn fit(rows: &[Row]) -> Option<Self> {
        let average = |of: &dyn Fn(&Row) -> f64| mean(rows.iter().map(of));
        let center = [average(&|row| row.0[0])?, average(&|row| row.0[1])?];
        let center_value = average(&|row| row.1)?;
        let product =
            |i: usize, j: usize| average(&|row| (row.0[i] - center[i]) * (row.0[j] - center[j]));
        let with = |i: usize| average(&|row| (row.0[i] - center[i]) * (row.1 - center_value));
        // A small term keeps the system regular if a motor did not move.
        let (a, b, d) = (product(0, 0)? + 1e-6, product(0, 1)?, product(1, 1)? + 1e-6);
        let (x, y) = (with(0)?, with(1)?);
        let determinant = a * d - b * b;
        let plane = Self {
            center,
            center_value,
            gain: [(d * x - b * y) / determinant, (a * y - b * x) / determinant],
        };
        let slope = plane.slope();
        (rows.len() > 1 && slope.is_finite() && slope > 1e-9).then_some(plane)
    }

    fn slope(&self) -> f64 {
        self.gain[0].hypot(self.gain[1])
    }

    fn value(&self, counts: &[f64; 2]) -> f64 {
        self.center_value
            + self.gain[0] * (counts[0] - self.center[0])
            + self.gain[1] * (counts[1] - self.center[1])
    }

    /// Counts along the gradient.
    fn along(&self, counts: &[f64; 2]) -> f64 {
        (self.gain[0] * counts[0] + self.gain[1] * counts[1]) / self.slope()
    }
}

/// The mean distance between the branches in each bin of the stroke; the median of all bins.
fn loop_width(rising: &[[f64; 3]], falling: &[[f64; 3]]) -> Option<f64> {
    let [a, b] = [rising, falling].map(|branch| min_max(branch.iter().map(|row| row[0])));
    let (low, high) = (a.0.max(b.0), a.1.min(b.1));
    if !(high - low).is_finite() || high <= low {
        return None;
    }
    let bin_means = |branch: &[[f64; 3]]| {
        let mut sums = [(0.0, 0usize); BINS];
        for [along, _, distance] in branch.iter().filter(|row| (low..high).contains(&row[0])) {
            let bin = ((along - low) / (high - low) * BINS as f64) as usize;
            let (sum, count) = &mut sums[bin.min(BINS - 1)];
            *sum += distance;
            *count += 1;
        }
        sums.map(|(sum, count)| (count >= MIN_SAMPLES).then(|| sum / count as f64))
    };
    let branches = bin_means(falling).into_iter().zip(bin_means(rising));
    let widths = branches.filter_map(|(falling, rising)| Some(falling? - rising?));
    // Which branch is above depends on the direction of the stroke.
    quantile_of_unsorted(&mut widths.collect::<Vec<_>>(), 0.5).map(f64::abs)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A play of half-width 30 counts on both motors, at 0.02 degrees per count along the first
    /// diagonal.
    fn trial(half_width: f64) -> Trial {
        let mut trial = Trial::default();
        let mut play = 0.0_f64;
        for k in 0..20_000u64 {
            let q = 500.0 * (k as f64 * 0.002).sin();
            play = (q - half_width).max((q + half_width).min(play));
            let stamp = k * 1_000_000;
            trial.counts.push(stamp, [q, q]);
            trial.measured.push(stamp, [0.02 * play, -0.02 * play]);
        }
        trial
    }

    #[test]
    fn the_width_of_a_play_is_found() {
        let loops = hysteresis_loops(&trial(30.0));
        assert_eq!(loops.len(), 2);
        for found in loops {
            // Both motors move alike: along the diagonal the slope is lower by the root of 2.
            let slope = found.slope_deg_per_count;
            assert!((slope - 0.02 / 2f64.sqrt()).abs() < 5e-4, "{slope}");
            // Two half-widths at 0.02 degrees per count. Yaw falls where pitch rises, and lags too.
            let width = found.width_deg.unwrap();
            assert!((width - 1.2).abs() < 0.06, "{width}");
            assert!(found.rising.len() > 5000 && found.falling.len() > 5000);
        }
    }

    #[test]
    fn loop_has_no_width_without_play_and_needs_motion() {
        let widths = hysteresis_loops(&trial(0.0)).into_iter().map(|found| found.width_deg);
        assert!(widths.flatten().all(|width| width.abs() < 1e-6));
        assert!(hysteresis_loops(&Trial::default()).is_empty());
        let mut still = Trial::default();
        for k in 0..100 {
            still.counts.push(k * 1_000_000, [5.0, 5.0]);
            still.measured.push(k * 1_000_000, [1.0, 1.0]);
        }
        assert!(hysteresis_loops(&still).is_empty());
    }
}
