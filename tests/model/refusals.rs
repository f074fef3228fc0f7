//! Errors of a model file are one sentence that names the field.

use std::path::Path;

use i2ris::model::ModelError;
use i2ris::model::file::FAMILIES;
use i2ris::model::hysteresis::backlash_play::PlayParameters;

use super::file::mixture;
use super::*;

fn refused(file: ModelFile) -> String {
    let text = Model::from_file(file).unwrap_err().to_string();
    assert!(!text.contains('\n'));
    text
}

#[track_caller]
fn with_mixture(change: impl FnOnce(&mut MixtureParameters), parts: &[&str]) {
    let mut file = file(1, two_components(), region(1, 300.0));
    change(mixture(&mut file));
    assert_mentions(&refused(file), parts);
}

#[track_caller]
fn with_file(change: impl FnOnce(&mut ModelFile), parts: &[&str]) {
    let mut file = file(2, two_by_two(), square(50.0));
    change(&mut file);
    assert_mentions(&refused(file), parts);
}

#[track_caller]
fn assert_mentions(text: &str, parts: &[&str]) {
    assert!(parts.iter().all(|part| text.contains(part)), "{text}");
}

#[test]
fn another_format_or_version_is_named_before_its_fields() {
    let parse = |text: &str, parts: &[&str]| {
        assert_mentions(&ModelFile::parse(text).unwrap_err().to_string(), parts);
    };
    parse(
        r#"{"format": "i2ris-model", "schema_version": 2, "new": 1}"#,
        &["schema_version 2", "reads 1 only"],
    );
    parse(r#"{"format": "octave"}"#, &["is not a model", "`octave`"]);
    parse("{}", &["is not a model"]);
    parse("pitch,yaw", &["line 1"]);
    with_file(|it| it.schema_version = 7, &["schema_version 7"]);
    with_file(|it| it.format.clear(), &["is not a model"]);
}

#[test]
fn an_unknown_or_missing_field_is_named() {
    let text = serde_json::to_string(&file(1, two_components(), region(1, 300.0))).unwrap();
    let parse = |from: &str, to: &str, parts: &[&str]| {
        assert!(text.contains(from));
        let error = ModelFile::parse(&text.replacen(from, to, 1)).unwrap_err();
        assert_mentions(&error.to_string(), parts);
    };
    parse("\"robot_id\"", "\"robotid\"", &["unknown field `robotid`", "robot_id"]);
    parse("\"kind\":\"gmr\"", "\"kind\":\"gmr\",\"lag\":1", &["unknown field `lag`"]);
    parse("\"weights\"", "\"weight\"", &["unknown field `weight`"]);
    // Families of earlier versions.
    let with_drift = "\"built_in\":{\"base\":\"\"},\"robot_id\"";
    parse("\"robot_id\"", with_drift, &["unknown field `built_in`", "as `i2ris calibrate fit`"]);
    parse("\"seed\":1,", "", &["missing field `seed`"]);
    parse("\"deg\"", "\"rad\"", &["unknown variant `rad`", "`deg`"]);
}

#[test]
fn unsupported_family_is_refused_with_supported_ones_and_remedy() {
    let kinds: Vec<String> = all()
        .iter()
        .map(|sample| {
            serde_json::to_value(&sample.file.family).unwrap()["kind"].as_str().unwrap().to_owned()
        })
        .collect();
    assert_eq!(kinds, FAMILIES);
    let text = serde_json::to_string(&file(1, two_components(), region(1, 300.0))).unwrap();
    for other in ["gmr-stop", "gmr-prandtl-ishlinskii", "spline"] {
        let text = text.replacen("\"kind\":\"gmr\"", &format!("\"kind\":\"{other}\",\"lag\":1"), 1);
        let error = ModelFile::parse(&text).unwrap_err();
        assert!(matches!(&error, ModelError::Family(found) if found == other));
        let parts = [&format!("the family `{other}`"), "force-balance", "calibrate again"];
        assert_mentions(&error.to_string(), &parts);
    }
}

#[test]
fn every_error_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("snake.json");
    let load = |parts: &[&str]| {
        assert_mentions(&Model::load(&path).unwrap_err().to_string(), parts);
    };
    load(&["cannot read model file", "snake.json", "calibrate fit"]);
    std::fs::write(&path, "{}").unwrap();
    load(&["snake.json", "is not a model"]);
    let mut bad = file(1, two_components(), region(1, 300.0));
    bad.robot_id = " ".to_owned();
    std::fs::write(&path, serde_json::to_string(&bad).unwrap()).unwrap();
    load(&["snake.json", "robot_id"]);
    assert!(matches!(Model::load(Path::new("/")), Err(ModelError::Read { .. })));
}

