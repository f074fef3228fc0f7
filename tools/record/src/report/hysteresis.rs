//! Counts against angle: the loop, and how wide it is.
//!
//! Every output is drawn over the counts along the direction in which it changes most: the slope of
//! the plane that fits it best (least squares). What is left when the plane is taken off is the
//! loop; its two branches are told apart by the sense in which the counts move.

use serde::Serialize;

use super::trial::Trial;

/// Samples closer than this, counts, do not tell in which sense a motor moves.
const TURN_COUNTS: f64 = 3.0;

/// The width is taken in so many bins along the stroke, between branches that have so many samples
/// each.
const BINS: usize = 24;
const FEWEST: usize = 5;

/// Samples that count have a count and an angle this close in time.
const GAP_NS: u64 = 20_000_000;

/// The loop of one output.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Loop {
    /// Pitch or yaw.
    pub output: &'static str,
    /// What the angles are from: `camera` or `estimate`.
    pub from: &'static str,
    /// Degrees per count along the direction in which the output changes most.
    pub slope_deg_per_count: f64,
    /// How far the branch on the way down lies above the one on the way up, median along the
    /// stroke, degrees. Positive: the output lags behind the motors.
    pub width_deg: Option<f64>,
    /// Counts along the direction, angle, distance from the plane; on the way up, in the order of
    /// time.
    #[serde(skip)]
    pub rising: Vec<[f64; 3]>,
    /// The same on the way down.
    #[serde(skip)]
    pub falling: Vec<[f64; 3]>,
}

/// The loops of pitch and yaw, of what the camera saw, or of the model's estimate where there is no
/// camera.
pub fn loops(trial: &Trial) -> Vec<Loop> {
    let (from, angles) = if trial.camera.is_empty() {
        ("estimate", &trial.measured)
    } else {
        ("camera", &trial.camera)
    };
    let rows: Vec<([f64; 2], [f64; 2])> = angles
        .iter()
        .filter_map(|(stamp, angle)| Some((trial.counts.at(*stamp, GAP_NS)?, *angle)))
        .collect();
    ["pitch", "yaw"]
        .into_iter()
        .enumerate()
        .filter_map(|(axis, output)| one(&rows, axis, output, from))
        .collect()
}

fn one(
    rows: &[([f64; 2], [f64; 2])],
    axis: usize,
    output: &'static str,
    from: &'static str,
) -> Option<Loop> {
    let plane = Plane::fitted(rows.iter().map(|(counts, angles)| (*counts, angles[axis])))?;
    let (mut rising, mut falling) = (Vec::new(), Vec::new());
    let (mut turn, mut upwards) = (plane.along(&rows.first()?.0), None);
    for (counts, angles) in rows {
        let along = plane.along(counts);
        // A turn counts once the motors have come back by more than noise.
        if (along - turn).abs() > TURN_COUNTS {
            upwards = Some(along > turn);
            turn = along;
        }
        let row = [along, angles[axis], angles[axis] - plane.at(counts)];
        match upwards {
            Some(true) => rising.push(row),
            Some(false) => falling.push(row),
            None => {}
        }
    }
    let width_deg = width(&rising, &falling);
    Some(Loop {
        output,
        from,
        slope_deg_per_count: plane.slope(),
        width_deg,
        rising,
        falling,
    })
}

/// Counts, and the angle there.
type Row = ([f64; 2], f64);

/// An angle as an affine function of the counts.
struct Plane {
    middle: [f64; 2],
    value: f64,
    gain: [f64; 2],
}

