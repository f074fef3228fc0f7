//! Sample models, built from numbers, and random ones.

use i2ris::model::file::{FORMAT, FamilyParameters, FitMetrics, HullParameters};
use i2ris::model::file::{MixtureParameters, ModelFile, OutputMetrics, OutputSpec};
use i2ris::model::file::{OutputUnit, SCHEMA_VERSION, TrainingRecord};
use i2ris::model::{Memory, Model};
use i2ris::units::MotorVec;
use proptest::prelude::*;

pub const DEG: f64 = std::f64::consts::PI / 180.0;

/// A model file with a family and a hull; all other fields have valid values.
pub fn file(outputs: usize, family: FamilyParameters, corners: Vec<Vec<f64>>) -> ModelFile {
    let fit = FitMetrics { r2: 0.99, rmsd: 0.5, nrmsd: 0.01, mae: 0.4, max: 1.5 };
    let names = ["pitch", "yaw", "roll"];
    let spec = |name: &&str| OutputSpec { name: (*name).to_owned(), unit: OutputUnit::Deg };
    ModelFile {
        slow_error: None,
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
            software: "i2ris 0.1.0".to_owned(),
            ..TrainingRecord::default()
        },
        worthless: None,
        metrics: vec![OutputMetrics { training: fit, held_out: None }; outputs],
    }
}

/// `output = gain * counts + offset`, degrees, with a variance of 0.25 deg^2.
pub fn affine(gain: &[&[f64]], offset: &[f64]) -> FamilyParameters {
    let outputs = offset.len();
    let row = |i| (0..outputs).map(|j| if i == j { 0.25 } else { 0.0 }).collect();
    let covariance = (0..outputs).map(row).collect();
    FamilyParameters::Linear {
        gain: gain.iter().map(|row| row.to_vec()).collect(),
        offset: offset.to_vec(),
        covariance,
    }
}

pub fn two_components() -> FamilyParameters {
    let mixture = MixtureParameters {
        weights: vec![0.4, 0.6],
        means: vec![vec![-100.0, -2.0], vec![150.0, 4.0]],
        covariances: vec![
            vec![vec![2500.0, 60.0], vec![60.0, 4.0]],
            vec![vec![10000.0, 200.0], vec![200.0, 9.0]],
        ],
    };
    FamilyParameters::Gmr { mixture: mixture.into() }
}

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
    FamilyParameters::Gmr { mixture: mixture.into() }
}

pub fn square(half_width: f64) -> Vec<Vec<f64>> {
    let h = half_width;
    vec![vec![-h, -h], vec![h, -h], vec![h, h], vec![-h, h]]
}

/// The hull `[-half_width, half_width]` of one motor, the square of two.
pub fn region(motors: usize, half_width: f64) -> Vec<Vec<f64>> {
    if motors == 1 { vec![vec![-half_width], vec![half_width]] } else { square(half_width) }
}

pub const REACH: f64 = 500.0;

/// A mixture that follows a smooth invertible map: components on a lattice, each tangent to it.
///
/// Every motor `j` contributes `g(x) = x + bend * s * sin(x / s)`, outputs are `gain * g(counts)`.
#[derive(Debug, Clone)]
pub struct SmoothMap {
    /// Degrees per count, one row per output.
    pub gain: Vec<Vec<f64>>,
    /// Relative change of the slope over the range, below 1.
    pub bend: f64,
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

    pub fn straight(gain: &[&[f64]]) -> Self {
        Self { gain: gain.iter().map(|row| row.to_vec()).collect(), bend: 0.0, steps: 1 }
    }

    pub fn family(&self) -> FamilyParameters {
        FamilyParameters::Gmr { mixture: self.mixture().into() }
    }

    pub fn mixture(&self) -> MixtureParameters {
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
        MixtureParameters { weights, means, covariances }
    }

    pub fn of_size(&self, motors: usize, outputs: usize) -> Self {
        let gain = self.gain.iter().take(outputs).map(|row| row[..motors].to_vec());
        Self { gain: gain.collect(), ..self.clone() }
    }

    pub fn file(&self) -> ModelFile {
        file(self.gain.len(), self.family(), region(self.gain[0].len(), REACH))
    }
}

/// Smooth maps of given sizes. Two planes may be oblique. A third output follows both.
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

pub fn position(motors: usize) -> impl Strategy<Value = [f64; 2]> {
    (-REACH..REACH, -REACH..REACH)
        .prop_map(move |(a, b)| if motors == 1 { [a, 0.0] } else { [a, b] })
}

pub fn any_number() -> impl Strategy<Value = f64> {
    let special = [f64::NAN, f64::INFINITY, f64::MAX, -0.0].map(Just);
    let [nan, infinity, max, zero] = special;
    prop_oneof![any::<f64>(), -2.0..2.0_f64, nan, infinity, max, zero]
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

/// Effect of one count of the motor with the larger effect.
pub fn one_count(model: &Model, counts: &MotorVec, memory: &Memory) -> f64 {
    let jacobian = model.jacobian(counts, memory);
    (0..2).map(|motor| distance(&jacobian.map(|row| row[motor]), &[0.0; 3])).fold(0.0, f64::max)
}
