//! `i2ris record export`: recordings as tables, trials as data sets. Whole, or not at all.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use i2ris_record::dataset::{self, Options, Source, Sources, Version, find_ffmpeg, staged};
use i2ris_record::export::{ExportError, TableFormat, export};
use i2ris_report::Failure;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Arguments of `i2ris record export`.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Recordings, complete or cut off; folders of trials; or studies, of which all trials that
    /// were not aborted are taken
    #[arg(required = true, value_name = "RECORDING|TRIAL|STUDY")]
    recordings: Vec<PathBuf>,
    /// Folder to write; of several recordings, each has its tables in a folder of its own
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    /// What to write
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    /// Replace an earlier export
    #[arg(long)]
    overwrite: bool,
    /// LeRobot: rows per second where there are no pictures
    #[arg(long, value_name = "HZ", default_value_t = 30, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rate_hz: u32,
    /// LeRobot: leave pictures out
    #[arg(long)]
    without_pictures: bool,
    /// LeRobot: pictures as they are, and no video
    #[arg(long)]
    images: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
enum Format {
    /// Comma-separated text
    #[default]
    Csv,
    /// Apache Parquet: columns with types, compressed
    // With Snappy. pandas, MATLAB, DuckDB and Julia read it.
    Parquet,
    /// A data set that LeRobot 0.2 and 0.3 load, as Open-H-Embodiment asks for
    #[value(name = "lerobot-v2.1")]
    LerobotV21,
    /// A data set that LeRobot from 0.4 on loads
    #[value(name = "lerobot-v3")]
    LerobotV3,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    let sources = Sources::find(&arguments.recordings)?;
    for (name, why) in &sources.left_out {
        eprintln!("left out: {name}: {why}");
    }
    if sources.taken.is_empty() {
        return Err("there is no trial to export".into());
    }
    match arguments.format {
        Format::Csv => tables(arguments, &sources.taken, TableFormat::Csv),
        Format::Parquet => tables(arguments, &sources.taken, TableFormat::Parquet),
        Format::LerobotV21 => data_set(arguments, &sources.taken, Version::V21),
        Format::LerobotV3 => data_set(arguments, &sources.taken, Version::V3),
    }
}

/// How many recordings are done, on stderr if that is a terminal.
fn bar(sources: &[Source]) -> ProgressBar {
    let target = ProgressDrawTarget::stderr();
    let bar = ProgressBar::with_draw_target(Some(sources.len() as u64), target);
    // The template is a constant; with a wrong one the bar would look plain.
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len} {msg}, {elapsed}") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

fn tables(arguments: &Arguments, sources: &[Source], format: TableFormat) -> Result<(), Failure> {
    let bar = bar(sources);
    let written = staged(&arguments.output, arguments.overwrite, |folder| {
        let mut rows: BTreeMap<PathBuf, u64> = BTreeMap::new();
        let mut warnings = Vec::new();
        for source in sources {
            bar.set_message(source.name.clone());
            let within = if sources.len() > 1 { Path::new(&source.name) } else { Path::new("") };
            let exported = export(&source.recording, &folder.join(within), format)?;
            rows.extend(exported.rows.iter().map(|(name, rows)| (within.join(name), *rows)));
            warnings.extend(exported.stopped_by.map(|error| error.to_string()));
            bar.inc(1);
        }
        let recordings: Vec<_> = sources.iter().map(|source| &source.recording).collect();
        let made_of = serde_json::json!({
            "software": concat!("i2ris ", env!("CARGO_PKG_VERSION")), "recordings": recordings,
        });
        let path = folder.join(dataset::MADE_OF);
        fs::write(&path, format!("{made_of:#}\n"))
            .map_err(|error| ExportError::Write { path, reason: error.to_string() })?;
        Ok::<_, ExportError>((rows, warnings))
    });
    bar.finish_and_clear();
    let (rows, warnings) = written?;
    for (name, rows) in &rows {
        println!("{rows:>9} rows  {}", arguments.output.join(name).display());
    }
    for warning in warnings {
        eprintln!("warning: the recording is not complete: {warning}");
    }
    Ok(())
}

fn data_set(arguments: &Arguments, sources: &[Source], version: Version) -> Result<(), Failure> {
    let options = Options {
        version,
        rate_hz: f64::from(arguments.rate_hz),
        without_pictures: arguments.without_pictures,
        ffmpeg: find_ffmpeg().filter(|_| !arguments.images),
    };
    let bar = bar(sources);
    let written = staged(&arguments.output, arguments.overwrite, |folder| {
        dataset::write(sources, folder, &options, |done, name| {
            bar.set_position(done as u64);
            bar.set_message(name.to_owned());
        })
    });
    bar.finish_and_clear();
    let written = written?;
    for (name, why) in &written.left_out {
        eprintln!("left out: {name}: {why}");
    }
    if !written.views.is_empty() && options.ffmpeg.is_none() && !arguments.images {
        eprintln!("no `ffmpeg` on the search path: pictures are in the tables, not in videos");
    }
    let rows: usize = written.episodes.iter().map(|episode| episode.rows).sum();
    println!(
        "{} episodes, {rows} rows at {} Hz: {}",
        written.episodes.len(),
        written.fps,
        arguments.output.display()
    );
    Ok(())
}
