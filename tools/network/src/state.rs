//! What the controller reports: the newest of every stream.

use i2ris::ipc::payload::{
    ActuatorState, AdaptationMsg, ExternalPosition, Health, JointState, OperatingStateMsg,
    PeriodStatistics, Version, VirtualFixturesMsg,
};
use zerocopy::{FromBytes, Immutable, IntoBytes};

use crate::offset::ClockOffset;
use i2ris::units::Nanos;

/// The newest of every stream; `None`: nothing new.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct State {
    pub operating: Option<OperatingStateMsg>,
    pub measured: Option<JointState>,
    pub setpoint: Option<JointState>,
    pub goal: Option<JointState>,
    pub actuators: Option<ActuatorState>,
    pub statistics: Option<PeriodStatistics>,
    pub health: Option<Health>,
    pub external: Option<ExternalPosition>,
    pub adaptation: Option<AdaptationMsg>,
    pub fixtures: Option<VirtualFixturesMsg>,
    pub version: Option<Version>,
}

/// Calls `$each!(name, field)` for every stream with its name.
macro_rules! for_each_stream {
    ($each:ident) => {
        $each!("operating_state", operating);
        $each!("measured_js", measured);
        $each!("setpoint_js", setpoint);
        $each!("goal_js", goal);
        $each!("actuators/measured_js", actuators);
        $each!("period_statistics", statistics);
        $each!("health", health);
        $each!("external/measured_jp", external);
        $each!("adaptation", adaptation);
        $each!("virtual_fixtures", fixtures);
        $each!("version", version);
    };
}

impl State {
    /// Hands over the name and the bytes of every stream that is there.
    pub fn write(&self, mut send: impl FnMut(&'static str, &[u8])) {
        macro_rules! write_stream {
            ($name:literal, $field:ident) => {
                if let Some(message) = &self.$field {
                    send($name, message.as_bytes());
                }
            };
        }
        for_each_stream!(write_stream);
    }

    /// Takes in a message. `false`: there is no such stream, or this is no message of it.
    pub fn read(&mut self, stream: &str, bytes: &[u8]) -> bool {
        macro_rules! read_stream {
            ($name:literal, $field:ident) => {
                if stream == $name {
                    let message = value(bytes);
                    self.$field = message.or(self.$field);
                    return message.is_some();
                }
            };
        }
        for_each_stream!(read_stream);
        false
    }

    /// Keeps what was known where nothing is new.
    pub fn update(&mut self, new: &Self) {
        macro_rules! update_stream {
            ($name:literal, $field:ident) => {
                self.$field = new.$field.or(self.$field);
            };
        }
        for_each_stream!(update_stream);
    }

    /// The same with every stamp on our clock; `None` while it is not known how the clocks stand.
    pub fn here(mut self, offset: &ClockOffset, now: Nanos) -> Option<Self> {
        let here = |stamp: &mut u64| offset.here(*stamp, now).map(|moved| *stamp = moved);
        let joints = [&mut self.measured, &mut self.setpoint, &mut self.goal];
        for joint in joints.into_iter().flatten() {
            here(&mut joint.stamp_ns)?;
        }
        if let Some(state) = &mut self.operating {
            here(&mut state.stamp_ns)?;
            here(&mut state.since_ns)?;
        }
        if let Some(motors) = &mut self.actuators {
            here(&mut motors.stamp_ns)?;
            let lists = [
                &mut motors.measured_stamp_ns,
                &mut motors.written_stamp_ns,
                &mut motors.command_stamp_ns,
            ];
            for stamp in lists.into_iter().flatten() {
                here(stamp)?;
            }
        }
        if let Some(statistics) = &mut self.statistics {
            here(&mut statistics.stamp_ns)?;
        }
        if let Some(health) = &mut self.health {
            here(&mut health.stamp_ns)?;
        }
        if let Some(seen) = &mut self.external {
            here(&mut seen.stamp_ns)?;
        }
        if let Some(adaptation) = &mut self.adaptation {
            here(&mut adaptation.stamp_ns)?;
        }
        if let Some(fixtures) = &mut self.fixtures {
            here(&mut fixtures.stamp_ns)?;
        }
        Some(self)
    }
}

fn value<T: FromBytes + IntoBytes + Immutable>(bytes: &[u8]) -> Option<T> {
    T::read_from_bytes(bytes).ok()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn full() -> State {
        let joint = |stamp_ns| Some(JointState { stamp_ns, ..JointState::default() });
        State {
            operating: Some(OperatingStateMsg { stamp_ns: 1, ..OperatingStateMsg::default() }),
            measured: joint(2),
            setpoint: joint(3),
            goal: joint(4),
            actuators: Some(ActuatorState { stamp_ns: 5, ..ActuatorState::default() }),
            statistics: Some(PeriodStatistics { stamp_ns: 6, ..PeriodStatistics::default() }),
            health: Some(Health { stamp_ns: 7, ..Health::default() }),
            external: Some(ExternalPosition { stamp_ns: 8, ..ExternalPosition::default() }),
            adaptation: Some(AdaptationMsg { stamp_ns: 9, ..AdaptationMsg::default() }),
            fixtures: Some(VirtualFixturesMsg { stamp_ns: 10, ..VirtualFixturesMsg::default() }),
            version: Some(Version { pid: 9, ..Version::default() }),
        }
    }

    #[test]
    fn every_stream_is_read_again_and_cut_ones_are_none() {
        let (mut read, mut streams) = (State::default(), 0);
        full().write(|name, bytes| {
            streams += 1;
            assert!(read.read(name, bytes), "{name}");
            assert!(!State::default().read(name, &bytes[1..]), "{name}");
        });
        assert_eq!((read, streams), (full(), 11));
        assert!(!read.read("servo_jp", &[]));
    }

    #[test]
    fn what_is_not_new_stays_known() {
        let mut known = full();
        let goal = Some(JointState { stamp_ns: 19, ..JointState::default() });
        known.update(&State { goal, ..State::default() });
        assert_eq!(known, State { goal, ..full() });
    }

    #[test]
    fn without_an_exchange_nothing_is_shown() {
        let mut offset = ClockOffset::default();
        assert_eq!(full().here(&offset, Nanos(100)), None);
        offset.note(Nanos(50), Nanos(1050), Nanos(50));
        let moved = full().here(&offset, Nanos(50)).unwrap();
        assert_eq!(moved.version, full().version);
        assert_eq!(moved.goal.unwrap().stamp_ns, 1, "no moment before the first");
    }

    proptest! {
        #[test]
        fn whatever_arrives_nothing_panics(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = State::default().read("measured_js", &bytes);
        }
    }
}
