//! The data of the plots: the last seconds at a low rate. Bounded: the oldest entry is dropped.

use std::collections::VecDeque;

use i2ris::ipc::Message;
use i2ris::ipc::payload::{ActuatorState, ExternalPosition, JointState};
use i2ris::units::{MAX_MOTORS, Nanos};
use i2ris_report::view::{LatestMessages, Pair, STALE, angles, count};

/// Time between samples: enough for a plot, and much slower than the streams.
pub const SAMPLE_PERIOD: Nanos = Nanos::from_millis(40);
pub const SPAN: Nanos = Nanos::from_millis(30_000);
/// Samples, and frames of a camera, that are kept.
const CAPACITY: usize = (SPAN.0 / SAMPLE_PERIOD.0) as usize;
/// Frames that wait for the encoder position at their instant.
const MAX_PENDING: usize = 16;

/// Everything at one instant. A stream that is stale, invalid or absent leaves a gap.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    pub stamp: Nanos,
    /// Time at which the encoders were read.
    pub read: [Nanos; MAX_MOTORS],
    pub goal: Pair,
    pub setpoint: Pair,
    pub estimate: Pair,
    /// Standard deviation of the estimate, degrees.
    pub deviation: Pair,
    /// Encoder positions, counts.
    pub counts: Pair,
    pub setpoint_counts: Pair,
    /// Milliampere.
    pub current: Pair,
}

/// Angles from a camera, with the encoder positions at the same instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraFrame {
    pub stamp: Nanos,
    /// Degrees.
    pub angles: [f64; 2],
    /// Counts at that instant: a frame is late, and present counts would widen the hysteresis loop.
    pub counts: Pair,
}

#[derive(Debug, Clone, Default)]
pub struct History {
    samples: Ring<Sample>,
    frames: Ring<CameraFrame>,
    waiting: VecDeque<ExternalPosition>,
}

impl History {
    pub fn sample(&mut self, view: &LatestMessages, now: Nanos) {
        let last = self.samples.entries.back();
        if last.is_some_and(|last| now.duration_since(last.stamp) < SAMPLE_PERIOD) {
            return;
        }
        self.samples.push(sample(view, now));
        while let Some(camera) = self.waiting.front().copied()
            && self.is_due(&camera, now)
        {
            self.waiting.pop_front();
            self.take(&camera);
        }
    }

    pub fn add_frame(&mut self, camera: &ExternalPosition) {
        if camera.flags & ExternalPosition::VALID == 0 || camera.count != 2 {
            return;
        }
        let last = self.waiting.back().map(Message::stamp);
        let last = last.or(self.frames.entries.back().map(|frame| frame.stamp));
        let since = |last| camera.stamp().duration_since(last);
        // Stamps that do not increase come from a restarted camera, or from a second one.
        if last.is_some_and(|last| since(last) < SAMPLE_PERIOD && camera.stamp() >= last) {
            return;
        }
        if self.waiting.len() == MAX_PENDING {
            self.waiting.pop_front();
        }
        self.waiting.push_back(*camera);
    }

    /// Samples from this number on, the oldest first, and the number that the next one will have.
    pub fn samples(&self, after: u64) -> (impl Iterator<Item = &Sample> + Clone, u64) {
        (self.samples.after(after), self.samples.next)
    }

    pub fn frames(&self, after: u64) -> (impl Iterator<Item = &CameraFrame> + Clone, u64) {
        (self.frames.after(after), self.frames.next)
    }

    /// Whether the encoders were read after the frame was taken, or will not be.
    fn is_due(&self, camera: &ExternalPosition, now: Nanos) -> bool {
        let later = |read: &Nanos| *read >= camera.stamp();
        let last = self.samples.entries.back();
        last.is_some_and(|last| last.read.iter().all(later)) || camera.age(now) > STALE
    }

    fn take(&mut self, camera: &ExternalPosition) {
        let counts_at = |motor| self.counts_at(motor, camera.stamp());
        let counts = counts_at(0).zip(counts_at(1)).map(|(first, second)| [first, second]);
        let angles = [camera.position[0].to_degrees(), camera.position[1].to_degrees()];
        self.frames.push(CameraFrame { stamp: camera.stamp(), angles, counts });
    }

    /// The encoder position at an instant, interpolated between two readings; `None` in a gap.
    fn counts_at(&self, motor: usize, instant: Nanos) -> Option<f64> {
        let reading =
            |sample: &Sample| Some((*sample.read.get(motor)?, *sample.counts?.get(motor)?));
        let mut later: Option<(Nanos, f64)> = None;
        for (read, counts) in self.samples.entries.iter().rev().map_while(reading) {
            if read <= instant {
                let (next, there) = later?;
                let share = instant.duration_since(read).as_seconds()
                    / next.duration_since(read).as_seconds().max(1e-9);
                return Some(counts + share * (there - counts));
            }
            later = Some((read, counts));
        }
        None
    }
}

