//! Plausibility: the pose that a camera measures against the estimate from the encoders (H12).
//!
//! A slack or torn wire, a slipping gear, or a model of another snake does not show in the
//! encoders. It shows in a camera that measures the angles. A camera frame is some hundredths of a
//! second old when it arrives, so it is compared with the estimate at the time of the frame. A
//! single frame proves nothing: only a distance that frame after frame confirms is a fault. A
//! camera that is silent or too late proves nothing either, and then the robot reports that it is
//! not checked.

use serde::{Deserialize, Serialize};

use crate::core::events::PlausibilityCheck;
use crate::core::faults::Debounce;
use crate::core::inputs::ExternalPose;
use crate::core::vector;
use crate::robot::{Measurement, Quantity};
use crate::units::{Nanos, OutputVec};

/// The estimates are stored in rows of 32: serde has no longer arrays.
const ROWS: usize = 4;
const COLUMNS: usize = 32;
/// Interval between two stored estimates. All of them cover half a second.
const SPACING: Nanos = Nanos::from_millis(4);

/// Age up to which a frame can be compared, and silence after which the camera counts as silent.
const MAX_AGE: Nanos = Nanos::from_millis(500);

/// Duration of the distance that leads to FAULT: several frames of the camera.
const DEBOUNCE: Nanos = Nanos::from_millis(300);

/// The pose with the correction of the adaptation, and as calibrated, rad.
pub(crate) type Estimates = [OutputVec; 2];

/// Compares measured poses with estimates.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(crate) struct PlausibilityMonitor {
    /// Largest distance, rad; 0: the monitor is off.
    limit: f64,
    debounce: Debounce,
    /// Adapted and calibrated poses; equal without adaptation.
    estimates: [[(Nanos, Estimates); COLUMNS]; ROWS],
    written: u64,
    last: Nanos,
    /// Stamp of the newest frame.
    newest: Nanos,
    /// When the newest frame arrived.
    arrived: Nanos,
    /// When a frame was last compared.
    compared: Nanos,
    /// Start of the present check.
    checked_since: Option<Nanos>,
    is_implausible: bool,
    /// Distance of the last frame that was compared, rad.
    distance: f64,
}

impl PlausibilityMonitor {
    /// `limit_deg`: 0 switches the check off.
    pub(crate) fn new(limit_deg: f64) -> Self {
        Self { limit: limit_deg.to_radians(), debounce: Debounce::new(DEBOUNCE), ..Self::default() }
    }

    /// The distance of the last frame that was compared, and the limit.
    pub(crate) fn measurement(&self) -> Option<Measurement> {
        let (distance, limit) = (self.distance.to_degrees(), self.limit.to_degrees());
        let measurement = Measurement::new(Quantity::Degrees, distance, Some(limit));
        (self.is_on() && self.distance > self.limit).then_some(measurement)
    }

    pub(crate) fn is_on(&self) -> bool {
        self.limit > 0.0
    }

    pub(crate) fn record_estimates(&mut self, now: Nanos, estimates: Estimates) {
        if now.duration_since(self.last) < SPACING || !self.is_on() {
            return;
        }
        self.last = now;
        let index = (self.written % (ROWS * COLUMNS) as u64) as usize;
        self.written += 1;
        if let Some(entry) = self.estimates.as_flattened_mut().get_mut(index) {
            *entry = (now, estimates);
        }
    }

    /// Forgets the estimates: they belong to another model or another zero.
    pub(crate) fn reset(&mut self) {
        self.written = 0;
        self.estimates = Default::default();
        self.forget_distance();
    }

    fn forget_distance(&mut self) {
        self.is_implausible = false;
        self.debounce.reset();
    }

    /// Whether measured poses have contradicted the estimate for too long. `is_checked`: the robot
    /// is on, and the memory of the model is known.
    pub(crate) fn is_implausible(
        &mut self,
        measured: Option<&ExternalPose>,
        outputs: usize,
        is_checked: bool,
        now: Nanos,
    ) -> bool {
        self.checked_since = is_checked.then(|| self.checked_since.unwrap_or(now));
        if !is_checked || now.duration_since(self.compared) > MAX_AGE {
            self.forget_distance();
        }
        if let Some(measured) = measured
            && measured.outputs as usize == outputs
            && measured.stamp != self.newest
        {
            (self.newest, self.arrived) = (measured.stamp, now);
            if let Some(estimates) = self.estimates_at(measured.stamp) {
                self.compared = now;
                let distances = estimates.iter().map(|from| distance(from, &measured.position));
                self.distance = distances.fold(0.0, f64::max);
                let is_far = self.distance > self.limit;
                self.is_implausible = self.debounce.update(is_checked && is_far, now);
            }
        }
        self.is_implausible
    }

