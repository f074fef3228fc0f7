//! Detection of the base where it enters the image.

use super::intensity_profile::{Candidate, IntensityProfile};
use super::{DetectorSettings, QualityIssue};
use crate::image::{GreyImage, Px, across, advance, step};

/// Sections inside the border in which the base is searched.
const SECTIONS: usize = 9;
/// The base must show at this many of them.
const MIN_COUNT: usize = 5;
/// Distance of the first station, and of the first point of the trace, from the border, px.
pub(super) const MARGIN: f64 = 8.0;
/// The base comes in within this angle of the inward direction: its tangent.
const MAX_SLOPE: f64 = 0.47;
/// The weakest contrast that counts, grey levels.
pub(super) const MIN_CONTRAST: f32 = 14.0;
/// The base may be this many px off the straight line through two of its stations.
const OFF_LINE: f64 = 2.0;

#[derive(Debug, Clone, Copy)]
pub struct BaseDetection {
    /// Point on the base, `MARGIN` px inside the border.
    pub start: Px,
    pub direction_rad: f64,
    pub contrast: f32,
    pub ground: f32,
}

/// One candidate at one station: distance from the border, place along it.
#[derive(Clone, Copy)]
struct EdgePair {
    depth: f64,
    place: f64,
    candidate: Candidate,
}

pub fn find(image: &GreyImage, settings: &DetectorSettings) -> Result<BaseDetection, QualityIssue> {
    let frame = BorderFrame::new(image, settings);
    let seen = frame.detect(image, settings);
    let mut fits: Vec<_> = hypotheses(&seen).collect();
    fits.sort_by(|a, b| (b.0, b.1).partial_cmp(&(a.0, a.1)).unwrap_or(std::cmp::Ordering::Equal));
    let best = fits.first().filter(|(support, ..)| *support >= MIN_COUNT);
    let (support, _, on_it) = best.ok_or(QualityIssue::NoBase)?;
    let rivals = fits.iter().filter(|fit| differs(on_it, &fit.2, settings.body_width));
    let rival = rivals.map(|fit| fit.0).max().unwrap_or(0);
    if rival + 1 >= *support && rival >= MIN_COUNT {
        return Err(QualityIssue::TwoBases);
    }
    frame.entry(on_it).ok_or(QualityIssue::NoBase)
}

/// Lines through two candidates of different stations, with all candidates that lie on them.
fn hypotheses(seen: &[Vec<EdgePair>]) -> impl Iterator<Item = (usize, f32, Vec<EdgePair>)> + '_ {
    let stations = (0..SECTIONS - MIN_COUNT + 1)
        .flat_map(|i| (i + MIN_COUNT - 1..SECTIONS).map(move |j| (i, j)));
    let pairs = stations.flat_map(move |(i, j)| {
        seen[i].iter().flat_map(move |a| seen[j].iter().map(move |b| (*a, *b)))
    });
    pairs.filter_map(move |(a, b)| {
        let slope = (b.place - a.place) / (b.depth - a.depth);
        let expected = |s: &EdgePair| a.place + slope * (s.depth - a.depth);
        (slope.abs() <= MAX_SLOPE).then(|| {
            let on_it = seen.iter().filter_map(|station| nearest(station, expected));
            let on_it: Vec<EdgePair> = on_it.collect();
            let contrast = on_it.iter().map(|s| s.candidate.contrast).sum::<f32>();
            (on_it.len(), contrast, on_it)
        })
    })
}

fn nearest(station: &[EdgePair], expected: impl Fn(&EdgePair) -> f64) -> Option<EdgePair> {
    let off = |s: &EdgePair| (s.place - expected(s)).abs();
    station.iter().min_by(|a, b| off(a).total_cmp(&off(b))).filter(|s| off(s) <= OFF_LINE).copied()
}

fn differs(a: &[EdgePair], b: &[EdgePair], width: f64) -> bool {
    let common = a.iter().filter(|s| {
        b.iter().any(|t| t.depth == s.depth && (t.place - s.place).abs() < 0.5 * width)
    });
    2 * common.count() < a.len()
}

/// The image as seen from the side of entry.
struct BorderFrame {
    corner: Px,
    inward: Px,
    along: Px,
    inward_rad: f64,
    width: f64,
    depths: [f64; SECTIONS],
}

impl BorderFrame {
    fn new(image: &GreyImage, settings: &DetectorSettings) -> Self {
        let inward_rad = settings.inward_rad();
        // Clean unit vectors: a cosine of a right angle is not quite 0.
        let inward = step(inward_rad).map(f64::round);
        let along = across(inward_rad).map(f64::round);
        let (right, bottom) = (image.width() as f64 - 1.0, image.height() as f64 - 1.0);
        // The corner from which `along` runs into the image.
        let corner = [
            if inward[0] + along[0] > 0.0 { 0.0 } else { right },
            if inward[1] + along[1] > 0.0 { 0.0 } else { bottom },
        ];
        let width = along[0].abs() * right + along[1].abs() * bottom;
        let spacing = (settings.base_length - MARGIN) / SECTIONS as f64;
        let depths = std::array::from_fn(|i| MARGIN + spacing * i as f64);
        Self { corner, inward, along, inward_rad, width, depths }
    }

    fn detect(&self, image: &GreyImage, settings: &DetectorSettings) -> Vec<Vec<EdgePair>> {
        let (mut profile, mut found) = (IntensityProfile::default(), Vec::new());
        let half = (0.5 * self.width) as usize;
        let station = |depth: &f64| {
            let inside = advance(self.corner, self.inward, *depth);
            let centre = advance(inside, self.along, half as f64);
            profile.read(image, settings.ground, centre, self.along, half);
            profile.find(settings.body_width, MIN_CONTRAST, &mut found);
            let pair = |candidate: &Candidate| {
                let (depth, place) = (*depth, half as f64 + candidate.offset);
                EdgePair { depth, place, candidate: *candidate }
            };
            found.iter().map(pair).filter(|it| self.is_near(settings, it.place)).collect()
        };
        self.depths.iter().map(station).collect()
    }

    fn is_near(&self, settings: &DetectorSettings, place: f64) -> bool {
        // `near` counts from the image's left or upper corner; `along` may run the other way.
        let from_zero =
            if self.along[0] + self.along[1] > 0.0 { place } else { self.width - place };
        settings.near.is_none_or(|[at, within]| (from_zero - at).abs() <= within)
    }

    fn entry(&self, on_it: &[EdgePair]) -> Option<BaseDetection> {
        let count = on_it.len() as f64;
        let mean = |f: &dyn Fn(&EdgePair) -> f64| on_it.iter().map(f).sum::<f64>() / count;
        let (depth, place) = (mean(&|s| s.depth), mean(&|s| s.place));
        let slope = on_it.iter().map(|s| (s.depth - depth) * (s.place - place)).sum::<f64>()
            / on_it.iter().map(|s| (s.depth - depth).powi(2)).sum::<f64>();
        let inside = advance(self.corner, self.inward, MARGIN);
        let start = advance(inside, self.along, place + slope * (MARGIN - depth));
        slope.is_finite().then(|| BaseDetection {
            start,
            // `along` is to the left of `inward`.
            direction_rad: self.inward_rad + slope.atan(),
            contrast: mean(&|s| f64::from(s.candidate.contrast)) as f32,
            ground: mean(&|s| f64::from(s.candidate.ground)) as f32,
        })
    }
}
