//! Changes of the virtual fixtures by request: regions without corners, on and off.

use serde::{Deserialize, Serialize};

use crate::config::FixtureShape;

/// A change of the fixtures by request.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum FixtureChange {
    /// All regions count.
    SwitchOn,
    /// No region counts.
    SwitchOff,
    /// One more region, and all regions count.
    Add(SimpleRegion),
    /// Removes the regions that requests have added.
    RemoveAdded,
}

/// The coordinates of a region.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum FixtureSpace {
    /// Pitch and yaw, rad.
    Angles,
    /// Position of the tip, m.
    Tip,
}

/// A region without corners, as requests add it. Without margin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SimpleRegion {
    /// The coordinates.
    pub space: FixtureSpace,
    /// The set.
    pub shape: SimpleShape,
}

/// The set of a [`SimpleRegion`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum SimpleShape {
    /// A circle or a ball.
    Ball { centre: [f64; 3], radius: f64 },
    /// Everything beyond a line or a plane.
    HalfSpace {
        /// Direction into the forbidden side, of length 1.
        normal: [f64; 3],
        /// Distance of the border from the origin along the normal.
        offset: f64,
    },
}

impl SimpleRegion {
    /// A shape without corners in rad and m; `None` for a polygon.
    pub fn new(shape: &FixtureShape) -> Option<Self> {
        let plane = |[pitch, yaw]: [f64; 2]| [pitch, yaw, 0.0];
        let unit = |normal: [f64; 3]| {
            let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
            normal.map(|n| n / length)
        };
        let metres = |mm: f64| mm * 1e-3;
        let (space, shape) = match *shape {
            FixtureShape::Circle { centre_deg, radius_deg } => (
                FixtureSpace::Angles,
                SimpleShape::Ball {
                    centre: plane(centre_deg.map(f64::to_radians)),
                    radius: radius_deg.to_radians(),
                },
            ),
            FixtureShape::HalfPlane { normal, offset_deg } => (
                FixtureSpace::Angles,
                SimpleShape::HalfSpace {
                    normal: unit(plane(normal)),
                    offset: offset_deg.to_radians(),
                },
            ),
            FixtureShape::Ball { centre_mm, radius_mm } => (
                FixtureSpace::Tip,
                SimpleShape::Ball { centre: centre_mm.map(metres), radius: metres(radius_mm) },
            ),
            FixtureShape::HalfSpace { normal, offset_mm } => (
                FixtureSpace::Tip,
                SimpleShape::HalfSpace { normal: unit(normal), offset: metres(offset_mm) },
            ),
            FixtureShape::Polygon { .. } => return None,
        };
        Some(Self { space, shape })
    }
}
