//! What `i2ris calibrate fit` prints: at most 100 columns wide.

use std::fmt::{self, Display, Formatter};

use i2ris::model::Model;
use i2ris::model::ModelError;
use i2ris::model::file::{FamilyParameters, FitMetrics, OutputSpec};
use i2ris_calibration::fit::family::Family;
use i2ris_calibration::fit::split::SplitKind;
use i2ris_calibration::fit::{Candidate, Components, FitOptions, FitOutcome, Verdict};
use i2ris_calibration::recording::{ReadReport, Recording};
use i2ris_calibration::survey::noise::NoiseFloor;
use i2ris_calibration::survey::spike::Spike;

/// Lines of the recording that are named one by one before the rest is only counted.
const NAMED: usize = 12;

/// The whole report.
pub fn report<'a>(
    recording: &'a Recording,
    read: &'a ReadReport,
    options: &'a FitOptions,
    outcome: &'a FitOutcome,
) -> impl Display + 'a {
    Report { recording, read, options, outcome }
}

struct Report<'a> {
    recording: &'a Recording,
    read: &'a ReadReport,
    options: &'a FitOptions,
    outcome: &'a FitOutcome,
}

impl Display for Report<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.what_was_read(f)?;
        self.what_was_found(f)?;
        self.candidates(f)?;
        self.metrics(f)?;
        self.readings(f)?;
        for warning in &self.outcome.report.survey.warnings {
            write!(
                f,
                "\nwarning{}",
                &Wrapped(&warning.to_string()).to_string()["warning".len()..]
            )?;
        }
        let reasons = self.outcome.reasons();
        if !reasons.is_empty() {
            writeln!(
                f,
                "\nchoice     by rows held out, and by the inverse run on the other families"
            )?;
        }
        for reason in reasons {
            write!(f, "{}", Wrapped(&reason))?;
        }
        writeln!(f, "\nmodel id   {}", self.outcome.model.id())
    }
}

