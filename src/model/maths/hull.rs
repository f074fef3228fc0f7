//! The convex region of motor space that calibration visited.
//!
//! One motor: an interval. Two motors: a convex polygon, stored as corners in counter-clockwise
//! order and as half-planes `normal . x <= offset`. The normals have length 1, so a violation is a
//! distance in counts.

use serde::{Deserialize, Serialize};

use crate::model::error::{ModelError, require};
pub use crate::model::maths::plane::TOLERANCE_COUNTS;
use crate::model::maths::plane::{self, Quadratic, add, dot, subtract};
use crate::units::{MAX_MOTORS, MotorVec};

/// The most corners of a polygon. It bounds the work of every tick.
pub const MAX_CORNERS: usize = 64;

/// The largest position: the drive reports 32 bits (object 0x6064).
pub(in crate::model) const MAX_COUNTS: f64 = 2_147_483_648.0;

/// The least width of a hull, in counts. A narrower hull allows no motion.
const MIN_WIDTH_COUNTS: f64 = 1.0;

/// Weight of a motion within slack relative to one that moves the snake: practically 0, but it
/// decides between equals.
const SLACK_WEIGHT: f64 = 1e-9;

/// The convex region of motor space that calibration visited, counts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HullParameters {
    /// One motor: lowest and highest count. Two motors: corners of a convex polygon,
    /// counter-clockwise.
    pub corners: Vec<Vec<f64>>,
}

/// A convex region of motor space.
#[derive(Debug, Clone, PartialEq)]
pub struct Hull {
    shape: Shape,
    centre: MotorVec,
}

/// `inner_radius`: of the circle around the centre that touches the nearest side. Most positions
/// lie in it and need no further test.
#[derive(Debug, Clone, PartialEq)]
enum Shape {
    Interval { low: f64, high: f64 },
    Polygon { edges: Vec<Edge>, inner_radius: f64 },
}

/// One side of a polygon: from `corner` along `along` to the next corner.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Edge {
    corner: MotorVec,
    along: MotorVec,
    /// Outward, of length 1.
    normal: MotorVec,
    offset: f64,
}

impl Edge {
    fn new(corner: MotorVec, next: MotorVec) -> Self {
        let along = subtract(next, corner);
        let length = along[0].hypot(along[1]);
        let normal = [along[1] / length, -along[0] / length];
        Self { corner, along, normal, offset: dot(normal, corner) }
    }

    fn excess(&self, counts: MotorVec) -> f64 {
        dot(self.normal, counts) - self.offset
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::model) struct Minimum {
    pub counts: MotorVec,
    /// Distance of the unconstrained minimum from the hull, counts; 0 or negative when it lies
    /// inside.
    pub excess: f64,
}

impl Hull {
    /// The hull of a model file.
    ///
    /// # Errors
    ///
    /// When the corners do not form an interval (one motor) or a convex polygon in
    /// counter-clockwise order with at most [`MAX_CORNERS`] corners (two motors), are not finite
    /// counts of a drive, or enclose less than one count.
    pub fn new(parameters: &HullParameters, motors: usize) -> Result<Self, ModelError> {
        let corners = checked_corners(parameters, motors)?;
        let centre = mean(&corners);
        let shape = match (motors, corners.as_slice()) {
            (1, [low, high]) => Shape::Interval { low: low[0], high: high[0] },
            _ => {
                let edges = edges(&corners);
                let inner_radius =
                    edges.iter().map(|edge| -edge.excess(centre)).fold(f64::INFINITY, f64::min);
                Shape::Polygon { edges, inner_radius }
            }
        };
        let hull = Self { shape, centre };
        hull.check(&corners)?;
        Ok(hull)
    }

    /// The smallest convex hull around positions of the motors. If it has more than [`MAX_CORNERS`]
    /// corners, sides are removed and their neighbours are extended until they meet: for a circle
    /// with a radius of 1700 counts, 2 counts further out.
    ///
    /// # Errors
    ///
    /// When a position is not finite or all of them lie within one count of a point (one motor) or
    /// a line (two motors).
    pub fn from_points(motors: usize, points: &[MotorVec]) -> Result<Self, ModelError> {
        for (i, point) in points.iter().enumerate() {
            let is_finite = point.iter().all(|c| c.is_finite());
            let (key, shown) = (|| format!("position {i}"), format!("{point:?}"));
            require(is_finite, key, shown, "must be finite counts")?;
        }
        let corners = match motors {
            1 => plane::interval(points),
            _ => plane::thin(plane::convex_hull(points), MAX_CORNERS),
        };
        if corners.len() < motors + 1 {
            return Err(ModelError::FlatHull(mean(points)));
        }
        let corners =
            corners.iter().map(|corner| corner.iter().take(motors).copied().collect()).collect();
        Self::new(&HullParameters { corners }, motors)
    }

