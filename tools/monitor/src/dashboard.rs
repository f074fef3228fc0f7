//! Everything that a monitor shows, whichever way: filled by [`super::subscriptions::Subscriptions`], read by the
//! screens.

use super::event_log::EventLog;
use super::history::History;
use super::latest_messages::LatestMessages;
use super::model_poller::Models;

/// What there is to show.
#[derive(Debug, Clone, Default)]
pub struct Dashboard {
    /// The last message of every stream. Kept when the controller goes, and stale then.
    pub view: LatestMessages,
    /// Why the controller cannot be heard, if it cannot.
    pub problem: Option<String>,
    pub history: History,
    pub event_log: EventLog,
    pub models: Models,
}
