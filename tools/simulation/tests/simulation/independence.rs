//! Physics and drives are written independently of the controller: a misreading of a reference or a
//! property of a model that both share would stay unseen.

use std::fs;
use std::path::{Path, PathBuf};

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

#[test]
fn physics_ageing_and_drives_import_no_code_of_the_controller_but_units() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for folder in ["physics", "ageing", "drive"] {
        for file in files(&source.join(folder)) {
            let text = fs::read_to_string(&file).unwrap();
            for line in text.lines().filter(|line| line.contains("i2ris::")) {
                assert!(line.contains("i2ris::units"), "{}: {line}", file.display());
            }
        }
    }
}
