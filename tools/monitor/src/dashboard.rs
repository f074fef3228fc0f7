//! Everything that the monitor shows: filled by [`super::subscriptions::Subscriptions`], read by
//! terminal and web page.

use super::event_log::EventLog;
use super::history::History;
use super::latest_messages::LatestMessages;
use super::model_poller::Models;

/// The content of screen and page.
#[derive(Debug, Clone, Default)]
pub struct Dashboard {
    /// The last message of every stream. Kept when the controller ends, and stale then.
    pub view: LatestMessages,
    /// The process that holds the lease, if it is known.
    pub commander: Option<String>,
    /// Why the controller is not reachable, if it is not.
    pub problem: Option<String>,
    pub history: History,
    pub event_log: EventLog,
    pub models: Models,
}
