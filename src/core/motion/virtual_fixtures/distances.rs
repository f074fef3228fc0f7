//! Distances of one pose to all regions. The position of the tip, which takes longest, is computed
//! once for all of them.

use crate::config::MAX_REGIONS;
use crate::model::file::OutputUnit;
use crate::model::kinematic;
use crate::units::OutputVec;

use super::region::{Point, Region, dot};
use crate::core::drift::correction::CalibratedView;
use crate::core::fixture_change::FixtureSpace;

/// Poses that a region is kept away from: adapted and calibrated.
pub(crate) const POSES: usize = 2;

/// The distance of a pose to a region, with the slope in output space. NaN for a region in angles
/// with outputs that are not angles.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct PoseDistance {
    pub region: u8,
    pub distance: f64,
    pub slope: OutputVec,
}

/// The distances of a pose, and of the same as calibrated, to all regions.
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
