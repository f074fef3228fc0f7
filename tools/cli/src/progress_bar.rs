//! Progress display: a spinner, a time bar, and the progress of a fit.

use std::io::{IsTerminal, stderr};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use i2ris_calibration::progress::Progress;
use indicatif::{ProgressBar, ProgressStyle};

const PATIENCE: Duration = Duration::from_millis(700);
const BETWEEN_LINES: Duration = Duration::from_secs(5);
const STEPS: f64 = 1000.0;
/// Share of the work below which the remaining time cannot be estimated.
const MIN_SHARE: f64 = 0.03;

pub fn spinner(what: &str) -> ProgressBar {
    let spinner = ProgressBar::new_spinner().with_message(what.to_owned());
    spinner.enable_steady_tick(Duration::from_millis(100));
    spinner
}

/// A bar that counts [`tenths`] of a second.
pub fn bar_of_time(what: &str, length_s: f64) -> ProgressBar {
    let bar = ProgressBar::new(tenths(length_s)).with_message(what.to_owned());
    styled(bar, "{msg} {wide_bar} {percent} %, {eta} left")
}

pub fn tenths(seconds: f64) -> u64 {
    (seconds * 10.0) as u64
}

/// The templates are fixed; an invalid one would only make the bar look plain.
fn styled(bar: ProgressBar, template: &str) -> ProgressBar {
    match ProgressStyle::with_template(template) {
        Ok(style) => bar.with_style(style),
        Err(_) => bar,
    }
}

/// Progress of a fit on stderr: a bar on a terminal, a line every few seconds into a pipe.
pub struct Bar {
    begun: Instant,
    bar: Option<ProgressBar>,
    work: Mutex<Work>,
}

impl Bar {
    pub fn new() -> Self {
        let bar = stderr().is_terminal().then(|| {
            let bar = ProgressBar::hidden();
            bar.set_length(STEPS as u64);
            styled(bar, "{prefix} {wide_bar} {percent} %{msg}")
        });
        Self { begun: Instant::now(), bar, work: Mutex::new(Work::default()) }
    }

    fn change(&self, change: impl FnOnce(&mut Work)) {
        let elapsed = self.begun.elapsed();
        let Ok(mut work) = self.work.lock() else { return };
        change(&mut work);
        match &self.bar {
            Some(bar) if elapsed > PATIENCE => {
                if bar.is_hidden() {
                    bar.set_draw_target(indicatif::ProgressDrawTarget::stderr());
                }
                bar.set_prefix(format!("fitting {}", work.name));
                bar.set_message(work.time_to_go(elapsed));
                bar.set_position((STEPS * work.share()) as u64);
            }
            None if elapsed >= work.next_line + BETWEEN_LINES => {
                work.next_line = elapsed;
                eprintln!("{}", work.line(elapsed));
            }
            _ => {}
        }
    }
}

impl Progress for Bar {
    fn part(&self, name: &str, from: f64, to: f64) {
        self.change(|work| {
            let (name, next_line) = (name.to_owned(), work.next_line);
            *work = Work { name, from, to, next_line, ..Work::default() }
        });
    }

    fn begin(&self, steps: usize) {
        self.change(|work| (work.steps, work.done) = (steps, 0));
    }

    fn step(&self) {
        self.change(|work| work.done += 1);
    }

    fn end(&self) {
        self.change(|work| {
            work.pieces += 1;
            (work.steps, work.done) = (0, 0);
        });
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

#[derive(Debug, Clone, Default)]
struct Work {
    name: String,
    from: f64,
    to: f64,
    /// Completed pieces of it; their total number is unknown in advance.
    pieces: i32,
    steps: usize,
    done: usize,
    next_line: Duration,
}

impl Work {
    /// Every piece counts as half of the rest of its part.
    fn share(&self) -> f64 {
        let piece = if self.steps == 0 { 0.0 } else { self.done as f64 / self.steps as f64 };
        let left = 0.5_f64.powi(self.pieces) * (1.0 - 0.5 * piece.min(1.0));
        self.from + (self.to - self.from) * (1.0 - left)
    }

    fn time_to_go(&self, elapsed: Duration) -> String {
        let share = self.share();
        if share < MIN_SHARE {
            return String::new();
        }
        let left = elapsed.as_secs_f64() * (1.0 - share) / share;
        format!(", about {:.0} s to go", left.max(1.0))
    }

    fn line(&self, elapsed: Duration) -> String {
        let percent = 100.0 * self.share();
        let to_go = self.time_to_go(elapsed);
        format!("fitting {}: {percent:.0} %{to_go}", self.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn line_reports_the_family_and_the_time_left() {
        let work = Work { name: "gmr".to_owned(), to: 1.0, steps: 4, done: 2, ..Work::default() };
        let line = work.line(Duration::from_secs(10));
        assert_eq!(line, "fitting gmr: 25 %, about 30 s to go");
        assert_eq!(Work::default().line(Duration::from_secs(10)), "fitting : 0 %");
    }
}
