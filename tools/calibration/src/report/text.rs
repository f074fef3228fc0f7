//! The printed report of a fit.

use std::fmt::{self, Display, Formatter};

use i2ris::model::file::FitMetrics;

use super::choice::explanation;
use super::fit::{CalibrationReport, OutputFacts};
use crate::quality::NoiseFloor;

/// Number of recording lines that are listed before the rest is only counted.
const NAMED: usize = 12;

impl Display for CalibrationReport {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.what_was_read(f)?;
        self.what_was_found(f)?;
        self.write_metrics(f)?;
        for family in &self.families {
            if let Some(reading) = &family.reading {
                let name = &family.name;
                writeln!(f, "\n{name}: properties of the robot (lengths in output units):")?;
                reading.lines().try_for_each(|line| write!(f, "{}", Wrapped("", line)))?;
            }
        }
        for warning in &self.warnings {
            write!(f, "\n{}", Wrapped("warning", warning))?;
        }
        if !self.choice.is_empty() {
            writeln!(f, "\nchoice     by held-out rows, and by the inverse on the other families")?;
        }
        self.choice.iter().try_for_each(|score| write!(f, "{}", Wrapped("", &score.sentence)))?;
        if let Some(explanation) = explanation(&self.choice, self.unit()) {
            write!(f, "{}", Wrapped("", &explanation))?;
        }
        let range = format!("the robot may use {:.1} % of the measured poses", self.usable_percent);
        write!(f, "\n{}", Wrapped("range", &range))?;
        if let Some(hand) = &self.hand {
            write!(f, "{}", Wrapped("limits", &format!("as delivered: {hand}")))?;
        }
        if let Some(unexplained) = &self.unexplained {
            write!(f, "{}", Wrapped("residual", &unexplained.to_string()))?;
        }
        if let Some(beyond) = &self.beyond_model {
            write!(f, "{}", Wrapped("warning", beyond))?;
        }
        writeln!(f, "model id   {}", self.model_id)
    }
}

impl CalibrationReport {
    fn what_was_read(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let read = &self.recording.read;
        let at = self.recorded_at.as_ref().map_or_else(String::new, |at| format!(", {at}"));
        writeln!(f, "recording  {}{at}", self.recording.name)?;
        let motors = read.counts_columns.iter().enumerate();
        let motors = motors.map(|(motor, column)| format!("motor {motor} `{column}`"));
        let outputs = self.outputs.iter().zip(&read.output_columns);
        let outputs = outputs.map(|(output, column)| format!("{} `{column}`", output.name));
        let time = read.time_column.iter().map(|column| format!("time `{column}`"));
        writeln!(f, "columns    {}", joined(motors.chain(outputs).chain(time)))?;
        let positions = match read.positions {
            0 => String::new(),
            positions => format!(", {positions} of them without angles"),
        };
        let (rows, dropped) = (read.rows, &read.dropped);
        write!(f, "rows       {rows}{positions}; {} dropped for an empty cell", dropped.len())?;
        list(f, dropped.iter().map(|row| format!("{} ({})", row.line, row.column)))
    }

