//! What the controller reports, in one packet: the newest of every stream.

use std::mem::size_of;

use i2ris::ipc::payload::{
    ActuatorState, ExternalPosition, JointState, OperatingStateMsg, PeriodStatistics, Version,
};

use crate::packet::Shift;
use crate::wire::Rest;
use zerocopy::{FromBytes, Immutable, IntoBytes};

/// The newest of every stream; `None`: nothing new.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct State {
    /// There is a controller.
    pub controller: bool,
    pub operating: Option<OperatingStateMsg>,
    pub measured: Option<JointState>,
    pub setpoint: Option<JointState>,
    pub goal: Option<JointState>,
    pub actuators: Option<ActuatorState>,
    pub statistics: Option<PeriodStatistics>,
    pub external: Option<ExternalPosition>,
    pub version: Option<Version>,
}

impl State {
    /// The body of a packet.
    pub fn write(&self) -> Vec<u8> {
        let mut pieces = Pieces {
            mask: 0,
            bit: 0,
            bytes: vec![0; 4],
        };
        pieces
            .bytes
            .extend(u32::from(self.controller).to_le_bytes());
        pieces.push(self.operating.as_ref());
        pieces.push(self.measured.as_ref());
        pieces.push(self.setpoint.as_ref());
        pieces.push(self.goal.as_ref());
        pieces.push(self.actuators.as_ref());
        pieces.push(self.statistics.as_ref());
        pieces.push(self.external.as_ref());
        pieces.push(self.version.as_ref());
        pieces.bytes[..4].copy_from_slice(&pieces.mask.to_le_bytes());
        pieces.bytes
    }

    /// The state in the body of a packet.
    pub fn read(body: &[u8]) -> Option<Self> {
        let mut rest = Rest(body);
        let (mut mask, controller) = (rest.u32()?, rest.u32()? == 1);
        let state = Self {
            controller,
            operating: piece(&mut mask, &mut rest)?,
            measured: piece(&mut mask, &mut rest)?,
            setpoint: piece(&mut mask, &mut rest)?,
            goal: piece(&mut mask, &mut rest)?,
            actuators: piece(&mut mask, &mut rest)?,
            statistics: piece(&mut mask, &mut rest)?,
            external: piece(&mut mask, &mut rest)?,
            version: piece(&mut mask, &mut rest)?,
        };
        (mask == 0 && rest.0.is_empty()).then_some(state)
    }

    /// The same with every stamp on our clock.
    pub fn here(mut self, shift: &Shift) -> Self {
        let joints = [&mut self.measured, &mut self.setpoint, &mut self.goal];
        joints
            .into_iter()
            .flatten()
            .for_each(|joint| joint.stamp_ns = shift.here(joint.stamp_ns));
        if let Some(state) = &mut self.operating {
            state.stamp_ns = shift.here(state.stamp_ns);
            state.since_ns = shift.here(state.since_ns);
        }
        if let Some(motors) = &mut self.actuators {
            motors.stamp_ns = shift.here(motors.stamp_ns);
            let lists = [
                &mut motors.measured_stamp_ns,
                &mut motors.written_stamp_ns,
                &mut motors.command_stamp_ns,
            ];
            lists
                .into_iter()
                .flatten()
                .for_each(|stamp| *stamp = shift.here(*stamp));
        }
        if let Some(statistics) = &mut self.statistics {
            statistics.stamp_ns = shift.here(statistics.stamp_ns);
        }
        if let Some(seen) = &mut self.external {
            seen.stamp_ns = shift.here(seen.stamp_ns);
        }
        self
    }

    /// Keeps what was known where nothing is new.
    pub fn update(&mut self, new: &Self) {
        self.controller = new.controller;
        keep(&mut self.operating, new.operating);
        keep(&mut self.measured, new.measured);
        keep(&mut self.setpoint, new.setpoint);
        keep(&mut self.goal, new.goal);
        keep(&mut self.actuators, new.actuators);
        keep(&mut self.statistics, new.statistics);
        keep(&mut self.external, new.external);
        keep(&mut self.version, new.version);
    }
}

fn keep<T>(known: &mut Option<T>, new: Option<T>) {
    if new.is_some() {
        *known = new;
    }
}

struct Pieces {
    mask: u32,
    bit: u32,
    bytes: Vec<u8>,
}

impl Pieces {
    fn push<T: FromBytes + IntoBytes + Immutable>(&mut self, piece: Option<&T>) {
        if let Some(piece) = piece {
            self.mask |= 1 << self.bit;
            self.bytes.extend(piece.as_bytes());
        }
        self.bit += 1;
    }
}

/// `Some(None)`: it is not there; `None`: it should be and is not.
fn piece<T: FromBytes + IntoBytes + Immutable>(
    mask: &mut u32,
    rest: &mut Rest<'_>,
) -> Option<Option<T>> {
    let present = *mask & 1 == 1;
    *mask >>= 1;
    if present {
        T::read_from_bytes(rest.take(size_of::<T>())?)
            .ok()
            .map(Some)
    } else {
        Some(None)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::key::MAC_LENGTH;
    use crate::packet::{HEADER, LONGEST};

    fn full() -> State {
        State {
            controller: true,
            operating: Some(OperatingStateMsg {
                stamp_ns: 1,
                ..OperatingStateMsg::default()
            }),
            measured: Some(JointState {
                stamp_ns: 2,
                ..JointState::default()
            }),
            setpoint: Some(JointState {
                stamp_ns: 3,
                ..JointState::default()
            }),
            goal: Some(JointState {
                stamp_ns: 4,
                ..JointState::default()
            }),
            actuators: Some(ActuatorState {
                stamp_ns: 5,
                ..ActuatorState::default()
            }),
            statistics: Some(PeriodStatistics {
                stamp_ns: 6,
                ..PeriodStatistics::default()
            }),
            external: Some(ExternalPosition {
                stamp_ns: 7,
                ..ExternalPosition::default()
            }),
            version: Some(Version {
                pid: 8,
                ..Version::default()
            }),
        }
    }

    #[test]
    fn everything_fits_into_one_packet() {
        let body = full().write();
        assert!(
            HEADER + body.len() + MAC_LENGTH <= LONGEST,
            "{}",
            body.len()
        );
        assert_eq!(State::read(&body), Some(full()));
        for length in 0..body.len() {
            assert_eq!(State::read(&body[..length]), None, "cut to {length}");
        }
    }

    #[test]
    fn what_is_not_new_stays_known() {
        let mut known = full();
        let goal = Some(JointState {
            stamp_ns: 9,
            ..JointState::default()
        });
        known.update(&State {
            controller: true,
            goal,
            ..State::default()
        });
        assert_eq!(known, State { goal, ..full() });
    }

    proptest! {
        #[test]
        fn any_choice_of_streams_is_read_again(mask in 0_u32..256) {
            let mut state = full();
            let keep = |bit: u32| mask >> bit & 1 == 1;
            if !keep(0) { state.operating = None }
            if !keep(1) { state.measured = None }
            if !keep(2) { state.setpoint = None }
            if !keep(3) { state.goal = None }
            if !keep(4) { state.actuators = None }
            if !keep(5) { state.statistics = None }
            if !keep(6) { state.external = None }
            if !keep(7) { state.version = None }
            prop_assert_eq!(State::read(&state.write()), Some(state));
        }

        #[test]
        fn whatever_arrives_nothing_panics(body in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = State::read(&body);
        }
    }
}
