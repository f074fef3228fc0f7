//! Synthetic models of any size: two motors that bend two planes by about 40 degrees in both
//! directions.

use i2ris::model::file::{
    FORMAT, FamilyParameters, FitMetrics, HullParameters, MixtureParameters, ModelFile,
    OutputMetrics, OutputSpec, OutputUnit, SCHEMA_VERSION, TrainingRecord,
};
use i2ris::model::hysteresis::backlash_play::PlayParameters;
use i2ris::model::hysteresis::prandtl_ishlinskii::{
    PlayParameters as GeneralisedPlay, PrandtlIshlinskiiParameters,
};
use i2ris::model::hysteresis::residual::{ResidualParameters, count};
use i2ris::model::hysteresis::stop::{
    StopAxis, StopElement, StopMotor, StopParameters, StopSegment,
};
use i2ris::model::{Model, ModelError};

/// Half the width of the hull, counts.
const REACH: f64 = 1500.0;

/// Degrees per count of each motor in the direction that it bends.
const GAIN_DEG: f64 = 0.022;

/// The largest threshold of a play, counts.
const WIDEST: f64 = 120.0;

/// Stops per segment of a model with stops.
const STOPS: usize = 3;

/// What a model remembers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operators {
    /// Plays per motor beside the one of threshold 0: `gmr-play`; none: `gmr`.
    Plays(usize),
    /// Segments of three stops: `gmr-stop`.
    Stops(usize),
    /// Generalised plays in each of two directions: `gmr-prandtl-ishlinskii`.
    GeneralisedPlays(usize),
}

impl Operators {
    /// Number of lags of the operator.
    fn lags(self) -> usize {
        match self {
            Self::Plays(plays) | Self::GeneralisedPlays(plays) => 2 * plays,
            Self::Stops(segments) => segments * STOPS * 4 + 2,
        }
    }
}

/// A model with a mixture of `components` and the given operators.
pub fn model(components: usize, operators: Operators) -> Result<Model, ModelError> {
    let mixture = mixture(components);
    let square = |reach: f64| HullParameters {
        corners: [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|corner: [f64; 2]| corner.map(|c| c * reach).to_vec())
            .to_vec(),
    };
    let hull = square(REACH);
    let residual = Some(residual(operators.lags()));
    let virtual_hull = hull.clone();
    let family = match operators {
        Operators::Plays(0) => FamilyParameters::Gmr { mixture },
        Operators::Plays(plays) => FamilyParameters::GmrPlay {
            plays: play_parameters(plays),
            mixture,
            residual,
            virtual_hull,
        },
        Operators::Stops(segments) => FamilyParameters::GmrStop {
            stops: stop_parameters(segments),
            mixture,
            residual,
            // Stops at the limits of the joints take virtual counts beyond those of the motors.
            virtual_hull: square(1.2 * REACH),
        },
        Operators::GeneralisedPlays(plays) => FamilyParameters::GmrPrandtlIshlinskii {
            operator: generalised_plays(plays),
            mixture,
            residual,
            virtual_hull,
        },
    };
    Model::from_file(file(family, hull))
}

/// The map that the mixture approximates: angles, deg, and their slope at counts. The planes lie at
/// 45 degrees to the motors, and the slope changes with the counts.
fn map(counts: [f64; 2]) -> ([f64; 2], [[f64; 2]; 2]) {
    let s = REACH / 2.0;
    let curve = |c: f64| (c + 0.25 * s * (c / s).sin(), 1.0 + 0.25 * (c / s).cos());
    let [(a, a_slope), (b, b_slope)] = counts.map(curve);
    let gain = GAIN_DEG * 0.5_f64.sqrt();
    (
        [gain * (a - b), gain * (a + b)],
        [[gain * a_slope, -gain * b_slope], [gain * a_slope, gain * b_slope]],
    )
}

/// Components on a spiral over the hull, each tangent to the map.
fn mixture(components: usize) -> MixtureParameters {
    const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
    let width = 1.1 * REACH / (components as f64).sqrt();
    let center = |k: usize| {
        let (radius, angle) =
            (REACH * ((k as f64 + 0.5) / components as f64).sqrt(), GOLDEN_ANGLE * k as f64);
        [radius * angle.cos(), radius * angle.sin()]
    };
    let mean = |k: usize| center(k).into_iter().chain(map(center(k)).0).collect();
    let covariance = |k: usize| {
        let slope = map(center(k)).1;
        let rows = [[1.0, 0.0], [0.0, 1.0], slope[0], slope[1]];
        let noise = |i: usize, j: usize| if i == j && i >= 2 { 0.04 } else { 0.0 };
        let entry = |i: usize, j: usize| {
            width * width * (rows[i][0] * rows[j][0] + rows[i][1] * rows[j][1]) + noise(i, j)
        };
        (0..4).map(|i| (0..4).map(|j| entry(i, j)).collect()).collect()
    };
    MixtureParameters {
        weights: vec![1.0 / components as f64; components],
        means: (0..components).map(mean).collect(),
        covariances: (0..components).map(covariance).collect(),
    }
}

