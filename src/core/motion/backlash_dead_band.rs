//! What keeps a model with memory from making the motors chatter.
//!
//! At a turn the exact inverse jumps by the gap, so a trembling hand would send the motors to and
//! fro across it, and a residual that is inverted as it stands answers its own motion. Hence:
//!
//! - **turning band**: the goal is a pen on a disc. While the pen pushes the disc along, the goal
//!   is followed as it is, without lag. A goal that turns back inside the disc is held where it was
//!   until it reaches the other side.
//! - **correction**: the residual of the model goes through a first-order low-pass and a play of
//!   its own.

use serde::{Deserialize, Serialize};

use crate::config::CompensationConfig;
use crate::core::motion::joint_space::NotFinite;
use crate::model::file::OutputUnit;
use crate::units::{Nanos, OutputVec};

/// The two filters and what they remember.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Steady {
    /// Radius of the disc, rad; 0 where the outputs are no angles.
    band: f64,
    /// Part of the way that the low-pass goes in one tick.
    share: f64,
    /// Half-width of the play behind it, rad; 0 where the outputs are no angles.
    correction_band: f64,
    pen: Option<Pen>,
    correction: Option<Filtered>,
}

/// Where the disc is, and the goal that was taken last.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Pen {
    disc: OutputVec,
    goal: OutputVec,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Filtered {
    low: OutputVec,
    held: OutputVec,
}

/// A goal after the turning band.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Settled {
    /// Where to go.
    pub goal: OutputVec,
    /// The goal is held, because it turned back by less than the band.
    pub held: bool,
}

impl Steady {
    /// `jumps`: the inverse crosses a gap at a turn, so there is something to be held back from.
    pub fn new(config: &CompensationConfig, unit: OutputUnit, tick: Nanos, jumps: bool) -> Self {
        let angle = |degrees: f64| {
            if unit == OutputUnit::Deg {
                degrees.to_radians()
            } else {
                0.0
            }
        };
        let tick_s = tick.as_seconds();
        Self {
            band: if jumps {
                angle(config.reversal_dead_band_deg)
            } else {
                0.0
            },
            share: tick_s / (tick_s + 1e-3 * config.residual_filter_ms),
            correction_band: angle(config.residual_dead_band_deg),
            pen: None,
            correction: None,
        }
    }

    /// Nothing is followed: the next goal is taken as it comes.
    pub fn release(&mut self) {
        self.pen = None;
    }

    /// Another model has been in use: its goal is held on to, and the correction starts from what
    /// this model says.
    pub fn begin_like(&mut self, before: Option<&Self>) {
        self.pen = before.and_then(|before| before.pen);
        self.correction = None;
    }

    /// The memory belongs to other counts.
    pub fn forget(&mut self) {
        self.pen = None;
        self.correction = None;
    }

    /// Takes the goal of a tick.
    pub fn settle(&mut self, goal: &OutputVec) -> Settled {
        let pen = self.pen.get_or_insert(Pen {
            disc: *goal,
            goal: *goal,
        });
        let apart = distance(goal, &pen.disc);
        let held = apart <= self.band && self.band > 0.0 && pen.goal != *goal;
        if !held {
            pen.goal = *goal;
            if apart > self.band {
                let share = 1.0 - self.band / apart;
                pen.disc
                    .iter_mut()
                    .zip(goal)
                    .for_each(|(disc, goal)| *disc += share * (goal - *disc));
            }
        }
        Settled {
            goal: pen.goal,
            held,
        }
    }

    /// Takes the correction of a tick.
    pub fn correct(&mut self, correction: OutputVec) -> Result<(), NotFinite> {
        if !correction.iter().all(|value| value.is_finite()) {
            return Err(NotFinite);
        }
        let filtered = self.correction.get_or_insert(Filtered {
            low: correction,
            held: correction,
        });
        for ((low, held), value) in filtered
            .low
            .iter_mut()
            .zip(&mut filtered.held)
            .zip(correction)
        {
            *low += self.share * (value - *low);
            *held = held
                .max(*low - self.correction_band)
                .min(*low + self.correction_band);
        }
        Ok(())
    }

