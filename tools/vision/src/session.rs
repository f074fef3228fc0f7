//! The whole way of the pictures, without any input or output: looks of one or two views in, rows
//! out.
//!
//! The first seconds are the rest reference: their rows are held back until it is known, then told
//! like all others.

use std::collections::BTreeMap;

use i2ris::units::Nanos;

use crate::joint::Stereo;
use crate::look::{Cause, Look};
use crate::pair::{Pairer, Together};
use crate::record::Row;
use crate::rest::{Rest, RestError, Resting};
use crate::setup::{Axis, Setup};
use crate::source::{Gap, Twins};

/// What angles count from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reference {
    /// The straight pose that the first pictures show, for this long.
    First(Nanos),
    /// What the setup says.
    Setup,
}

/// Why a session cannot start or go on.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// No reference from the pictures.
    #[error(transparent)]
    Rest(#[from] RestError),
    /// No reference in the setup.
    #[error(
        "the setup has no rest for view {view}: begin the pictures at rest and give --rest-s, or calibrate"
    )]
    NoRest {
        /// Name of the view.
        view: String,
    },
    /// Nothing to measure.
    #[error("no picture came")]
    NoPicture,
}

/// What happened so far.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tally {
    /// Rows.
    pub rows: usize,
    /// Rows with angles.
    pub good: usize,
    /// Why the others have none: view and cause, or both views' names. Both views can have a cause
    /// in one row.
    pub causes: BTreeMap<(String, String), usize>,
    /// The largest difference between the stamps of a pair.
    pub skew: Nanos,
}

/// One run over pictures.
#[derive(Debug)]
pub struct Session {
    setup: Setup,
    reference: Reference,
    twins: Twins,
    pairer: Pairer<Look>,
    first: Option<Nanos>,
    resting: Vec<Resting>,
    held: Vec<Together<Look>>,
    stereo: Option<(Stereo, Vec<Rest>)>,
    ended: bool,
    tally: Tally,
}

impl Session {
    /// Starts.
    ///
    /// # Errors
    ///
    /// [`SessionError::NoRest`].
    pub fn new(setup: &Setup, reference: Reference) -> Result<Self, SessionError> {
        let mut session = Self {
            setup: setup.clone(),
            reference,
            twins: Twins::default(),
            pairer: Pairer::new(Nanos((setup.pair_within_ms * 1e6) as u64)),
            first: None,
            resting: vec![Resting::default(); setup.views.len()],
            held: Vec::new(),
            stereo: None,
            ended: false,
            tally: Tally::default(),
        };
        if setup.views.len() == 1 {
            session.pairer.end(1);
        }
        if reference == Reference::Setup {
            let missing = |view: &crate::setup::View| SessionError::NoRest {
                view: view.name.clone(),
            };
            let rests: Result<Vec<Rest>, _> = setup
                .views
                .iter()
                .map(|v| v.rest.ok_or_else(|| missing(v)))
                .collect();
            session.refer_to(rests?);
        }
        Ok(session)
    }

    /// The view that has to deliver next; `None`: all have ended.
    #[must_use]
    pub fn wanted(&self) -> Option<usize> {
        self.pairer.wanted()
    }

    /// Takes what a view saw.
    pub fn take(&mut self, view: usize, mut look: Look) {
        if let Some(digest) = look.digest
            && self.twins.are_one(view, digest)
        {
            look.seen = Err(Cause::Gap(Gap::SameCamera));
        }
        // Pictures and traces are for looking at, not for waiting with.
        look.picture = None;
        if let Ok(reading) = &mut look.seen {
            reading.trace = Vec::new();
        }
        self.pairer.push(view, look.stamp, look);
    }

    /// Nothing more comes from this view.
    pub fn end(&mut self, view: usize) {
        self.pairer.end(view);
        self.ended = self.pairer.wanted().is_none();
    }

    /// A camera has delivered nothing for a while: what waits for it waits no more.
    pub fn stalled(&mut self, view: usize, now: Nanos) -> Result<Vec<Row>, SessionError> {
        let mut rows = Vec::new();
        while let Some(together) = self.pairer.give_up() {
            rows.extend(self.settle(together)?);
        }
        rows.push(self.row(now, vec![(view, Cause::Gap(Gap::NoPicture))]));
        Ok(rows)
    }

    /// The rows that are certain by now.
    ///
    /// # Errors
    ///
    /// [`SessionError::Rest`] when the first pictures give no reference,
    /// [`SessionError::NoPicture`] at an end without any.
    pub fn rows(&mut self) -> Result<Vec<Row>, SessionError> {
        let mut rows = Vec::new();
        while let Some(together) = self.pairer.pop() {
            rows.extend(self.settle(together)?);
        }
        if self.ended && self.stereo.is_none() {
            rows.extend(self.finish_rest()?);
        }
        Ok(rows)
    }