    fn what_was_found(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "spikes     {} reading(s) flagged", self.spikes.len())?;
        list(
            f,
            self.spikes.iter().map(|spike| match self.outputs.get(spike.output) {
                Some(OutputFacts { name, unit, .. }) => {
                    let (line, measured, off) = (spike.line, spike.measured, spike.distance);
                    format!("{line} ({name} {measured:.2} {unit}, {off:+.2} off)")
                }
                None => spike.line.to_string(),
            }),
        )?;
        let noise = |output: &OutputFacts| match &output.noise {
            Some(NoiseFloor { deviation, method, samples }) => {
                format!("{} {deviation:.3} {} ({samples} {method})", output.name, output.unit)
            }
            None => format!("{} cannot be estimated from these rows", output.name),
        };
        writeln!(f, "noise      {}", joined(self.outputs.iter().map(noise)))?;
        write!(f, "{}", Wrapped("axes", &self.axes()))?;
        if let Some(latency) = self.latency {
            let (ms, deviation) = (1e3 * latency.seconds, 1e3 * latency.deviation_s);
            let stands_out = ms.abs() > 4.0 * deviation.max(1.0);
            let hint = match stands_out {
                true => "; `--latency-ms auto` corrects it if held-out rows confirm it",
                false => "",
            };
            writeln!(
                f,
                "latency    outputs are stamped {ms:+.1} ms late (standard deviation \
                 {deviation:.1} ms){hint}"
            )?;
        }
        let every = match self.recording.every {
            1 => String::new(),
            every => format!(": every {every}th row; more hardly improve the fit"),
        };
        writeln!(f, "training   {} row(s){every}", self.recording.training)?;
        match self.recording.held_out {
            0 => writeln!(f, "held out   nothing"),
            rows => writeln!(f, "held out   {rows} row(s): {}", self.recording.held_out_rows),
        }
    }

    /// Average effect of the motors: it shows swapped columns and mirrored images.
    fn axes(&self) -> String {
        let motor = |motor: usize| {
            let moves = self.outputs.iter().map(|OutputFacts { name, unit, gain, .. }| {
                let gain = gain.get(motor).copied().unwrap_or_default();
                format!("{name} by {gain:+.4} {unit}")
            });
            let moves: Vec<_> = moves.collect();
            format!("one count of motor {motor} moves {}", moves.join(" and "))
        };
        format!(
            "{}; if the robot moves differently, two columns are swapped (--counts, --angles) or \
             the image is mirrored",
            joined((0..self.recording.motors).map(motor))
        )
    }

    fn write_metrics(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let header =
            ["R2", "RMSD", "NRMSD", "MAE", "max"].map(|name| format!(" {name:>9}")).concat();
        writeln!(f, "\n{:<44}{header}", "")?;
        for (index, output) in self.outputs.iter().enumerate() {
            let mut name = format!("{} ({})", output.name, output.unit);
            for family in &self.families {
                let Some(metrics) = family.metrics.get(index) else { continue };
                let family = format!("{}{}", family.title, if family.chosen { "*" } else { "" });
                let line = format!("{name:<12}{family:<24}training");
                metrics_line(f, &line, Some(&metrics.training))?;
                if self.recording.held_out > 0 {
                    let line = format!("{:<36}held out", "");
                    metrics_line(f, &line, metrics.held_out.as_ref())?;
                }
                name.clear();
            }
        }
        for family in &self.families {
            let note = family.note.iter().map(|note| format!("`{}`: {note}.", family.name));
            note.into_iter().try_for_each(|note| write!(f, "{}", Wrapped("", &note)))?;
        }
        for (family, reason) in &self.failures {
            write!(f, "{}", Wrapped("", &format!("No `{family}`: {reason}.")))?;
        }
        match self.recording.held_out_flagged {
            0 => Ok(()),
            flagged => writeln!(
                f,
                "The held-out rows include {flagged} flagged row(s), which count in these figures."
            ),
        }
    }
}

fn metrics_line(f: &mut Formatter<'_>, name: &str, metrics: Option<&FitMetrics>) -> fmt::Result {
    match metrics {
        Some(FitMetrics { r2, rmsd, nrmsd, mae, max }) => {
            writeln!(f, "{name:<44} {r2:>9.4} {rmsd:>9.3} {nrmsd:>9.4} {mae:>9.3} {max:>9.3}")
        }
        None => writeln!(f, "{name:<44} {:>9}", "constant"),
    }
}

fn joined(parts: impl Iterator<Item = String>) -> String {
    parts.collect::<Vec<_>>().join(", ")
}

/// Ends a line with the first of some lines of the recording.
fn list(f: &mut Formatter<'_>, lines: impl ExactSizeIterator<Item = String>) -> fmt::Result {
    let count = lines.len();
    if count == 0 {
        return writeln!(f);
    }
    let mut text = format!("line {}", joined(lines.take(NAMED)));
    if count > NAMED {
        text.push_str(&format!(" and {} more", count - NAMED));
    }
    write!(f, ":\n{}", Wrapped("", &text))
}

/// A name and text in lines of at most 100 columns, the text in the column of the values.
struct Wrapped<'a>(&'a str, &'a str);

impl Display for Wrapped<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mut before = format!("{:<11}", self.0);
        let mut width = 0;
        for word in self.1.split(' ') {
            if width > 0 && width + 1 + word.len() > 100 {
                writeln!(f)?;
                (before, width) = (" ".repeat(11), 0);
            }
            write!(f, "{before}{word}")?;
            width += before.len() + word.len();
            " ".clone_into(&mut before);
        }
        writeln!(f)
    }
}
