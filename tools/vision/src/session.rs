//! Frames to angles without any input or output: results of one or two views in, rows out.
//!
//! The first seconds are the rest reference: their rows are held back until it is known.

use std::collections::{BTreeMap, VecDeque};

use i2ris::units::Nanos;

use crate::angle_csv::AngleRow;
use crate::joint_angles::{RestPose, RestPoseError, RestPoseEstimator, Stereo};
use crate::setup::{JointAxis, VisionSetup};
use crate::source::FrameFault;
use crate::view_detector::{Rejection, ViewResult};

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
    /// Causes of rows without angles: view and cause. Both views can have one.
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
        let first = *self.first.get_or_insert(pair.stamp);
        if pair.stamp.duration_since(first) < self.rest {
            for (view, result) in &pair.items {
                self.estimator[*view].add(result.seen.as_ref().ok());
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
        let (stamp, results) = (pair.stamp, &pair.items);
        let cause = |(view, result): &(usize, ViewResult)| Some((*view, result.good().err()?));
        let mut causes: Vec<(usize, Rejection)> = results.iter().filter_map(cause).collect();
        if results.len() < self.setup.views.len() && causes.is_empty() {
            let missing = 1 - results.first().map_or(0, |(view, _)| *view);
            causes.push((missing, Rejection::Frame(FrameFault::NoPartner)));
        }
        if let [(_, a), (_, b)] = results.as_slice() {
            let skew = Nanos(a.stamp.0.abs_diff(b.stamp.0));
            self.statistics.skew = self.statistics.skew.max(skew);
        }
        let sized = results.iter().filter_map(|(_, it)| Some((it.good().ok()?, it.size)));
        let sized: Vec<_> = sized.collect();
        let Some((stereo, _)) = self.stereo.as_ref().filter(|_| causes.is_empty()) else {
            return self.row(stamp, causes);
        };
        match stereo.solve(&sized) {
            Ok(angles) => {
                self.statistics.rows += 1;
                self.statistics.good += 1;
                AngleRow { stamp, seen: Ok(angles) }
            }
            Err((view, issue)) => self.row(stamp, vec![(view, Rejection::Quality(issue))]),
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

/// Pairs the frames of two views by their stamps, each view in the order of its stamps.
#[derive(Debug)]
struct FramePairer<T> {
    within: Nanos,
    waiting: [VecDeque<(Nanos, T)>; 2],
    ended: [bool; 2],
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct PairResult<T> {
    /// Of a pair, the instant half-way between the stamps.
    stamp: Nanos,
    /// One of each view, or one without a partner; with their views.
    items: Vec<(usize, T)>,
}

impl<T> FramePairer<T> {
    /// Pairs frames that are at most `within` apart.
    fn new(within: Nanos) -> Self {
        Self { within, waiting: [VecDeque::new(), VecDeque::new()], ended: [false; 2] }
    }

    fn push(&mut self, view: usize, stamp: Nanos, item: T) {
        self.waiting[view & 1].push_back((stamp, item));
    }

    fn end(&mut self, view: usize) {
        self.ended[view & 1] = true;
    }

    /// The view that has to deliver before the next result; `None`: both have ended.
    fn wanted(&self) -> Option<usize> {
        (0..2).filter(|view| !self.ended[*view]).min_by_key(|view| self.waiting[*view].len())
    }

    fn pop(&mut self) -> Option<PairResult<T>> {
        match [0, 1].map(|view| self.waiting[view].front().map(|(stamp, _)| *stamp)) {
            [Some(a), Some(b)] if a.0.abs_diff(b.0) <= self.within.0 => {
                let (_, first) = self.waiting[0].pop_front()?;
                let (_, second) = self.waiting[1].pop_front()?;
                let (stamp, items) = (Nanos(a.0.midpoint(b.0)), vec![(0, first), (1, second)]);
                Some(PairResult { stamp, items })
            }
            [Some(a), Some(b)] => self.alone(usize::from(b < a)),
            [Some(_), None] if self.ended[1] => self.alone(0),
            [None, Some(_)] if self.ended[0] => self.alone(1),
            _ => None,
        }
    }

    /// Gives up waiting for a partner: the oldest one of a view that has any.
    fn give_up(&mut self) -> Option<PairResult<T>> {
        self.alone(0).or_else(|| self.alone(1))
    }

    fn alone(&mut self, view: usize) -> Option<PairResult<T>> {
        let (stamp, item) = self.waiting[view].pop_front()?;
        Some(PairResult { stamp, items: vec![(view, item)] })
    }
}

/// Detects that both views show the same camera.
///
/// Two readers of one camera may get different frames: one match makes all suspect for a while.
#[derive(Debug, Default)]
struct DuplicateCameraMonitor {
    recent: [VecDeque<u64>; 2],
    suspicion: u32,
}

/// Frames of each view that are remembered.
const REMEMBERED: usize = 16;
/// Frames without another match until the suspicion ends.
const SUSPICION: u32 = 128;

impl DuplicateCameraMonitor {
    /// Records a frame of `view` (0 or 1) and returns whether both views are suspect.
    fn is_same_camera(&mut self, view: usize, digest: u64) -> bool {
        let [first, second] = &mut self.recent;
        let (own, other) = if view == 0 { (first, second) } else { (second, first) };
        self.suspicion =
            if other.contains(&digest) { SUSPICION } else { self.suspicion.saturating_sub(1) };
        own.push_back(digest);
        if own.len() > REMEMBERED {
            own.pop_front();
        }
        self.suspicion > 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(first: &[u64], second: &[u64]) -> Vec<PairResult<u64>> {
        let mut pairer = FramePairer::new(Nanos(10));
        let mut sources = [first.iter(), second.iter()];
        let mut out = Vec::new();
        while let Some(view) = pairer.wanted() {
            match sources[view].next() {
                Some(stamp) => pairer.push(view, Nanos(*stamp), *stamp),
                None => pairer.end(view),
            }
            while let Some(pair) = pairer.pop() {
                out.push(pair);
            }
        }
        out
    }

    #[test]
    fn near_stamps_pair_and_the_pair_lies_half_way() {
        let both = |stamp, a, b| PairResult { stamp: Nanos(stamp), items: vec![(0, a), (1, b)] };
        assert_eq!(run(&[100, 133], &[104, 131]), [both(102, 100, 104), both(132, 133, 131)]);
    }

    #[test]
    fn frames_after_the_end_of_the_other_view_are_unpaired() {
        assert_eq!(run(&[100, 133], &[]).len(), 2);
        assert!(
            run(&[], &[5])
                .iter()
                .all(|t| *t == PairResult { stamp: Nanos(5), items: vec![(1, 5)] })
        );
    }

    #[test]
    fn views_that_never_meet_do_not_pair() {
        let found = run(&[100, 200, 300], &[150, 250, 350]);
        assert!(found.iter().all(|t| t.items.len() == 1) && found.len() == 6);
    }

    #[test]
    fn one_camera_in_both_views_is_detected_despite_missing_frames() {
        let mut duplicates = DuplicateCameraMonitor::default();
        let mut suspected = 0;
        for image in 0..200_u64 {
            // Each view gets two of three frames.
            for view in 0..2 {
                let is_seen = (image + view) % 3 != 0;
                let is_same = is_seen && duplicates.is_same_camera(view as usize, image);
                suspected += usize::from(is_same);
            }
        }
        assert!(suspected > 250, "{suspected}");
    }

    #[test]
    fn two_cameras_are_two_and_a_single_match_is_forgotten() {
        let mut duplicates = DuplicateCameraMonitor::default();
        assert!((0..100).all(|i| !duplicates.is_same_camera((i % 2) as usize, i)));
        assert!(duplicates.is_same_camera(1, 98) && duplicates.is_same_camera(0, 1000));
        assert!((0..200).any(|i| !duplicates.is_same_camera((i % 2) as usize, 2000 + i)));
    }
}
