//! When the robot followed commands.

use i2ris::ipc::OperatingState;
use i2ris::ipc::payload::OperatingStateMsg;

use super::trial::Trial;

/// Whether the robot followed commands during this state.
fn follows(state: &OperatingStateMsg) -> bool {
    let other = OperatingStateMsg::HOLDING | OperatingStateMsg::BUSY;
    state.state == OperatingState::Enabled.number() && state.flags & other == 0
}

impl Trial {
    /// Whether the robot followed commands at an instant. A recording without states counts as
    /// following.
    pub fn was_following(&self, stamp_ns: u64) -> bool {
        let after = self.states.partition_point(|state| state.stamp_ns <= stamp_ns);
        match self.states[..after].last() {
            Some(state) => follows(state),
            None => self.states.is_empty(),
        }
    }

    /// The intervals in which the robot did not follow commands, seconds.
    pub fn intervals_without_following(&self) -> Vec<[f64; 2]> {
        let mut intervals: Vec<[f64; 2]> = Vec::new();
        let mut since = None;
        for state in &self.states {
            let now = self.seconds(state.stamp_ns);
            if !follows(state) {
                since.get_or_insert(now);
            } else if let Some(from) = since.take() {
                intervals.push([from, now]);
            }
        }
        intervals.extend(since.map(|from| [from, self.length_s()]));
        intervals
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_without_following_end_with_the_next_state_or_the_recording() {
        let state = |seconds: u64, state: OperatingState| OperatingStateMsg {
            stamp_ns: seconds * 1_000_000_000,
            state: state.number(),
            ..OperatingStateMsg::default()
        };
        let trial = Trial {
            states: vec![
                state(1, OperatingState::Disabled),
                state(2, OperatingState::Fault),
                state(3, OperatingState::Enabled),
                state(5, OperatingState::Disabled),
            ],
            end_ns: 9_000_000_000,
            ..Trial::default()
        };
        assert_eq!(trial.intervals_without_following(), [[1.0, 3.0], [5.0, 9.0]]);
        let following = [0, 2, 4, 6].map(|s| trial.was_following(s * 1_000_000_000));
        assert_eq!(following, [false, false, true, false]);
    }
}
