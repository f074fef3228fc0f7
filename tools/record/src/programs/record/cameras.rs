//! Pictures from cameras, and the delay of their stamps.

use std::collections::BTreeMap;

use i2ris::ipc::Domain;
use i2ris::ipc::client::PictureSubscription;
use i2ris::units::Nanos;
use i2ris_record::pictures::Alignment;
use i2ris_record::recorder::{ALIGNMENT, ALIGNMENT_DEVIATION, MessageCounts, TrialRecorder};

pub struct Cameras {
    pictures: PictureSubscription,
    pub alignment: Alignment,
    /// Last number of each camera, and how many pictures were not read in time.
    missed: BTreeMap<String, (u64, u64)>,
}

impl Cameras {
    pub fn new(domain: &Domain) -> Self {
        let (pictures, missed) = (PictureSubscription::new(domain), BTreeMap::new());
        Self { pictures, alignment: Alignment::default(), missed }
    }

    /// Passes on all new pictures. Without a controller there are none.
    pub fn record(&mut self, trial: &mut TrialRecorder, now: Nanos) {
        let missed = &mut self.missed;
        let _ = self.pictures.drain(|header, jpeg| {
            let view = header.view();
            let (last, missed) = missed.entry(view.clone()).or_insert((header.sequence, 0));
            // A restarted camera counts from the beginning.
            *missed += header.sequence.saturating_sub(*last + 1);
            *last = header.sequence;
            trial.record_picture(&view, Nanos(header.stamp_ns), jpeg, now);
        });
    }

    /// Entries for the metadata at the end of the recording.
    pub fn outcome(&self, counts: &MessageCounts) -> BTreeMap<String, String> {
        let mut outcome = BTreeMap::new();
        for (view, pictures) in &counts.pictures {
            let missed = self.missed.get(view).map_or(0, |(_, missed)| *missed);
            let lost = pictures.dropped + pictures.over_budget + missed;
            outcome.insert(format!("pictures {view}"), pictures.recorded.to_string());
            outcome.insert(format!("pictures {view} dropped"), lost.to_string());
        }
        if let Some(found) = self.alignment.measure() {
            outcome.insert(ALIGNMENT.to_owned(), found.seconds.to_string());
            outcome.insert(ALIGNMENT_DEVIATION.to_owned(), found.deviation_s.to_string());
        }
        outcome
    }
}
