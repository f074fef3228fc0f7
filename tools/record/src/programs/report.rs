//! `i2ris report`: a recorded trial as a page, or as numbers.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a command-line program prints"
)]

use std::path::PathBuf;

use i2ris_record::report::{Report, Spread, Tracked};

use clap::Parser;
use i2ris_terminal::Failure;
use i2ris_terminal::files;
use i2ris_terminal::while_working;
use std::process::ExitCode;

/// Make a page of a recorded trial: tracking error, hysteresis, latencies, events
#[derive(Debug, Parser)]
#[command(
    name = "i2ris-report",
    bin_name = "i2ris report",
    version,
    propagate_version = true
)]
#[command(after_help = "Examples:
  i2ris report trial.mcap
  i2ris report trial.mcap --output page.html
  i2ris report trial.mcap --json

The page needs nothing but itself: no network, no scripts. It prints on A4.")]
struct Arguments {
    /// The recording, whole or cut off
    recording: PathBuf,
    /// Where to write the page [default: beside the recording, .html]
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
    let report = while_working("reading", || Report::of(&arguments.recording))?;
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

fn print(report: &Report) {
    let summary = report.summary();
    println!("{}: {:.1} s", summary.file, summary.length_s);
    tracked("goal against camera", summary.camera.as_ref());
    tracked("goal against estimate", summary.estimate.as_ref());
    for own in &summary.hysteresis {
        let width = own.width_deg.map_or_else(
            || "cannot be told".to_owned(),
            |deg| format!("{deg:.2} deg"),
        );
        println!("  loop of {:<6} ({}): {width} wide", own.output, own.from);
    }
    let spread = |name: &str, spread: Option<&Spread>, unit: &str| {
        if let Some(Spread { p50, p99, max, .. }) = spread {
            println!("  {name:<24} p50 {p50:.3} {unit}, p99 {p99:.3} {unit}, max {max:.3} {unit}");
        }
    };
    spread("command to line", summary.command_to_line_ms.as_ref(), "ms");
    spread(
        "loop late",
        summary.control_loop.as_ref().map(|own| &own.lateness_us),
        "us",
    );
    let troubles = summary
        .events
        .iter()
        .filter(|event| event.is_trouble)
        .count();
    println!(
        "  {} events, {troubles} of them not meant to happen",
        summary.events.len()
    );
    if let Some(why) = &summary.cut_off {
        eprintln!("warning: the recording is not whole: {why}");
    }
}

fn tracked(name: &str, tracked: Option<&Tracked>) {
    if let Some(Tracked {
        length_rms_deg,
        length,
        samples,
        ..
    }) = tracked
    {
        println!(
            "  {name:<24} RMS {length_rms_deg:.3} deg, p99 {:.3} deg, max {:.3} deg ({samples} samples)",
            length.p99, length.max
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
        assert!(
            help.contains("Example") && help.contains("i2ris report"),
            "{help}"
        );
        command.debug_assert();
    }
}
