//! The angle between base and tip, and how far it can be trusted.

use super::{
    Line, Px, Settings, end, entry, line,
    trace::{self, Stop, Trace},
};
use crate::image::Grey;

/// A reading of this quality or better is good.
pub const GOOD: f64 = 0.5;

/// Blur and an oblique cut spoil this much of the tip, px, for the direction.
const CUT: f64 = 3.0;
/// Part of the straight stretch at the tip that is used. Where it begins is known only roughly, and
/// a bend of 40 deg towards the camera or away from it shortens the stretch in the picture to cos
/// 40 deg = 0.77.
const USED: f64 = 0.7;

/// Limits at which the quality is [`GOOD`].
mod limit {
    /// Missing part of the base.
    pub const BASE_MISSING: f64 = 0.4;
    /// Missing part of the tip.
    pub const TIP_MISSING: f64 = 0.35;
    /// Turn of the base from its middle to its end, rad: 0.3 deg.
    pub const BASE_BEND: f64 = 0.0052;
    /// Turn of the tip from its middle to its end, rad: 0.35 deg.
    pub const TIP_BEND: f64 = 0.0061;
    /// Standard deviation of the angle, rad: 0.2 deg.
    pub const STD: f64 = 0.0035;
    /// Scatter across a line, px.
    pub const SCATTER: f64 = 1.2;
    /// Angle between both edges, rad: 0.6 deg. If something covers one edge it turns the middle by
    /// half of that.
    pub const TAPER: f64 = 0.0105;
    /// Angle of the cut at the end, rad: 40 deg.
    pub const CUT: f64 = 0.7;
}

/// Why a reading is missing or not good.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Doubt {
    /// No base of the given thickness comes in on the given side.
    NoBase,
    /// Two things come in that could be the base.
    TwoBases,
    /// Too little of the base is seen.
    BaseCovered,
    /// The base is bent.
    BaseBent,
    /// Too little of the tip is seen.
    TipCovered,
    /// The stretch that should be the straight tip is bent.
    TipBent,
    /// There is no clear end.
    NoEnd,
    /// Something lies at the end of the tip.
    EndCovered,
    /// The fibre leaves the picture.
    OutOfPicture,
    /// It is shorter or longer than at rest.
    Length,
    /// Too much scatter to tell the angle.
    Noise,
}

impl Doubt {
    /// Every doubt.
    pub const ALL: [Self; 11] = [
        Self::NoBase,
        Self::TwoBases,
        Self::BaseCovered,
        Self::BaseBent,
        Self::TipCovered,
        Self::TipBent,
        Self::NoEnd,
        Self::EndCovered,
        Self::OutOfPicture,
        Self::Length,
        Self::Noise,
    ];

    /// What people read.
    #[must_use]
    pub const fn text(self) -> &'static str {
        match self {
            Self::NoBase => "no base in view",
            Self::TwoBases => "two bases in view",
            Self::BaseCovered => "base covered",
            Self::BaseBent => "base not straight",
            Self::TipCovered => "tip covered",
            Self::TipBent => "tip not straight",
            Self::NoEnd => "no clear end",
            Self::EndCovered => "something at the end",
            Self::OutOfPicture => "out of the picture",
            Self::Length => "not as long as at rest",
            Self::Noise => "too noisy",
        }
    }
}

impl std::fmt::Display for Doubt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.text())
    }
}

/// What one picture says. Where the quality is below [`GOOD`] the values are for looking at, not
/// for using.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// From the direction of the base to that of the tip, rad, counter-clockwise as seen.
    pub angle_rad: f64,
    /// Its standard deviation, rad, from the scatter of the trace around both lines.
    pub std_rad: f64,
    /// Middle of the fibre's end, px.
    pub tip_px: [f64; 2],
    /// The line of the base.
    pub base: Line,
    /// The line of the tip.
    pub tip: Line,
    /// From the border of the picture along the fibre to its end, px.
    pub length_px: f64,
    /// 0 to 1; [`GOOD`] or more can be used.
    pub quality: f64,
    /// What limits the quality, if it is not good.
    pub doubt: Option<Doubt>,
    /// The middle of the fibre as traced, px; for showing.
    pub trace: Vec<[f64; 2]>,
}

impl Reading {
    /// The values may be used.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.quality >= GOOD
    }

    /// Adds what another check found: `size` of the trouble, `limit` at which it is too much.
    pub fn doubt_if(&mut self, doubt: Doubt, size: f64, limit: f64) {
        let quality = score(size, limit);
        if quality < self.quality {
            self.quality = quality;
            self.doubt = (quality < GOOD).then_some(doubt);
        }
    }
}

/// Reads a picture.
///
/// # Errors
///
/// The doubt that leaves nothing to report: no base, two bases, or too little of base or tip for a
/// line.
pub fn measure(picture: &Grey, settings: &Settings) -> Result<Reading, Doubt> {
    let entry = entry::find(picture, settings).map_err(|none| match none {
        entry::NoEntry::Nothing => Doubt::NoBase,
        entry::NoEntry::Two => Doubt::TwoBases,
    })?;
    let trace = trace::follow(picture, settings, entry).ok_or(Doubt::BaseCovered)?;
    let base = stretch(&trace, 0.0, settings.base_length);
    let base = Line::fit(&base, entry.direction_rad).ok_or(Doubt::BaseCovered)?;
    let last = trace.points.last().ok_or(Doubt::BaseCovered)?.along;
    let points = stretch(&trace, tip_from(settings, last), last - CUT);
    let rough = direction(&points).ok_or(Doubt::TipCovered)?;
    let tip = Line::fit(&points, rough).ok_or(Doubt::TipCovered)?;
    Ok(judge(picture, settings, &trace, base, tip))
}

