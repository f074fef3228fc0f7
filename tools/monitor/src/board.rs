//! Everything that a monitor shows, whichever way: filled by [`super::sight::Sight`], read by the
//! screens.

use super::journal::Journal;
use super::models::Models;
use super::trail::Trail;
use super::view::View;

/// What there is to show.
#[derive(Debug, Clone, Default)]
pub struct Board {
    /// The last message of every stream. Kept when the controller goes, and stale then.
    pub view: View,
    /// Why the controller cannot be heard, if it cannot.
    pub problem: Option<String>,
    pub trail: Trail,
    pub journal: Journal,
    pub models: Models,
}
