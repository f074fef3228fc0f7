//! The lines of the controller's run log that belong to one run.

use std::fs;
use std::path::Path;

use i2ris::process::run_log::FILE;
use serde_json::Value;

/// All lines of one run, unchanged; `None` if there is no log or no such line.
pub fn lines_of_run(folder: &Path, boot_id: u64) -> Option<Vec<u8>> {
    select(&fs::read_to_string(folder.join(FILE)).ok()?, boot_id)
}

fn select(text: &str, boot_id: u64) -> Option<Vec<u8>> {
    let run = format!("{boot_id:016x}");
    let is_of_run =
        |line: &&str| serde_json::from_str(line).is_ok_and(|entry: Value| entry["run"] == *run);
    let lines: String = text.lines().filter(is_of_run).map(|line| format!("{line}\n")).collect();
    (!lines.is_empty()).then(|| lines.into_bytes())
}
