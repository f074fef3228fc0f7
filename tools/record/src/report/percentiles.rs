//! When the robot followed commands.

use i2ris::ipc::OperatingState;
use i2ris::ipc::payload::OperatingStateMsg;

use super::trial::Trial;

/// Whether the robot followed commands while this state lasted.
pub fn follows(state: &OperatingStateMsg) -> bool {
    let away = OperatingStateMsg::HOLDING | OperatingStateMsg::BUSY;
    state.state == OperatingState::Enabled.number() && state.flags & away == 0
}

impl Trial {
    /// Whether the robot followed commands at an instant. Without any state in the recording it is
    /// taken to have.
    pub fn followed_at(&self, stamp_ns: u64) -> bool {
        let after = self
            .states
            .partition_point(|state| state.stamp_ns <= stamp_ns);
        match after
            .checked_sub(1)
            .and_then(|index| self.states.get(index))
        {
            Some(state) => follows(state),
            None => self.states.is_empty(),
        }
    }

    /// Stretches of time in which it did not, seconds.
    pub fn away(&self) -> Vec<[f64; 2]> {
        let mut stretches: Vec<[f64; 2]> = Vec::new();
        let mut since = None;
        for state in &self.states {
            match (follows(state), since) {
                (false, None) => since = Some(self.seconds(state.stamp_ns)),
                (true, Some(from)) => {
                    stretches.push([from, self.seconds(state.stamp_ns)]);
                    since = None;
                }
                _ => {}
            }
        }
        stretches.extend(since.map(|from| [from, self.length_s()]));
        stretches
    }
}
