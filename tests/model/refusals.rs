//! What is wrong with a file is said in one sentence that names the place.

use std::path::Path;

use i2ris::model::file::{FamilyParameters, MixtureParameters, ModelFile, OutputUnit};
use i2ris::model::{Model, ModelError};

use crate::samples::{file, linear, region, square, two_by_two, two_components};

fn refused(file: ModelFile) -> String {
    let text = Model::from_file(file).unwrap_err().to_string();
    assert!(!text.contains('\n'));
    text
}

fn with_mixture(change: impl FnOnce(&mut MixtureParameters)) -> String {
    let mut file = file(1, two_components(), region(1, 300.0));
    let FamilyParameters::Gmr { mixture } = &mut file.family else {
        panic!()
    };
    change(mixture);
    refused(file)
}

fn with_file(change: impl FnOnce(&mut ModelFile)) -> String {
    let mut file = file(2, two_by_two(), square(50.0));
    change(&mut file);
    refused(file)
}

#[track_caller]
fn says(text: &str, parts: &[&str]) {
    assert!(parts.iter().all(|part| text.contains(part)), "{text}");
}

#[test]
fn another_format_or_version_is_named_before_its_fields() {
    let parse = |text: &str| ModelFile::parse(text).unwrap_err().to_string();
    says(
        &parse(r#"{"format": "i2ris-model", "schema_version": 2, "new": 1}"#),
        &["schema_version 2", "reads 1 only"],
    );
    says(
        &parse(r#"{"format": "octave"}"#),
        &["is not a model", "`octave`"],
    );
    says(&parse("{}"), &["is not a model"]);
    says(&parse("pitch,yaw"), &["line 1"]);
    says(
        &with_file(|file| file.schema_version = 7),
        &["schema_version 7"],
    );
    says(&with_file(|file| file.format.clear()), &["is not a model"]);
}

#[test]
fn an_unknown_or_missing_field_is_named() {
    let text = serde_json::to_string(&file(1, two_components(), region(1, 300.0))).unwrap();
    let parse = |from: &str, to: &str| {
        assert!(text.contains(from));
        ModelFile::parse(&text.replacen(from, to, 1))
            .unwrap_err()
            .to_string()
    };
    says(
        &parse("\"robot_id\"", "\"robotid\""),
        &["unknown field `robotid`", "robot_id"],
    );
    says(
        &parse("\"kind\":\"gmr\"", "\"kind\":\"gmr\",\"lag\":1"),
        &["unknown field `lag`"],
    );
    says(
        &parse("\"weights\"", "\"weight\""),
        &["unknown field `weight`"],
    );
    says(
        &parse("\"kind\":\"gmr\"", "\"kind\":\"spline\""),
        &["unknown variant `spline`", "`gmr`"],
    );
    says(&parse("\"seed\":1,", ""), &["missing field `seed`"]);
    says(
        &parse("\"deg\"", "\"rad\""),
        &["unknown variant `rad`", "`deg`"],
    );
}

#[test]
fn a_file_is_named_in_every_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("snake.json");
    says(
        &Model::load(&path).unwrap_err().to_string(),
        &["cannot read model file", "snake.json", "calibrate fit"],
    );
    std::fs::write(&path, "{}").unwrap();
    says(
        &Model::load(&path).unwrap_err().to_string(),
        &["snake.json", "is not a model"],
    );
    let mut bad = file(1, two_components(), region(1, 300.0));
    bad.robot_id = " ".to_owned();
    std::fs::write(&path, serde_json::to_string(&bad).unwrap()).unwrap();
    says(
        &Model::load(&path).unwrap_err().to_string(),
        &["snake.json", "robot_id"],
    );
    assert!(matches!(
        Model::load(Path::new("/")),
        Err(ModelError::Read { .. })
    ));
}

#[test]
fn outputs_and_records_must_fit() {
    says(
        &with_file(|file| file.outputs.clear()),
        &["outputs = 0", "1 to 3"],
    );
    says(
        &with_file(|file| file.outputs[1].name = "pitch".to_owned()),
        &["outputs[1].name", "another output"],
    );
    says(
        &with_file(|file| file.outputs[1].name = "a".repeat(17)),
        &["outputs[1].name", "16 bytes"],
    );
    says(
        &with_file(|file| file.outputs[1].name.clear()),
        &["outputs[1].name", "16 bytes"],
    );
    says(
        &with_file(|file| file.outputs[0].unit = OutputUnit::Mm),
        &["outputs[0].unit", "one unit"],
    );
    says(
        &with_file(|file| file.metrics.truncate(1)),
        &["metrics = 1 entries", "one per output"],
    );
    says(
        &with_file(|file| file.metrics[1].training.r2 = f64::NAN),
        &["metrics[1]", "NaN"],
    );
    says(
        &with_file(|file| file.training.bic = Some(f64::INFINITY)),
        &["training.bic", "inf"],
    );
}

#[test]
fn the_hull_must_have_the_motors_of_the_family() {
    says(
        &with_file(|file| file.hull.corners.clear()),
        &["hull.corners[0]", "1 or 2"],
    );
    says(
        &with_file(|file| file.hull.corners[2].truncate(1)),
        &["hull.corners[2]", "one number per motor"],
    );
    says(
        &with_file(|file| file.hull.corners = region(1, 50.0)),
        &["family.mixture.means[0]", "per motor and output"],
    );
}

#[test]
fn a_mixture_must_be_one() {
    says(
        &with_mixture(|mixture| mixture.weights[0] = 0.3),
        &["family.mixture.weights = sum 0.8", "sum to 1"],
    );
    says(
        &with_mixture(|mixture| mixture.weights = vec![0.0, 1.0]),
        &["weights[0] = 0", "above 0"],
    );
    says(
        &with_mixture(|mixture| mixture.weights[1] = f64::NAN),
        &["weights[1] = NaN"],
    );
    says(
        &with_mixture(|mixture| mixture.means.truncate(1)),
        &["family.mixture.means", "per weight"],
    );
    says(
        &with_mixture(|mixture| mixture.covariances.truncate(1)),
        &["family.mixture.covariances", "per weight"],
    );
    says(
        &with_mixture(|mixture| mixture.means[1].push(1.0)),
        &["means[1]", "3 numbers"],
    );
    says(
        &with_mixture(|mixture| mixture.means[0][1] = f64::INFINITY),
        &["means[0] = inf", "finite"],
    );
    says(
        &with_mixture(|mixture| mixture.means[0][1] = 1e200),
        &["means[0]", "at most 1e15"],
    );
    says(
        &with_mixture(|mixture| mixture.covariances[1][1].truncate(1)),
        &["covariances[1]", "[2, 1]"],
    );
    says(
        &with_mixture(|mixture| mixture.covariances[0][1][1] = f64::NAN),
        &["covariances[0] = NaN"],
    );
    says(
        &with_mixture(|mixture| mixture.weights = vec![0.01; 100]),
        &["100 components", "1 to 64"],
    );
}

#[test]
fn a_covariance_must_be_symmetric_and_positive_definite() {
    says(
        &with_mixture(|mixture| mixture.covariances[0][0][1] = 61.0),
        &["covariances[0][1][0]", "symmetric"],
    );
    let indefinite = |to: f64| {
        with_mixture(|mixture| mixture.covariances[1] = vec![vec![10_000.0, to], vec![to, 9.0]])
    };
    says(&indefinite(301.0), &["covariances[1]", "positive definite"]);
    says(&indefinite(300.0), &["covariances[1]", "positive definite"]);
    says(
        &with_mixture(|mixture| mixture.covariances[1][1][1] = -9.0),
        &["covariances[1][1][1] = -9", "negative"],
    );
    says(
        &with_mixture(|mixture| mixture.covariances[1] = vec![vec![0.0; 2]; 2]),
        &["variances", "positive definite"],
    );
    let tiny = vec![vec![1e-30, 0.0], vec![0.0, 9.0]];
    says(
        &with_mixture(|mixture| mixture.covariances[1] = tiny),
        &["covariances[1] = width 1.0e-15", "too narrow"],
    );
}

#[test]
fn a_linear_model_must_fit_its_sizes() {
    type Rows = Vec<Vec<f64>>;
    let refuse = |change: fn(&mut Rows, &mut Vec<f64>, &mut Rows)| {
        let mut file = file(
            2,
            linear(&[&[0.02, 0.01], &[0.0, 0.03]], &[0.0, 1.0]),
            square(100.0),
        );
        let FamilyParameters::Linear {
            gain,
            offset,
            covariance,
        } = &mut file.family
        else {
            panic!()
        };
        change(gain, offset, covariance);
        refused(file)
    };
    says(
        &refuse(|gain, _, _| gain.truncate(1)),
        &["family.gain = rows of [2] numbers"],
    );
    says(
        &refuse(|gain, _, _| gain[1][1] = f64::NAN),
        &["family.gain = NaN"],
    );
    says(
        &refuse(|gain, _, _| *gain = vec![vec![0.0; 2]; 2]),
        &["family.gain = all 0", "move"],
    );
    says(
        &refuse(|_, offset, _| offset.push(1.0)),
        &["family.offset = 3 numbers"],
    );
    says(
        &refuse(|_, _, covariance| covariance[0][0] = -0.25),
        &["family.covariance[0][0] = -0.25"],
    );
    says(
        &refuse(|_, _, covariance| *covariance = vec![vec![1.0, 2.0], vec![2.0, 1.0]]),
        &["family.covariance", "eigen"],
    );
    // Without any residual there is nothing wrong.
    let mut exact = file(1, linear(&[&[0.02]], &[0.0]), region(1, 100.0));
    let FamilyParameters::Linear { covariance, .. } = &mut exact.family else {
        panic!()
    };
    covariance[0][0] = 0.0;
    assert!(Model::from_file(exact).is_ok());
}

#[test]
fn a_model_whose_inverse_does_not_lead_back_is_refused_with_the_place() {
    // Rises in the middle and dips at both ends: left behind a hump, right behind a drop. A search
    // downwards from the middle ends at the hump, and the conditional mean of the two dips is the
    // middle again.
    let component = |count: f64, deg: f64, width: f64| {
        (
            vec![count, deg],
            vec![
                vec![width * width, 0.02 * width * width],
                vec![0.02 * width * width, 0.01 * width * width],
            ],
        )
    };
    let (means, covariances) = [
        component(-400.0, -10.0, 25.0),
        component(-290.0, 1.0, 20.0),
        component(0.0, 0.0, 90.0),
        component(400.0, -10.0, 25.0),
    ]
    .into_iter()
    .unzip();
    let mixture = MixtureParameters {
        weights: vec![0.25; 4],
        means,
        covariances,
    };
    let bad = file(1, FamilyParameters::Gmr { mixture }, region(1, 440.0));
    let error = Model::from_file(bad).unwrap_err();
    assert!(matches!(
        &error,
        ModelError::NotInvertible { counts, .. } if counts.len() == 1 && counts[0].abs() > 200.0,
    ));
    says(
        &error.to_string(),
        &[
            "the inverse fails at counts [",
            " deg, and one count is worth 0.0",
            "fewer components",
        ],
    );
}

#[test]
fn a_model_of_another_robot_is_refused() {
    let model = Model::from_file(file(1, two_components(), region(1, 300.0))).unwrap();
    assert!(model.check_robot("bench", 1).is_ok());
    says(
        &model.check_robot("theatre", 1).unwrap_err().to_string(),
        &["robot `bench`", "`theatre`"],
    );
    says(
        &model.check_robot("bench", 2).unwrap_err().to_string(),
        &["for 1 motor", "has 2"],
    );
}
