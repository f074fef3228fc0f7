//! What the plots show: the last seconds, thinned out. Bounded: the oldest is dropped.

use std::collections::VecDeque;

use i2ris::ipc::Message;
use i2ris::ipc::payload::{ActuatorState, ExternalPosition, JointState};
use i2ris::units::{MAX_MOTORS, Nanos};

use super::view::{STALE, View, angles, count};

/// How far apart samples are: enough for the eye, a thousandth of the load of the streams
/// themselves.
pub const SPACING: Nanos = Nanos::from_millis(40);
/// How far back the trail goes.
pub const SPAN: Nanos = Nanos::from_millis(30_000);
/// Samples, and pictures of a camera, that are kept.
const KEPT: usize = (SPAN.0 / SPACING.0) as usize;
/// Pictures that wait for the encoder position at their instant.
const WAITING: usize = 16;

/// Pitch and yaw, degrees.
pub type Pair = Option<[f64; 2]>;

/// Everything at one instant. A stream that is stale, invalid or absent leaves a gap.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    /// When it was looked at.
    pub stamp: Nanos,
    /// When the encoders were read.
    pub read: [Nanos; MAX_MOTORS],
    pub goal: Pair,
    pub setpoint: Pair,
    pub estimate: Pair,
    /// Standard deviation of the estimate, degrees.
    pub deviation: Pair,
    /// What the encoders say, counts.
    pub counts: Pair,
    /// What the motors are told, counts.
    pub setpoint_counts: Pair,
    /// Milliampere.
    pub current: Pair,
}

/// Angles that a camera saw, and where the motors were when it did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Picture {
    /// When the picture was taken.
    pub stamp: Nanos,
    /// Degrees.
    pub angles: [f64; 2],
    /// Counts at that instant: cameras are late, and a picture beside the present counts would
    /// widen the loop.
    pub counts: Pair,
}

/// The last seconds.
#[derive(Debug, Clone, Default)]
pub struct Trail {
    samples: Ring<Sample>,
    pictures: Ring<Picture>,
    waiting: VecDeque<ExternalPosition>,
}

