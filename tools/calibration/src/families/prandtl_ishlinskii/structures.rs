//! Structures of the operator: directions, thresholds and growth of the plays.

use i2ris::model::hysteresis::prandtl_ishlinskii::PlayParameters;
use i2ris::units::MotorVec;

/// The smallest and the largest threshold, as parts of half the range of the input. The largest is
/// forgotten over four fifths of the range.
const SMALLEST: f64 = 0.01;
const LARGEST: f64 = 0.8;

/// A half-width may grow by no more than this per count of the input.
const MOST_GROWTH: f64 = 0.8;

/// A direction whose weaker motor has at least this share moves both virtual counts.
const DIAGONAL: f64 = 0.75;

/// A structure that is tried.
#[derive(Debug, Clone, Copy)]
pub(super) struct Structure {
    /// For the report.
    pub name: &'static str,
    /// Beside the axes: shares of the other motor, with both signs.
    shares: &'static [f64],
    /// Thresholds per direction.
    thresholds: usize,
    /// Growth above and below the centre, as multiples of the threshold at the end of the range;
    /// negative where the widths fall.
    growth: &'static [[f64; 2]],
}

const CONSTANT: &[[f64; 2]] = &[[0.0, 0.0]];
const CHANGING: &[[f64; 2]] =
    &[[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 2.0], [-0.7, -0.7], [-0.7, 0.0], [0.0, -0.7]];
const SHARES: &[f64] = &[0.1, 0.3, 0.6];

/// What motion along the axes shows: motor 0 at rest is pulled through its gap by a part of the
/// motion of motor 1. Larger shares need the plane.
const SHARES_ON_AXES: &[f64] = &[0.1];

const ONE_MOTOR: Structure = Structure {
    name: "one motor at a time, constant widths",
    shares: &[],
    thresholds: 10,
    growth: CONSTANT,
};
const ONE_MOTOR_CHANGING: Structure =
    Structure { name: "one motor at a time, changing widths", growth: CHANGING, ..ONE_MOTOR };

/// The structures for motion in the plane, the simplest first.
pub(super) const IN_PLANE: [Structure; 4] = [
    ONE_MOTOR,
    ONE_MOTOR_CHANGING,
    Structure {
        name: "directions between the motors, constant widths",
        shares: SHARES,
        thresholds: 8,
        growth: CONSTANT,
    },
    Structure {
        name: "directions between the motors, changing widths",
        shares: SHARES,
        thresholds: 6,
        growth: CHANGING,
    },
];

/// The structures for motion along one axis at a time, the simplest first.
pub(super) const ON_AXES: [Structure; 4] = [
    ONE_MOTOR,
    ONE_MOTOR_CHANGING,
    Structure {
        name: "motors that pull on each other, constant widths",
        shares: SHARES_ON_AXES,
        ..ONE_MOTOR
    },
    Structure {
        name: "motors that pull on each other, changing widths",
        shares: SHARES_ON_AXES,
        ..ONE_MOTOR_CHANGING
    },
];

impl Structure {
    /// Whether it differs from a simpler one for so many motors.
    pub fn is_for(&self, motors: usize) -> bool {
        motors == 2 || self.shares.is_empty()
    }

    /// The plays for motors with given half ranges, with weight 1.
    pub fn plays(&self, half_ranges: &[f64]) -> Vec<PlayParameters> {
        let directions = directions(half_ranges.len(), self.shares);
        directions
            .iter()
            .flat_map(|direction| along(direction, half_ranges, self.thresholds, self.growth))
            .collect()
    }
}

/// Plays whose lags are features of the residual: of each motor, and along directions between them.
pub(super) fn residual_plays(half_ranges: &[f64]) -> Vec<PlayParameters> {
    let directions = directions(half_ranges.len(), &[0.5]);
    let plays = directions.iter().flat_map(|direction| along(direction, half_ranges, 8, CONSTANT));
    let without_weight =
        plays.map(|play| PlayParameters { weight: vec![0.0; half_ranges.len()], ..play });
    without_weight.collect()
}

/// Directions in the plane of motors whose half ranges are 1.
fn directions(motors: usize, shares: &[f64]) -> Vec<Vec<f64>> {
    if motors == 1 {
        return vec![vec![1.0]];
    }
    let mut directions = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
    for share in shares {
        for share in [*share, -share] {
            directions.push(vec![1.0, share]);
            directions.push(vec![share, 1.0]);
        }
    }
    directions
}

/// The plays along a direction.
fn along(
    direction: &[f64],
    half_ranges: &[f64],
    thresholds: usize,
    growth: &[[f64; 2]],
) -> Vec<PlayParameters> {
    let strongest = strongest(direction);
    // The input is in counts of the strongest motor.
    let scale = half_ranges[strongest];
    let scaled: Vec<f64> = direction
        .iter()
        .zip(half_ranges)
        .map(|(part, half_range)| part * scale / half_range)
        .collect();
    let reach: f64 = direction.iter().map(|part| part.abs() * scale).sum();
    let mut plays = Vec::new();
    for step in 0..thresholds {
        let exponent = step as f64 / (thresholds.max(2) - 1) as f64;
        let threshold = scale * SMALLEST * (LARGEST / SMALLEST).powf(exponent);
        for growth in growth {
            let growth = growth.map(|multiple| multiple * threshold / reach);
            if growth.iter().any(|growth| *growth > MOST_GROWTH) {
                continue;
            }
            plays.push(PlayParameters {
                direction: scaled.clone(),
                threshold_counts: threshold,
                growth,
                weight: weight(direction, half_ranges, strongest),
            });
        }
    }
    plays
}

fn strongest(direction: &[f64]) -> usize {
    let by_share = |a: &usize, b: &usize| direction[*a].abs().total_cmp(&direction[*b].abs());
    (0..direction.len()).rev().max_by(by_share).unwrap_or_default()
}

/// What a play of weight 1 moves: the virtual counts of the strongest motor alone, or of both along
/// a diagonal. With this choice no pair of plays can turn the inverse round.
fn weight(direction: &[f64], half_ranges: &[f64], strongest: usize) -> Vec<f64> {
    let length: f64 = direction.iter().map(|part| part * part).sum();
    let is_diagonal = |part: &f64| part.abs() >= DIAGONAL * direction[strongest].abs();
    let diagonal = direction.len() == 2 && direction.iter().all(is_diagonal);
    let mut weight = vec![0.0; direction.len()];
    for (motor, value) in weight.iter_mut().enumerate() {
        if diagonal {
            *value = direction[motor] / length * half_ranges[motor] / half_ranges[strongest];
        } else if motor == strongest {
            *value = 1.0 / direction[motor];
        }
    }
    weight
}

/// The middle and half of the range of every motor along a path.
pub(super) fn ranges(motors: usize, path: &[MotorVec]) -> Vec<[f64; 2]> {
    let range = |motor: usize| {
        let values = || path.iter().map(|counts| counts[motor]);
        let low = values().fold(f64::INFINITY, f64::min);
        let high = values().fold(f64::NEG_INFINITY, f64::max);
        [(low + high) / 2.0, (high - low) / 2.0]
    };
    (0..motors).map(range).collect()
}