    /// Intersection of two hulls. Allocates: not for the control loop. Fails if the intersection is
    /// nearly empty, see [`Hull::from_points`].
    pub(in crate::model) fn common(&self, other: &Self, motors: usize) -> Result<Self, ModelError> {
        let inside = |one: &Self, of: &Self| -> Vec<MotorVec> {
            one.corners().filter(|corner| of.contains(corner)).collect()
        };
        let mut points = [inside(self, other), inside(other, self)].concat();
        if let (Shape::Polygon { edges: one, .. }, Shape::Polygon { edges: two, .. }) =
            (&self.shape, &other.shape)
        {
            let pairs = one.iter().flat_map(|edge| two.iter().map(move |other| (edge, other)));
            points.extend(pairs.filter_map(|(edge, other)| edge.crossing(other)));
        }
        Self::from_points(motors, &points)
    }

    /// The parameters of the hull in a model file.
    #[must_use]
    pub fn parameters(&self) -> HullParameters {
        let corners = match &self.shape {
            Shape::Interval { low, high } => vec![vec![*low], vec![*high]],
            Shape::Polygon { edges, .. } => edges.iter().map(|edge| edge.corner.to_vec()).collect(),
        };
        HullParameters { corners }
    }

    /// The corners: the two ends for one motor, the polygon in counter-clockwise order for two.
    pub fn corners(&self) -> impl Iterator<Item = MotorVec> + '_ {
        let (ends, edges) = match &self.shape {
            Shape::Interval { low, high } => {
                ([Some([*low, 0.0]), Some([*high, 0.0])], [].as_slice())
            }
            Shape::Polygon { edges, .. } => ([None, None], edges.as_slice()),
        };
        ends.into_iter().flatten().chain(edges.iter().map(|edge| edge.corner))
    }

    /// The lowest and the highest counts of every motor; 0 for motors that there are not.
    pub(crate) fn bounds(&self) -> [MotorVec; 2] {
        let start = [[f64::INFINITY; MAX_MOTORS], [f64::NEG_INFINITY; MAX_MOTORS]];
        self.corners().fold(start, |[low, high], at| {
            [[0, 1].map(|i: usize| low[i].min(at[i])), [0, 1].map(|i: usize| high[i].max(at[i]))]
        })
    }

    /// The mean of the corners, a point inside the hull.
    #[must_use]
    pub fn centre(&self) -> MotorVec {
        self.centre
    }

    /// Whether a point lies in the hull, within [`TOLERANCE_COUNTS`]. False if it is not finite.
    #[must_use]
    pub fn contains(&self, counts: &MotorVec) -> bool {
        match &self.shape {
            Shape::Interval { low, high } => {
                counts[0] >= low - TOLERANCE_COUNTS && counts[0] <= high + TOLERANCE_COUNTS
            }
            Shape::Polygon { edges, .. } => {
                edges.iter().all(|edge| edge.excess(*counts) <= TOLERANCE_COUNTS)
            }
        }
    }

    /// How far a point is beyond the side that it violates most, counts; negative inside. NaN if
    /// the point is not a number.
    #[must_use]
    pub fn excess(&self, counts: &MotorVec) -> f64 {
        match &self.shape {
            Shape::Interval { low, high } => {
                counts.first().map_or(f64::NAN, |at| (low - at).max(at - high))
            }
            Shape::Polygon { edges, .. } => {
                let excesses = edges.iter().map(|edge| edge.excess(*counts));
                let most = excesses.fold(f64::NEG_INFINITY, f64::max);
                if counts.iter().any(|at| at.is_nan()) { f64::NAN } else { most }
            }
        }
    }

