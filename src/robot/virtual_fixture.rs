//! Requests about virtual fixtures: regions that the snake may not enter.

use super::numbered_enum::numbered_enum;

numbered_enum! {
    /// A request about virtual fixtures.
    FixtureAction {
        /// All regions count.
        On = 1, "on";
        /// No region counts. Needs the lease, and a robot that follows no goal.
        Off = 2, "off";
        /// One more region; all regions count.
        Add = 3, "add";
        /// Removes the regions that requests have added. As `off`.
        Remove = 4, "remove";
    }
}

numbered_enum! {
    /// The shape of a region, with the meaning of its values. Angles are pitch and yaw, rad;
    /// positions are those of the tip, m.
    FixtureKind {
        /// No region.
        None = 0, "none";
        /// Centre (2) and radius, angles.
        Circle = 1, "circle";
        /// Direction into the forbidden side (2) and distance of the line from the origin, angles.
        HalfPlane = 2, "half-plane";
        /// Centre (3) and radius, of the tip.
        Ball = 3, "ball";
        /// Direction into the forbidden side (3) and distance of the plane from the base, of the
        /// tip.
        HalfSpace = 4, "half-space";
        /// Number of corners, and pitch and yaw of up to eight, angles. Only in the configuration.
        Polygon = 5, "polygon";
    }
}
