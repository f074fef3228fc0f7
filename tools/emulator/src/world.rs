//! Both drives and the snake behind them, brought forward in fixed small steps of time.

use std::sync::Arc;

use i2ris::units::Nanos;

use crate::drive::{Abort, Answer, Drive, is_read};
use crate::frame::Incoming;
use crate::log::{Event, EventKind, Log};
use crate::snake::Snake;
use crate::wire::Wire;

/// One step of the plant: a tenth of the time constant of a position loop.
const STEP: Nanos = Nanos::from_micros(500);

/// After a longer stall (a suspended machine) the time before is left out.
const LONGEST_CATCH_UP: Nanos = Nanos::from_millis(2000);

/// The plant.
#[derive(Debug)]
pub(crate) struct World {
    pub(crate) drives: [Drive; 2],
    pub(crate) snake: Snake,
    /// The wires between motors and snake.
    pub(crate) wires: [Wire; 2],
    gateway: Option<Nanos>,
    time: Nanos,
    log: Arc<Log>,
}

impl World {
    /// Starts at `now`, the snake straight and its motors at the drives' positions.
    pub(crate) fn new(drives: [Drive; 2], snake: Snake, log: Arc<Log>, now: Nanos) -> Self {
        let mut world = Self {
            drives,
            snake,
            wires: Default::default(),
            gateway: None,
            time: now,
            log,
        };
        world.record(now);
        world
    }

    /// The first drive passes requests on to the second over CAN, which takes this long there and
    /// back.
    pub(crate) fn with_gateway(mut self, round_trip: Nanos) -> Self {
        self.gateway = Some(round_trip);
        self
    }

    /// Until when it has been brought forward.
    pub(crate) fn time(&self) -> Nanos {
        self.time
    }

    /// Lets time pass. If `now` has passed already, nothing happens: two threads may come in either
    /// order.
    pub(crate) fn advance_to(&mut self, now: Nanos) {
        if now - self.time > LONGEST_CATCH_UP {
            self.time = now - LONGEST_CATCH_UP;
        }
        while self.time + STEP <= now {
            self.time = self.time + STEP;
            self.drives
                .iter_mut()
                .for_each(|drive| drive.advance(STEP.as_seconds()));
            let pulled =
                [0, 1].map(|axis: usize| self.wires[axis].pull(self.drives[axis].motor_counts()));
            self.snake.step(STEP.as_seconds(), pulled);
            self.record(self.time);
        }
    }

    /// Lets a drive answer a frame that was complete at `arrived`.
    pub(crate) fn answer(
        &mut self,
        axis: usize,
        incoming: &Incoming,
        arrived: Nanos,
    ) -> Option<Answer> {
        self.advance_to(arrived);
        let answer = self.route(axis, incoming);
        // A thread that comes late cannot change what has happened: its set-points count from then
        // on.
        self.record(self.time.max(arrived));
        answer
    }

    /// Hands a frame to the drive that it is for: that of the port, or one behind it.
    fn route(&mut self, axis: usize, incoming: &Incoming) -> Option<Answer> {
        let Some(round_trip) = self.gateway else {
            return self.drives[axis].answer(incoming);
        };
        let port = &mut self.drives[axis];
        if port.is_deaf() {
            return None;
        }
        let to_read = is_read(incoming);
        let (node, command) = match port.hear(incoming) {
            Ok(addressed) => addressed,
            Err(abort) => return Some(port.reply(Err(abort), to_read)),
        };
        if port.is_addressed_by(node) {
            let answered = command.is_answered(port.family());
            let outcome = port.serve(command);
            return answered.then(|| port.reply(outcome, to_read));
        }
        let other = (0..self.drives.len()).find(|other| {
            *other != axis
                && Some(self.drives[*other].node_id()) == node
                && !self.drives[*other].is_deaf()
        });
        let (outcome, delay) = match other {
            None => (Err(Abort::SdoTimeout), self.drives[axis].gateway_timeout()),
            Some(_) if command.is_segmented() => (Err(Abort::UnsupportedAccess), Nanos::ZERO),
            Some(other) => (self.drives[other].serve(command), round_trip),
        };
        Some(Answer {
            delay,
            ..self.drives[axis].reply(outcome, to_read)
        })
    }

    /// Does something to a drive, now.
    pub(crate) fn disturb(&mut self, axis: usize, now: Nanos, what: impl FnOnce(&mut Drive)) {
        self.advance_to(now);
        what(&mut self.drives[axis]);
        self.record(self.time.max(now));
    }

    /// Adds an event of the line.
    pub(crate) fn note(&self, axis: usize, stamp: Nanos, kind: EventKind) {
        self.log.push(Event { stamp, axis, kind });
    }

    fn record(&mut self, stamp: Nanos) {
        for axis in 0..2 {
            for kind in self.drives[axis].take_events() {
                self.note(axis, stamp, kind);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::DriveConfig;
    use crate::frame::Request;
    use crate::snake::tests::config;

    fn world(log: &Arc<Log>) -> World {
        let drives = [0, 1].map(|_| Drive::new(&DriveConfig::default(), 0.0));
        World::new(
            drives,
            Snake::new(&config("steel"), 1),
            Arc::clone(log),
            Nanos::ZERO,
        )
    }

    fn write(world: &mut World, now: Nanos, index: u16, value: u8) {
        let [low, high] = index.to_le_bytes();
        let request = Request {
            opcode: 0x68,
            data: vec![1, low, high, 0, value, 0, 0, 0],
        };
        assert!(world.answer(0, &Incoming::Request(request), now).is_some());
    }

    #[test]
    fn requests_take_no_time_away_from_the_plant() {
        let (idle, busy) = (Arc::new(Log::default()), Arc::new(Log::default()));
        let angles = [(idle, 10_000u64), (busy, 1_300)].map(|(log, period_us)| {
            let mut world = world(&log);
            for (index, value) in [(0x6060, 3), (0x6040, 6), (0x6040, 15), (0x60FF, 50)] {
                write(&mut world, Nanos::ZERO, index, value);
            }
            for step in 1..=1_000_000 / period_us {
                write(&mut world, Nanos::from_micros(step * period_us), 0x60FF, 50);
            }
            world.advance_to(Nanos::from_millis(1000));
            world.drives[0].motor_counts()
        });
        assert!(
            angles[0] > 500.0 && (angles[0] - angles[1]).abs() < 2.0,
            "{angles:?}"
        );
    }

    #[test]
    fn a_late_request_is_stamped_when_it_takes_effect() {
        let log = Arc::new(Log::default());
        let mut world = world(&log);
        world.advance_to(Nanos::from_millis(20));
        write(&mut world, Nanos::from_millis(5), 0x607A, 9);
        write(&mut world, Nanos::from_micros(20_300), 0x607A, 9);
        let stamps: Vec<Nanos> = log
            .events()
            .iter()
            .filter(|event| matches!(event.kind, EventKind::Setpoint(9)))
            .map(|event| event.stamp)
            .collect();
        assert_eq!(stamps, [Nanos::from_millis(20), Nanos::from_micros(20_300)]);
    }
}
