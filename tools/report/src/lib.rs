//! What every report is made of: statistics of plain numbers, figures as SVG, and pages of figures
//! and tables as one HTML file.
//!
//! The crate turns numbers into text. It has no fonts, no scripts, no network, no input and no
//! output, and it does not know what the numbers mean.
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
//! | `canvas` | the SVG back end of `plotters` |
//! | `plot` | the area of a panel, in which marks draw |
//! | `decimate` | leaves out points that cannot be seen |
//! | [`mark`] | lines, point clouds, bands, ellipses, box plots, heat maps |
//! | `figure` | panels with a legend |
//! | [`page`] | headings, tables and figures on one HTML page, with `maud` |
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

mod axis;
mod canvas;
mod decimate;
mod figure;
pub mod mark;
pub mod number;
pub mod page;
pub mod plot;
pub mod statistics;
mod style;

pub use axis::Axis;
pub use figure::{Figure, Panel};
pub use mark::{
    Band, BoxPlot, Ellipse, Heatmap, Line, Mark, ReferenceLine, Scatter, ShadedInterval,
};
pub use page::{Page, Table};
pub use style::{Color, Dash, Marker, Stroke};