    /// The nearest point of the hull, counts. A point inside is its own projection. A NaN point
    /// gives the centre.
    #[must_use]
    pub fn project(&self, counts: &MotorVec) -> MotorVec {
        if counts.iter().any(|c| c.is_nan()) {
            return self.centre;
        }
        let bounded = counts.map(|c| c.clamp(-MAX_COUNTS, MAX_COUNTS));
        self.minimise(&Quadratic::DISTANCE, bounded).counts
    }

    /// The nearest point of the hull where the motors may be anywhere between the lowest and the
    /// highest counts of a box around `counts` for nothing: the point that is nearest to the box,
    /// and of several the one that is nearest to `counts`. Without slack it is
    /// [`Hull::project`].
    #[must_use]
    pub fn project_with_slack(&self, counts: &MotorVec, slack: &[MotorVec; 2]) -> MotorVec {
        if counts.iter().any(|c| c.is_nan()) || self.contains(counts) {
            return self.project(counts);
        }
        let [low, high] = slack;
        let mut anchor = counts.map(|c| c.clamp(-MAX_COUNTS, MAX_COUNTS));
        let mut hessian = [[1.0, 0.0], [0.0, 1.0]];
        for motor in 0..MAX_MOTORS {
            let is_slack = low[motor] < high[motor];
            hessian[motor][motor] = if is_slack { SLACK_WEIGHT } else { 1.0 };
        }
        let mut found = anchor;
        // A motor counts only after it has used up its slack.
        for _ in 0..=MAX_MOTORS {
            let Some(distance) = Quadratic::new([0.0; MAX_MOTORS], hessian, 0.0) else { break };
            found = self.minimise(&distance, anchor).counts;
            let mut changed = false;
            for motor in 0..MAX_MOTORS {
                let within = found[motor].max(low[motor]).min(high[motor]);
                if hessian[motor][motor] < 1.0 && found[motor] != within {
                    (anchor[motor], hessian[motor][motor], changed) = (within, 1.0, true);
                }
            }
            if !changed {
                break;
            }
        }
        found
    }

    /// Hull point that minimises a quadratic in the step from `origin`. If the
    /// unconstrained minimum lies outside, the point lies on a side, because the hull and the
    /// quadratic are convex. `origin` may lie outside.
    pub(in crate::model) fn minimise(&self, quadratic: &Quadratic, origin: MotorVec) -> Minimum {
        let free = add(origin, quadratic.minimum);
        match &self.shape {
            Shape::Interval { low, high } => Minimum {
                counts: [free[0].clamp(*low, *high), 0.0],
                excess: (low - free[0]).max(free[0] - high),
            },
            Shape::Polygon { edges, inner_radius } => {
                let [across_0, across_1] = subtract(free, self.centre);
                if across_0 * across_0 + across_1 * across_1 <= inner_radius * inner_radius {
                    return Minimum { counts: free, excess: 0.0 };
                }
                let excess =
                    edges.iter().map(|edge| edge.excess(free)).fold(f64::NEG_INFINITY, f64::max);
                let counts = if excess <= 0.0 {
                    free
                } else {
                    self.minimise_on(edges, quadratic, origin, free)
                };
                Minimum { counts, excess }
            }
        }
    }

    /// The least of the minima along the sides that `free` violates. The other sides cannot contain
    /// the constrained minimum. Proof: at the constrained minimum `x` the gradient `H (x - free)`
    /// is minus a sum of outward normals of the active sides, `-n`. Then `n . (free - x) = n . H^-1
    /// n > 0`, so `free` violates at least one of them.
    fn minimise_on(
        &self,
        edges: &[Edge],
        quadratic: &Quadratic,
        origin: MotorVec,
        free: MotorVec,
    ) -> MotorVec {
        let mut best = (f64::INFINITY, self.centre);
        for edge in edges.iter().filter(|edge| edge.excess(free) > 0.0) {
            let counts = edge.minimum(quadratic, origin);
            let value = quadratic.value(subtract(counts, origin));
            if value < best.0 {
                best = (value, counts);
            }
        }
        best.1
    }

    fn check(&self, corners: &[MotorVec]) -> Result<(), ModelError> {
        match &self.shape {
            Shape::Interval { low, high } => require(
                high - low >= MIN_WIDTH_COUNTS,
                || "hull.corners".to_owned(),
                format!("[[{low}], [{high}]]"),
                "the second must lie at least one count above the first",
            ),
            Shape::Polygon { edges, .. } => {
                edges.iter().enumerate().try_for_each(|(i, edge)| edge.check(i, corners))
            }
        }
    }
}

