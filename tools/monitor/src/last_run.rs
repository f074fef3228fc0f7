//! Reason why a controller that is no longer running ended, and the place of its records.

use std::fs;
use std::path::Path;

use i2ris::ipc::Domain;
use i2ris::process::run_log::FILE;
use serde_json::Value;

/// A sentence about the last run of a domain, if it has not ended cleanly.
pub fn sentence(domain: &Domain) -> Option<String> {
    let (boot_id, folder) = domain.last_run()?;
    let (run, log) = (format!("{boot_id:016x}"), folder.join(FILE));
    let text = fs::read_to_string(&log).ok()?;
    let lines = text.lines().rev().filter_map(|line| serde_json::from_str::<Value>(line).ok());
    let lines: Vec<Value> = lines.filter(|line| line["run"] == run.as_str()).collect();
    let field = |name: &str| lines.iter().find_map(|line| line[name].as_str());
    let time = field("time")?;
    let how = match field("outcome") {
        Some(outcome) => format!("ended at {time}: {outcome}"),
        None => format!("was killed or crashed after {time}"),
    };
    let reason = field("reason").map(|it| format!(", the last reason was `{it}`"));
    // Names begin with the time.
    let black_box = match newest(&folder) {
        Some(path) if field("outcome").is_some() => format!("black box {path}"),
        _ => "the next start writes its black box there".to_owned(),
    };
    let (reason, log) = (reason.unwrap_or_default(), log.display());
    Some(format!("the last one {how}{reason}; log {log}; {black_box}"))
}

fn newest(folder: &Path) -> Option<String> {
    let entries = fs::read_dir(folder).ok()?.flatten().map(|entry| entry.path());
    let boxes = entries.filter(|path| path.extension().is_some_and(|it| it == "box"));
    boxes.max().map(|path| path.display().to_string())
}
