//! What slower threads know of the motors and the models: written by the thread of shared memory,
//! tick by tick, and read by whoever stages models. The loop has no part in it.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::core::HistoryCursor;
use crate::core::{CycleReport, ModelSlots};
use crate::model::{History, Model, ModelId};
use crate::units::MotorVec;

/// A model that the loop has or may have, and where it comes from.
#[derive(Debug, Clone)]
pub struct Known {
    /// The model.
    pub model: Arc<Model>,
    /// Its file.
    pub file: PathBuf,
}

/// The way of the motors, and the models at hand.
#[derive(Debug, Default)]
pub struct Chronicle {
    /// Where the motors have been, up to `mark`.
    pub history: History,
    /// How far along the trail of the loop that is.
    pub mark: HistoryCursor,
    /// Where the motors are, counts.
    pub position: MotorVec,
    /// The models at hand in the newest tick.
    pub slots: ModelSlots,
    /// Every model that is at hand, or on its way.
    pub known: BTreeMap<ModelId, Known>,
}

impl Chronicle {
    /// Takes note of a tick. Ticks that were lost on the way leave a gap in the history, and a
    /// memory that is rebuilt from a history with a gap would be wrong without saying so: then it
    /// starts anew.
    pub fn note(&mut self, report: &CycleReport) {
        self.slots = report.models;
        if report.mark == self.mark {
            return;
        }
        let next = HistoryCursor {
            recorded: self.mark.recorded + 1,
            ..self.mark
        };
        if report.mark != next {
            self.history.forget();
        }
        self.position
            .iter_mut()
            .zip(&report.feedback)
            .for_each(|(to, drive)| *to = drive.position.as_f64());
        self.history.note(&self.position);
        self.mark = report.mark;
    }

    /// A model at hand.
    #[must_use]
    pub fn model(&self, id: Option<ModelId>) -> Option<&Known> {
        self.known.get(&id?)
    }
}

/// The chronicle, shared among slower threads.
#[derive(Debug, Clone, Default)]
pub struct SharedChronicle(Arc<Mutex<Chronicle>>);

impl SharedChronicle {
    /// Exclusive access. Held for microseconds only.
    pub fn lock(&self) -> MutexGuard<'_, Chronicle> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;
    use crate::core::CycleInputs;
    use crate::core::cycle::ControlCycle;
    use crate::units::{Counts, Nanos};

    fn report(epoch: u64, recorded: u64, position: i32) -> CycleReport {
        let text = "robot_id = \"r\"\n[[ports]]\ndevice = \"/dev/null\"\n[[ports.axes]]\nmotor = 0\nnode_id = 0\n\
                    serial_number = 1\nposition_min_counts = -9\nposition_max_counts = 9\n";
        let config = Config::parse(text, "r.toml".as_ref()).unwrap();
        let mut report = ControlCycle::new(&config, None)
            .step(Nanos(1), &CycleInputs::default())
            .report;
        report.mark = HistoryCursor { epoch, recorded };
        report.feedback[0].position = Counts(position);
        report
    }

    fn way(chronicle: &Chronicle) -> Vec<f64> {
        chronicle
            .history
            .positions()
            .map(|counts| counts[0])
            .collect()
    }

    #[test]
    fn a_gap_or_a_zero_that_moves_starts_the_history_anew() {
        let mut chronicle = Chronicle::default();
        for (recorded, position) in [(1, 0), (1, 0), (2, 5), (3, 3)] {
            chronicle.note(&report(0, recorded, position));
        }
        assert_eq!(way(&chronicle), [0.0, 5.0, 3.0]);
        chronicle.note(&report(0, 5, 4));
        assert_eq!(way(&chronicle), [4.0]);
        chronicle.note(&report(1, 6, 8));
        assert_eq!(
            (way(&chronicle), chronicle.mark),
            (
                vec![8.0],
                HistoryCursor {
                    epoch: 1,
                    recorded: 6
                }
            )
        );
    }
}
