//! `i2ris report`: the report of a recorded trial as a page or as numbers.
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "a command-line program prints")]

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use i2ris_record::report::{Percentiles, TrackingError, TrialReport};
use i2ris_terminal::{Failure, files, while_working};

/// Make a page of a recorded trial: tracking error, hysteresis, latencies, events
#[derive(Debug, Parser)]
#[command(name = "i2ris-report", bin_name = "i2ris report", version, propagate_version = true)]
#[command(after_help = "Examples:
  i2ris report trial.mcap
  i2ris report trial.mcap --output page.html
  i2ris report trial.mcap --json

The page needs nothing but itself: no network, no scripts. It prints on A4.")]
struct Arguments {
    /// The recording, complete or cut off
    recording: PathBuf,
    /// HTML file to write [default: beside the recording]
    #[arg(long, short, value_name = "FILE.html")]
    output: Option<PathBuf>,
    /// Print the numbers as JSON; a page is written only with --output
    #[arg(long)]
    json: bool,
}

fn main() -> ExitCode {
    i2ris_terminal::program::run(|_| true, run)
}

fn run(arguments: Arguments) -> Result<(), Failure> {
    let report = while_working("reading", || TrialReport::read(&arguments.recording))?;
    let output = match (&arguments.output, arguments.json) {
        (Some(output), _) => Some(output.clone()),
        (None, false) => Some(arguments.recording.with_extension("html")),
        (None, true) => None,
    };
    if let Some(output) = &output {
        let page = report.page().to_string();
        files::replace(output, page.as_bytes())
            .map_err(|error| format!("cannot write {}: {error}", output.display()))?;
    }
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(report.summary())?);
        return Ok(());
    }
    print(&report);
    if let Some(output) = &output {
        println!("written: {}", output.display());
    }
    Ok(())
}

fn print(report: &TrialReport) {
    let summary = report.summary();
    println!("{}: {:.1} s", summary.file, summary.length_s);
    print_tracking("goal against camera", summary.camera.as_ref());
    print_tracking("goal against estimate", summary.estimate.as_ref());
    if let Some(score) = &summary.reaches {
        let arrived = 100.0 * score.arrived;
        let times = score
            .arrived_s
            .map(|[median, p95]| format!(", after {median:.2} s (median), {p95:.2} s (95 %)"));
        println!(
            "  {} reaches: {arrived:.0} % within 0.15 deg by the {}{}; overshoot {:.2} deg (95 %)",
            score.reaches.len(),
            score.by,
            times.unwrap_or_default(),
            score.overshoot_deg[1]
        );
    }
    if let Some(score) = &summary.targets {
        println!("  {}", score.line());
    }
    for found in &summary.hysteresis {
        let width = found.width_deg.map(|width| format!("{width:.2} deg wide"));
        let width = width.unwrap_or_else(|| "width not known".to_owned());
        println!("  loop of {:<6} ({}): {width}", found.output, found.from);
    }
    let late = summary.control_loop.as_ref().map(|timing| timing.lateness_us);
    for (name, percentiles, unit) in
        [("command to line", summary.command_to_line_ms, "ms"), ("loop late", late, "us")]
    {
        if let Some(Percentiles { p50, p99, max, .. }) = percentiles {
            println!("  {name:<24} p50 {p50:.3} {unit}, p99 {p99:.3} {unit}, max {max:.3} {unit}");
        }
    }
    let troubles = summary.events.iter().filter(|event| event.is_trouble).count();
    println!("  {} events, {troubles} of them unintended", summary.events.len());
    if let Some(reason) = &summary.cut_off {
        eprintln!("warning: the recording is not complete: {reason}");
    }
}

fn print_tracking(name: &str, tracking: Option<&TrackingError>) {
    if let Some(tracking) = tracking {
        let Percentiles { p99, max, .. } = tracking.length;
        let (rms, samples) = (tracking.length_rms_deg, tracking.samples);
        println!(
            "  {name:<24} RMS {rms:.3} deg, p99 {p99:.3} deg, max {max:.3} deg ({samples} samples)"
        );
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_help_has_an_example_and_the_command_line_is_consistent() {
        let mut command = Arguments::command();
        let help = command.render_long_help().to_string();
        assert!(help.contains("Example") && help.contains("i2ris report"), "{help}");
        command.debug_assert();
    }
}
