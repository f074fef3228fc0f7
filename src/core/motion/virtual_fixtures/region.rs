//! A forbidden region: a convex set with the distance to it; and the distances of one pose to all.
//!
//! The distance `d` is positive outside. For a convex set it is a convex function, so that
//! `d(x + s) >= d(x) + n s` with its slope `n` at `x`. A step `s` with `n s >= -d(x)` therefore
//! never enters the set, however long it is.

use serde::{Deserialize, Serialize};

use crate::config::{FixtureShape, MAX_CORNERS, MAX_REGIONS};
use crate::core::drift::CalibratedView;
use crate::core::inputs::{FixtureSpace, SimpleRegion, SimpleShape};
use crate::model::file::OutputUnit;
use crate::model::kinematic;
use crate::units::OutputVec;

/// A point or a direction: pitch and yaw, rad, and 0; or a position of the tip, m.
pub(crate) type Point = [f64; 3];

/// A region, grown by its margin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Region {
    pub space: FixtureSpace,
    shape: Shape,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "the loop may not allocate a box for it")]
enum Shape {
    Ball { centre: Point, radius: f64 },
    Faces { faces: [Face; MAX_CORNERS], count: u8 },
}

/// The half-space where `outward x <= offset`; a region is the intersection of several.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Face {
    /// Unit vector.
    outward: Point,
    offset: f64,
}

impl Region {
    /// A region of the configuration, which has been checked.
    pub(crate) fn new(shape: &FixtureShape) -> Self {
        match SimpleRegion::new(shape) {
            Some(simple) => Self::grown(&simple),
            None => Self::polygon(shape.corners_deg(), margin(FixtureSpace::Angles)),
        }
    }

    pub(crate) fn grown(simple: &SimpleRegion) -> Self {
        let margin = margin(simple.space);
        let shape = match simple.shape {
            SimpleShape::Ball { centre, radius } => Shape::Ball { centre, radius: radius + margin },
            SimpleShape::HalfSpace { normal, offset } => {
                let mut faces = [Face::default(); MAX_CORNERS];
                faces[0] = Face { outward: normal.map(|n| -n), offset: margin - offset };
                Shape::Faces { faces, count: 1 }
            }
        };
        Self { space: simple.space, shape }
    }

    fn polygon(corners_deg: &[[f64; 2]], margin: f64) -> Self {
        let corner = |index: usize| {
            let corner = corners_deg.get(index % corners_deg.len());
            corner.copied().unwrap_or_default().map(f64::to_radians)
        };
        let area: f64 =
            (0..corners_deg.len()).map(|index| cross(corner(index), corner(index + 1))).sum();
        let mut faces = [Face::default(); MAX_CORNERS];
        for (index, face) in faces.iter_mut().enumerate().take(corners_deg.len()) {
            let (a, b) = (corner(index), corner(index + 1));
            let length = (b[0] - a[0]).hypot(b[1] - a[1]) * area.signum();
            let outward = [(b[1] - a[1]) / length, (a[0] - b[0]) / length, 0.0];
            *face = Face { outward, offset: outward[0] * a[0] + outward[1] * a[1] + margin };
        }
        Self {
            space: FixtureSpace::Angles,
            shape: Shape::Faces { faces, count: corners_deg.len().min(MAX_CORNERS) as u8 },
        }
    }

    /// The distance to a point, negative inside, and its slope, of length 1, or 0 at the centre of
    /// a ball. Beyond a corner it is that to the farther of two sides, which is not more than the
    /// real one: to the safe side.
    pub(super) fn distance(&self, point: &Point) -> (f64, Point) {
        match &self.shape {
            Shape::Ball { centre, radius } => {
                let from = crate::core::vector::difference(point, centre);
                let length = norm(&from);
                let slope =
                    if length > 0.0 { from.map(|value| value / length) } else { Point::default() };
                (length - radius, slope)
            }
            Shape::Faces { faces, count } => {
                let mut farthest = (f64::NEG_INFINITY, Point::default());
                for face in faces.iter().take(usize::from(*count)) {
                    let distance = dot(&face.outward, point) - face.offset;
                    if distance > farthest.0 {
                        farthest = (distance, face.outward);
                    }
                }
                farthest
            }
        }
    }
}

/// Distance that a goal keeps from regions in angles, deg, and of the tip, m. It covers the
/// distance of goal and setpoint while motors cross their backlash.
const MARGIN_DEG: f64 = 0.5;
const TIP_MARGIN: f64 = 2e-5;

/// The margin of a region, rad (m).
pub(super) fn margin(space: FixtureSpace) -> f64 {
    match space {
        FixtureSpace::Angles => MARGIN_DEG.to_radians(),
        FixtureSpace::Tip => TIP_MARGIN,
    }
}

pub(super) fn dot(a: &Point, b: &Point) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(a: &Point) -> f64 {
    dot(a, a).sqrt()
}

fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// Poses that a region is kept away from: adapted and calibrated.
const POSES: usize = 2;

/// The distance of a pose to a region, with the slope in output space. NaN for a region in angles
/// with outputs that are not angles.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct PoseDistance {
    pub region: u8,
    pub distance: f64,
    pub slope: OutputVec,
}

/// The distances of a pose, and of the same as calibrated, to all regions. The position of the tip,
/// which takes longest, is computed once for all of them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Distances {
    list: [PoseDistance; POSES * MAX_REGIONS],
    count: usize,
}

