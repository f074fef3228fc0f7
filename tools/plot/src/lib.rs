//! Figures as SVG, and reports of figures and tables as one HTML file.
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
//! | `markup` | elements, attributes and text; the only place that writes markup |
//! | [`number`] | numbers for readers, and coordinates |
//! | `style`, `path` | colors, dashes, markers; SVG path data |
//! | `scale`, `ticks`, `axis` | from values to coordinates; where axes have numbers |
//! | `decimate` | leaves out points that cannot be seen |
//! | [`mark`] | lines, scatter, bands, ellipses, box plots, heat maps |
//! | `legend`, `panel`, `figure`, `text_width` | layout |
//! | [`page`] | headings, tables and figures on one HTML page |
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

mod axis;
mod decimate;
mod figure;
mod legend;
pub mod mark;
mod markup;
pub mod number;
pub mod page;
mod panel;
mod path;
mod scale;
mod style;
mod text_width;
mod ticks;

pub use axis::Axis;
pub use figure::Figure;
pub use mark::{
    Band, BoxPlot, Ellipse, Heatmap, Line, Mark, ReferenceLine, Scatter, ShadedInterval,
};
pub use page::{Page, Table};
pub use panel::Panel;
pub use style::{Color, Dash, Marker, Stroke};