fn sample(view: &LatestMessages, now: Nanos) -> Sample {
    let fresh =
        |joint: Option<&JointState>| joint.filter(|joint| joint.age(now) <= STALE).and_then(angles);
    let estimate = view.measured.as_ref();
    let deviation =
        |joint: &JointState| [joint.deviation[0].to_degrees(), joint.deviation[1].to_degrees()];
    let motors = view.actuators.as_ref().filter(|motors| motors.age(now) <= STALE);
    let of = |field: fn(&ActuatorState) -> [i32; MAX_MOTORS]| {
        motors.map(|motors| field(motors).map(f64::from))
    };
    Sample {
        stamp: now,
        read: motors.map_or([Nanos::ZERO; MAX_MOTORS], |motors| readings(motors, now)),
        goal: fresh(view.goal.as_ref()),
        setpoint: fresh(view.setpoint.as_ref()),
        estimate: fresh(estimate),
        deviation: fresh(estimate).and(estimate.map(deviation)),
        counts: of(|motors| motors.measured_counts).filter(|_| is_read(motors, now)),
        setpoint_counts: of(|motors| motors.setpoint_counts),
        current: of(|motors| motors.current_ma),
    }
}

/// Times at which the encoders were read. An absent motor counts as read now.
fn readings(motors: &ActuatorState, now: Nanos) -> [Nanos; MAX_MOTORS] {
    let mut read = motors.measured_stamp_ns.map(Nanos);
    read.iter_mut().skip(count(motors.count)).for_each(|read| *read = now);
    read
}

/// Whether every encoder was read a short time ago.
fn is_read(motors: Option<&ActuatorState>, now: Nanos) -> bool {
    let is_recent = |stamp: &u64| *stamp > 0 && now.duration_since(Nanos(*stamp)) <= STALE;
    motors.is_some_and(|motors| {
        motors.measured_stamp_ns.iter().take(count(motors.count)).all(is_recent)
    })
}

/// The newest entries, numbered from the first that ever was.
#[derive(Debug, Clone)]
struct Ring<T> {
    entries: VecDeque<T>,
    next: u64,
}

impl<T> Default for Ring<T> {
    fn default() -> Self {
        Self { entries: VecDeque::with_capacity(CAPACITY), next: 0 }
    }
}

impl<T> Ring<T> {
    fn push(&mut self, entry: T) {
        if self.entries.len() == CAPACITY {
            self.entries.pop_front();
        }
        self.entries.push_back(entry);
        self.next += 1;
    }

    /// A number of another run may be larger than any here: then everything is new.
    fn after(&self, number: u64) -> impl Iterator<Item = &T> + Clone {
        let first = self.next - self.entries.len() as u64;
        let skip = if number > self.next { 0 } else { number.saturating_sub(first) };
        self.entries.iter().skip(usize::try_from(skip).unwrap_or(usize::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn moving(milliseconds: u64) -> LatestMessages {
        let now = Nanos::from_millis(milliseconds);
        LatestMessages {
            actuators: Some(ActuatorState {
                stamp_ns: now.0,
                // The encoders were read 5 ms ago, and the motors turn at 1000 counts/s.
                measured_stamp_ns: [now.0 - 5_000_000; 2],
                measured_counts: [i32::try_from(milliseconds).unwrap() - 5, 7],
                count: 2,
                ..ActuatorState::default()
            }),
            ..LatestMessages::default()
        }
    }

    fn camera(milliseconds: u64) -> ExternalPosition {
        ExternalPosition {
            stamp_ns: Nanos::from_millis(milliseconds).0,
            position: [0.1, -0.1, 0.0],
            count: 2,
            flags: ExternalPosition::VALID,
            ..ExternalPosition::default()
        }
    }

    #[test]
    fn a_late_frame_gets_the_counts_of_its_instant() {
        let mut history = History::default();
        for milliseconds in (1000..2000).step_by(10) {
            if milliseconds == 1500 {
                history.add_frame(&camera(1333));
            }
            history.sample(&moving(milliseconds), Nanos::from_millis(milliseconds));
        }
        let frame = *history.frames(0).0.next().unwrap();
        let counts = frame.counts.unwrap();
        assert!((counts[0] - 1333.0).abs() < 1e-6 && counts[1] == 7.0, "{frame:?}");
        assert!((frame.angles[0] - 0.1_f64.to_degrees()).abs() < 1e-12);
    }

    #[test]
    fn invalid_frames_and_frames_in_gaps_get_no_counts() {
        let mut history = History::default();
        history.add_frame(&ExternalPosition { flags: 0, ..camera(900) });
        history.add_frame(&camera(900));
        history.sample(&moving(1000), Nanos::from_millis(1000));
        history.sample(&LatestMessages::default(), Nanos::from_millis(1600));
        let frames: Vec<_> = history.frames(0).0.collect();
        assert_eq!((frames.len(), frames[0].counts), (1, None));
    }

    #[test]
    fn stale_data_leave_a_gap() {
        let mut history = History::default();
        history.sample(&moving(1000), Nanos::from_millis(1100));
        history.sample(&moving(1000), Nanos::from_millis(1600));
        let counts: Vec<_> = history.samples(0).0.map(|sample| sample.counts.is_some()).collect();
        assert_eq!(counts, [true, false]);
    }
}
