//! `i2ris record report`: the report of a recorded trial as a page or as numbers.

use std::path::PathBuf;

use i2ris_record::report::TrialReport;
use i2ris_record::trial::comparison::StudyReport;
use i2ris_report::exit::{Coded, INCOMPLETE};
use i2ris_report::{Failure, files, while_working};

#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  i2ris record report trial.mcap
  i2ris record report trial.mcap --output page.html
  i2ris record report trial.mcap --json
  i2ris record report reach-study                  all trials of a study, page and CSV

The page is self-contained (no network, no scripts) and prints on A4.")]
pub struct Arguments {
    /// Recording, complete or truncated; or the folder of a study
    recording: PathBuf,
    /// HTML file to write [default: next to the recording]
    #[arg(long, short, value_name = "FILE.html")]
    output: Option<PathBuf>,
    /// Print the numbers as JSON; a page is written only with --output
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    if arguments.recording.is_dir() {
        return study(arguments);
    }
    let report = while_working("reading", || TrialReport::read(&arguments.recording))?;
    let output = match (&arguments.output, arguments.json) {
        (Some(output), _) => Some(output.clone()),
        (None, false) => Some(arguments.recording.with_extension("html")),
        (None, true) => None,
    };
    if let Some(output) = &output {
        files::write(output, report.html())?;
    }
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        print!("{}", report.text());
        if let Some(output) = &output {
            println!("written: {}", output.display());
        }
    }
    report.cut_off.map_or(Ok(()), |reason| {
        let sentence = format!("the recording is not complete: {reason}");
        Err(Coded { code: INCOMPLETE, sentence }.into())
    })
}

/// Writes the page of all trials of a study, and its numbers as CSV next to it.
fn study(arguments: &Arguments) -> Result<(), Failure> {
    let folder = &arguments.recording;
    let report = while_working("reading", || StudyReport::read(folder, |_| {}))?;
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&report)?);
    } else {
        print!("{}", report.text());
    }
    let output = match (&arguments.output, arguments.json) {
        (Some(output), _) => output.clone(),
        (None, false) => folder.join("report.html"),
        (None, true) => return Ok(()),
    };
    files::write(&output, report.html())?;
    let name = output.file_stem().unwrap_or_default().to_string_lossy();
    for (end, table) in report.tables()? {
        files::write(&output.with_file_name(format!("{name}{end}.csv")), table)?;
    }
    if !arguments.json {
        let csv = output.with_file_name(format!("{name}*.csv"));
        println!("written: {}, {}", output.display(), csv.display());
    }
    Ok(())
}