impl Plane {
    /// By least squares; `None`: the motors did not move, or not enough to tell.
    fn fitted(rows: impl Iterator<Item = Row> + Clone) -> Option<Self> {
        let count = rows.clone().count() as f64;
        let sum = |of: &dyn Fn(&Row) -> f64| rows.clone().map(|row| of(&row)).sum::<f64>() / count;
        let (middle, value) = (
            [sum(&|row| row.0[0]), sum(&|row| row.0[1])],
            sum(&|row| row.1),
        );
        let product =
            |i: usize, j: usize| sum(&|row| (row.0[i] - middle[i]) * (row.0[j] - middle[j]));
        let with = |i: usize| sum(&|row| (row.0[i] - middle[i]) * (row.1 - value));
        // A motor that stands still says nothing: a little is added to keep the system regular.
        let (a, b, d) = (product(0, 0) + 1e-6, product(0, 1), product(1, 1) + 1e-6);
        let determinant = a * d - b * b;
        let gain = [
            (d * with(0) - b * with(1)) / determinant,
            (a * with(1) - b * with(0)) / determinant,
        ];
        let slope = gain[0].hypot(gain[1]);
        (count > 1.0 && slope.is_finite() && slope > 1e-9).then_some(Self {
            middle,
            value,
            gain,
        })
    }

    fn slope(&self) -> f64 {
        self.gain[0].hypot(self.gain[1])
    }

    fn at(&self, counts: &[f64; 2]) -> f64 {
        self.value
            + self.gain[0] * (counts[0] - self.middle[0])
            + self.gain[1] * (counts[1] - self.middle[1])
    }

    fn along(&self, counts: &[f64; 2]) -> f64 {
        (self.gain[0] * counts[0] + self.gain[1] * counts[1]) / self.slope()
    }
}

/// Median over the bins of the stroke of the mean distance between the branches.
fn width(rising: &[[f64; 3]], falling: &[[f64; 3]]) -> Option<f64> {
    let reach = |branch: &[[f64; 3]]| {
        branch
            .iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], row| {
                [low.min(row[0]), high.max(row[0])]
            })
    };
    let ([a, b], [c, d]) = (reach(rising), reach(falling));
    let (low, high) = (a.max(c), b.min(d));
    if !(high - low).is_finite() || high <= low {
        return None;
    }
    let bin = |row: &[f64; 3]| ((row[0] - low) / (high - low) * BINS as f64) as usize;
    let means = |branch: &[[f64; 3]]| {
        let mut sums = [(0.0, 0usize); BINS];
        for row in branch.iter().filter(|row| (low..high).contains(&row[0])) {
            let (sum, count) = &mut sums[bin(row).min(BINS - 1)];
            *sum += row[2];
            *count += 1;
        }
        sums.map(|(sum, count)| (count >= FEWEST).then(|| sum / count as f64))
    };
    let mut widths: Vec<f64> = means(falling)
        .into_iter()
        .zip(means(rising))
        .filter_map(|(down, up)| Some(down? - up?))
        .collect();
    widths.sort_by(f64::total_cmp);
    (!widths.is_empty()).then(|| i2ris_plot::series::percentile(&widths, 0.5))
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
        let loops = loops(&trial(30.0));
        assert_eq!(loops.len(), 2);
        for (own, sign) in loops.iter().zip([1.0, -1.0]) {
            // Both motors move alike, so the direction is the diagonal: the slope is that of either
            // over the root of 2.
            assert!(
                (own.slope_deg_per_count - 0.02 / 2f64.sqrt()).abs() < 5e-4,
                "{}",
                own.slope_deg_per_count
            );
            let width = own.width_deg.unwrap();
            // Two half-widths at 0.02 degrees a count; yaw falls where pitch rises, and lags all
            // the same.
            assert!((width - 1.2).abs() < 0.06, "{width} {sign}");
            assert!(own.rising.len() > 5000 && own.falling.len() > 5000);
        }
    }

    #[test]
    fn without_play_there_is_no_width_and_without_motion_no_loop() {
        assert!(
            loops(&trial(0.0))
                .iter()
                .all(|own| own.width_deg.unwrap().abs() < 1e-6)
        );
        assert!(loops(&Trial::default()).is_empty());
        let mut still = Trial::default();
        (0..100).for_each(|k| {
            still.counts.push(k * 1_000_000, [5.0, 5.0]);
            still.measured.push(k * 1_000_000, [1.0, 1.0]);
        });
        assert!(loops(&still).is_empty());
    }
}