impl Distances {
    pub(super) fn new(
        regions: &[Option<Region>; MAX_REGIONS],
        pose: &OutputVec,
        view: Option<&CalibratedView>,
        unit: OutputUnit,
    ) -> Self {
        let mut distances = Self { list: [PoseDistance::default(); POSES * MAX_REGIONS], count: 0 };
        distances.add(regions, pose, unit);
        if let Some(view) = view {
            let before = distances.count;
            distances.add(regions, &view.pose(pose), unit);
            for added in distances.list.iter_mut().take(distances.count).skip(before) {
                added.slope = view.slope(&added.slope);
            }
        }
        distances
    }

    fn add(&mut self, regions: &[Option<Region>; MAX_REGIONS], pose: &OutputVec, unit: OutputUnit) {
        let is_tip = |region: &Region| region.space == FixtureSpace::Tip;
        let needs_tip = unit == OutputUnit::Deg && regions.iter().flatten().any(is_tip);
        let tip = needs_tip.then(|| kinematic::tip_position(pose[0], pose[1]));
        for (index, region) in (0..).zip(regions) {
            let Some(region) = region else { continue };
            let (distance, slope) = match (region.space, unit, &tip) {
                (FixtureSpace::Angles, OutputUnit::Deg, _) => {
                    region.distance(&[pose[0], pose[1], 0.0])
                }
                (FixtureSpace::Tip, OutputUnit::Mm, _) => region.distance(pose),
                (FixtureSpace::Tip, OutputUnit::Deg, Some(tip)) => {
                    let (distance, slope) = region.distance(&tip.position_m);
                    let along = |column: &Point| dot(&slope, column);
                    let [pitch, yaw] = &tip.slope_m_per_rad;
                    (distance, [along(pitch), along(yaw), 0.0])
                }
                _ => (f64::NAN, OutputVec::default()),
            };
            if let Some(entry) = self.list.get_mut(self.count) {
                *entry = PoseDistance { region: index, distance, slope };
                self.count += 1;
            }
        }
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = &PoseDistance> {
        self.list.iter().take(self.count)
    }

    /// The first distance that is less than the least that is allowed after a distance before.
    pub(crate) fn first_below(
        &self,
        before: &Self,
        least: impl Fn(&PoseDistance) -> f64,
    ) -> Option<u8> {
        let mut pairs = self.iter().zip(before.iter());
        // A distance that is not a number is less than any.
        let is_allowed = |now: &PoseDistance, before: &PoseDistance| now.distance >= least(before);
        pairs.find(|(now, before)| !is_allowed(now, before)).map(|(now, _)| now.region)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distance_deg(region: &Region, pitch_deg: f64, yaw_deg: f64) -> f64 {
        let point = [pitch_deg.to_radians(), yaw_deg.to_radians(), 0.0];
        region.distance(&point).0.to_degrees()
    }

    #[test]
    fn polygon_distance_is_independent_of_orientation() {
        let mut corners_deg = vec![[2.0, 1.0], [6.0, 1.0], [6.0, 5.0], [2.0, 5.0]];
        for _ in 0..2 {
            let corners = corners_deg.clone();
            let square = Region::new(&FixtureShape::Polygon { corners_deg: corners });
            for (at, expected) in
                [([0.0, 3.0], 1.5), ([4.0, 9.0], 3.5), ([4.0, 3.0], -2.5), ([6.4, 3.0], -0.1)]
            {
                let distance = distance_deg(&square, at[0], at[1]);
                assert!((distance - expected).abs() < 1e-9, "{at:?}: {distance}");
            }
            corners_deg.reverse();
        }
    }

    #[test]
    fn a_half_plane_forbids_the_side_of_its_normal() {
        let wall = FixtureShape::HalfPlane { normal: [0.0, -3.0], offset_deg: 10.0 };
        let wall = Region::new(&wall);
        assert!((distance_deg(&wall, 20.0, 0.0) - 9.5).abs() < 1e-9);
        assert!((distance_deg(&wall, 0.0, -12.0) + 2.5).abs() < 1e-9);
    }

    #[test]
    fn a_ball_of_the_tip_is_in_metres() {
        let ball = FixtureShape::Ball { centre_mm: [1.0, 0.0, 2.0], radius_mm: 0.5 };
        let ball = Region::new(&ball);
        let (distance, slope) = ball.distance(&[0.0, 0.0, 2e-3]);
        assert!((distance - 0.48e-3).abs() < 1e-12);
        assert_eq!(slope, [-1.0, 0.0, 0.0]);
        assert_eq!(ball.distance(&[1e-3, 0.0, 2e-3]).1, [0.0; 3], "its centre");
    }

    #[test]
    fn calibrated_view_shifts_and_rotates_distances() {
        let view = CalibratedView { inverse: [[1.5, 0.25], [-0.5, 2.0]], zero: [0.1, -0.2] };
        let is_near = |found: OutputVec, wanted: [f64; 3]| {
            found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-12)
        };
        assert!(is_near(view.pose(&[0.3, 0.5, 0.7]), [0.475, 1.3, 0.7]));
        assert!(is_near(view.slope(&[0.6, 0.8, 0.1]), [0.5, 1.75, 0.1]));
    }
}
