//! Everything that the monitor knows: filled by [`super::subscriptions::Subscriptions`].

use i2ris::ipc::payload::ReasonMsg;
use i2ris::units::Nanos;
use i2ris_report::model_poller::Known;
use i2ris_report::view::{LatestMessages, State, View};

use super::event_log::EventLog;
use super::history::History;

/// Content of text and web page.
#[derive(Debug, Clone, Default)]
pub struct Dashboard {
    /// Kept when the controller ends, and stale then.
    pub messages: LatestMessages,
    /// The last refusals, stops and clips, in the order in which they came.
    pub warnings: Vec<ReasonMsg>,
    /// The process that holds the lease, if it is known.
    pub commander: Option<String>,
    /// Reason why the controller is not reachable, if it is not.
    pub problem: Option<String>,
    pub history: History,
    pub event_log: EventLog,
    pub models: Known,
}

impl Dashboard {
    /// View of the robot for people.
    pub fn view(&self, now: Nanos) -> View {
        let view = View::new(&self.messages, now);
        let commander = self.commander.clone();
        View {
            problem: self.problem.clone(),
            state: view.state.map(|state| State { commander, ..state }),
            models: self.models.models.clone(),
            events: self.event_log.newest(now),
            ..view
        }
    }
}
