//! Measurements drawn over their images, for people.
//!
//! The font is a small bitmap font: `imageproc` with `ab_glyph` would bring dozens of packages and
//! a font file for the few words of an overlay.
//!
//! | file | content |
//! |---|---|
//! | `canvas` | a colour image to draw on, and its PNG file |
//! | `font` | a bitmap font |
//! | `overlay` | lines, centreline, tip and numbers over one image |
//! | `contact_sheet` | many small overlays on one page |

mod canvas;
mod contact_sheet;
mod font;
mod overlay;

pub use canvas::{Canvas, SaveError, save_grey};
pub use contact_sheet::ContactSheet;
pub use overlay::overlay;
