//! What happened in one tick.

use crate::core::{Event, EventKind};
use crate::units::Nanos;

/// The events of one tick, in order. What does not fit is counted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Events {
    stamp: Nanos,
    list: [Option<Event>; 4],
    lost: u64,
}

impl Events {
    /// None yet.
    pub fn new(stamp: Nanos) -> Self {
        Self {
            stamp,
            list: [None; 4],
            lost: 0,
        }
    }

    /// Adds an event. A change of state takes the place of the last event of another kind when the
    /// list is full: the log must never miss one.
    pub fn push(&mut self, kind: EventKind) {
        let event = Event {
            stamp: self.stamp,
            kind,
        };
        if let Some(free) = self.list.iter_mut().find(|entry| entry.is_none()) {
            *free = Some(event);
            return;
        }
        self.lost += 1;
        if matches!(kind, EventKind::State { .. }) {
            self.drop_last_other();
            if let Some(free) = self.list.iter_mut().find(|entry| entry.is_none()) {
                *free = Some(event);
            }
        }
    }

    /// The events, and how many did not fit.
    pub fn finish(self) -> ([Option<Event>; 4], u64) {
        (self.list, self.lost)
    }

    /// Drops the last event that is no change of state and closes the gap.
    fn drop_last_other(&mut self) {
        let other = |entry: &Option<Event>| {
            entry.is_some_and(|e| !matches!(e.kind, EventKind::State { .. }))
        };
        if let Some(place) = self.list.iter().rposition(other)
            && let Some(tail) = self.list.get_mut(place..)
        {
            tail.rotate_left(1);
            if let Some(last) = tail.last_mut() {
                *last = None;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{Fault, OperatingState};

    fn lease(client_id: u64) -> EventKind {
        EventKind::Lease { client_id }
    }

    const STATE: EventKind = EventKind::State {
        from: OperatingState::Enabled,
        to: OperatingState::Fault,
        command: None,
        fault: Fault::Link,
    };

    fn kinds(events: Events) -> (Vec<EventKind>, u64) {
        let (list, lost) = events.finish();
        (
            list.iter().flatten().map(|event| event.kind).collect(),
            lost,
        )
    }

    #[test]
    fn what_does_not_fit_is_counted() {
        let mut events = Events::new(Nanos(7));
        (1..=6).for_each(|client| events.push(lease(client)));
        assert_eq!(kinds(events), ((1..=4).map(lease).collect(), 2));
    }

    #[test]
    fn a_change_of_state_always_fits() {
        let mut events = Events::new(Nanos(7));
        events.push(STATE);
        (1..=3).for_each(|client| events.push(lease(client)));
        events.push(STATE);
        assert_eq!(kinds(events), (vec![STATE, lease(1), lease(2), STATE], 1));
    }
}
