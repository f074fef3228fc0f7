//! Virtual fixtures: regions that the snake may not enter.

use serde::{Deserialize, Serialize};

use super::bounds::Findings;

/// Regions at the same time, also with those of requests.
pub const MAX_REGIONS: usize = 8;
/// Corners of a polygon.
pub const MAX_CORNERS: usize = 8;

/// A forbidden region.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct FixtureRegionConfig {
    /// Name in messages and on the screen.
    pub name: String,
    /// Shape of the region.
    pub shape: FixtureShape,
}

/// A convex shape. Angles are `[pitch, yaw]`; positions of the tip are `[x, y, z]` at the base of
/// the snake: z along the straight snake, yaw bends towards x, pitch towards y.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum FixtureShape {
    /// A circle in the plane of pitch and yaw.
    Circle {
        /// Centre, degrees.
        centre_deg: [f64; 2],
        /// Radius, degrees.
        radius_deg: f64,
    },
    /// Everything beyond a straight line in the plane of pitch and yaw.
    HalfPlane {
        /// Direction into the forbidden side; its length does not matter.
        normal: [f64; 2],
        /// Distance of the line from the straight snake along the normal, degrees.
        offset_deg: f64,
    },
    /// A convex polygon in the plane of pitch and yaw.
    Polygon {
        /// Three to eight corners, listed around the polygon, degrees.
        corners_deg: Vec<[f64; 2]>,
    },
    /// A ball in space, for the tip.
    Ball {
        /// Centre, mm.
        centre_mm: [f64; 3],
        /// Radius, mm.
        radius_mm: f64,
    },
    /// Everything beyond a plane in space, for the tip.
    HalfSpace {
        /// Direction into the forbidden side; its length does not matter.
        normal: [f64; 3],
        /// Distance of the plane from the base along the normal, mm.
        offset_mm: f64,
    },
}

/// Maximum coordinate, degrees or mm.
const MAX_COORDINATE: f64 = 360.0;

pub(super) fn check(regions: &[FixtureRegionConfig], findings: &mut Findings) {
    findings.require(
        regions.len() <= MAX_REGIONS,
        "virtual_fixtures",
        regions.len(),
        format!("must be at most {MAX_REGIONS}"),
    );
    for (index, region) in regions.iter().enumerate() {
        let key = format!("virtual_fixtures[{index}]");
        findings.require(
            (1..=24).contains(&region.name.len()),
            format!("{key}.name"),
            &region.name,
            "must have 1 to 24 bytes",
        );
        let reason = region.shape.problem();
        findings.require(
            reason.is_none(),
            format!("{key}.shape"),
            format!("{:?}", region.shape),
            reason.unwrap_or_default(),
        );
    }
}

impl FixtureShape {
    /// The corners of a polygon, degrees; other shapes have none.
    pub(crate) fn corners_deg(&self) -> &[[f64; 2]] {
        match self {
            Self::Polygon { corners_deg } => corners_deg,
            Self::Circle { .. }
            | Self::HalfPlane { .. }
            | Self::Ball { .. }
            | Self::HalfSpace { .. } => &[],
        }
    }

    /// Why this shape cannot be used; `None`: it can.
    pub fn problem(&self) -> Option<&'static str> {
        let is_in_range = |values: &[f64]| values.iter().all(|value| value.abs() <= MAX_COORDINATE);
        let is_size = |radius: f64| radius > 0.0 && radius <= MAX_COORDINATE;
        let is_direction = |normal: &[f64]| {
            let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
            (1e-6..=1e6).contains(&length)
        };
        let no_direction = "needs a normal that is not zero";
        let is_valid = match self {
            Self::Circle { centre_deg, radius_deg } => {
                is_in_range(centre_deg) && is_size(*radius_deg)
            }
            Self::Ball { centre_mm, radius_mm } => is_in_range(centre_mm) && is_size(*radius_mm),
            Self::HalfPlane { normal, .. } if !is_direction(normal) => return Some(no_direction),
            Self::HalfSpace { normal, .. } if !is_direction(normal) => return Some(no_direction),
            Self::HalfPlane { offset_deg: offset, .. }
            | Self::HalfSpace { offset_mm: offset, .. } => is_in_range(&[*offset]),
            Self::Polygon { corners_deg } if !(3..=MAX_CORNERS).contains(&corners_deg.len()) => {
                return Some("must have 3 to 8 corners");
            }
            Self::Polygon { corners_deg } if !is_convex(corners_deg) => {
                return Some("must be convex, with its corners listed around it");
            }
            Self::Polygon { corners_deg } => corners_deg.iter().all(|corner| is_in_range(corner)),
        };
        (!is_valid).then_some("must have a size above 0 and coordinates of -360 to 360")
    }
}

/// Every corner turns to the same side, and all of them together turn once.
fn is_convex(corners: &[[f64; 2]]) -> bool {
    let count = corners.len();
    let edge = |from: usize| {
        let (a, b) = (corners[from % count], corners[(from + 1) % count]);
        [b[0] - a[0], b[1] - a[1]]
    };
    let mut turned = 0.0;
    let mut is_left = None;
    for index in 0..count {
        let (a, b) = (edge(index), edge(index + 1));
        let (cross, dot) = (a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1]);
        let is_turn = cross.abs() > 1e-9;
        if !is_turn || is_left.is_some_and(|left| left != (cross > 0.0)) {
            return false;
        }
        is_left = Some(cross > 0.0);
        turned += cross.atan2(dot).abs();
    }
    turned < 1.5 * std::f64::consts::TAU
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polygon(corners_deg: &[[f64; 2]]) -> FixtureShape {
        FixtureShape::Polygon { corners_deg: corners_deg.to_vec() }
    }

    #[test]
    fn convex_polygons_are_accepted_in_either_sense_only() {
        let square = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        assert_eq!(polygon(&square).problem(), None);
        let mut reversed = square;
        reversed.reverse();
        assert_eq!(polygon(&reversed).problem(), None);
        let crossed = [[0.0, 0.0], [4.0, 4.0], [4.0, 0.0], [0.0, 4.0]];
        let dented = [[0.0, 0.0], [4.0, 0.0], [1.0, 1.0], [0.0, 4.0]];
        let star = [[0.0, 3.0], [2.0, -3.0], [-3.0, 1.0], [3.0, 1.0], [-2.0, -3.0]];
        for corners in [&crossed[..], &dented, &star] {
            assert!(polygon(corners).problem().is_some(), "{corners:?}");
        }
        assert!(polygon(&square[..2]).problem().is_some());
    }

    #[test]
    fn sizes_and_numbers_that_mean_nothing_are_refused() {
        let circle = |radius_deg| FixtureShape::Circle { centre_deg: [1.0, 2.0], radius_deg };
        assert_eq!(circle(3.0).problem(), None);
        for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(circle(radius).problem().is_some(), "{radius}");
        }
        let wall = |normal| FixtureShape::HalfPlane { normal, offset_deg: 10.0 };
        assert_eq!(wall([0.0, 2.0]).problem(), None);
        assert!(wall([0.0, 0.0]).problem().is_some());
        assert!(wall([f64::NAN, 1.0]).problem().is_some());
    }
}
