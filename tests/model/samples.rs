//! Sample models for the tests, built from numbers.

use i2ris::model::file::{
    FORMAT, FamilyParameters, FitMetrics, HullParameters, MixtureParameters, ModelFile,
    OutputMetrics, OutputSpec, OutputUnit, PolynomialParameters, SCHEMA_VERSION, TrainingRecord,
};
use i2ris::model::hysteresis::force_balance::{BalanceMotor, BalanceParameters, BalanceStop};
use i2ris::model::hysteresis::stop::{
    StopAxis, StopElement, StopMotor, StopParameters, StopSegment,
};
use i2ris::model::{Memory, Model};
use i2ris::units::MotorVec;
use proptest::prelude::*;

/// One degree in radians.
pub const DEG: f64 = std::f64::consts::PI / 180.0;

/// A model file with a family and a hull; all other fields have valid values.
pub fn file(outputs: usize, family: FamilyParameters, corners: Vec<Vec<f64>>) -> ModelFile {
    let fit = FitMetrics { r2: 0.99, rmsd: 0.5, nrmsd: 0.01, mae: 0.4, max: 1.5 };
    let names = ["pitch", "yaw", "roll"];
    let spec = |name: &&str| OutputSpec { name: (*name).to_owned(), unit: OutputUnit::Deg };
    ModelFile {
        slow_error: None,
        built_in: None,
        format: FORMAT.to_owned(),
        schema_version: SCHEMA_VERSION,
        robot_id: "bench".to_owned(),
        outputs: names.iter().take(outputs).map(spec).collect(),
        family,
        hull: HullParameters { corners },
        training: TrainingRecord {
            data_file: "recording.csv".to_owned(),
            data_sha256: "0".repeat(64),
            rows: 1000,
            seed: 1,
            restarts: 1,
            log_likelihood: Some(-4.25),
            bic: None,
            software: "i2ris 0.1.0".to_owned(),
            recorded_at: None,
            linear_gain: None,
        },
        worthless: None,
        metrics: vec![OutputMetrics { training: fit, held_out: None }; outputs],
    }
}

/// `output = gain * counts + offset`, degrees, with a variance of 0.25 deg^2.
pub fn linear(gain: &[&[f64]], offset: &[f64]) -> FamilyParameters {
    let outputs = offset.len();
    let covariance = (0..outputs)
        .map(|i| (0..outputs).map(|j| if i == j { 0.25 } else { 0.0 }).collect())
        .collect();
    FamilyParameters::Linear {
        gain: gain.iter().map(|row| row.to_vec()).collect(),
        offset: offset.to_vec(),
        covariance,
    }
}

/// A Gaussian mixture of two components over one motor and one angle.
pub fn two_components() -> FamilyParameters {
    let mixture = MixtureParameters {
        weights: vec![0.4, 0.6],
        means: vec![vec![-100.0, -2.0], vec![150.0, 4.0]],
        covariances: vec![
            vec![vec![2500.0, 60.0], vec![60.0, 4.0]],
            vec![vec![10000.0, 200.0], vec![200.0, 9.0]],
        ],
    };
    FamilyParameters::Gmr { mixture }
}

/// A Gaussian mixture of two components over two motors and two angles.
pub fn two_by_two() -> FamilyParameters {
    let rows = |rows: [[f64; 4]; 4]| rows.iter().map(|row| row.to_vec()).collect();
    let mixture = MixtureParameters {
        weights: vec![0.3, 0.7],
        means: vec![vec![-50.0, 20.0, -1.0, 2.0], vec![80.0, -60.0, 3.0, -2.0]],
        covariances: vec![
            rows([
                [3600.0, 1200.0, 90.0, -18.0],
                [1200.0, 5300.0, 58.0, 113.0],
                [90.0, 58.0, 3.22, 0.41],
                [-18.0, 113.0, 0.41, 3.66],
            ]),
            rows([
                [8100.0, -2700.0, 180.0, 54.0],
                [-2700.0, 3400.0, -85.0, 42.0],
                [180.0, -85.0, 5.46, 0.16],
                [54.0, 42.0, 0.16, 2.45],
            ]),
        ],
    };
    FamilyParameters::Gmr { mixture }
}