    /// The correction to invert with.
    pub fn correction(&self) -> Option<OutputVec> {
        self.correction.map(|filtered| filtered.held)
    }
}

fn distance(a: &OutputVec, b: &OutputVec) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b) * (a - b))
        .sum::<f64>()
        .sqrt()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn steady() -> Steady {
        let config = CompensationConfig {
            reversal_dead_band_deg: 1.0,
            residual_dead_band_deg: 0.5,
            ..CompensationConfig::default()
        };
        Steady::new(&config, OutputUnit::Deg, Nanos::from_millis(1), true)
    }

    fn degrees(pitch: f64, yaw: f64) -> OutputVec {
        [pitch.to_radians(), yaw.to_radians(), 0.0]
    }

    #[test]
    fn a_goal_that_goes_on_is_followed_and_one_that_turns_back_a_little_is_held() {
        let mut steady = steady();
        for pitch in [0.0, 1.5, 3.0] {
            assert_eq!(
                steady.settle(&degrees(pitch, 0.0)),
                Settled {
                    goal: degrees(pitch, 0.0),
                    held: false
                }
            );
        }
        // The disc is at 2 deg.
        assert_eq!(
            steady.settle(&degrees(2.5, 0.0)),
            Settled {
                goal: degrees(3.0, 0.0),
                held: true
            }
        );
        assert_eq!(
            steady.settle(&degrees(1.1, 0.3)),
            Settled {
                goal: degrees(3.0, 0.0),
                held: true
            }
        );
        assert_eq!(
            steady.settle(&degrees(0.9, 0.0)),
            Settled {
                goal: degrees(0.9, 0.0),
                held: false
            }
        );
        steady.release();
        assert!(!steady.settle(&degrees(1.0, 0.0)).held);
    }

    #[test]
    fn the_correction_follows_slowly_and_not_at_all_for_little() {
        let mut steady = steady();
        steady.correct(degrees(0.0, 0.0)).unwrap();
        let after = |steady: &mut Steady, pitch: f64, ticks: u32| {
            (0..ticks).for_each(|_| steady.correct(degrees(pitch, 0.0)).unwrap());
            steady.correction().unwrap()[0].to_degrees()
        };
        assert_eq!(after(&mut steady, 0.4, 1000), 0.0);
        // One time constant of 50 ms from 0.4 to 10: 0.4 + 9.6 (1 - 1/e) less the play.
        let found = after(&mut steady, 10.0, 51);
        assert!((found - (0.4 + 9.6 * 0.632 - 0.5)).abs() < 0.1, "{found}");
        assert!((after(&mut steady, 10.0, 1000) - 9.5).abs() < 1e-6);
        assert!(steady.correct([f64::NAN; 3]).is_err());
    }

    #[test]
    fn tremor_inside_the_band_moves_nothing() {
        let mut steady = steady();
        let first = steady.settle(&degrees(5.0, 5.0)).goal;
        for tick in 0..500 {
            let phase = f64::from(tick) * 0.0628;
            assert_eq!(
                steady.settle(&degrees(5.0 + 0.9 * phase.sin(), 5.0)).goal,
                first
            );
        }
    }

    proptest! {
        #[test]
        fn the_goal_is_never_left_by_more_than_twice_the_band(
            goals in prop::collection::vec((-30.0..30.0_f64, -30.0..30.0_f64), 1..200)
        ) {
            let mut steady = steady();
            for (pitch, yaw) in goals {
                let goal = degrees(pitch, yaw);
                let settled = steady.settle(&goal);
                prop_assert!(distance(&settled.goal, &goal) <= 2.0_f64.to_radians() * (1.0 + 1e-9));
                prop_assert_eq!(settled.held, settled.goal != goal);
            }
        }
    }
}
