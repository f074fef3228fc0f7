//! What the demo prints at the end.

use i2ris::ipc::payload::PeriodStatistics;

use super::tracking::{MotionRun, length_percentile_deg, rms_deg};
use super::unseen_motion::Motion;
use i2ris_statistics::quantile;

/// One model and its run.
pub struct Followed {
    /// Name of the model's family.
    pub family: String,
    /// What it followed.
    pub motion: Motion,
    /// What it showed.
    pub run: MotionRun,
}

/// Prints everything. `note` says what the camera adds.
pub fn print(followed: &[Followed], note: &str) {
    tracking(followed);
    println!("  {note}");
    if let Some(last) = followed.last() {
        statistics(&last.run.statistics);
        latency(&last.run.command_to_wire_us);
    }
}

fn tracking(followed: &[Followed]) {
    println!("\nTracking error on unseen motions: goal against camera, degrees");
    println!(
        "  {:14} {:16} {:>8} {:>9} {:>9} {:>10} {:>10} {:>10} {:>13}",
        "motion",
        "model",
        "frames",
        "pitch RMS",
        "yaw RMS",
        "length RMS",
        "length p99",
        "length max",
        "below linear"
    );
    for Followed { family, motion, run } in followed {
        let errors = &run.errors_deg;
        let [pitch, yaw, length] = rms_deg(errors);
        let (p99, max) = (length_percentile_deg(errors, 0.99), length_percentile_deg(errors, 1.0));
        let linear =
            followed.iter().find(|other| other.family == "linear" && other.motion == *motion);
        let below = match linear {
            Some(linear) if family != "linear" => {
                format!("{:.1} %", 100.0 * (1.0 - length / rms_deg(&linear.run.errors_deg)[2]))
            }
            _ => "-".to_owned(),
        };
        println!(
            "  {motion:14} {family:16} {:>8} {pitch:>9.3} {yaw:>9.3} {length:>10.3} {p99:>10.3} \
             {max:>10.3} {below:>13}",
            errors.len()
        );
    }
}

fn statistics(windows: &[PeriodStatistics]) {
    let (Some(first), Some(last)) = (windows.first(), windows.last()) else {
        println!("\nThe loop reported no statistics.");
        return;
    };
    let us = |ns: u64| ns as f64 / 1e3;
    let worst =
        |pick: fn(&PeriodStatistics) -> u64| us(windows.iter().map(pick).max().unwrap_or(0));
    let typical = |pick: fn(&PeriodStatistics) -> u64| {
        let mut all: Vec<f64> = windows.iter().map(|window| us(pick(window))).collect();
        all.sort_by(f64::total_cmp);
        quantile(&all, 0.5).unwrap_or(f64::NAN)
    };
    let ticks: u64 = windows.iter().map(|window| window.ticks).sum();
    let missed: u64 = windows.iter().map(|window| window.missed).sum();
    println!(
        "\nControl loop, {:.0} Hz: {ticks} ticks, {missed} skipped; {}",
        1e9 / first.period_ns as f64,
        granted(last)
    );
    println!(
        "  {:12} {:>14} {:>14} {:>10}",
        "microseconds", "p50 (typical)", "p99 (typical)", "max"
    );
    println!(
        "  {:12} {:>14.1} {:>14.1} {:>10.1}",
        "lateness",
        typical(|w| w.lateness.p50_ns),
        typical(|w| w.lateness.p99_ns),
        worst(|w| w.lateness.max_ns)
    );
    println!(
        "  {:12} {:>14.1} {:>14.1} {:>10.1}",
        "compute",
        typical(|w| w.compute.p50_ns),
        typical(|w| w.compute.p99_ns),
        worst(|w| w.compute.max_ns)
    );
    println!("  typical: median over the windows of one second");
}

fn granted(statistics: &PeriodStatistics) -> String {
    let scheduling = match statistics.priority {
        0 => "normal scheduling".to_owned(),
        priority => format!("SCHED_FIFO {priority}"),
    };
    let memory = if statistics.memory_locked == 1 { "memory locked" } else { "memory not locked" };
    let cpu = if statistics.cpu == u32::MAX {
        "not pinned".to_owned()
    } else {
        format!("pinned to processor {}", statistics.cpu)
    };
    format!("{scheduling}, {memory}, {cpu}")
}

fn latency(sorted_us: &[f64]) {
    let ms = |share| quantile(sorted_us, share).unwrap_or(f64::NAN) / 1e3;
    println!(
        "\nCommand published by another process -> its set-point handed to the serial line, {} \
         commands",
        sorted_us.len()
    );
    println!(
        "  p50 {:.2} ms, p90 {:.2} ms, p99 {:.2} ms, max {:.2} ms",
        ms(0.5),
        ms(0.9),
        ms(0.99),
        ms(1.0)
    );
    println!("  On the wire a set-point takes another 1.2 ms (14 bytes at 115200 baud).");
}