/// A square of motor space around 0.
pub fn square(half_width: f64) -> Vec<Vec<f64>> {
    let h = half_width;
    vec![vec![-h, -h], vec![h, -h], vec![h, h], vec![-h, h]]
}

/// The hull `[-half_width, half_width]` of one motor, the square of two.
pub fn region(motors: usize, half_width: f64) -> Vec<Vec<f64>> {
    if motors == 1 { vec![vec![-half_width], vec![half_width]] } else { square(half_width) }
}

/// Half the width of the hull of [`smooth_gmr`].
pub const REACH: f64 = 500.0;

/// A mixture that follows a smooth invertible map: components on a lattice of motor space, each
/// tangent to the map.
///
/// Every motor `j` contributes `g(x) = x + bend * s * sin(x / s)`, and the outputs are `gain *
/// g(counts)`.
#[derive(Debug, Clone)]
pub struct SmoothMap {
    /// Degrees per count, one row per output.
    pub gain: Vec<Vec<f64>>,
    /// Relative change of the slope over the range, below 1.
    pub bend: f64,
    /// Components along each motor.
    pub steps: usize,
}

impl SmoothMap {
    fn curve(&self, count: f64) -> (f64, f64) {
        let s = REACH / 2.5;
        (count + self.bend * s * (count / s).sin(), 1.0 + self.bend * (count / s).cos())
    }