#[test]
fn invalid_outputs_and_records_are_refused() {
    with_file(|it| it.outputs.clear(), &["outputs = 0", "1 to 3"]);
    with_file(|it| it.outputs[1].name = "pitch".to_owned(), &["outputs[1].name", "another output"]);
    with_file(|it| it.outputs[1].name = "a".repeat(17), &["outputs[1].name", "16 bytes"]);
    with_file(|it| it.outputs[1].name.clear(), &["outputs[1].name", "16 bytes"]);
    with_file(|it| it.outputs[0].unit = OutputUnit::Mm, &["outputs[0].unit", "one unit"]);
    with_file(|it| it.metrics.truncate(1), &["metrics = 1 entries", "one per output"]);
    with_file(|it| it.metrics[1].training.r2 = f64::NAN, &["metrics[1]", "NaN"]);
    with_file(|it| it.training.bic = Some(f64::INFINITY), &["training.bic", "inf"]);
}

#[test]
fn a_hull_for_another_number_of_motors_is_refused() {
    with_file(|it| it.hull.corners.clear(), &["hull.corners[0]", "1 or 2"]);
    with_file(|it| it.hull.corners[2].truncate(1), &["hull.corners[2]", "one number per motor"]);
    with_file(
        |it| it.hull.corners = region(1, 50.0),
        &["family.mixture.means[0]", "per motor and output"],
    );
}

#[test]
fn invalid_mixtures_are_refused() {
    with_mixture(|it| it.weights[0] = 0.3, &["family.mixture.weights = sum 0.8", "sum to 1"]);
    with_mixture(|it| it.weights = vec![0.0, 1.0], &["weights[0] = 0", "above 0"]);
    with_mixture(|it| it.weights[1] = f64::NAN, &["weights[1] = NaN"]);
    with_mixture(|it| it.means.truncate(1), &["family.mixture.means", "per weight"]);
    with_mixture(|it| it.covariances.truncate(1), &["family.mixture.covariances", "per weight"]);
    with_mixture(|it| it.means[1].push(1.0), &["means[1]", "3 numbers"]);
    with_mixture(|it| it.means[0][1] = f64::INFINITY, &["means[0] = inf", "finite"]);
    with_mixture(|it| it.means[0][1] = 1e200, &["means[0]", "at most 1e15"]);
    with_mixture(|it| it.covariances[1][1].truncate(1), &["covariances[1]", "[2, 1]"]);
    with_mixture(|it| it.covariances[0][1][1] = f64::NAN, &["covariances[0] = NaN"]);
    with_mixture(|it| it.weights = vec![0.01; 100], &["100 components", "1 to 64"]);
}

#[test]
fn a_covariance_must_be_symmetric_and_positive_definite() {
    with_mixture(|it| it.covariances[0][0][1] = 61.0, &["covariances[0][1][0]", "symmetric"]);
    for to in [301.0, 300.0] {
        let indefinite = vec![vec![10_000.0, to], vec![to, 9.0]];
        with_mixture(|it| it.covariances[1] = indefinite, &["covariances[1]", "positive definite"]);
    }
    with_mixture(|it| it.covariances[1][1][1] = -9.0, &["covariances[1][1][1] = -9", "negative"]);
    with_mixture(
        |it| it.covariances[1] = vec![vec![0.0; 2]; 2],
        &["variances", "positive definite"],
    );
    let tiny = vec![vec![1e-30, 0.0], vec![0.0, 9.0]];
    with_mixture(|it| it.covariances[1] = tiny, &["covariances[1] = width 1.0e-15", "too narrow"]);
}

#[test]
fn a_fit_may_be_exact() {
    let mut exact = file(1, affine(&[&[0.02]], &[0.0]), region(1, 100.0));
    let FamilyParameters::Linear { covariance, .. } = &mut exact.family else { panic!() };
    covariance[0][0] = 0.0;
    assert!(Model::from_file(exact).is_ok());
}

