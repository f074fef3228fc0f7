//! The virtual fixtures as clients see them: names and values in addition to the regions of the
//! loop.
//!
//! The loop keeps regions without names. All requests pass through the IPC thread in order, so this
//! table assigns them the same indices as the loop.

use std::collections::VecDeque;

use crate::config::{FixtureRegionConfig, FixtureShape};
use crate::core::{CycleReport, FixtureChange, SimpleRegion};
use crate::ipc::payload::{FIXTURES, VirtualFixtureRequest, VirtualFixturesMsg, padded_text};
use crate::robot::{FixtureAction, FixtureKind, Refusal};

#[derive(Debug)]
pub(super) struct FixtureTable {
    pub message: VirtualFixturesMsg,
    configured: usize,
    pending: VecDeque<(u64, VirtualFixtureRequest)>,
    added: u32,
}

impl FixtureTable {
    pub(super) fn new(regions: &[FixtureRegionConfig]) -> Self {
        let mut message = VirtualFixturesMsg::default();
        for (index, region) in regions.iter().enumerate().take(FIXTURES) {
            let (kind, values) = described(&region.shape);
            message.kind[index] = kind.number();
            message.values[index] = values;
            message.name[index] = padded_text(&region.name);
        }
        Self {
            message,
            configured: regions.len().min(FIXTURES),
            pending: VecDeque::new(),
            added: 0,
        }
    }

    /// The change that a request asks for. Refuses an action or a region that does not exist.
    pub(super) fn parse(request: &VirtualFixtureRequest) -> Result<FixtureChange, Refusal> {
        let action = FixtureAction::from_number(request.action).ok_or(Refusal::Malformed)?;
        let is_empty = request.kind == 0 && request.values == [0.0; 4];
        match action {
            FixtureAction::Add => shape(request)
                .and_then(|shape| SimpleRegion::new(&shape))
                .map(FixtureChange::Add)
                .ok_or(Refusal::Malformed),
            _ if !is_empty => Err(Refusal::Malformed),
            FixtureAction::On => Ok(FixtureChange::SwitchOn),
            FixtureAction::Off => Ok(FixtureChange::SwitchOff),
            FixtureAction::Remove => Ok(FixtureChange::RemoveAdded),
        }
    }

    pub(super) fn sent(&mut self, token: u64, request: VirtualFixtureRequest) {
        self.pending.push_back((token, request));
    }

    /// Records the reply of the loop. Returns whether the table changed.
    pub(super) fn answered(&mut self, token: u64, refusal: Refusal) -> bool {
        let place = self.pending.iter().position(|(sent, _)| *sent == token);
        let Some((_, request)) = place.and_then(|place| self.pending.remove(place)) else {
            return false;
        };
        if refusal != Refusal::None {
            return false;
        }
        match FixtureAction::from_number(request.action) {
            Some(FixtureAction::Add) => self.add(&request),
            Some(FixtureAction::Remove) => {
                for index in self.configured..FIXTURES {
                    self.message.kind[index] = FixtureKind::None.number();
                    self.message.values[index] = Default::default();
                    self.message.name[index] = Default::default();
                }
            }
            Some(FixtureAction::On | FixtureAction::Off) | None => {}
        }
        true
    }

    pub(super) fn update(&mut self, report: &CycleReport) {
        self.message.active = report.fixtures;
        if let Some(index) = report.limited_by_fixture {
            self.message.limited_by = u32::from(index) + 1;
        }
    }

    fn add(&mut self, request: &VirtualFixtureRequest) {
        if let Some(index) = (0..FIXTURES).find(|index| self.message.kind[*index] == 0) {
            self.added += 1;
            self.message.kind[index] = request.kind;
            self.message.values[index] = Default::default();
            self.message.values[index][..4].copy_from_slice(&request.values);
            self.message.name[index] = padded_text(&format!("request {}", self.added));
        }
    }
}

