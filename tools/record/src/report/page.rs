//! The report as a document: what the figures show, in words and tables.

use i2ris_report::number::{fixed, milliseconds};
use i2ris_report::{Document, Table};

use super::latency::Percentiles;
use super::reaches::ARRIVED_DEG;
use super::{TrialReport, figures};

/// Maximum number of events and reaches in their tables. Further ones are only counted.
const MAX_EVENTS: usize = 200;
const MAX_REACHES: usize = 100;

pub fn document(report: &TrialReport) -> Document {
    let recorded = report.recorded.as_deref().unwrap_or("at an unknown time");
    let mut page = Document::new(format!("Trial {}, recorded {recorded}", report.file));
    page.main_result(main_result(report));
    page.notice("Note", notices(report));
    let preflight = report.about.get("preflight").filter(|text| !text.is_empty());
    page.facts(preflight.map(|text| ("preflight", text.clone())));
    page.page_only(|page| page.facts(about(report)));
    write_tracking(&mut page, report);
    write_reaches(&mut page, report);
    write_targets(&mut page, report);
    if !report.pursuits.is_empty() {
        page.section("Pursuit");
        report.pursuits.iter().for_each(|pursuit| page.paragraph(format!("{}.", pursuit.line())));
    }
    write_hysteresis(&mut page, report);
    write_adaptation(&mut page, report);
    write_latencies(&mut page, report);
    write_events(&mut page, report);
    page.page_only(|page| write_streams(page, report));
    let version = env!("CARGO_PKG_VERSION");
    page.footer(format!("Written by i2ris {version} from the recording alone."));
    page
}

fn main_result(report: &TrialReport) -> String {
    let mut length = format!("{:.1} s", report.length_s);
    let mut goal = "its goal";
    if let Some(out_of_reach) = &report.out_of_reach {
        length = format!("{length}; {}", out_of_reach.sentence());
        goal = "the nearest goal in reach";
    }
    match (&report.camera, &report.estimate) {
        (Some(camera), _) => format!(
            "{length}. While it followed commands, the robot was {:.2} deg from {goal} by the \
             camera (root mean square of the two-dimensional error), at most {:.2} deg.",
            camera.length_rms_deg, camera.length.max
        ),
        (None, Some(estimate)) => format!(
            "{length}, no camera. While it followed commands, the model's estimate was {:.2} deg \
             from {goal} (root mean square of the two-dimensional error). This recording does \
             not contain the error of the robot itself.",
            estimate.length_rms_deg
        ),
        (None, None) => format!("{length}. The robot followed no commands in angles."),
    }
}

fn notices(report: &TrialReport) -> Vec<String> {
    let mut notices = Vec::new();
    if let Some(reason) = &report.cut_off {
        notices.push(format!("The recording is not complete ({reason})."));
    } else if report.outcome.is_empty() {
        notices.push("The recorder did not end cleanly: the recording has no outcome.".to_owned());
    }
    let missing: u64 = report.streams.iter().map(|stream| stream.missing).sum();
    if missing > 0 {
        notices.push(format!("{missing} message(s) of the controller are missing."));
    }
    notices.extend(report.trial.unread().map(|text| format!("{text}.")));
    let other = "The model has not two angles: this report does not draw its outputs.";
    notices.extend(report.trial.has_other_outputs.then(|| other.to_owned()));
    let troubles = report.troubles().count();
    if troubles > 0 {
        notices.push(format!("{troubles} unintended event(s); see the list."));
    }
    notices
}

fn about(report: &TrialReport) -> Vec<(String, String)> {
    // The offset of the clocks is for programs.
    let is_shown = |(name, value): &(&String, &String)| {
        !value.is_empty() && !name.ends_with("_ns") && *name != "preflight"
    };
    let about = report.about.iter().filter(is_shown);
    let about = about.map(|(name, value)| (name.replace('_', " "), value.clone()));
    let mut facts: Vec<(String, String)> = about.collect();
    let attached = report.attached.iter().map(|(name, size)| format!("{name} ({size} bytes)"));
    let attached: Vec<String> = attached.collect();
    let attached = if attached.is_empty() { "nothing".to_owned() } else { attached.join(", ") };
    facts.push(("attached".to_owned(), attached));
    facts
}

