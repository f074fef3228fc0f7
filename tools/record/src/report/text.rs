//! The report as a few lines of text.

use super::TrialReport;
use super::latency::Percentiles;
use super::reaches::times;
use super::tracking::TrackingError;

pub fn text(report: &TrialReport) -> String {
    let recorded = report.recorded.as_deref().unwrap_or("at an unknown time");
    let (file, length_s) = (&report.file, report.length_s);
    let mut lines = vec![format!("{file}: {length_s:.1} s, recorded {recorded}")];
    let preflight = report.about.get("preflight").filter(|text| !text.is_empty());
    lines.extend(preflight.map(|text| format!("  {text}")));
    lines.extend(report.trial.unread().map(|text| format!("  {text}")));
    let short = report.out_of_reach.as_ref();
    lines.extend(short.map(|found| format!("  {}", found.sentence())));
    lines.extend(report.camera.as_ref().map(|found| tracking("goal against camera", found)));
    lines.extend(report.estimate.as_ref().map(|found| tracking("goal against estimate", found)));
    lines.extend(report.reaches.as_ref().map(|score| {
        format!(
            "  {} reaches: {:.0} % within 0.15 deg by the {}{}; overshoot {:.2} deg (95 %)",
            score.reaches.len(),
            100.0 * score.arrived,
            score.by,
            times(score.arrived_s),
            score.overshoot_deg[1]
        )
    }));
    lines.extend(report.targets.as_ref().map(|score| format!("  {}", score.line())));
    lines.extend(report.pursuits.iter().map(|pursuit| format!("  {}", pursuit.line())));
    lines.extend(report.hysteresis.iter().map(|found| {
        let width = found.width_deg.map(|width| format!("{width:.2} deg wide"));
        let width = width.unwrap_or_else(|| "width not known".to_owned());
        format!("  loop of {:<6} ({}): {width}", found.output, found.from)
    }));
    let late = report.control_loop.as_ref().map(|timing| timing.lateness_us);
    for (name, percentiles, unit) in
        [("command to line", report.command_to_line_ms, "ms"), ("loop late", late, "us")]
    {
        lines.extend(percentiles.map(|Percentiles { p50, p99, max, .. }| {
            format!("  {name:<24} p50 {p50:.3} {unit}, p99 {p99:.3} {unit}, max {max:.3} {unit}")
        }));
    }
    let (events, troubles) = (report.events.len(), report.troubles().count());
    lines.push(format!("  {events} events, {troubles} of them unintended\n"));
    lines.join("\n")
}

fn tracking(name: &str, found: &TrackingError) -> String {
    let TrackingError { length_rms_deg: rms, samples, length, .. } = found;
    let Percentiles { p99, max, .. } = length;
    format!("  {name:<24} RMS {rms:.3} deg, p99 {p99:.3} deg, max {max:.3} deg ({samples} samples)")
}