impl Trail {
    /// Takes a sample, if it is time for one.
    pub fn note(&mut self, view: &View, now: Nanos) {
        if self
            .samples
            .last()
            .is_some_and(|last| now.since(last.stamp) < SPACING)
        {
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

    /// Takes in what a camera saw; nothing if it saw nothing.
    pub fn see(&mut self, camera: &ExternalPosition) {
        if camera.flags & ExternalPosition::VALID == 0 || camera.count != 2 {
            return;
        }
        let last = self
            .waiting
            .back()
            .map(Message::stamp)
            .or(self.pictures.last().map(|picture| picture.stamp));
        // Stamps that do not rise come from a camera that was started anew, or from a second one.
        if last.is_some_and(|last| camera.stamp().since(last) < SPACING && camera.stamp() >= last) {
            return;
        }
        if self.waiting.len() == WAITING {
            self.waiting.pop_front();
        }
        self.waiting.push_back(*camera);
    }

    /// Samples from this number on, the oldest first, and the number that the next one will have.
    pub fn samples(&self, after: u64) -> (impl Iterator<Item = &Sample> + Clone, u64) {
        (self.samples.after(after), self.samples.next)
    }

    /// The same for what a camera saw.
    pub fn pictures(&self, after: u64) -> (impl Iterator<Item = &Picture> + Clone, u64) {
        (self.pictures.after(after), self.pictures.next)
    }

    /// The encoders have been read after the picture was taken, or never will be.
    fn is_due(&self, camera: &ExternalPosition, now: Nanos) -> bool {
        let later = |read: &Nanos| *read >= camera.stamp();
        self.samples
            .last()
            .is_some_and(|last| last.read.iter().all(later))
            || camera.age(now) > STALE
    }

    fn take(&mut self, camera: &ExternalPosition) {
        let counts = [
            self.counts_at(0, camera.stamp()),
            self.counts_at(1, camera.stamp()),
        ];
        let counts = if let [Some(first), Some(second)] = counts {
            Some([first, second])
        } else {
            None
        };
        let angles = [
            camera.position[0].to_degrees(),
            camera.position[1].to_degrees(),
        ];
        self.pictures.push(Picture {
            stamp: camera.stamp(),
            angles,
            counts,
        });
    }

    /// The encoder position of a motor at an instant, between two readings of it; `None` where
    /// there is a gap.
    fn counts_at(&self, motor: usize, instant: Nanos) -> Option<f64> {
        let reading =
            |sample: &Sample| Some((*sample.read.get(motor)?, *sample.counts?.get(motor)?));
        let mut later: Option<(Nanos, f64)> = None;
        for (read, counts) in self.samples.entries.iter().rev().map_while(reading) {
            if read <= instant {
                let (next, there) = later?;
                let share =
                    instant.since(read).as_seconds() / next.since(read).as_seconds().max(1e-9);
                return Some(counts + share * (there - counts));
            }
            later = Some((read, counts));
        }
        None
    }
}

fn sample(view: &View, now: Nanos) -> Sample {
    let fresh = |joint: Option<&JointState>| angles(joint.filter(|joint| joint.age(now) <= STALE));
    let estimate = view.measured.as_ref();
    let deviation = |joint: &JointState| {
        [
            joint.deviation[0].to_degrees(),
            joint.deviation[1].to_degrees(),
        ]
    };
    let motors = view
        .actuators
        .as_ref()
        .filter(|motors| motors.age(now) <= STALE);
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

/// When the encoders were read; a motor that is not there stands where it is.
fn readings(motors: &ActuatorState, now: Nanos) -> [Nanos; MAX_MOTORS] {
    let mut read = motors.measured_stamp_ns.map(Nanos);
    read.iter_mut()
        .skip(count(motors.count))
        .for_each(|read| *read = now);
    read
}

/// Whether every encoder was read a short time ago.
fn is_read(motors: Option<&ActuatorState>, now: Nanos) -> bool {
    motors.is_some_and(|motors| {
        motors
            .measured_stamp_ns
            .iter()
            .take(count(motors.count))
            .all(|stamp| *stamp > 0 && now.since(Nanos(*stamp)) <= STALE)
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
        Self {
            entries: VecDeque::with_capacity(KEPT),
            next: 0,
        }
    }
}

impl<T> Ring<T> {
    fn push(&mut self, entry: T) {
        if self.entries.len() == KEPT {
            self.entries.pop_front();
        }
        self.entries.push_back(entry);
        self.next += 1;
    }

    fn last(&self) -> Option<&T> {
        self.entries.back()
    }

    /// A number from another start of the monitor may be larger than any here: then everything is
    /// new.
    fn after(&self, number: u64) -> impl Iterator<Item = &T> + Clone {
        let first = self.next - self.entries.len() as u64;
        let skip = if number > self.next {
            0
        } else {
            number.saturating_sub(first)
        };
        self.entries
            .iter()
            .skip(usize::try_from(skip).unwrap_or(usize::MAX))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn moving(milliseconds: u64) -> View {
        let now = Nanos::from_millis(milliseconds);
        View {
            actuators: Some(ActuatorState {
                stamp_ns: now.0,
                // The encoders were read 5 ms ago, and the motors turn at 1000 counts/s.
                measured_stamp_ns: [now.0 - 5_000_000; 2],
                measured_counts: [i32::try_from(milliseconds).unwrap() - 5, 7],
                count: 2,
                ..ActuatorState::default()
            }),
            ..View::default()
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
    fn samples_keep_their_distance_and_the_oldest_is_dropped() {
        let mut trail = Trail::default();
        for milliseconds in (1000..101_000).step_by(10) {
            trail.note(&moving(milliseconds), Nanos::from_millis(milliseconds));
        }
        let (samples, next) = trail.samples(0);
        assert_eq!((samples.clone().count(), next), (KEPT, 2500));
        assert_eq!(samples.last().unwrap().stamp, Nanos::from_millis(100_960));
        assert_eq!(trail.samples(2498).0.count(), 2);
        assert_eq!(
            trail.samples(9999).0.count(),
            KEPT,
            "the number of another monitor"
        );
    }

    #[test]
    fn a_late_picture_stands_beside_the_counts_of_its_instant() {
        let mut trail = Trail::default();
        for milliseconds in (1000..2000).step_by(10) {
            if milliseconds == 1500 {
                trail.see(&camera(1333));
            }
            trail.note(&moving(milliseconds), Nanos::from_millis(milliseconds));
        }
        let picture = *trail.pictures(0).0.next().unwrap();
        let counts = picture.counts.unwrap();
        assert!(
            (counts[0] - 1333.0).abs() < 1e-6 && counts[1] == 7.0,
            "{picture:?}"
        );
        assert!((picture.angles[0] - 0.1_f64.to_degrees()).abs() < 1e-12);
    }

    #[test]
    fn a_picture_from_a_gap_has_no_counts_and_one_without_a_snake_is_none() {
        let mut trail = Trail::default();
        trail.see(&ExternalPosition {
            flags: 0,
            ..camera(900)
        });
        trail.see(&camera(900));
        trail.note(&moving(1000), Nanos::from_millis(1000));
        trail.note(&View::default(), Nanos::from_millis(1600));
        let pictures: Vec<_> = trail.pictures(0).0.collect();
        assert_eq!((pictures.len(), pictures[0].counts), (1, None));
    }

    #[test]
    fn what_is_stale_leaves_a_gap() {
        let mut trail = Trail::default();
        trail.note(&moving(1000), Nanos::from_millis(1100));
        trail.note(&moving(1000), Nanos::from_millis(1600));
        let counts: Vec<_> = trail
            .samples(0)
            .0
            .map(|sample| sample.counts.is_some())
            .collect();
        assert_eq!(counts, [true, false]);
    }

    proptest! {
        #[test]
        fn any_number_gives_the_newest_entries(pushed in 0_u64..2000, after: u64) {
            let mut ring = Ring::default();
            (0..pushed).for_each(|entry| ring.push(entry));
            let got: Vec<u64> = ring.after(after).copied().collect();
            prop_assert!(got.len() <= KEPT);
            prop_assert!(got.last().is_none_or(|last| *last == pushed - 1));
            prop_assert!(got.windows(2).all(|pair| pair[1] == pair[0] + 1));
            if after <= pushed {
                prop_assert_eq!(got.len() as u64, (pushed - after).min(KEPT as u64));
            }
        }
    }
}