/// Shape of a request, in degrees and mm as in the configuration; `None` if it is invalid.
fn shape(request: &VirtualFixtureRequest) -> Option<FixtureShape> {
    let [a, b, c, d] = request.values;
    let (deg, mm) = (f64::to_degrees, |metres: f64| metres * 1e3);
    let shape = match FixtureKind::from_number(request.kind)? {
        FixtureKind::Circle => {
            FixtureShape::Circle { centre_deg: [deg(a), deg(b)], radius_deg: deg(c) }
        }
        FixtureKind::HalfPlane => FixtureShape::HalfPlane { normal: [a, b], offset_deg: deg(c) },
        FixtureKind::Ball => {
            FixtureShape::Ball { centre_mm: [mm(a), mm(b), mm(c)], radius_mm: mm(d) }
        }
        FixtureKind::HalfSpace => FixtureShape::HalfSpace { normal: [a, b, c], offset_mm: mm(d) },
        FixtureKind::None | FixtureKind::Polygon => return None,
    };
    shape.problem().is_none().then_some(shape)
}

fn described(shape: &FixtureShape) -> (FixtureKind, [f64; 17]) {
    let rad = |deg: &f64| deg.to_radians();
    let (kind, list) = match shape {
        FixtureShape::Circle { centre_deg: [pitch, yaw], radius_deg } => {
            (FixtureKind::Circle, vec![rad(pitch), rad(yaw), rad(radius_deg)])
        }
        FixtureShape::HalfPlane { normal: [pitch, yaw], offset_deg } => {
            (FixtureKind::HalfPlane, vec![*pitch, *yaw, rad(offset_deg)])
        }
        FixtureShape::Ball { centre_mm: [x, y, z], radius_mm } => {
            (FixtureKind::Ball, [x, y, z, radius_mm].map(|mm| mm * 1e-3).to_vec())
        }
        FixtureShape::HalfSpace { normal: [x, y, z], offset_mm } => {
            (FixtureKind::HalfSpace, vec![*x, *y, *z, offset_mm * 1e-3])
        }
        FixtureShape::Polygon { corners_deg } => {
            let corners = corners_deg.iter().flatten().map(rad);
            let count = corners_deg.len() as f64;
            (FixtureKind::Polygon, [count].into_iter().chain(corners).collect())
        }
    };
    let mut values = [0.0; 17];
    for (to, from) in values.iter_mut().zip(list) {
        *to = from;
    }
    (kind, values)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request(action: u32, kind: u32, values: [f64; 4]) -> VirtualFixtureRequest {
        VirtualFixtureRequest { client_id: 7, action, kind, values, ..Default::default() }
    }

    #[test]
    fn unknown_fixture_request_is_malformed() {
        let circle = [0.1, 0.2, 0.05, 0.0];
        assert!(FixtureTable::parse(&request(3, 1, circle)).is_ok());
        for (action, kind, values) in [
            (0, 0, [0.0; 4]),
            (5, 0, [0.0; 4]),
            (1, 1, [0.0; 4]),
            (2, 0, circle),
            (3, 0, circle),
            (3, 5, circle),
            (3, 9, circle),
            (3, 1, [0.1, 0.2, 0.0, 0.0]),
            (3, 1, [f64::NAN, 0.2, 0.1, 0.0]),
            (3, 2, [0.0, 0.0, 0.1, 0.0]),
        ] {
            let parsed = FixtureTable::parse(&request(action, kind, values));
            assert_eq!(parsed, Err(Refusal::Malformed), "{action} {kind} {values:?}");
        }
    }

    #[test]
    fn table_follows_the_replies_of_the_loop() {
        let mut table = FixtureTable::new(&[FixtureRegionConfig {
            name: "lens".to_owned(),
            shape: FixtureShape::Circle { centre_deg: [10.0, 5.0], radius_deg: 3.0 },
        }]);
        let wall = request(3, 2, [1.0, 0.0, 0.3, 0.0]);
        table.sent(1, wall);
        table.sent(2, wall);
        assert!(!table.answered(1, Refusal::Range));
        assert_eq!(table.message.kind[..3], [1, 0, 0]);
        assert!(table.answered(2, Refusal::None));
        assert_eq!(table.message.kind[..3], [1, 2, 0]);
        assert_eq!(table.message.values[1][2], 0.3);
        table.sent(3, request(4, 0, [0.0; 4]));
        assert!(table.answered(3, Refusal::None));
        assert_eq!(table.message.kind[..3], [1, 0, 0]);
    }
}
