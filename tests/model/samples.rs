//! Models to test with, built from numbers.

use i2ris::model::file::{
    FORMAT, FamilyParameters, FitMetrics, HullParameters, ModelFile, OutputMetrics, OutputSpec, OutputUnit,
    SCHEMA_VERSION, TrainingRecord,
};

/// A model file around a family and a hull, with everything else filled in.
pub fn file(outputs: usize, family: FamilyParameters, corners: Vec<Vec<f64>>) -> ModelFile {
    let fit = FitMetrics { r2: 0.99, rmsd: 0.5, nrmsd: 0.01, mae: 0.4, max: 1.5 };
    let names = ["pitch", "yaw", "roll"];
    ModelFile {
        format: FORMAT.to_owned(),
        schema_version: SCHEMA_VERSION,
        robot_id: "bench".to_owned(),
        outputs: names
            .iter()
            .take(outputs)
            .map(|name| OutputSpec { name: (*name).to_owned(), unit: OutputUnit::Deg })
            .collect(),
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
        },
        metrics: vec![OutputMetrics { training: fit, held_out: None }; outputs],
    }
}

/// `output = gain * counts + offset`, degrees, with a variance of 0.25 deg^2.
pub fn linear(gain: &[&[f64]], offset: &[f64]) -> FamilyParameters {
    let outputs = offset.len();
    let covariance = (0..outputs).map(|i| (0..outputs).map(|j| if i == j { 0.25 } else { 0.0 }).collect()).collect();
    FamilyParameters::Linear {
        gain: gain.iter().map(|row| row.to_vec()).collect(),
        offset: offset.to_vec(),
        covariance,
    }
}

/// A square of motor space around 0.
pub fn square(half_width: f64) -> Vec<Vec<f64>> {
    let h = half_width;
    vec![vec![-h, -h], vec![h, -h], vec![h, h], vec![-h, h]]
}
