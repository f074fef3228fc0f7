//! Motor positions and loaded models, for the slower threads. The IPC thread updates it tick by
//! tick; the model manager reads it to stage models. The loop does not use it.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};

use crate::config::Config;
use crate::core::{CycleReport, HistoryCursor, ModelSlots, newest_stamp};
use crate::model::{History, Model, ModelId};
use crate::units::{MotorVec, Nanos};

#[derive(Debug, Clone)]
pub(super) struct LoadedModel {
    pub model: Arc<Model>,
    pub file: PathBuf,
}

#[derive(Debug, Default)]
pub(super) struct LoopHistory {
    /// Past positions of the motors, up to `mark`.
    pub history: History,
    /// Cursor in the motion history of the loop.
    pub mark: HistoryCursor,
    stamp: Nanos,
    /// Present position of the motors, counts.
    pub position: MotorVec,
    pub slots: ModelSlots,
    /// Every model that is loaded, or on its way to the loop.
    pub known: BTreeMap<ModelId, LoadedModel>,
}

impl LoopHistory {
    /// Adds a tick. If ticks were lost, the history starts again: a memory rebuilt from a history
    /// with a gap would be wrong without any error.
    pub(super) fn update(&mut self, report: &CycleReport) {
        self.slots = report.models;
        if report.mark == self.mark {
            return;
        }
        let recorded = self.mark.recorded + 1;
        if report.mark != (HistoryCursor { recorded, ..self.mark }) {
            self.history.forget();
        }
        for (position, drive) in self.position.iter_mut().zip(&report.feedback) {
            *position = drive.position.as_f64();
        }
        let stamp = newest_stamp(&report.feedback);
        let time_s = stamp.duration_since(self.stamp).as_seconds();
        self.history.push_after(&self.position, time_s);
        self.stamp = stamp;
        self.mark = report.mark;
    }

    pub(super) fn model(&self, id: Option<ModelId>) -> Option<&LoadedModel> {
        self.known.get(&id?)
    }
}

#[derive(Debug, Clone, Default)]
pub(super) struct SharedLoopHistory(Arc<Mutex<LoopHistory>>);

impl SharedLoopHistory {
    /// History at the start; `model` is the configured model.
    pub(super) fn new(config: &Config, model: Option<&Arc<Model>>) -> Self {
        let shared = Self::default();
        if let Some(model) = model {
            let file = config.control.model.clone().unwrap_or_default();
            let id = model.id();
            let mut history = shared.lock();
            history.slots.active = Some(id);
            history.known.insert(id, LoadedModel { model: Arc::clone(model), file });
        }
        shared
    }

    /// Locks the history; hold the lock for microseconds only.
    pub(super) fn lock(&self) -> MutexGuard<'_, LoopHistory> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn try_lock(&self) -> Option<MutexGuard<'_, LoopHistory>> {
        match self.0.try_lock() {
            Ok(history) => Some(history),
            Err(TryLockError::Poisoned(poisoned)) => Some(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::CycleInputs;
    use crate::core::cycle::ControlCycle;
    use crate::units::{Counts, Nanos};

    #[test]
    fn gap_or_new_zero_restarts_the_history() {
        let text = "robot_id = \"r\"\n[[ports]]\ndevice = \"/dev/null\"\n[[ports.axes]]\n\
                    motor = 0\nnode_id = 0\nserial_number = 1\nposition_min_counts = -9\n\
                    position_max_counts = 9\n";
        let config = Config::parse(text, "r.toml".as_ref()).unwrap();
        let mut cycle = ControlCycle::new(&config, None);
        let mut report = cycle.step(Nanos(1), &CycleInputs::default()).report;
        let mut history = LoopHistory::default();
        let mut update = |epoch, recorded, position| {
            report.mark = HistoryCursor { epoch, recorded };
            report.feedback[0].position = Counts(position);
            history.update(&report);
            assert_eq!(history.mark, report.mark);
            let positions = history.history.positions();
            positions.map(|counts| counts[0]).collect::<Vec<f64>>()
        };
        assert_eq!(update(0, 1, 0), [0.0]);
        assert_eq!(update(0, 1, 0), [0.0]);
        assert_eq!(update(0, 2, 5), [0.0, 5.0]);
        assert_eq!(update(0, 3, 3), [0.0, 5.0, 3.0]);
        assert_eq!(update(0, 5, 4), [4.0], "a gap");
        assert_eq!(update(1, 6, 8), [8.0], "a new zero");
    }
}
