//! Whether the snake is where the model says: the camera against the estimate from the encoders
//! (H12).
//!
//! A wire that is slack or torn, a gear that slips, or a model of another snake does not show in
//! the encoders. It shows in a camera that sees the angles. Its pictures are some hundredths of a
//! second old when they arrive, so they are compared with the estimate of the instant at which they
//! were taken. A single picture proves nothing: only a distance that lasts is a fault.

use serde::{Deserialize, Serialize};

use crate::config::PlausibilityConfig;
use crate::core::External;
use crate::core::faults::overload::Patience;
use crate::units::{Nanos, OutputVec};

/// Estimates that are kept, in rows of 32, because that is the largest array that can be written to
/// a file.
const ROWS: usize = 4;
const COLUMNS: usize = 32;
/// One estimate is kept every so often: all of them cover half a second.
const SPACING: Nanos = Nanos::from_millis(4);

/// The watch over the snake.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Plausible {
    /// Largest distance, rad; 0: no watch.
    distance: f64,
    patience: Patience,
    estimates: [[(Nanos, OutputVec); COLUMNS]; ROWS],
    written: u64,
    last: Nanos,
    /// How far apart they were in the last picture, rad.
    apart: Option<f64>,
}

impl Plausible {
    /// As configured.
    pub fn new(config: &PlausibilityConfig) -> Self {
        Self {
            distance: config.distance_deg.to_radians(),
            patience: Patience::new(Nanos::from_millis(config.debounce_ms)),
            estimates: [[(Nanos::ZERO, OutputVec::default()); COLUMNS]; ROWS],
            written: 0,
            last: Nanos::ZERO,
            apart: None,
        }
    }

    /// There is something to watch for.
    pub fn is_on(&self) -> bool {
        self.distance > 0.0
    }

    /// Takes note of the estimate of this tick.
    pub fn note(&mut self, now: Nanos, estimate: OutputVec) {
        if now.since(self.last) < SPACING || !self.is_on() {
            return;
        }
        self.last = now;
        let place = (self.written % (ROWS * COLUMNS) as u64) as usize;
        self.written += 1;
        if let Some(entry) = self
            .estimates
            .get_mut(place / COLUMNS)
            .and_then(|row| row.get_mut(place % COLUMNS))
        {
            *entry = (now, estimate);
        }
    }

    /// What was noted belongs to another model, or to another zero.
    pub fn forget(&mut self) {
        self.written = 0;
        self.estimates = [[(Nanos::ZERO, OutputVec::default()); COLUMNS]; ROWS];
        self.apart = None;
        self.patience.is_over(false, Nanos::ZERO);
    }

    /// Whether the snake has been elsewhere for too long. `watched`: the robot is on, and the
    /// memory of the model is known.
    pub fn is_broken(
        &mut self,
        picture: Option<&External>,
        outputs: usize,
        watched: bool,
        now: Nanos,
    ) -> bool {
        if let Some(picture) = picture
            && picture.outputs as usize == outputs
            && self.is_on()
        {
            self.apart = self
                .at(picture.stamp)
                .map(|estimate| distance(&estimate, &picture.position));
        }
        let far = watched && self.apart.is_some_and(|apart| apart > self.distance);
        self.patience.is_over(far, now)
    }

    /// The estimate nearest to an instant; `None` if none was made near it.
    fn at(&self, stamp: Nanos) -> Option<OutputVec> {
        let apart = |noted: &Nanos| noted.since(stamp) + stamp.since(*noted);
        let noted = self
            .estimates
            .iter()
            .flatten()
            .filter(|(noted, _)| *noted > Nanos::ZERO);
        let (nearest, estimate) = noted.min_by_key(|(noted, _)| apart(noted))?;
        (apart(nearest) <= SPACING + SPACING).then_some(*estimate)
    }
}

/// Not a number is far from anything.
fn distance(a: &OutputVec, b: &OutputVec) -> f64 {
    let distance = a
        .iter()
        .zip(b)
        .map(|(a, b)| (a - b) * (a - b))
        .sum::<f64>()
        .sqrt();
    if distance.is_nan() {
        f64::INFINITY
    } else {
        distance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(milliseconds: u64) -> Nanos {
        Nanos::from_millis(1000 + milliseconds)
    }

    fn picture(stamp: u64, degrees: f64) -> External {
        External {
            stamp: ms(stamp),
            position: [degrees.to_radians(), 0.0, 0.0],
            outputs: 2,
        }
    }

    fn moving() -> Plausible {
        let config = PlausibilityConfig {
            distance_deg: 2.0,
            debounce_ms: 100,
        };
        let mut plausible = Plausible::new(&config);
        // 10 deg/s.
        (0..400).for_each(|t| plausible.note(ms(t), [(0.01 * t as f64).to_radians(), 0.0, 0.0]));
        plausible
    }

    #[test]
    fn an_old_picture_is_compared_with_the_estimate_of_its_instant() {
        let mut plausible = moving();
        // Compared with the newest estimate these would be 2.5 deg apart.
        for now in (400..800).step_by(40) {
            assert!(!plausible.is_broken(Some(&picture(150, 1.5)), 2, true, ms(now)));
        }
    }

    #[test]
    fn a_distance_that_lasts_is_a_fault_and_one_picture_is_none() {
        let mut plausible = moving();
        assert!(!plausible.is_broken(Some(&picture(300, 6.0)), 2, true, ms(400)));
        assert!(!plausible.is_broken(None, 2, true, ms(450)));
        assert!(!plausible.is_broken(Some(&picture(340, 3.4)), 2, true, ms(480)));
        assert!(!plausible.is_broken(Some(&picture(350, 6.0)), 2, true, ms(500)));
        assert!(plausible.is_broken(None, 2, true, ms(600)));
        assert!(
            !plausible.is_broken(None, 2, false, ms(601)),
            "nobody is watched who is off"
        );
    }

    #[test]
    fn what_cannot_be_compared_is_no_fault() {
        let mut plausible = moving();
        for now in (400..900).step_by(40) {
            assert!(
                !plausible.is_broken(Some(&picture(700, 60.0)), 2, true, ms(now)),
                "no estimate of that instant"
            );
            assert!(
                !plausible.is_broken(Some(&picture(300, 60.0)), 3, true, ms(now)),
                "a position is no angle"
            );
        }
        plausible.forget();
        assert!(!plausible.is_broken(Some(&picture(300, 60.0)), 2, true, ms(1000)));
        assert!(!plausible.is_broken(None, 2, true, ms(2000)));
    }
}
