//! Frames to angles without any input or output: results of one or two views in, rows out.
//!
//! The first seconds are the rest reference: their rows are held back until it is known, then
//! reported like all others.

use std::collections::BTreeMap;

use i2ris::units::Nanos;

use crate::angle_csv::AngleRow;
use crate::frame_pairing::{FramePairer, PairResult};
use crate::joint_angles::Stereo;
use crate::rest_pose::{RestPose, RestPoseError, RestPoseEstimator};
use crate::setup::{JointAxis, VisionSetup};
use crate::source::{DuplicateCameraMonitor, FrameFault};
use crate::view_detector::{Rejection, ViewResult};

/// Reason why a session cannot start or continue.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    #[error(transparent)]
    RestPose(#[from] RestPoseError),
    #[error("no frame arrived")]
    NoPicture,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub struct SessionStatistics {
    pub rows: usize,
    pub good: usize,
    /// Causes of rows without angles: view and cause, or both views' names. Both can have a cause
    /// in one row.
    pub causes: BTreeMap<(String, String), usize>,
    /// The largest difference between the stamps of a pair.
    pub skew: Nanos,
}

#[derive(Debug)]
pub struct Session {
    setup: VisionSetup,
    /// Time for which the first frames show the straight pose.
    rest: Nanos,
    duplicates: DuplicateCameraMonitor,
    pairer: FramePairer<ViewResult>,
    first: Option<Nanos>,
    estimator: Vec<RestPoseEstimator>,
    held: Vec<PairResult<ViewResult>>,
    stereo: Option<(Stereo, Vec<RestPose>)>,
    ended: bool,
    statistics: SessionStatistics,
}

impl Session {
    /// Measures angles from the straight pose in the first frames, which lasts for `rest`.
    pub fn new(setup: &VisionSetup, rest: Nanos) -> Self {
        let mut session = Self {
            setup: setup.clone(),
            rest,
            duplicates: DuplicateCameraMonitor::default(),
            pairer: FramePairer::new(Nanos((setup.pair_within_ms * 1e6) as u64)),
            first: None,
            estimator: vec![RestPoseEstimator::default(); setup.views.len()],
            held: Vec::new(),
            stereo: None,
            ended: false,
            statistics: SessionStatistics::default(),
        };
        if setup.views.len() == 1 {
            session.pairer.end(1);
        }
        session
    }

    /// The view that has to deliver next; `None`: all have ended.
    pub fn wanted(&self) -> Option<usize> {
        self.pairer.wanted()
    }

    pub fn take(&mut self, view: usize, mut result: ViewResult) {
        if let Some(digest) = result.digest
            && self.duplicates.is_same_camera(view, digest)
        {
            result.seen = Err(Rejection::Frame(FrameFault::SameCamera));
        }
        // Frames and traces are for display; results in the queue do not need them.
        result.image = None;
        if let Ok(reading) = &mut result.seen {
            reading.trace = Vec::new();
        }
        self.pairer.push(view, result.stamp, result);
    }

    pub fn end(&mut self, view: usize) {
        self.pairer.end(view);
        self.ended = self.pairer.wanted().is_none();
    }

    /// A camera has delivered nothing for a while: stops waiting for it.
    pub fn stalled(&mut self, view: usize, now: Nanos) -> Result<Vec<AngleRow>, SessionError> {
        let mut rows = Vec::new();
        while let Some(pair) = self.pairer.give_up() {
            rows.extend(self.process(pair)?);
        }
        rows.push(self.row(now, vec![(view, Rejection::Frame(FrameFault::NoPicture))]));
        Ok(rows)
    }

    /// Returns the rows that are final.
    pub fn rows(&mut self) -> Result<Vec<AngleRow>, SessionError> {
        let mut rows = Vec::new();
        while let Some(pair) = self.pairer.pop() {
            rows.extend(self.process(pair)?);
        }
        if self.ended && self.stereo.is_none() {
            rows.extend(self.finish_rest()?);
        }
        Ok(rows)
    }

    /// The straight poses in use, in the order of the views; empty while they are unknown.
    pub fn rests(&self) -> &[RestPose] {
        self.stereo.as_ref().map_or(&[], |(_, rests)| rests)
    }

    pub fn statistics(&self) -> &SessionStatistics {
        &self.statistics
    }

    pub fn axes(&self) -> [bool; 2] {
        match self.setup.views.as_slice() {
            [view] => [view.axis == JointAxis::Pitch, view.axis == JointAxis::Yaw],
            _ => [true; 2],
        }
    }

    fn process(&mut self, pair: PairResult<ViewResult>) -> Result<Vec<AngleRow>, SessionError> {
        if self.stereo.is_some() {
            return Ok(vec![self.evaluate(&pair)]);
        }
        let (stamp, results) = parts(&pair);
        let first = *self.first.get_or_insert(stamp);
        if stamp.duration_since(first) < self.rest {
            for (view, result) in results {
                self.estimator[view].add(result.seen.as_ref().ok());
            }
            self.held.push(pair);
            return Ok(Vec::new());
        }
        let mut rows = self.finish_rest()?;
        rows.push(self.evaluate(&pair));
        Ok(rows)
    }

    fn finish_rest(&mut self) -> Result<Vec<AngleRow>, SessionError> {
        if self.first.is_none() {
            return Err(SessionError::NoPicture);
        }
        let named = self.estimator.iter().zip(&self.setup.views);
        let rests: Result<Vec<RestPose>, RestPoseError> =
            named.map(|(estimator, view)| estimator.finish(&view.name)).collect();
        let rests = rests?;
        self.stereo = Some((Stereo::new(&self.setup, &rests), rests));
        let held = std::mem::take(&mut self.held);
        Ok(held.iter().map(|pair| self.evaluate(pair)).collect())
    }

    /// The row of a pair, once the reference is known.
    fn evaluate(&mut self, pair: &PairResult<ViewResult>) -> AngleRow {
        let (stamp, results) = parts(pair);
        let mut causes: Vec<(usize, Rejection)> = results
            .iter()
            .filter_map(|(view, result)| result.good().err().map(|cause| (*view, cause)))
            .collect();
        if results.len() < self.setup.views.len() && causes.is_empty() {
            let missing = 1 - results.first().map_or(0, |(view, _)| *view);
            causes.push((missing, Rejection::Frame(FrameFault::NoPartner)));
        }
        if let [(_, a), (_, b)] = results.as_slice() {
            let skew = Nanos(a.stamp.0.abs_diff(b.stamp.0));
            self.statistics.skew = self.statistics.skew.max(skew);
        }
        let sized: Option<Vec<_>> = results
            .iter()
            .map(|(_, result)| result.good().ok().map(|reading| (reading, result.size)))
            .collect();
        match (&self.stereo, sized, causes.is_empty()) {
            (Some((stereo, _)), Some(sized), true) => match stereo.solve(&sized) {
                Ok(angles) => {
                    self.statistics.rows += 1;
                    self.statistics.good += 1;
                    AngleRow { stamp, seen: Ok(angles) }
                }
                Err((view, issue)) => self.row(stamp, vec![(view, Rejection::Quality(issue))]),
            },
            _ => self.row(stamp, causes),
        }
    }

    fn row(&mut self, stamp: Nanos, causes: Vec<(usize, Rejection)>) -> AngleRow {
        self.statistics.rows += 1;
        let mut texts = Vec::new();
        for (view, cause) in causes {
            let name =
                self.setup.views.get(view).map_or_else(String::new, |view| view.name.clone());
            texts.push(format!("{name}: {cause}"));
            *self.statistics.causes.entry((name, cause.to_string())).or_default() += 1;
        }
        AngleRow { stamp, seen: Err(texts.join("; ")) }
    }
}

fn parts(pair: &PairResult<ViewResult>) -> (Nanos, Vec<(usize, &ViewResult)>) {
    match pair {
        PairResult::Matched(stamp, [a, b]) => (*stamp, vec![(0, a), (1, b)]),
        PairResult::Unmatched(view, stamp, result) => (*stamp, vec![(*view, result)]),
    }
}
