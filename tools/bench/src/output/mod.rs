//! Outcomes as files.
//!
//! | file | contains |
//! |---|---|
//! | `json` | all numbers as JSON |
//! | `hdr_log` | the histograms as an HDR histogram log |
//! | `figure` | percentile curves as SVG |
//! | `page` | figures, tables, machine and notes as one HTML page |

mod figure;
mod hdr_log;
mod json;
mod page;

use std::fs;
use std::path::{Path, PathBuf};

pub use figure::figure;
pub use hdr_log::hdr_log;
pub use json::json;
pub use page::page;

use crate::error::BenchError;
use crate::outcome::BenchOutcome;

/// Writes `NAME.json`, `NAME.hlog` and `NAME.svg` of every outcome, and `index.html` of all, into a
/// folder, which is created if necessary. Returns the files.
///
/// # Errors
///
/// [`BenchError::Write`], [`BenchError::Histogram`].
pub fn write(folder: &Path, outcomes: &[BenchOutcome]) -> Result<Vec<PathBuf>, BenchError> {
    let error = |path: &Path, source| BenchError::Write { path: path.to_owned(), source };
    fs::create_dir_all(folder).map_err(|source| error(folder, source))?;
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    for outcome in outcomes {
        let name = outcome.bench;
        files.push((format!("{name}.json"), format!("{:#}\n", json(outcome)).into()));
        files.push((format!("{name}.hlog"), hdr_log(outcome)?));
        files.push((format!("{name}.svg"), figure(outcome).to_string().into()));
    }
    files.push(("index.html".to_owned(), page(outcomes).to_string().into()));
    let mut written = Vec::new();
    for (name, bytes) in files {
        let path = folder.join(name);
        fs::write(&path, bytes).map_err(|source| error(&path, source))?;
        written.push(path);
    }
    Ok(written)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::Role;
    use crate::outcome::tests::{outcome, variant};

    #[test]
    fn all_files_have_the_same_numbers() {
        let folder = tempfile::tempdir().unwrap();
        let variants = vec![
            variant("least", "polled", Role::Floor, 500),
            variant("ours, <b>", "polled", Role::Ours, 1500),
        ];
        let written = write(folder.path(), &[outcome(variants)]).unwrap();
        let names = written.iter().map(|path| path.file_name().unwrap().to_str().unwrap());
        let expected = ["ipc.json", "ipc.hlog", "ipc.svg", "index.html"];
        assert_eq!(names.collect::<Vec<_>>(), expected);
        let json: serde_json::Value =
            serde_json::from_slice(&fs::read(&written[0]).unwrap()).unwrap();
        let [floor, ours] = [0, 1].map(|index| &json["variants"][index]);
        assert_eq!(ours["role"], "ours");
        assert_eq!(ours["spans_ns"]["count"], 1000);
        assert!(floor["x_floor"].is_null());
        assert!(ours["x_floor"]["p50"].as_f64().unwrap() > 1.5);
        let page = fs::read_to_string(&written[3]).unwrap();
        assert!(page.contains("ours, &lt;b&gt;") && !page.contains("<b>"), "{page}");
        assert!(page.contains("<td>2.00</td>"), "{page}");
    }

    #[test]
    fn an_error_names_the_folder() {
        let text = write(Path::new("/proc/nowhere"), &[]).unwrap_err().to_string();
        assert!(text.contains("/proc/nowhere"), "{text}");
    }
}