fn write_tracking(page: &mut Document, report: &TrialReport) {
    page.section("Tracking");
    if report.trial.goal.is_empty() && report.trial.measured.is_empty() {
        page.paragraph("No pair of angles was recorded.");
        return;
    }
    page.figure(
        figures::angles(report),
        "Angles over time, and the error while commands were followed. The estimate is the \
         model's, from the encoders: it is only as accurate as the model.",
    );
    let header = "against/samples/pitch RMS/yaw RMS/length RMS/p50/p90/p99/max".split('/');
    let caption = "Error while commands were followed, degrees; length: of the two-dimensional \
                   error.";
    let mut table = Table::new(caption, header);
    let sources = [
        ("angles by the camera", &report.camera, true),
        ("the model's estimate", &report.estimate, false),
    ];
    for (name, tracking, strong) in sources {
        if let Some(tracking) = tracking {
            let Percentiles { p50, p90, p99, max } = tracking.length;
            let (pitch, yaw) = (tracking.pitch_rms_deg, tracking.yaw_rms_deg);
            let degrees = [pitch, yaw, tracking.length_rms_deg, p50, p90, p99, max];
            let cells = [name.to_owned(), tracking.samples.to_string()].into_iter();
            let cells = cells.chain(degrees.map(|value| fixed(value, 3)));
            table.row(cells).strong = strong;
        }
    }
    page.table(table);
}

fn pose([pitch, yaw]: [f64; 2]) -> String {
    format!("{pitch:+.2} {yaw:+.2}")
}

fn time_or_no(time: Option<f64>) -> String {
    time.map_or_else(|| "no".to_owned(), |time| fixed(time, 2))
}

fn write_reaches(page: &mut Document, report: &TrialReport) {
    let Some(score) = &report.reaches else { return };
    page.section("Reaches");
    let arrived = (score.arrived * score.reaches.len() as f64).round();
    let times = score.arrived_s.map_or_else(String::new, |[median, p95]| {
        format!(" Time until then: median {median:.2} s, 95 % {p95:.2} s.")
    });
    page.paragraph(format!(
        "{} point-to-point motions by the {}; in {arrived} of them the snake came within \
         {ARRIVED_DEG} deg of the end and stayed.{times} Overshoot: median {:.2} deg, 95 % {:.2} \
         deg.",
        score.reaches.len(),
        score.by,
        score.overshoot_deg[0],
        score.overshoot_deg[1]
    ));
    let header = "at (s)/from (deg)/to (deg)/goal moves (s)/arrived (s)/overshoot (deg)/detour";
    let caption = "Every reach; detour: path of the goal divided by the distance.";
    let mut table = Table::new(caption, header.split('/'));
    for reach in score.reaches.iter().take(MAX_REACHES) {
        table.row([
            fixed(reach.t_s, 2),
            pose(reach.from_deg),
            pose(reach.to_deg),
            fixed(reach.goal_s, 2),
            time_or_no(reach.arrived_s),
            fixed(reach.overshoot_deg, 2),
            fixed(reach.detour, 2),
        ]);
    }
    page.page_only(|page| page.table(table));
}

fn write_targets(page: &mut Document, report: &TrialReport) {
    let Some(score) = &report.targets else { return };
    page.section("Reach and hold");
    page.paragraph(format!("{}.", score.line()));
    let header = "number/shown at (s)/from (deg)/target (deg)/arrived (s)/held (s)/overshoot (deg)/\
                  detour";
    let caption = format!(
        "Every target, with the time since it was shown. Arrived: within {ARRIVED_DEG} deg; \
         detour: path of the goal divided by the distance."
    );
    let mut table = Table::new(caption, header.split('/'));
    for target in &score.targets {
        table.row([
            target.number.to_string(),
            fixed(target.t_s, 2),
            pose(target.from_deg),
            pose(target.to_deg),
            time_or_no(target.arrived_s),
            time_or_no(target.held_s),
            fixed(target.overshoot_deg, 2),
            fixed(target.detour, 2),
        ]);
    }
    page.page_only(|page| page.table(table));
}

