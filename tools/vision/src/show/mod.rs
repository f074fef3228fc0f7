//! Pictures for people: what the detector saw, drawn over what the camera saw.
//!
//! | file | holds |
//! |---|---|
//! | `paper` | a colour picture to draw on, and its PNG file |
//! | `font` | letters of three by five dots |
//! | `overlay` | lines, trace, tip and numbers over one picture |
//! | `sheet` | many small overlays on one page |

mod font;
mod overlay;
mod paper;
mod sheet;

pub use overlay::overlay;
pub use paper::{Paper, SaveError, save_grey};
pub use sheet::Sheet;