impl Report<'_> {
    fn what_was_read(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let read = self.read;
        writeln!(f, "recording  {}", self.recording.name())?;
        let motors = read
            .counts_columns
            .iter()
            .enumerate()
            .map(|(motor, column)| format!("motor {motor} `{column}`"));
        let outputs = self.recording.outputs().iter().zip(&read.output_columns);
        let outputs = outputs.map(|(output, column)| format!("{} `{column}`", output.name));
        let time = read.time_column.iter().map(|column| format!("time `{column}`"));
        let columns: Vec<_> = motors.chain(outputs).chain(time).collect();
        writeln!(f, "columns    {}", columns.join(", "))?;
        let positions = match read.positions {
            0 => String::new(),
            positions => format!(", {positions} of them without angles"),
        };
        write!(
            f,
            "rows       {}{positions}; {} dropped for an empty cell",
            read.rows,
            read.dropped.len()
        )?;
        list(f, read.dropped.iter().map(|row| format!("{} ({})", row.line, row.column)))
    }

    fn what_was_found(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let FitOutcome { report, .. } = self.outcome;
        write!(f, "spikes     {} reading(s) flagged", report.survey.spikes.len())?;
        let outputs = self.recording.outputs();
        list(f, report.survey.spikes.iter().map(|spike| spike_text(spike, outputs)))?;
        let noise = outputs
            .iter()
            .zip(&report.survey.noise)
            .map(|(output, noise)| noise_text(output, noise.as_ref()));
        writeln!(f, "noise      {}", noise.collect::<Vec<_>>().join(", "))?;
        self.axes(f)?;
        self.latency(f)?;
        self.drift(f)?;
        let (training, held_out) = (report.training.len(), report.split.held_out().count());
        let every = match report.every {
            1 => String::new(),
            every => format!(": every {every}th, more add hardly anything"),
        };
        writeln!(f, "training   {training} row(s){every}")?;
        match report.split.kind() {
            SplitKind::Nothing => writeln!(f, "held out   nothing"),
            kind => writeln!(f, "held out   {held_out} row(s): {kind}"),
        }
    }

    /// What the motors do on average: who knows the robot sees columns that are swapped, and a
    /// picture that is mirrored.
    fn axes(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let linear = self.outcome.linear.file();
        let FamilyParameters::Linear { gain, .. } = &linear.family else {
            return Ok(());
        };
        let motor = |motor: usize| {
            let outputs = linear.outputs.iter().zip(gain);
            let moves = outputs.map(|(output, row)| {
                let gain = row.get(motor).copied().unwrap_or_default();
                format!("{} by {gain:+.4} {}", output.name, output.unit)
            });
            let moves: Vec<_> = moves.collect();
            format!("a count of motor {motor} moves {}", moves.join(" and "))
        };
        let motors: Vec<_> = (0..self.recording.motors()).map(motor).collect();
        let text = format!(
            "{}; where the robot does otherwise, two columns are swapped (--counts, \
             --angles) or the picture is mirrored",
            motors.join(", ")
        );
        write!(f, "axes{}", &Wrapped(&text).to_string()["axes".len()..])
    }

    /// How late the outputs are, if that stands out of its uncertainty.
    fn latency(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Some(latency) = self.outcome.report.survey.latency else {
            return Ok(());
        };
        let (ms, deviation) = (1e3 * latency.seconds, 1e3 * latency.deviation_s);
        let hint = if ms.abs() > 4.0 * deviation.max(1.0) {
            "; `--latency-ms auto` takes it off"
        } else {
            ""
        };
        writeln!(
            f,
            "latency    outputs are stamped {ms:+.1} ms late (standard deviation {deviation:.1} \
             ms){hint}"
        )
    }

    fn drift(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let drift = &self.outcome.report.drift;
        let part = if drift.cycles { "cycle" } else { "fifth of the rows" };
        let outputs = self.recording.outputs().iter().enumerate().map(|(index, output)| {
            let (per_part, largest) = (drift.per_part(index), drift.largest_step(index));
            format!("{} {per_part:+.3} {} (at most {largest:.3})", output.name, output.unit)
        });
        let outputs: Vec<_> = outputs.collect();
        let text = format!("per {part}, away from the model: {}", outputs.join(", "));
        write!(f, "drift{}", &Wrapped(&text).to_string()["drift".len()..])
    }

    /// What the parameters say about the robot.
    fn readings(&self, f: &mut Formatter<'_>) -> fmt::Result {
        for outcome in &self.outcome.families {
            if let Some(reading) = self.outcome.reading(outcome) {
                writeln!(
                    f,
                    "\n{} says of the robot (lengths in the unit of the outputs):",
                    outcome.family
                )?;
                reading.lines().try_for_each(|line| write!(f, "{}", Wrapped(line)))?;
            }
        }
        Ok(())
    }

    /// What was tried, where a number of components was chosen.
    fn candidates(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let candidates = &self.outcome.report.candidates;
        if candidates.is_empty() {
            return Ok(());
        }
        let starts = self.options.em.restarts;
        writeln!(
            f,
            "\ngmr: mixtures, best of {starts} starts each (log-likelihood and its spread over the \
             starts: nats/row; left\nout: RMS length of the error on blocks left out)"
        )?;
        writeln!(
            f,
            "{:>4} {:>15} {:>8} {:>7} {:>12} {:>9}",
            "K", "log-likelihood", "spread", "failed", "BIC", "left out"
        )?;
        candidates.iter().try_for_each(|candidate| candidate_line(f, candidate))?;
        match (self.options.components, candidates.last().map(|last| &last.verdict)) {
            (Components::UpTo(most), Some(Verdict::Chosen)) => {
                writeln!(f, "More might be better: --max-components was {most}.")
            }
            _ => Ok(()),
        }
    }

    fn metrics(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let header =
            ["R2", "RMSD", "NRMSD", "MAE", "max"].map(|name| format!(" {name:>9}")).concat();
        writeln!(f, "\n{:<44}{header}", "")?;
        for (index, output) in self.recording.outputs().iter().enumerate() {
            let mut name = format!("{} ({})", output.name, output.unit);
            for outcome in &self.outcome.families {
                if let Ok(model) = &outcome.result {
                    self.family(f, &name, outcome.family, model, index)?;
                    name.clear();
                }
            }
        }
        for outcome in &self.outcome.families {
            if let Err(reason) = &outcome.result {
                write!(f, "{}", Wrapped(&format!("No `{}`: {reason}.", outcome.family)))?;
            }
        }
        let flagged = self
            .outcome
            .report
            .split
            .held_out()
            .filter(|row| self.outcome.report.survey.is_flagged(*row));
        match flagged.count() {
            0 => Ok(()),
            flagged => writeln!(
                f,
                "The rows held out hold {flagged} flagged row(s), which count in these figures."
            ),
        }
    }

    fn family(
        &self,
        f: &mut Formatter<'_>,
        name: &str,
        family: Family,
        model: &Model,
        output: usize,
    ) -> fmt::Result {
        let Some(metrics) = model.file().metrics.get(output) else {
            return Ok(());
        };
        let taken = if family == self.outcome.family { "*" } else { "" };
        metrics_line(
            f,
            &format!("{name:<12}{:<24}training", format!("{family}{taken}")),
            Some(&metrics.training),
        )?;
        if self.outcome.report.split.is_empty() {
            return Ok(());
        }
        metrics_line(f, &format!("{:<36}held out", ""), metrics.held_out.as_ref())
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

fn candidate_line(f: &mut Formatter<'_>, candidate: &Candidate) -> fmt::Result {
    let verdict = match &candidate.verdict {
        Verdict::Chosen => "chosen",
        Verdict::Surpassed => "",
        Verdict::Refused(ModelError::NotInvertible { .. }) => {
            "refused: its inverse fails in the hull"
        }
        Verdict::Refused(_) => "refused",
        Verdict::TooFlat(_) => "refused: too flat somewhere",
        Verdict::Failed(_) => "no start succeeded",
    };
    let line = match &candidate.fit {
        Some(fit) => {
            let (failed, spread) = (fit.starts.failures.len(), fit.starts.spread());
            let unfinished = if fit.converged { "" } else { " (not converged)" };
            let (likelihood, bic) = (fit.log_likelihood, fit.bic);
            let k = candidate.components;
            let left_out = candidate.left_out_rms.map_or("-".to_owned(), |rms| format!("{rms:.3}"));
            format!(
                "{k:>4} {likelihood:>15.4} {spread:>8.4} {failed:>7} {bic:>12.1} {left_out:>9}  \
                 {verdict}{unfinished}"
            )
        }
        None => format!("{:>4} {verdict:>15}", candidate.components),
    };
    writeln!(f, "{}", line.trim_end())
}

fn spike_text(spike: &Spike, outputs: &[OutputSpec]) -> String {
    let Some(OutputSpec { name, unit }) = outputs.get(spike.output) else {
        return spike.line.to_string();
    };
    format!("{} ({name} {:.2} {unit}, {:+.2} off)", spike.line, spike.measured, spike.distance)
}

fn noise_text(output: &OutputSpec, noise: Option<&NoiseFloor>) -> String {
    let OutputSpec { name, unit } = output;
    match noise {
        Some(NoiseFloor { deviation, method, samples }) => {
            format!("{name} {deviation:.3} {unit} ({samples} {method})")
        }
        None => format!("{name} cannot be found from these rows"),
    }
}

/// Ends a line with the first few of some lines of the recording.
fn list(f: &mut Formatter<'_>, lines: impl ExactSizeIterator<Item = String>) -> fmt::Result {
    let count = lines.len();
    if count == 0 {
        return writeln!(f);
    }
    let mut text = format!("line {}", lines.take(NAMED).collect::<Vec<_>>().join(", "));
    if count > NAMED {
        text.push_str(&format!(" and {} more", count - NAMED));
    }
    write!(f, ":\n{}", Wrapped(&text))
}

/// Text in lines of at most 100 columns, under the column of the values.
struct Wrapped<'a>(&'a str);

impl Display for Wrapped<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        const INDENT: &str = "           ";
        let mut width = 0;
        for word in self.0.split(' ') {
            if width > 0 && width + 1 + word.len() > 100 {
                writeln!(f)?;
                width = 0;
            }
            let before = if width == 0 { INDENT } else { " " };
            write!(f, "{before}{word}")?;
            width += before.len() + word.len();
        }
        writeln!(f)
    }
}