    fn component(&self, at: &[f64], width: f64) -> (Vec<f64>, Vec<Vec<f64>>) {
        let motors = at.len();
        let curves: Vec<_> = at.iter().map(|c| self.curve(*c)).collect();
        let value = |row: &Vec<f64>| row.iter().zip(&curves).map(|(g, c)| g * c.0).sum();
        let mean = at.iter().copied().chain(self.gain.iter().map(value)).collect();
        // Rows of [identity; slope]: counts and outputs as functions of the counts.
        let unit =
            |i: usize| (0..motors).map(|j| if i == j { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
        let slope =
            |row: &Vec<f64>| row.iter().zip(&curves).map(|(g, c)| g * c.1).collect::<Vec<f64>>();
        let rows: Vec<_> = (0..motors).map(unit).chain(self.gain.iter().map(slope)).collect();
        let size = rows.len();
        let dot =
            |i: usize, j: usize| rows[i].iter().zip(&rows[j]).map(|(a, b)| a * b).sum::<f64>();
        let noise = |i: usize, j: usize| if i == j && i >= motors { 0.05 } else { 0.0 };
        let entry = |i: usize, j: usize| width * width * dot(i, j) + noise(i, j);
        (mean, (0..size).map(|i| (0..size).map(|j| entry(i, j)).collect()).collect())
    }

    /// The mixture.
    pub fn family(&self) -> FamilyParameters {
        let motors = self.gain[0].len();
        let spacing = 2.0 * REACH / self.steps as f64;
        let coordinate = |i: usize| -REACH + spacing * (i as f64 + 0.5);
        let rows = if motors == 1 { 1 } else { self.steps };
        let lattice =
            (0..self.steps).flat_map(|i| (0..rows).map(move |j| [coordinate(i), coordinate(j)]));
        let components: Vec<_> =
            lattice.map(|at| self.component(&at[..motors], 0.6 * spacing)).collect();
        let weights = vec![1.0 / components.len() as f64; components.len()];
        let (means, covariances) = components.into_iter().unzip();
        FamilyParameters::Gmr { mixture: MixtureParameters { weights, means, covariances } }
    }

    /// The same for fewer motors or outputs.
    pub fn of_size(&self, motors: usize, outputs: usize) -> Self {
        let gain = self.gain.iter().take(outputs).map(|row| row[..motors].to_vec());
        Self { gain: gain.collect(), ..self.clone() }
    }

    /// The model file, with the hull [`REACH`].
    pub fn file(&self) -> ModelFile {
        file(self.gain.len(), self.family(), region(self.gain[0].len(), REACH))
    }
}

/// Smooth maps of given sizes. Two motors act in two planes that may be oblique. A third output
/// follows both.
pub fn smooth_gmr(motors: usize, outputs: usize) -> impl Strategy<Value = SmoothMap> {
    (0.005..0.05_f64, 0.005..0.05_f64, -0.4..0.4_f64, 0.0..0.4_f64, 1..6_usize).prop_map(
        move |(a, b, skew, bend, steps)| {
            let rows = [vec![a, skew * b], vec![-skew * a, b], vec![0.3 * a, 0.5 * b]];
            let first_motors = |row: &Vec<f64>| row.iter().take(motors).copied().collect();
            let gain = rows.iter().take(outputs).map(first_motors).collect();
            SmoothMap { gain, bend, steps }
        },
    )
}

/// A position in the hull of [`smooth_gmr`].
pub fn position(motors: usize) -> impl Strategy<Value = [f64; 2]> {
    (-REACH..REACH, -REACH..REACH)
        .prop_map(move |(a, b)| if motors == 1 { [a, 0.0] } else { [a, b] })
}

/// Stop operators of a snake with slack and friction, in degrees: a typical sample of [`stops`].
pub fn some_stops(motors: usize) -> StopParameters {
    stops_of(
        motors,
        [0.5, 0.3, 0.2, 0.6],
        [0.2, 0.1, 0.15, 0.25],
        [0.025, 0.03],
        [38.0, 135.0],
        0.08,
        1,
    )
}

fn stops_of(
    motors: usize,
    slack: [f64; 4],
    friction: [f64; 4],
    travel: [f64; 2],
    axes_deg: [f64; 2],
    loose_stiffness: f64,
    count: usize,
) -> StopParameters {
    let motor = |i: usize| StopMotor {
        neutral_counts: [15.0, -20.0][i],
        travel_per_count: travel[i],
        axis_deg: if motors == 1 { 0.0 } else { axes_deg[i] },
        slack: [slack[2 * i], slack[2 * i + 1]],
        friction: [friction[2 * i], friction[2 * i + 1]],
    };
    let stop = |(stiffness, share)| StopElement { stiffness, share };
    StopParameters {
        motors: (0..motors).map(motor).collect(),
        segments: segments(motors, count),
        softness: 0.25,
        loose_stiffness,
        base_friction: 1.1,
        friction_growth: 0.005,
        shared: if motors == 1 { 0.0 } else { 0.25 },
        stops: [(8.0, 0.5), (3.0, 0.3), (1.2, 0.2)].map(stop).into(),
    }
}

/// Segments in series, with friction that increases with the index.
fn segments(motors: usize, count: usize) -> Vec<StopSegment> {
    let segment = |s: usize| {
        let rank = 2.0 * (s as f64 + 1.0) / (count as f64 + 1.0);
        let axis = |_| StopAxis {
            stiffness: 0.15 * count as f64,
            stiffening: 2e-5,
            limit: 45.0 * rank / count as f64,
        };
        StopSegment { axes: (0..motors).map(axis).collect(), friction: rank }
    };
    (0..count).map(segment).collect()
}

/// Stop operators of snakes: slack up to a degree, friction coefficients up to 0.3, oblique axes.
pub fn stops(motors: usize) -> impl Strategy<Value = StopParameters> {
    let slack = prop::array::uniform4(0.0..1.0_f64);
    let friction = prop::array::uniform4(0.0..0.3_f64);
    let travel = prop::array::uniform2(0.02..0.035_f64);
    let axes = (20.0..60.0_f64, 110.0..150.0_f64);
    let loose_and_segments = (0.03..0.2_f64, 1..=3_usize);
    (slack, friction, travel, axes, loose_and_segments).prop_map(
        move |(slack, friction, travel, axes, (loose, segments))| {
            stops_of(motors, slack, friction, travel, [axes.0, axes.1], loose, segments)
        },
    )
}

/// A balance of forces of a snake with slack, backlash and friction: a typical sample of
/// [`balances`].
pub fn some_balance(motors: usize) -> BalanceParameters {
    balance_of(motors, [6.0, 9.0], [-12.0, -6.0, 15.0, 8.0], [0.2, 0.3])
}

/// A model of [`some_balance`] whose outputs are nearly straight.
pub fn balance_file(motors: usize) -> ModelFile {
    let rows = [[0.0, 12.0, -8.0, 0.5, 0.2, 0.1], [1.0, 9.0, 11.0, 0.1, -0.3, 0.2]];
    let one = |row: &[f64; 6]| vec![row[0], row[1], row[3]];
    let row = |row: &[f64; 6]| if motors == 1 { one(row) } else { row.to_vec() };
    let covariance = |i: usize| (0..motors).map(|j| if i == j { 0.01 } else { 0.0 }).collect();
    let family = FamilyParameters::ForceBalance {
        balance: some_balance(motors),
        read_out: PolynomialParameters {
            centre_counts: vec![0.0; motors],
            scale_counts: vec![500.0; motors],
            degree: 2,
            coefficients: rows[..motors].iter().map(row).collect(),
            covariance: (0..motors).map(covariance).collect(),
        },
        virtual_hull: HullParameters { corners: region(motors, 900.0) },
    };
    file(motors, family, region(motors, 1000.0))
}

fn balance_of(
    motors: usize,
    gap: [f64; 2],
    preload: [f64; 4],
    by_tension: [f64; 2],
) -> BalanceParameters {
    let other = |value: f64| if motors == 1 { 0.0 } else { value };
    let motor = |i: usize| BalanceMotor {
        centre_counts: [15.0, -20.0][i],
        travel_per_count: [0.8, 0.9][i],
        neutral: 4.0,
        gap: gap[i],
        coupling: other(0.05),
        preload: [preload[2 * i], preload[2 * i + 1]],
        preload_growth: 10.0,
        stiffness: [1.1, 0.9],
        spring: 0.15,
        hardening: 0.1,
        friction: 25.0,
        friction_by_tension: [by_tension[i], 0.2],
        friction_by_other: other(0.03),
        friction_growth: [0.2, other(0.1)],
        friction_slope: 0.1,
        friction_asymmetry: -0.1,
    };
    let stop = |(stiffness, share)| BalanceStop { stiffness, share, yields: stiffness == 3.0 };
    let shared = [(3.0, 0.2), (1.5, 0.3)].map(stop);
    BalanceParameters {
        motors: (0..motors).map(motor).collect(),
        own_stops: [(10.0, 0.4), (3.0, 0.4), (1.0, 0.2)].map(stop).into(),
        shared_stops: if motors == 1 { Vec::new() } else { shared.into() },
        loose_stiffness: 0.08,
        softness: 8.0,
        friction_stays: 0.3,
    }
}

/// Balances of forces of snakes: taut and slack, with and without backlash.
pub fn balances(motors: usize) -> impl Strategy<Value = BalanceParameters> {
    let gap = prop::array::uniform2(0.0..60.0_f64);
    let preload = prop::array::uniform4(-60.0..80.0_f64);
    let by_tension = prop::array::uniform2(0.0..0.6_f64);
    (gap, preload, by_tension)
        .prop_map(move |(gap, preload, by_tension)| balance_of(motors, gap, preload, by_tension))
}

/// Any number, also one that is none.
pub fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        any::<f64>(),
        -2.0..2.0_f64,
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(f64::MAX),
        Just(-0.0)
    ]
}

pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

pub fn memory_after(model: &Model, path: &[MotorVec]) -> Memory {
    let mut memory = model.new_memory();
    for counts in path {
        model.advance(&mut memory, counts);
    }
    memory
}

/// What one count of the motor with the larger effect is worth.
pub fn one_count(model: &Model, counts: &MotorVec, memory: &Memory) -> f64 {
    let jacobian = model.jacobian(counts, memory);
    (0..2).map(|motor| distance(&jacobian.map(|row| row[motor]), &[0.0; 3])).fold(0.0, f64::max)
}

/// The Jacobian is the numerical derivative.
#[track_caller]
pub fn assert_jacobian(model: &Model, at: MotorVec, memory: &Memory, tolerance: [f64; 2]) {
    const STEP: f64 = 0.01;
    let jacobian = model.jacobian(&at, memory);
    for motor in 0..model.motors() {
        let [behind, ahead] = [-STEP, STEP].map(|by| {
            let mut there = at;
            there[motor] += by;
            model.predict(&there, memory).mean
        });
        for output in 0..model.outputs() {
            let difference = (ahead[output] - behind[output]) / (2.0 * STEP);
            let found = jacobian[output][motor];
            let [relative, absolute] = tolerance;
            let is_near = (found - difference).abs() <= relative * found.abs() + absolute;
            assert!(is_near, "{found} is not {difference}");
        }
    }
}