fn judge(picture: &Grey, settings: &Settings, trace: &Trace, base: Line, tip: Line) -> Reading {
    let end = end::find(picture, settings, trace, &tip);
    let last = trace.points.last().map_or(0.0, |p| p.along);
    let mut reading = Reading {
        angle_rad: wrap(tip.direction_rad - base.direction_rad),
        std_rad: base.std_rad.hypot(tip.std_rad),
        tip_px: end.map_or_else(
            || trace.points.last().map_or([0.0; 2], |p| p.at),
            |end| end.at,
        ),
        length_px: entry::before_start() + last + end.map_or(0.0, |end| end.beyond),
        base,
        tip,
        quality: 1.0,
        doubt: None,
        trace: trace.points.iter().map(|p| p.at).collect(),
    };
    let missing = |line: &Line, length: f64| 1.0 - line.followed * trace::STRIDE / length;
    reading.doubt_if(
        Doubt::BaseCovered,
        missing(&base, settings.base_length - CUT),
        limit::BASE_MISSING,
    );
    reading.doubt_if(
        Doubt::TipCovered,
        missing(&tip, USED * settings.tip_length - CUT),
        limit::TIP_MISSING,
    );
    reading.doubt_if(
        Doubt::BaseBent,
        surely(base.bend_rad, base.bend_std_rad),
        limit::BASE_BEND,
    );
    reading.doubt_if(
        Doubt::TipBent,
        surely(tip.bend_rad, tip.bend_std_rad),
        limit::TIP_BEND,
    );
    let ends = [
        (Doubt::BaseCovered, 0.0, settings.base_length),
        (Doubt::TipCovered, tip_from(settings, last), last - CUT),
    ];
    for (doubt, from, to) in ends {
        reading.doubt_if(doubt, taper(trace, from, to), limit::TAPER);
    }
    reading.doubt_if(Doubt::Noise, reading.std_rad, limit::STD);
    reading.doubt_if(
        Doubt::Noise,
        base.sigma_px.max(tip.sigma_px),
        limit::SCATTER,
    );
    match (trace.stop, end) {
        (Stop::Border, _) => reading.doubt_if(Doubt::OutOfPicture, 1.0, 0.0),
        (Stop::Covered, _) => reading.doubt_if(Doubt::EndCovered, 1.0, 0.0),
        (Stop::Ground, None) => reading.doubt_if(Doubt::NoEnd, 1.0, 0.0),
        (Stop::Ground, Some(end)) => {
            reading.doubt_if(Doubt::EndCovered, 1.0 - end.free, 1.0 - end::FREE);
            reading.doubt_if(Doubt::EndCovered, end.cut_rad.abs(), limit::CUT);
        }
    }
    reading
}

/// Where the straight tip surely has begun, along the trace.
fn tip_from(settings: &Settings, last: f64) -> f64 {
    last - USED * settings.tip_length
}

/// The angle between both edges of a stretch, as far as scatter does not explain it, rad.
fn taper(trace: &Trace, from: f64, to: f64) -> f64 {
    let readings = trace
        .points
        .iter()
        .filter(|p| (from..=to).contains(&p.along));
    let widths: Vec<Px> = readings.map(|p| [p.along, -p.width]).collect();
    Line::fit(&widths, 0.0).map_or(0.0, |line| surely(line.direction_rad, line.std_rad))
}

/// The readings between two lengths along the trace.
fn stretch(trace: &Trace, from: f64, to: f64) -> Vec<Px> {
    trace
        .points
        .iter()
        .filter(|p| (from..=to).contains(&p.along))
        .map(|p| p.at)
        .collect()
}

/// Rough direction of a stretch: from the middle of its first to the middle of its last quarter.
fn direction(points: &[Px]) -> Option<f64> {
    let quarter = (points.len() / 4).max(1);
    let middle = |part: &[Px], axis: usize| {
        line::median(&mut part.iter().map(|p| p[axis]).collect::<Vec<_>>())
    };
    let (first, last) = (
        points.get(..quarter)?,
        points.get(points.len() - quarter..)?,
    );
    Some(f64::atan2(
        middle(first, 1)? - middle(last, 1)?,
        middle(last, 0)? - middle(first, 0)?,
    ))
}

/// The part of a size that its uncertainty does not explain.
fn surely(size: f64, std: f64) -> f64 {
    (size.abs() - 2.0 * std).max(0.0)
}

/// 1 for no trouble, [`GOOD`] at the limit, towards 0 beyond.
fn score(size: f64, limit: f64) -> f64 {
    let size = size.max(0.0);
    if limit <= 0.0 {
        f64::from(size <= 0.0)
    } else {
        1.0 / (1.0 + (size / limit).powi(2))
    }
}

fn wrap(angle: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    angle - turn * (angle / turn).round()
}