    /// The straight poses in use, in the order of the views; empty while they are not known.
    #[must_use]
    pub fn rests(&self) -> &[Rest] {
        self.stereo.as_ref().map_or(&[], |(_, rests)| rests)
    }

    /// What happened so far.
    #[must_use]
    pub fn tally(&self) -> &Tally {
        &self.tally
    }

    /// Whether pitch and yaw are seen.
    #[must_use]
    pub fn axes(&self) -> [bool; 2] {
        match self.setup.views.as_slice() {
            [view] => [view.axis == Axis::Pitch, view.axis == Axis::Yaw],
            _ => [true; 2],
        }
    }

    fn refer_to(&mut self, rests: Vec<Rest>) {
        self.stereo = Some((Stereo::new(&self.setup, &rests), rests));
    }

    fn settle(&mut self, together: Together<Look>) -> Result<Vec<Row>, SessionError> {
        if self.stereo.is_some() {
            return Ok(vec![self.judge(&together)]);
        }
        let (stamp, looks) = parts(&together);
        let first = *self.first.get_or_insert(stamp);
        let Reference::First(span) = self.reference else {
            return Ok(Vec::new());
        };
        if stamp.since(first) < span {
            for (view, look) in looks {
                self.resting[view].add(look.seen.as_ref().ok());
            }
            self.held.push(together);
            return Ok(Vec::new());
        }
        let mut rows = self.finish_rest()?;
        rows.push(self.judge(&together));
        Ok(rows)
    }

    fn finish_rest(&mut self) -> Result<Vec<Row>, SessionError> {
        if self.first.is_none() {
            return Err(SessionError::NoPicture);
        }
        let named = self.resting.iter().zip(&self.setup.views);
        let rests: Result<Vec<Rest>, RestError> = named
            .map(|(resting, view)| resting.finish(&view.name))
            .collect();
        self.refer_to(rests?);
        let held = std::mem::take(&mut self.held);
        Ok(held.iter().map(|together| self.judge(together)).collect())
    }

    /// The row of what came together, once the reference is known.
    fn judge(&mut self, together: &Together<Look>) -> Row {
        let (stamp, looks) = parts(together);
        let mut causes: Vec<(usize, Cause)> = looks
            .iter()
            .filter_map(|(view, look)| look.good().err().map(|cause| (*view, cause)))
            .collect();
        if looks.len() < self.setup.views.len() && causes.is_empty() {
            let missing = 1 - looks.first().map_or(0, |(view, _)| *view);
            causes.push((missing, Cause::Gap(Gap::NoPartner)));
        }
        if let [(_, a), (_, b)] = looks.as_slice() {
            self.tally.skew = self
                .tally
                .skew
                .max(a.stamp.since(b.stamp).max(b.stamp.since(a.stamp)));
        }
        let sized: Option<Vec<_>> = looks
            .iter()
            .map(|(_, look)| look.good().ok().map(|reading| (reading, look.size)))
            .collect();
        match (&self.stereo, sized, causes.is_empty()) {
            (Some((stereo, _)), Some(sized), true) => match stereo.solve(&sized) {
                Ok(joints) => {
                    self.tally.rows += 1;
                    self.tally.good += 1;
                    Row {
                        stamp,
                        seen: Ok(joints),
                    }
                }
                Err((view, doubt)) => self.row(stamp, vec![(view, Cause::Doubt(doubt))]),
            },
            _ => self.row(stamp, causes),
        }
    }

    /// A row without angles.
    fn row(&mut self, stamp: Nanos, causes: Vec<(usize, Cause)>) -> Row {
        self.tally.rows += 1;
        let mut texts = Vec::new();
        for (view, cause) in causes {
            let name = self
                .setup
                .views
                .get(view)
                .map_or_else(String::new, |view| view.name.clone());
            texts.push(format!("{name}: {cause}"));
            *self
                .tally
                .causes
                .entry((name, cause.to_string()))
                .or_default() += 1;
        }
        Row {
            stamp,
            seen: Err(texts.join("; ")),
        }
    }
}

fn parts(together: &Together<Look>) -> (Nanos, Vec<(usize, &Look)>) {
    match together {
        Together::Both(stamp, [a, b]) => (*stamp, vec![(0, a), (1, b)]),
        Together::Alone(view, stamp, look) => (*stamp, vec![(*view, look)]),
    }
}
