//! Figures for papers as SVG, and pages of figures and tables as one HTML file.
//!
//! Numbers in, text out: no fonts, no scripts, no network, no input or output. Nothing here knows
//! what the numbers mean.
//!
//! # Principles
//!
//! 1. **Readable in grey.** Lines differ by dash and marker, not by colour alone; see [`style`].
//! 2. **Small.** What cannot be seen is not written: lines and clouds of dots are thinned to the
//!    resolution of the figure ([`thin`](mod@thin)), so ten times the rows do not make ten times
//!    the file.
//! 3. **Nothing breaks it.** Numbers that are not finite leave a gap, empty data an empty panel,
//!    and every text is escaped where it is written ([`xml`]), nowhere else.
//! 4. **For everyone.** Every figure has a title and a description that a screen reader finds; text
//!    is dark on white.
//!
//! # Map
//!
//! | module | holds |
//! |---|---|
//! | [`xml`] | elements, attributes and text: the only place that writes markup |
//! | [`number`] | numbers as people read them |
//! | [`scale`], [`ticks`] | from values to places on paper; where to mark an axis |
//! | [`style`] | inks, dashes, markers |
//! | [`path`] | the outlines of lines and markers, written tightly |
//! | [`thin`](mod@thin) | leaving out what cannot be seen |
//! | [`mark`] | what can be drawn: lines, dots, bands, ellipses, boxes, cells |
//! | [`axis`], [`panel`], [`figure`], [`legend`] | putting it together |
//! | [`series`] | values over time, brought to common instants |
//! | [`page`] | headings, tables and figures on one page |
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used))]

pub mod axis;
pub mod figure;
pub mod legend;
pub mod mark;
pub mod number;
pub mod page;
pub mod panel;
pub mod path;
pub mod scale;
pub mod series;
pub mod style;
pub mod text;
pub mod thin;
pub mod ticks;
pub mod xml;

pub use axis::Axis;
pub use figure::Figure;
pub use mark::{Band, Boxes, Cells, Dots, Ellipse, Line, Mark, Rule, Shade};
pub use page::{Page, Table};
pub use panel::Panel;
pub use style::{Dash, Ink, Marker, Stroke};
