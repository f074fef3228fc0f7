//! Model files: identity, reading and writing.

use std::fs;
use std::path::Path;

use i2ris::model::ModelId;
use proptest::prelude::*;

use super::*;

fn sample() -> ModelFile {
    file(1, two_components(), region(1, 300.0))
}

fn id(file: &ModelFile) -> ModelId {
    file.id().unwrap()
}

#[test]
fn identity_is_the_sha256_of_the_canonical_form() {
    // Python: hashlib.sha256(json.dumps(json.load(file), separators=(",",
    // ":")).encode()).hexdigest()
    let expected = "8d53add712bd4c4c09cafa4b28b832756534461f007d4c065c86cef5e0801218";
    assert_eq!(id(&sample()).to_string(), expected);
    assert_eq!(Model::from_file(sample()).unwrap().id(), id(&sample()));
    assert_eq!(format!("{:?}", id(&sample())), format!("ModelId({expected})"));
}

#[test]
fn layout_and_order_of_fields_do_not_change_the_identity() {
    let compact = serde_json::to_string(&sample()).unwrap();
    let indented = serde_json::to_string_pretty(&sample()).unwrap().replace(':', " :\t");
    // A map sorts its keys by name.
    let sorted =
        serde_json::to_string(&serde_json::from_str::<serde_json::Value>(&compact).unwrap())
            .unwrap();
    assert_ne!(compact, sorted);
    for text in [compact, indented, sorted] {
        assert_eq!(id(&ModelFile::parse(&text).unwrap()), id(&sample()));
    }
}

pub fn mixture(file: &mut ModelFile) -> &mut MixtureParameters {
    match &mut file.family {
        FamilyParameters::Gmr { mixture: Mixture::Joint(mixture) } => mixture,
        _ => panic!("no mixture"),
    }
}

#[test]
fn every_value_changes_the_identity() {
    let changes: [fn(&mut ModelFile); 10] = [
        |file| file.robot_id.push('2'),
        |file| file.outputs[0].name.push('x'),
        |file| file.outputs[0].unit = OutputUnit::Mm,
        |file| file.hull.corners[1][0] = file.hull.corners[1][0].next_up(),
        |file| file.training.seed += 1,
        |file| file.training.bic = Some(0.0),
        |file| file.metrics[0].training.max = 1.25,
        |file| file.metrics[0].held_out = Some(file.metrics[0].training),
        |file| mixture(file).weights[0] = mixture(file).weights[0].next_up(),
        |file| {
            let covariance = &mut mixture(file).covariances[1][0][0];
            *covariance = covariance.next_down();
        },
    ];
    let mut ids = vec![id(&sample())];
    for change in changes {
        let mut changed = sample();
        change(&mut changed);
        ids.push(id(&changed));
    }
    let mut distinct = ids.clone();
    distinct.sort_by_key(|id| id.0);
    distinct.dedup();
    assert_eq!(distinct.len(), ids.len());
}

fn names_in(folder: &Path) -> Vec<String> {
    fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect()
}

#[test]
fn a_written_file_reads_back_and_leaves_no_temporary_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.json");
    file(2, two_by_two(), square(50.0)).write(&path).unwrap();
    sample().write(&path).unwrap();
    assert_eq!(names_in(folder.path()), ["model.json"]);
    let model = Model::load(&path).unwrap();
    assert_eq!(*model.file(), sample());
    assert_eq!((model.motors(), model.outputs()), (1, 1));
}

#[test]
fn a_written_file_has_one_line_per_row_of_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.json");
    file(2, two_by_two(), square(50.0)).write(&path).unwrap();
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.starts_with("{\n  \"format\": \"i2ris-model\",\n"), "{text}");
    assert!(text.contains("\n          [8100.0, -2700.0, 180.0, 54.0],\n"), "{text}");
    assert!(text.contains("\"weights\": [0.3, 0.7],\n"), "{text}");
    assert!(text.ends_with("}\n"));
}

#[test]
fn a_failed_write_changes_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.json");
    sample().write(&path).unwrap();
    let mut bad = sample();
    bad.robot_id.clear();
    assert!(bad.write(&path).unwrap_err().to_string().contains("robot_id"));
    assert_eq!(ModelFile::read(&path).unwrap(), sample());

    // A folder cannot be replaced by a file. This error occurs only at the final rename.
    let taken = folder.path().join("taken");
    fs::create_dir_all(taken.join("inner")).unwrap();
    let error = sample().write(&taken).unwrap_err().to_string();
    assert!(error.contains("cannot write model file") && error.contains("taken"), "{error}");
    let mut names = names_in(folder.path());
    names.sort();
    assert_eq!(names, ["model.json", "taken"]);
    let refused = sample().write(&folder.path().join("no/such/model.json")).unwrap_err();
    assert!(refused.to_string().contains("no/such"));
}

proptest! {
    #![proptest_config(i2ris_testing::cases(16))]

    #[test]
    fn parameters_read_back_bit_for_bit(map in smooth_gmr(2, 3)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.json");
        map.file().write(&path).unwrap();
        let read = ModelFile::read(&path).unwrap();
        prop_assert_eq!(id(&read), id(&map.file()));
        prop_assert_eq!(read, map.file());
    }

    #[test]
    fn parser_never_panics(
        text in ".{0,200}",
        cut in 0..2000_usize,
        byte in any::<u8>(),
    ) {
        prop_assert!(ModelFile::parse(&text).is_err());
        let mut bytes = serde_json::to_vec(&sample()).unwrap();
        let index = cut % bytes.len();
        bytes[index] = byte;
        // A changed byte gives a model or an error, never a panic.
        if let Ok(file) = ModelFile::parse(&String::from_utf8_lossy(&bytes)) {
            let _ = Model::from_file(file);
        }
    }
}
