//! `i2ris bench scale`.

use std::env;
use std::fs;
use std::path::Path;

use i2ris_bench::scale::{self, Curve, ScaleBenchmark, ScaleOutcome};
use i2ris_terminal::{Failure, Interrupt};

/// Arguments of `i2ris bench scale`.
#[derive(Debug, clap::Args)]
pub struct ScaleArguments {
    /// Up to a million rows, and longer measurements
    #[arg(long)]
    full: bool,
}

/// Measures, prints, and writes page and numbers.
pub fn measure(
    arguments: &ScaleArguments,
    folder: Option<&Path>,
    as_json: bool,
) -> Result<(), Failure> {
    let interrupt = Interrupt::catch()?;
    let benchmark = ScaleBenchmark { is_full: arguments.full, program: env::current_exe()? };
    let outcome = scale::run(&benchmark, &|| interrupt.came(), &mut |name| {
        if !as_json {
            eprintln!("measuring {name}");
        }
    })?;
    if as_json {
        println!("{}", serde_json::to_string_pretty(&outcome)?);
    } else {
        print(&outcome);
    }
    if let Some(folder) = folder {
        write(folder, &outcome)?;
        if !as_json {
            println!("\nwritten: {}", folder.join("scale.html").display());
        }
    }
    Ok(())
}

/// Prints the cost of one fit as JSON.
pub fn fit(rows: usize) -> Result<(), Failure> {
    println!("{}", serde_json::to_string(&scale::fit_cost(rows)?)?);
    Ok(())
}

fn write(folder: &Path, outcome: &ScaleOutcome) -> Result<(), Failure> {
    let failed = |error| format!("cannot write to {}: {error}", folder.display());
    fs::create_dir_all(folder).map_err(failed)?;
    fs::write(folder.join("scale.html"), scale::page(outcome).to_string()).map_err(failed)?;
    let numbers = format!("{}\n", serde_json::to_string_pretty(outcome)?);
    fs::write(folder.join("scale.json"), numbers).map_err(failed)?;
    Ok(())
}

fn print(outcome: &ScaleOutcome) {
    println!("How cost grows; exponent: 1 is linear\n  load: {}", outcome.load);
    for curve in &outcome.curves {
        println!("\n{} ({})", curve.name, exponent(curve));
        println!("{:>24} {:>14}", curve.size, format!("cost ({})", curve.unit));
        for [size, cost] in &curve.points {
            println!("{size:>24} {cost:>14.3}");
        }
    }
}

fn exponent(curve: &Curve) -> String {
    curve.exponent.map_or_else(|| "no exponent".to_owned(), |e| format!("exponent {e:.2}"))
}
