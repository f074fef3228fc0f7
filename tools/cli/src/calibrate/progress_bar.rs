//! A progress bar for long work.

use std::time::Duration;

use i2ris_calibration::progress::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Work that is over sooner needs no bar.
const PATIENCE: Duration = Duration::from_millis(700);

/// A bar on stderr that shows up when the work takes long, and only on a terminal.
pub struct Bar(ProgressBar);

impl Bar {
    /// A bar for what is being done.
    pub fn new(what: &'static str) -> Self {
        let bar = ProgressBar::hidden().with_message(what);
        // The template is fixed; were it wrong, the bar would look plain.
        if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {percent} %, {eta} left")
        {
            bar.set_style(style);
        }
        Self(bar)
    }
}

impl Progress for Bar {
    fn begin(&self, steps: usize) {
        self.0.set_length(steps as u64);
        self.0.reset();
    }

    fn step(&self) {
        self.0.inc(1);
        if self.0.is_hidden() && self.0.elapsed() > PATIENCE {
            self.0.set_draw_target(ProgressDrawTarget::stderr());
        }
    }

    fn end(&self) {
        self.0.finish_and_clear();
    }
}
