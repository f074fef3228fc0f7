//! Outcomes for people and programs.
//!
//! | file | holds |
//! |---|---|
//! | `json` | everything, as JSON |
//! | `log` | the histograms, as an HDR histogram log |
//! | `figure` | percentile curves, as SVG |
//! | `page` | figures, tables, machine and notes, as one HTML page |

mod figure;
mod json;
mod log;
mod page;

use std::fs;
use std::path::{Path, PathBuf};

pub use figure::figure;
pub use json::json;
pub use log::log;
pub use page::page;

use crate::error::BenchError;
use crate::outcome::Outcome;

/// Writes `NAME.json`, `NAME.hlog` and `NAME.svg` of every outcome, and `index.html` of all, into a
/// folder that is made if need be. Returns what was written.
///
/// # Errors
///
/// [`BenchError::Write`], [`BenchError::Histogram`].
pub fn write(folder: &Path, outcomes: &[Outcome]) -> Result<Vec<PathBuf>, BenchError> {
    fs::create_dir_all(folder).map_err(|source| BenchError::Write {
        path: folder.to_owned(),
        source,
    })?;
    let mut written = Vec::new();
    let mut put = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        fs::write(&path, bytes).map_err(|source| BenchError::Write {
            path: path.clone(),
            source,
        })?;
        written.push(path);
        Ok::<_, BenchError>(())
    };
    for outcome in outcomes {
        put(
            &format!("{}.json", outcome.bench),
            format!("{:#}\n", json(outcome)).as_bytes(),
        )?;
        put(&format!("{}.hlog", outcome.bench), &log(outcome)?)?;
        put(
            &format!("{}.svg", outcome.bench),
            figure(outcome).to_string().as_bytes(),
        )?;
    }
    put("index.html", page(outcomes).to_string().as_bytes())?;
    Ok(written)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::Role;
    use crate::outcome::tests::{outcome, way};

    #[test]
    fn a_folder_holds_every_form_and_says_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let ways = vec![
            way("least", "polled", Role::Floor, 500),
            way("ours, <b>", "polled", Role::Ours, 1500),
        ];
        let written = write(folder.path(), &[outcome(ways)]).unwrap();
        let names: Vec<_> = written
            .iter()
            .map(|path| path.file_name().unwrap().to_str().unwrap())
            .collect();
        assert_eq!(names, ["ipc.json", "ipc.hlog", "ipc.svg", "index.html"]);
        let told: serde_json::Value =
            serde_json::from_slice(&fs::read(&written[0]).unwrap()).unwrap();
        assert_eq!(
            (
                told["ways"][1]["role"].as_str(),
                told["ways"][1]["spans_ns"]["count"].as_u64()
            ),
            (Some("ours"), Some(1000))
        );
        assert!(
            told["ways"][0]["x_floor"].is_null()
                && told["ways"][1]["x_floor"]["p50"].as_f64().unwrap() > 1.5
        );
        let page = fs::read_to_string(&written[3]).unwrap();
        assert!(
            page.contains("ours, &lt;b&gt;")
                && !page.contains("<b>")
                && page.contains("<td>2.00</td>"),
            "{page}"
        );
    }

    #[test]
    fn a_place_that_cannot_be_written_is_named() {
        let text = write(Path::new("/proc/nowhere"), &[])
            .unwrap_err()
            .to_string();
        assert!(text.contains("/proc/nowhere"), "{text}");
    }
}