impl Edge {
    /// Where a side of another polygon crosses this one.
    fn crossing(&self, other: &Self) -> Option<MotorVec> {
        let share = -other.excess(self.corner) / dot(other.normal, self.along);
        let at = add(self.corner, self.along.map(|along| share * along));
        let along = dot(subtract(at, other.corner), other.along) / dot(other.along, other.along);
        let is_on = |share| (0.0..=1.0).contains(&share);
        (is_on(share) && is_on(along)).then_some(at)
    }

    /// The least value of a quadratic along a side: a parabola in its fraction, clamped to [0, 1].
    fn minimum(&self, quadratic: &Quadratic, origin: MotorVec) -> MotorVec {
        let slope = dot(quadratic.slope(subtract(self.corner, origin)), self.along);
        let curvature = dot(self.along, quadratic.bend(self.along));
        let fraction = (-slope / curvature).clamp(0.0, 1.0);
        add(self.corner, self.along.map(|along| fraction * along))
    }

    fn check(&self, number: usize, corners: &[MotorVec]) -> Result<(), ModelError> {
        let key = || format!("hull.corners[{number}]");
        let shown = format!("{:?}", self.corner);
        let excesses = || corners.iter().map(|corner| self.excess(*corner));
        let lowest = excesses().fold(f64::INFINITY, f64::min);
        let highest = excesses().fold(f64::NEG_INFINITY, f64::max);
        let convex = highest <= TOLERANCE_COUNTS;
        let reason = "the corners must go round a convex polygon counter-clockwise";
        require(convex, key, &shown, reason)?;
        let reason = "the polygon must be at least one count wide";
        require(lowest <= -MIN_WIDTH_COUNTS, key, &shown, reason)
    }
}

fn checked_corners(
    parameters: &HullParameters,
    motors: usize,
) -> Result<Vec<MotorVec>, ModelError> {
    let key = || "hull.corners".to_owned();
    let rows = &parameters.corners;
    let count = rows.len();
    let reason = "there must be 1 or 2";
    require((1..=MAX_MOTORS).contains(&motors), key, format!("for {motors} motors"), reason)?;
    let (is_possible, reason) = match motors {
        1 => (count == 2, "one motor takes 2: lowest and highest count"),
        _ => (
            (3..=MAX_CORNERS).contains(&count),
            "two motors take 3 to 64 corners of a convex polygon",
        ),
    };
    require(is_possible, key, format!("{count} corners"), reason)?;
    let corners = rows.iter().enumerate().map(|(i, corner)| checked_corner(i, corner, motors));
    let corners = corners.collect::<Result<Vec<_>, _>>()?;
    for (i, (corner, next)) in corners.iter().zip(corners.iter().cycle().skip(1)).enumerate() {
        let side = subtract(*next, *corner);
        let distinct = side[0].hypot(side[1]) > TOLERANCE_COUNTS;
        let reason = "must differ from the next corner";
        require(distinct, || format!("hull.corners[{i}]"), format!("{corner:?}"), reason)?;
    }
    Ok(corners)
}

fn checked_corner(number: usize, corner: &[f64], motors: usize) -> Result<MotorVec, ModelError> {
    let key = || format!("hull.corners[{number}]");
    let shown = format!("{corner:?}");
    require(corner.len() == motors, key, &shown, "must have one number per motor")?;
    // `contains` is false for NaN too.
    let counts = corner.iter().all(|c| (-MAX_COUNTS..=MAX_COUNTS).contains(c));
    require(counts, key, &shown, "must be finite counts that fit 32 bits")?;
    let mut padded = [0.0; MAX_MOTORS];
    for (entry, counts) in padded.iter_mut().zip(corner) {
        *entry = *counts;
    }
    Ok(padded)
}

fn edges(corners: &[MotorVec]) -> Vec<Edge> {
    corners
        .iter()
        .zip(corners.iter().cycle().skip(1))
        .map(|(corner, next)| Edge::new(*corner, *next))
        .collect()
}

fn mean(points: &[MotorVec]) -> MotorVec {
    let sum = points.iter().fold([0.0; MAX_MOTORS], |sum, point| add(sum, *point));
    sum.map(|s| s / points.len().max(1) as f64)
}
