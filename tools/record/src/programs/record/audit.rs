//! What the controller's own log of runs says about the run that is recorded.

use std::fs;
use std::path::Path;

use i2ris::control::audit::FILE;
use serde_json::Value;

/// Every line of one run, as they stand in the log; `None`: there is no such log, or it knows
/// nothing of the run.
pub fn lines(folder: &Path, boot_id: u64) -> Option<Vec<u8>> {
    of_run(&fs::read_to_string(folder.join(FILE)).ok()?, boot_id)
}

fn of_run(text: &str, boot_id: u64) -> Option<Vec<u8>> {
    let run = format!("{boot_id:016x}");
    let is_own =
        |line: &&str| serde_json::from_str(line).is_ok_and(|entry: Value| entry["run"] == *run);
    let lines: String = text
        .lines()
        .filter(is_own)
        .map(|line| format!("{line}\n"))
        .collect();
    (!lines.is_empty()).then(|| lines.into_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_lines_of_the_run_are_taken_and_broken_ones_are_left() {
        let text = "{\"run\":\"00000000000000ab\",\"event\":\"begin\"}\n{\"run\":\"0000000000000001\"}\n{\"run\":\"000000000000\n\
                    {\"run\":\"00000000000000ab\",\"event\":\"end\"}\n";
        let lines = String::from_utf8(of_run(text, 0xab).unwrap()).unwrap();
        assert_eq!(lines.lines().count(), 2);
        assert!(lines.contains("begin") && lines.ends_with("\"end\"}\n"));
        assert_eq!(of_run(text, 7), None);
    }
}
