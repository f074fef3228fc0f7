//! H17: a step of the wall clock. Nothing that moves the robot uses that clock.

use std::fs;
use std::path::{Path, PathBuf};

/// Names of functions and types that read a clock that can be set.
const WALL_CLOCKS: [&str; 5] =
    ["SystemTime", "CLOCK_REALTIME", "gettimeofday", "time::OffsetDateTime", "chrono::"];

fn sources(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap().flatten() {
        match entry.path() {
            path if path.is_dir() => sources(&path, into),
            path if path.extension().is_some_and(|extension| extension == "rs") => into.push(path),
            _ => {}
        }
    }
}

/// A test cannot set the clock of the machine, so it checks the sources: one file reads the wall
/// clock, and only files for records use it.
#[test]
fn h17_only_file_names_and_headers_use_the_wall_clock() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&folder, &mut files);
    assert!(files.len() > 100, "{}", files.len());
    let (mut readers, mut users) = (Vec::new(), Vec::new());
    for file in &files {
        let text = fs::read_to_string(file).unwrap();
        let name = file.strip_prefix(&folder).unwrap().to_str().unwrap().to_owned();
        if WALL_CLOCKS.iter().any(|clock| text.contains(clock)) {
            readers.push(name.clone());
        }
        if text.contains("wall_clock::") {
            users.push(name);
        }
    }
    users.sort();
    assert_eq!(readers, ["wall_clock.rs"]);
    assert_eq!(
        users,
        ["process/black_box/recorder.rs", "process/main_thread.rs", "process/run_log.rs"]
    );
}
