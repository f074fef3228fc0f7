//! What a panel can draw. Values are in the units of the axes; values that are not finite are left
//! out.
//!
//! | file | contains |
//! |---|---|
//! | `extent` | the range of values, the area of the panel, entries of the legend |
//! | `line` | lines, reference lines |
//! | `scatter` | point clouds |
//! | `band` | bands, shaded intervals |
//! | `ellipse` | ellipses of Gaussians |
//! | `box_plot` | box plots |
//! | `heatmap` | classes of cells |

/// Implements `label` for marks with a field `label`.
macro_rules! labelled {
    ($mark:ident) => {
        impl $mark {
            /// With an entry in the legend.
            #[must_use]
            pub fn label(self, label: impl Into<String>) -> Self {
                Self { label: Some(label.into()), ..self }
            }
        }
    };
}

mod band;
mod box_plot;
mod ellipse;
mod extent;
mod heatmap;
mod line;
mod scatter;

pub use band::{Band, ShadedInterval};
pub use box_plot::{BoxPlot, FiveNumbers};
pub use ellipse::Ellipse;
pub use extent::{Extent, LegendEntry, PlotArea, Symbol};
pub use heatmap::Heatmap;
pub use line::{Line, ReferenceLine};
pub use scatter::Scatter;

use crate::markup::Element;

/// Something that a panel can draw.
pub trait Mark: std::fmt::Debug {
    /// The values that the axes must contain.
    fn extent(&self) -> Extent {
        Extent::default()
    }

    /// Draws the mark. The panel clips what is outside.
    #[doc(hidden)]
    fn draw(&self, area: &PlotArea) -> Element;

    /// Its entries of the legend.
    fn legend(&self) -> Vec<LegendEntry> {
        Vec::new()
    }
}
