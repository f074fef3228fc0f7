//! Shared parts of the i2ris programs: start, output and end of a program, and building blocks of
//! reports: statistics of plain numbers, figures as SVG, and documents as text or one HTML page.
//!
//! Reports turn numbers into text. They have no fonts, no scripts, no network, no input and no
//! output, and do not know what the numbers mean.
//!
//! # Principles
//!
//! 1. **Readable in grey.** Lines differ by dash and marker, not by color alone.
//! 2. **Small files.** Lines and point clouds are thinned to the resolution of the figure: ten
//!    times the rows do not make ten times the file.
//! 3. **Robust.** Values that are not finite leave a gap, empty data an empty panel. Text is
//!    escaped in one place, where it is written.
//! 4. **Accessible.** Every figure has a title and a description for screen readers. Text is dark
//!    on white.
//!
//! # Modules
//!
//! | module | contains |
//! |---|---|
//! | [`statistics`] | mean, quantiles, histograms, distances, values over time |
//! | [`number`] | numbers for readers |
//! | `style` | colors, dashes, markers |
//! | `axis` | ranges and numbers of axes |
//! | `mark` | lines, point clouds, reference lines, intervals |
//! | `figure` | panels with a legend, as small SVG files from the back end of `plotters` |
//! | [`document`] | a report, as text and as one HTML page, with `maud` |
//! | [`process`] | child processes that end with this one |
//! | [`programs`] | the programs that `i2ris NAME` starts, and where they are found |
//! | [`program`] | the main function of a program: command line, exit code, `--domain`, signals |
//! | [`description`] | a command line as JSON, for the shell completions of `i2ris` |
//! | [`exit`] | exit codes |
//! | [`snake`] | the links of the snake and where they are at a bend, also as a URDF |
//! | [`ros`] | messages of ROS 2, for the bridge and for recordings |
//! | [`screen`] | standard output, redrawn on a terminal; a spinner during long work |
//! | [`stop`] | holds every client and ends every activity |
//! | [`tips`] | advice about a wrong command line |
//! | [`preflight`] | the result of a preflight, for the trial after it |
//! | [`files`] | atomic replacement of files |
//! | [`model_poller`] | the models of the controller, and the hull of the one in use |
//! | [`view`] | the robot as people see it: one value for every surface |
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

mod axis;
pub mod description;
pub mod document;
pub mod exit;
mod figure;
pub mod files;
mod mark;
pub mod model_poller;
pub mod number;
pub mod preflight;
pub mod process;
pub mod program;
pub mod programs;
pub mod ros;
pub mod screen;
pub mod snake;
pub mod statistics;
pub mod stop;
mod style;
#[cfg(test)]
mod tests;
pub mod tips;
pub mod view;

pub use axis::Axis;
pub use document::{Document, Table};
pub use figure::{Figure, Panel};
pub use mark::Mark;
pub use program::{DomainOption, Interrupt};
pub use screen::{Screen, until_closed, while_working};
pub use style::{Color, Dash, Marker, Stroke};

/// Why a program ends without success: one sentence for the user, from any thread.
pub type Failure = Box<dyn std::error::Error + Send + Sync>;

/// Ends a function with a sentence as its failure: the arguments of `format!`.
#[macro_export]
macro_rules! bail {
    ($($sentence:tt)*) => {
        return Err(format!($($sentence)*).into())
    };
}