#[test]
fn model_failing_round_trip_is_refused_with_position() {
    // The curve increases in the middle and falls at both ends: past a local maximum on the left,
    // past a drop on the right. A search downwards from the middle ends at the local maximum, and
    // the conditional mean of the two ends is the middle again.
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
    let mixture = MixtureParameters { weights: vec![0.25; 4], means, covariances };
    let bad = file(1, FamilyParameters::Gmr { mixture: mixture.into() }, region(1, 440.0));
    let error = Model::from_file(bad).unwrap_err();
    assert!(matches!(
        &error,
        ModelError::NotInvertible { counts, .. } if counts.len() == 1 && counts[0].abs() > 200.0,
    ));
    assert_mentions(
        &error.to_string(),
        &["fails at counts [", " deg, and one count is worth 0.0", "fewer components or another"],
    );
}

#[test]
fn a_model_of_another_robot_is_refused() {
    let model = Model::from_file(file(1, two_components(), region(1, 300.0))).unwrap();
    assert!(model.check_robot("bench", 1).is_ok());
    assert_mentions(
        &model.check_robot("theatre", 1).unwrap_err().to_string(),
        &["robot `bench`", "`theatre`"],
    );
    assert_mentions(
        &model.check_robot("bench", 2).unwrap_err().to_string(),
        &["for 1 motor", "has 2"],
    );
}

#[test]
fn model_marked_worthless_is_refused_on_every_robot() {
    let mut marked = file(1, two_components(), region(1, 300.0));
    marked.worthless = Some("on rows held out, R2 of `pitch` is -0.20".to_owned());
    let read = ModelFile::parse(&serde_json::to_string(&marked).unwrap()).unwrap();
    let model = Model::from_file(read).unwrap();
    assert_mentions(
        &model.check_use("bench", 1).unwrap_err().to_string(),
        &["is marked as worthless: on rows held out, R2 of `pitch` is -0.20; fit a better one"],
    );
    assert_mentions(&model.check_use("theatre", 1).unwrap_err().to_string(), &["`theatre`"]);
}

#[test]
fn model_with_gain_unlike_its_recording_is_refused() {
    let with_line = |line: [[f64; 2]; 2]| {
        let family = affine(&[&[0.02, -0.01], &[0.01, 0.02]], &[0.0, 0.0]);
        let mut file = file(2, family, region(2, 300.0));
        file.training.linear_gain = Some(line.map(|row| row.to_vec()).to_vec());
        Model::from_file(file)
    };
    assert!(with_line([[0.02, -0.01], [0.01, 0.02]]).is_ok());
    for (line, gains) in [
        ([[-0.02, 0.01], [-0.01, -0.02]], "-1.00 to -1.00"),
        ([[0.2, -0.1], [0.1, 0.2]], "0.10 to 0.10"),
        ([[0.005, -0.0025], [0.0025, 0.005]], "4.00 to 4.00"),
    ] {
        let sentence = with_line(line).unwrap_err().to_string();
        let start = format!("unusable gain: a count moves the outputs by {gains} times");
        assert_mentions(&sentence, &[&start, "record motion of both motors together"]);
    }
}

#[test]
fn wide_backlash_is_accepted_and_excessive_gain_refused() {
    // Nearly all of the motion follows after a gap that takes most of the range.
    let mixture = MixtureParameters {
        weights: vec![1.0],
        means: vec![vec![0.0, 0.0]],
        covariances: vec![vec![vec![1e4, 200.0], vec![200.0, 4.01]]],
    };
    let plays = PlayParameters {
        thresholds_counts: vec![vec![0.0, 330.0]],
        weights: vec![vec![0.02, 0.98]],
        planar_thresholds_counts: Vec::new(),
    };
    let virtual_hull = HullParameters { corners: region(1, 400.0) };
    let family =
        FamilyParameters::GmrPlay { plays, mixture: mixture.into(), residual: None, virtual_hull };
    let mut file = file(1, family, region(1, 400.0));
    let model = Model::from_file(file.clone()).unwrap();
    let mut memory = model.new_memory();
    let (mut product, mut square) = (0.0, 0.0);
    for step in 0..4000 {
        let at = 400.0 * (f64::from(step) * 0.01).sin();
        model.advance(&mut memory, &[at, 0.0]);
        product += at * model.predict(&[at, 0.0], &memory).mean[0] / DEG;
        square += at * at;
    }
    let mut with_line = |line: f64| {
        file.training.linear_gain = Some(vec![vec![line]]);
        Model::from_file(file.clone()).map(drop)
    };
    with_line(product / square).unwrap();
    for wild in [1e-9, 1e9, -1.0] {
        let found = with_line(wild * product / square);
        assert!(matches!(found, Err(ModelError::Gain { .. })), "{found:?}");
    }
}