fn write_hysteresis(page: &mut Document, report: &TrialReport) {
    let Some(first) = report.hysteresis.first() else { return };
    page.section("Hysteresis");
    let caption = format!(
        "Angle (by {}) against the counts along the direction in which it changes most. Below: its \
         distance from the plane through all counts, where the loop shows. Inner loops and the \
         other axis spread the samples.",
        first.from
    );
    page.figure(figures::loops(&report.hysteresis), caption);
    page.facts(report.hysteresis.iter().map(|found| {
        let width = found.width_deg.map(|width| format!("{width:.2} deg"));
        let width = width.unwrap_or_else(|| "not known".to_owned());
        let slope = found.slope_deg_per_count;
        let name = format!("{}: width of the loop", found.output);
        (name, format!("{width}; {slope:.4} deg per count"))
    }));
}

/// Nothing if the adaptation was off all the time.
fn write_adaptation(page: &mut Document, report: &TrialReport) {
    let Some(last) = report.trial.adaptation.last() else { return };
    page.section("Adaptation");
    page.figure(
        figures::adaptation(&report.trial),
        "The applied drift correction, and the share of the budget: a warning at 70 %; at 100 % \
         adaptation stops.",
    );
    let dropped: u64 = last.frames_dropped.iter().sum();
    let frames = format!(
        "{} used, {} rejected, {} while adaptation was paused, {dropped} dropped",
        last.frames_used, last.frames_refused, last.frames_paused
    );
    let errors = format!(
        "{:.3} deg from the calibrated model, {:.3} deg from the adapted one",
        last.calibrated_error.to_degrees(),
        last.adapted_error.to_degrees()
    );
    page.facts([
        ("frames", frames),
        ("camera, last window of 10 s", errors),
        ("reverted", last.taken_back.to_string()),
    ]);
}

fn write_latencies(page: &mut Document, report: &TrialReport) {
    page.section("Latencies");
    page.figure(
        figures::latencies(report),
        "Histograms with bins of equal width on a logarithmic axis; the control loop by its own \
         statistics, a point per second. On a virtual or shared machine the machine itself causes \
         the maxima.",
    );
    let mut table = Table::new("Percentiles.", ["", "p50", "p90", "p99", "max"]);
    let timing = report.control_loop.as_ref();
    let rows = [
        ("command published to its setpoint on the line", report.command_to_line_ms, 1.0),
        ("age of the encoder position in a tick", report.reading_age_ms, 1.0),
        ("loop: lateness of a tick (typical second)", timing.map(|t| t.lateness_us), 1e-3),
        ("loop: computing time of a tick (typical second)", timing.map(|t| t.compute_us), 1e-3),
    ];
    for (name, percentiles, ms) in rows {
        if let Some(Percentiles { p50, p90, p99, max }) = percentiles {
            let numbers = [p50, p90, p99, max].map(|value| milliseconds(value * ms));
            table.row([name.to_owned()].into_iter().chain(numbers));
        }
    }
    page.table(table);
    if let Some(timing) = timing {
        let scheduling = match timing.priority {
            0 => "normal scheduling".to_owned(),
            priority => format!("SCHED_FIFO {priority}"),
        };
        page.paragraph(format!(
            "The loop ran {} ticks, skipped {}, under {scheduling}.",
            timing.ticks, timing.missed
        ));
    }
}

fn write_events(page: &mut Document, report: &TrialReport) {
    page.section("Events");
    let (events, troubles) = (report.events.len(), report.troubles().count());
    page.paragraph(format!("{events} events, {troubles} of them unintended."));
    let mut table = Table::new("Unintended events are bold.", ["time (s)", "what"]).text_column(1);
    for event in report.events.iter().take(MAX_EVENTS) {
        let cells = [fixed(event.t_s, 3), event.what.clone()];
        table.row(cells).strong = event.is_trouble;
    }
    page.page_only(|page| {
        page.table(table);
        if events > MAX_EVENTS {
            let more = events - MAX_EVENTS;
            page.paragraph(format!("And {more} more, which `i2ris record report --json` lists."));
        }
    });
}

fn write_streams(page: &mut Document, report: &TrialReport) {
    page.section("Streams");
    let caption = "Recorded messages. Missing: by the sequence numbers of messages of one sender.";
    let mut table = Table::new(caption, ["stream", "messages", "per second", "missing"]);
    for stream in &report.streams {
        table.row([
            stream.name.to_owned(),
            stream.messages.to_string(),
            fixed(stream.rate_hz, 1),
            stream.missing.to_string(),
        ]);
    }
    page.table(table);
}
