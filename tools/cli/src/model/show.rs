//! `i2ris model show`.

use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use i2ris::model::file::{FamilyParameters, FitMetrics, OutputSpec};
use i2ris::model::hysteresis::force_balance::{BalanceParameters, CREEPING};
use i2ris::model::{Model, hysteresis::backlash_play::PlayParameters};
use i2ris::wall_clock::WallTime;
use i2ris_report::{DomainOption, Failure};
use serde_json::json;

use super::{loaded, si};

#[derive(Debug, clap::Args)]
#[command(after_help = "Example:
  i2ris model show config/models/steel.json
  i2ris model show --json                        the models of the running controller")]
pub struct Arguments {
    /// The model [default: those of the running controller]
    model: Option<PathBuf>,
    /// Print the file and the id of the model as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    domain: DomainOption,
}

pub fn run(arguments: &Arguments) -> Result<(), Failure> {
    match &arguments.model {
        Some(file) => show(file, arguments.json),
        None => loaded::list(&arguments.domain, arguments.json),
    }
}

pub fn show(path: &Path, json: bool) -> Result<(), Failure> {
    let model = Model::load(path)?;
    if json {
        let whole = json!({ "id": model.id().to_string(), "file": model.file() });
        println!("{}", serde_json::to_string_pretty(&whole)?);
        return Ok(());
    }
    header(path, &model);
    mechanics(&model);
    examination(&model);
    family(&model);
    metrics(&model);
    training(&model);
    Ok(())
}

/// Modification date of the file, which does not contain the day of the fit.
fn written(file: &Path) -> Option<String> {
    let at = std::fs::metadata(file).ok()?.modified().ok()?.duration_since(UNIX_EPOCH).ok()?;
    Some(WallTime::from_unix_seconds(at.as_secs()).to_string())
}

fn header(path: &Path, model: &Model) {
    let file = model.file();
    let named = |output: &OutputSpec| format!("{} ({})", output.name, output.unit);
    let outputs: Vec<String> = file.outputs.iter().map(named).collect();
    println!("model      {}", model.id());
    println!("file of    {}", written(path).unwrap_or_else(|| "unknown".to_owned()));
    println!("family     {}", file.family.title());
    println!("robot      {}, {} motor(s)", file.robot_id, model.motors());
    println!("outputs    {}", outputs.join(", "));
    let corners: Vec<_> = model.hull().corners().collect();
    for motor in 0..model.motors() {
        let values = corners.iter().map(|corner| corner[motor]);
        let (low, high) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        let shape = format!(" (hull of {} corners)", corners.len());
        let shape = if motor == 0 { &*shape } else { "" };
        println!("motor {motor}    {low:.0} to {high:.0} counts{shape}");
    }
}

/// Prints the effect of the motors on the outputs in the middle of the hull, without memory.
fn mechanics(model: &Model) {
    let gains = gains(model);
    let unit =
        model.file().outputs.first().map_or_else(String::new, |output| output.unit.to_string());
    let gain = |(motor, gain): (usize, &f64)| format!("motor {motor} {gain:.5} {unit}/count");
    let text: Vec<String> = gains.iter().enumerate().map(gain).collect();
    println!("gain       {} (middle of the hull)", text.join(", "));
    if let Some(rotation) = rotation_deg(model) {
        println!("rotation   {rotation:.1} deg from output 0 to the axis of motor 0");
    }
    let wipe = model.conditioning_range();
    if wipe.iter().any(|counts| *counts > 0.0) {
        let wipe = wipe.iter().take(model.motors()).map(|counts| format!("{counts:.0}"));
        let wipe: Vec<String> = wipe.collect();
        println!("memory     known once the motors have covered {} counts", wipe.join(" and "));
    } else {
        println!("memory     none");
    }
}

/// Prints the accuracy of the inverse on the model itself, and why the model is marked, if so.
fn examination(model: &Model) {
    let found = model.examine();
    let gains = found.gains.map_or_else(String::new, |[least, most]| {
        format!("; gain {least:.2} to {most:.2} times that of a linear fit")
    });
    let (missed, travel) = (100.0 * found.error, found.travel);
    println!(
        "inverse    misses {missed:.1} % of the motion, with {travel:.2} times the travel{gains}"
    );
    println!("range      the robot may use {:.1} % of the measured range", 100.0 * found.usable);
    if let Some(reason) = &model.file().worthless {
        println!("worthless  {reason}");
    }
}

/// Norms of the Jacobian's columns in the middle of the hull, in units of the file per count.
fn gains(model: &Model) -> Vec<f64> {
    let column =
        |motor: usize| slopes(model, motor).iter().map(|slope| slope * slope).sum::<f64>().sqrt();
    (0..model.motors()).map(column).collect()
}

fn slopes(model: &Model, motor: usize) -> Vec<f64> {
    let jacobian = model.jacobian(&model.hull().centre(), &model.new_memory());
    jacobian.iter().take(model.outputs()).map(|row| row[motor] / si(model)).collect()
}

