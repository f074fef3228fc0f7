//! H17: a step of the wall clock. Nothing that moves the robot knows that clock.

use std::fs;
use std::path::{Path, PathBuf};

/// Ways to read a clock that can be set.
const WALL_CLOCKS: [&str; 5] = [
    "SystemTime",
    "CLOCK_REALTIME",
    "gettimeofday",
    "time::OffsetDateTime",
    "chrono::",
];

fn sources(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap().flatten() {
        match entry.path() {
            path if path.is_dir() => sources(&path, into),
            path if path.extension().is_some_and(|extension| extension == "rs") => into.push(path),
            _ => {}
        }
    }
}

/// Setting the clock takes a machine of one's own, so what is tested is that nobody can ask for it:
/// one file reads the clock of the wall, and only the one that names files uses it.
#[test]
fn h17_only_file_names_and_headers_know_the_clock_of_the_wall() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&folder, &mut files);
    assert!(files.len() > 100, "{}", files.len());
    let (mut readers, mut users) = (Vec::new(), Vec::new());
    for file in &files {
        let text = fs::read_to_string(file).unwrap();
        let name = file
            .strip_prefix(&folder)
            .unwrap()
            .to_string_lossy()
            .into_owned();
        if WALL_CLOCKS.iter().any(|clock| text.contains(clock)) {
            readers.push(name.clone());
        }
        if text.contains("wall_clock::") {
            users.push(name);
        }
    }
    users.sort();
    assert_eq!(readers, ["wall.rs"]);
    assert!(
        users.iter().all(|user| user.starts_with("control/black_box/") || user.starts_with("control/audit")),
        "{users:?}"
    );
}