fn play_parameters(plays: usize) -> PlayParameters {
    let thresholds: Vec<f64> = (0..=plays).map(|j| WIDEST * j as f64 / plays as f64).collect();
    let weights: Vec<f64> =
        (0..=plays).map(|j| if j == 0 { 0.4 } else { 0.6 / plays as f64 }).collect();
    PlayParameters {
        thresholds_counts: vec![thresholds; 2],
        weights: vec![weights; 2],
        planar_thresholds_counts: Vec::new(),
    }
}

/// Half of the plays act on each motor; half-widths grow by a twentieth of the bend.
fn generalised_plays(plays: usize) -> PrandtlIshlinskiiParameters {
    let play = |motor: usize, j: usize| {
        let on_motor = |value: f64| (0..2).map(move |i| if i == motor { value } else { 0.0 });
        GeneralisedPlay {
            direction: on_motor(1.0).collect(),
            threshold_counts: WIDEST * (j + 1) as f64 / plays as f64,
            growth: [0.05, 0.05],
            weight: on_motor(0.6 / plays as f64).collect(),
        }
    };
    PrandtlIshlinskiiParameters {
        centre_counts: vec![0.0; 2],
        direct_weights: vec![0.4; 2],
        plays: (0..2).flat_map(|motor| (0..plays).map(move |j| play(motor, j))).collect(),
    }
}

/// A snake with slack and friction, in degrees.
fn stop_parameters(segments: usize) -> StopParameters {
    let motor = |axis_deg: f64| StopMotor {
        neutral_counts: 0.0,
        travel_per_count: 0.028,
        axis_deg,
        slack: [0.4, 0.4],
        friction: [0.15, 0.15],
    };
    let segment = |s: usize| {
        let rank = 2.0 * (s as f64 + 1.0) / (segments as f64 + 1.0);
        let axis = StopAxis {
            stiffness: 0.15 * segments as f64,
            stiffening: 2e-5,
            limit: 60.0 * rank / segments as f64,
        };
        StopSegment { axes: vec![axis; 2], friction: rank }
    };
    let stop = |(stiffness, share)| StopElement { stiffness, share };
    StopParameters {
        motors: [45.0, 135.0].map(motor).into(),
        segments: (0..segments).map(segment).collect(),
        softness: 0.25,
        loose_stiffness: 0.08,
        base_friction: 1.1,
        friction_growth: 0.005,
        shared: 0.25,
        stops: [(8.0, 0.5), (3.0, 0.3), (1.2, 0.2)].map(stop).into(),
    }
}

/// A residual with as many coefficients as a fit finds. It is small.
fn residual(lags: usize) -> ResidualParameters {
    let (shape_degree, lag_degree) = (5, 2);
    let features = count::<2>(shape_degree, lag_degree, lags);
    let coefficients = (0..2)
        .map(|i| (0..features).map(|j| 0.01 * ((i + 3 * j) as f64).sin()).collect())
        .collect();
    ResidualParameters { scale_counts: REACH, shape_degree, lag_degree, coefficients }
}

fn file(family: FamilyParameters, hull: HullParameters) -> ModelFile {
    let fit = FitMetrics { r2: 1.0, rmsd: 0.0, nrmsd: 0.0, mae: 0.0, max: 0.0 };
    ModelFile {
        slow_error: None,
        format: FORMAT.to_owned(),
        schema_version: SCHEMA_VERSION,
        robot_id: "bench".to_owned(),
        outputs: ["pitch", "yaw"]
            .map(|name| OutputSpec { name: name.to_owned(), unit: OutputUnit::Deg })
            .to_vec(),
        family,
        hull,
        training: TrainingRecord {
            data_file: "none".to_owned(),
            data_sha256: "0".repeat(64),
            rows: 0,
            seed: 0,
            restarts: 0,
            log_likelihood: None,
            bic: None,
            software: "i2ris-bench".to_owned(),
            linear_gain: None,
        },
        worthless: None,
        metrics: vec![OutputMetrics { training: fit, held_out: None }; 2],
    }
}