fn rotation_deg(model: &Model) -> Option<f64> {
    let slopes = slopes(model, 0);
    let [first, second] = slopes.as_slice() else { return None };
    Some(second.atan2(*first).to_degrees())
}

fn family(model: &Model) {
    let gains = gains(model);
    match &model.file().family {
        FamilyParameters::Linear { .. } | FamilyParameters::Gmr { .. } => {}
        FamilyParameters::GmrPlay { plays, residual, .. } => {
            match residual {
                None => println!("residual   none"),
                Some(residual) => println!(
                    "residual   {} features: shape of degree {}, lags times degree {}",
                    residual.coefficients.first().map_or(0, Vec::len),
                    residual.shape_degree,
                    residual.lag_degree
                ),
            }
            play_table(plays, &gains);
        }
        FamilyParameters::ForceBalance { balance, read_out, .. } => {
            println!("polynomial degree {} of virtual counts", read_out.degree);
            balance_table(balance);
        }
        FamilyParameters::Network { network, memory_counts, .. } => {
            println!(
                "network    {} layers, a step every {:.0} counts, forgets over {memory_counts:.0?} \
                 counts",
                network.layers.len(),
                network.step_counts
            );
        }
    }
}

/// A play of threshold r is a gap of 2 r.
fn play_table(plays: &PlayParameters, gains: &[f64]) {
    println!("\n{:<8}{:>14}{:>12}{:>10}", "plays", "gap (counts)", "gap (deg)", "weight");
    let motors = plays.thresholds_counts.iter().zip(&plays.weights).enumerate();
    for (motor, (thresholds, weights)) in motors {
        let gain = gains.get(motor).copied().unwrap_or_default();
        for (threshold, weight) in thresholds.iter().zip(weights) {
            let (gap, motor) = (2.0 * threshold, format!("motor {motor}"));
            println!("{motor:<8}{gap:>14.1}{:>12.3}{weight:>10.4}", gap * gain);
        }
    }
    for threshold in &plays.planar_thresholds_counts {
        println!("{:<8}{:>14.1}", "planar", 2.0 * threshold);
    }
}

fn balance_table(balance: &BalanceParameters) {
    println!(
        "\n{:<8}{:>14}{:>20}{:>20}{:>22}",
        "motor", "gap (counts)", "preload (counts)", "friction (counts)", "friction per tension"
    );
    for (index, motor) in balance.motors.iter().enumerate() {
        let counts = |travel: f64| travel / motor.travel_per_count;
        let [plus, minus] = motor.preload.map(counts);
        let [by_plus, by_minus] = motor.friction_by_tension;
        println!(
            "{:<8}{:>14.1}{:>20}{:>20.1}{:>22}",
            format!("motor {index}"),
            2.0 * counts(motor.gap),
            format!("{plus:.1}, {minus:.1}"),
            counts(motor.friction),
            format!("{by_plus:.3}, {by_minus:.3}")
        );
        let [sine, cosine, twice_sine, twice_cosine] = motor.transmission_error.map(counts);
        if motor.transmission_error != [0.0; 4] {
            let (once, twice) = (sine.hypot(cosine), twice_sine.hypot(twice_cosine));
            println!(
                "        transmission error {once:.2} counts once and {twice:.2} twice a turn of \
                 {:.0} counts",
                balance.counts_per_turn
            );
        }
    }
    if balance.creep != [0.0; CREEPING] {
        let parts = balance.creep.map(|part| format!("{part:.3}")).join(", ");
        println!("creep   over 0.5, 5 and 50 s, relative to the wire stiffness: {parts}");
    }
}

fn metrics(model: &Model) {
    let header = ["R2", "RMSD", "NRMSD", "MAE", "max"].map(|name| format!("{name:>9}")).concat();
    println!("\n{:<28}{header}", "");
    for (output, metrics) in model.file().outputs.iter().zip(&model.file().metrics) {
        let name = format!("{} ({})", output.name, output.unit);
        metrics_line(&format!("{name:<16}training"), &metrics.training);
        if let Some(held_out) = &metrics.held_out {
            metrics_line(&format!("{:<16}held out", ""), held_out);
        }
    }
}

fn metrics_line(name: &str, FitMetrics { r2, rmsd, nrmsd, mae, max }: &FitMetrics) {
    println!("{name:<28}{r2:>9.4}{rmsd:>9.3}{nrmsd:>9.4}{mae:>9.3}{max:>9.3}");
}

fn training(model: &Model) {
    let training = &model.file().training;
    println!("\nfitted to  {} ({} rows)", training.data_file, training.rows);
    let recorded = training.recorded_at.as_deref().unwrap_or("at an unknown time");
    println!("           recorded {recorded}");
    let (software, seed, restarts) = (&training.software, training.seed, training.restarts);
    println!("by         {software}, seed {seed}, {restarts} start(s)");
    if let (Some(likelihood), Some(bic)) = (training.log_likelihood, training.bic) {
        println!("           log-likelihood {likelihood:.4} nats/row, BIC {bic:.1}");
    }
}