    pub(crate) fn check(&self, now: Nanos) -> PlausibilityCheck {
        let Some(since) = self.checked_since.filter(|_| self.is_on()) else {
            return PlausibilityCheck::Inactive;
        };
        if self.compared > Nanos::ZERO && now.duration_since(self.compared) <= MAX_AGE {
            PlausibilityCheck::Working
        } else if now.duration_since(since) <= MAX_AGE {
            PlausibilityCheck::Inactive
        } else if now.duration_since(self.arrived) <= MAX_AGE {
            PlausibilityCheck::TooOld
        } else {
            PlausibilityCheck::Silent
        }
    }

    /// The estimates nearest to a time; `None` if there are none near it.
    fn estimates_at(&self, stamp: Nanos) -> Option<Estimates> {
        let difference =
            |recorded: &Nanos| recorded.duration_since(stamp) + stamp.duration_since(*recorded);
        let (nearest, estimates) = self
            .estimates
            .iter()
            .flatten()
            .filter(|(recorded, _)| *recorded > Nanos::ZERO)
            .min_by_key(|(recorded, _)| difference(recorded))?;
        (difference(nearest) <= SPACING + SPACING).then_some(*estimates)
    }
}

/// Euclidean distance. A value that is not a number is infinitely far.
fn distance(a: &OutputVec, b: &OutputVec) -> f64 {
    let distance = vector::distance(a, b);
    if distance.is_nan() { f64::INFINITY } else { distance }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(milliseconds: u64) -> Nanos {
        Nanos::from_millis(1000 + milliseconds)
    }

    fn measured(stamp: u64, degrees: f64) -> ExternalPose {
        ExternalPose {
            stamp: ms(stamp),
            position: [degrees.to_radians(), 0.0, 0.0],
            outputs: 2,
            quality: 0.0,
        }
    }

    /// A monitor that has recorded 0.4 s of motion at 10 deg/s.
    fn moving() -> PlausibilityMonitor {
        let mut monitor = PlausibilityMonitor::new(2.0);
        for t in 0..400 {
            let pose = [(0.01 * t as f64).to_radians(), 0.0, 0.0];
            monitor.record_estimates(ms(t), [pose; 2]);
        }
        monitor
    }

    #[test]
    fn late_pose_is_compared_at_its_own_time() {
        let mut monitor = moving();
        // The newest estimate is 2.5 deg away.
        for now in (400..800).step_by(40) {
            assert!(!monitor.is_implausible(Some(&measured(150, 1.5)), 2, true, ms(now)));
        }
    }

    #[test]
    fn lasting_distance_is_a_fault_single_pose_is_not() {
        let mut monitor = moving();
        for (pose, is_checked, now, is_fault) in [
            (Some(measured(300, 6.0)), true, 400, false),
            (None, true, 450, false),
            (Some(measured(340, 3.4)), true, 480, false),
            (Some(measured(350, 6.0)), true, 500, false),
            // Confirmed by a frame after the debounce time, and not by silence.
            (None, true, 820, false),
            (Some(measured(380, 6.0)), true, 820, true),
            (None, true, 821, true),
            // A robot that is off is not checked.
            (None, false, 822, false),
        ] {
            let found = monitor.is_implausible(pose.as_ref(), 2, is_checked, ms(now));
            assert_eq!(found, is_fault, "{now} ms");
        }
    }

    #[test]
    fn single_outlier_before_silence_is_not_a_fault() {
        let mut monitor = moving();
        let odd = measured(390, 60.0);
        // The control loop may hand the same frame over in every tick.
        for now in 400..3000 {
            assert!(!monitor.is_implausible(Some(&odd), 2, true, ms(now)), "{now}");
            monitor.record_estimates(ms(now), Estimates::default());
        }
        // Another odd one, long after the first.
        assert!(!monitor.is_implausible(Some(&measured(2990, 60.0)), 2, true, ms(3000)));
    }

    #[test]
    fn silent_or_late_camera_is_reported() {
        use PlausibilityCheck::{Inactive, Silent, TooOld, Working};
        let mut monitor = moving();
        for (pose, is_checked, now, expected) in [
            (None, false, 390, Inactive),
            (None, true, 400, Inactive),
            (None, true, 900, Inactive),
            (None, true, 901, Silent),
            (Some(measured(300, 3.0)), true, 910, Working),
            (None, true, 1410, Working),
            (None, true, 1411, Silent),
            // Long before the oldest estimate.
            (Some(measured(600, 3.0)), true, 1420, TooOld),
            (None, true, 1920, TooOld),
            (None, true, 1921, Silent),
            (None, false, 1922, Inactive),
        ] {
            let _ = monitor.is_implausible(pose.as_ref(), 2, is_checked, ms(now));
            assert_eq!(monitor.check(ms(now)), expected, "{now} ms");
        }
    }

    #[test]
    fn incomparable_pose_is_not_a_fault() {
        let mut monitor = moving();
        for now in (400..900).step_by(40) {
            // No estimate of that time.
            assert!(!monitor.is_implausible(Some(&measured(700, 60.0)), 2, true, ms(now)));
            // Another number of outputs.
            assert!(!monitor.is_implausible(Some(&measured(300, 60.0)), 3, true, ms(now)));
        }
    }

    #[test]
    fn measurement_is_the_distance_beyond_the_limit() {
        let mut monitor = moving();
        assert_eq!(monitor.measurement(), None);
        monitor.distance = monitor.limit;
        assert_eq!(monitor.measurement(), None);
        monitor.distance = 3.0_f64.to_radians();
        let measurement = monitor.measurement().unwrap();
        assert_eq!(measurement.quantity, Quantity::Degrees);
        assert!((measurement.measured - 3.0).abs() < 1e-12);
        assert!((measurement.limit.unwrap() - 2.0).abs() < 1e-12);
        monitor.limit = 0.0;
        assert!(!monitor.is_on());
        assert_eq!(monitor.measurement(), None, "the check is off");
    }

    #[test]
    fn distance_at_the_limit_is_not_a_fault() {
        let mut monitor = moving();
        monitor.reset();
        for t in 400..800 {
            monitor.record_estimates(ms(t), [[0.0; 3]; 2]);
        }
        for (degrees, is_fault) in [(2.0, false), (2.0 + 1e-9, true)] {
            for (stamp, now) in [(650, 800), (700, 1100), (720, 1101)] {
                // Every frame has a stamp of its own.
                let stamp = stamp + u64::from(is_fault);
                let pose = measured(stamp, degrees);
                let found = monitor.is_implausible(Some(&pose), 2, true, ms(now));
                assert_eq!(found, is_fault && now >= 1100, "{degrees} deg at {now} ms");
            }
        }
    }

    #[test]
    fn estimates_are_stored_every_four_milliseconds_for_half_a_second() {
        let mut monitor = moving();
        assert_eq!(monitor.written, 100);
        monitor.record_estimates(ms(399), Estimates::default());
        assert_eq!(monitor.written, 100, "3 ms after the last one");
        monitor.record_estimates(ms(400), Estimates::default());
        assert_eq!(monitor.written, 101);
        for (stamp, is_found) in [(0, true), (200, true), (408, true), (409, false)] {
            let found = monitor.estimates_at(ms(stamp));
            assert_eq!(found.is_some(), is_found, "{stamp} ms");
        }
        for t in 401..=512 {
            monitor.record_estimates(ms(t), Estimates::default());
        }
        let oldest = monitor.estimates_at(ms(4)).unwrap();
        assert_eq!(oldest[0][0], 0.04_f64.to_radians());
        assert_eq!(monitor.written, 129, "the first is written over");
        let oldest = monitor.estimates_at(ms(0)).unwrap();
        assert_eq!(oldest[0][0], 0.04_f64.to_radians(), "its neighbour");
        monitor.limit = 0.0;
        monitor.record_estimates(ms(600), Estimates::default());
        assert_eq!(monitor.written, 129, "the check is off");
    }

    #[test]
    fn a_reset_forgets_the_estimates() {
        let mut monitor = moving();
        monitor.reset();
        assert_eq!(monitor.estimates_at(ms(300)), None);
        let now = Nanos::from_millis(3);
        assert_eq!(monitor.estimates_at(now), None, "near the time zero");
        monitor.checked_since = Some(Nanos::ZERO);
        assert_eq!(monitor.check(now), PlausibilityCheck::Inactive);
    }

    #[test]
    fn a_distance_is_confirmed_only_within_half_a_second() {
        for (second, is_fault) in [(900, true), (901, false)] {
            let mut monitor = moving();
            assert!(!monitor.is_implausible(Some(&measured(390, 60.0)), 2, true, ms(400)));
            for now in 401..=second {
                assert!(!monitor.is_implausible(None, 2, true, ms(now)));
                monitor.record_estimates(ms(now), Estimates::default());
                // The tick of the second frame is the first without the former.
                if now == second {
                    let frame = measured(second - 10, 60.0);
                    let found = monitor.is_implausible(Some(&frame), 2, true, ms(now));
                    assert_eq!(found, is_fault, "{second} ms");
                }
            }
        }
    }
}
