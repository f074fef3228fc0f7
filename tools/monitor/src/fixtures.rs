//! The virtual fixtures in words and as outlines in the plane of pitch and yaw. Pure.

use std::f64::consts::TAU;

use i2ris::ipc::FixtureKind;
use i2ris::ipc::payload::{FIXTURES, VirtualFixturesMsg, unpadded_text};
use serde_json::{Value, json};

/// Points of a circle.
const CIRCLE_POINTS: u32 = 48;
/// How far the outline of a half-plane reaches, deg: beyond every picture.
const FAR_DEG: f64 = 180.0;

/// A region of a message.
struct Region {
    name: String,
    kind: FixtureKind,
    values: [f64; 17],
    is_active: bool,
}

/// One line, if there are regions.
pub fn line(message: &VirtualFixturesMsg) -> Option<String> {
    let words: Vec<String> = regions(message)
        .map(|region| {
            let state = if region.is_active { "" } else { " OFF" };
            format!("{} ({}){state}", region.name, region.kind)
        })
        .collect();
    (!words.is_empty()).then(|| words.join(", "))
}

/// For the page: name, whether it counts, and the outline in degrees; `null` for the tip.
pub fn as_json(message: &VirtualFixturesMsg) -> Value {
    let region = |region: Region| {
        let outline = outline(&region);
        json!({ "name": region.name, "active": region.is_active, "outline": outline })
    };
    regions(message).map(region).collect()
}

fn regions(message: &VirtualFixturesMsg) -> impl Iterator<Item = Region> + '_ {
    (0..FIXTURES).filter_map(|index| {
        let kind = FixtureKind::from_number(*message.kind.get(index)?)?;
        (kind != FixtureKind::None).then_some(())?;
        Some(Region {
            name: unpadded_text(message.name.get(index)?),
            kind,
            values: *message.values.get(index)?,
            is_active: message.active & (1 << index) != 0,
        })
    })
}

/// Pitch and yaw, deg.
fn outline(region: &Region) -> Option<Vec<[f64; 2]>> {
    let values = &region.values;
    let short = |value: f64| (1e3 * value).round() / 1e3;
    let deg = |index: usize| values[index].to_degrees();
    let points: Vec<[f64; 2]> = match region.kind {
        FixtureKind::Circle => (0..CIRCLE_POINTS)
            .map(|k| TAU * f64::from(k) / f64::from(CIRCLE_POINTS))
            .map(|at| [deg(0) + deg(2) * at.cos(), deg(1) + deg(2) * at.sin()])
            .collect(),
        FixtureKind::HalfPlane => {
            let length = values[0].hypot(values[1]);
            let normal = [values[0] / length, values[1] / length];
            let at = |along: f64, beyond: f64| {
                let offset = deg(2) + beyond;
                [offset * normal[0] - along * normal[1], offset * normal[1] + along * normal[0]]
            };
            vec![at(-FAR_DEG, 0.0), at(FAR_DEG, 0.0), at(FAR_DEG, FAR_DEG), at(-FAR_DEG, FAR_DEG)]
        }
        FixtureKind::Polygon => {
            (0..(values[0] as usize).min(8)).map(|k| [deg(1 + 2 * k), deg(2 + 2 * k)]).collect()
        }
        FixtureKind::Ball | FixtureKind::HalfSpace | FixtureKind::None => return None,
    };
    Some(points.into_iter().map(|point| point.map(short)).collect())
}

#[cfg(test)]
mod tests {
    use i2ris::ipc::payload::padded_text;

    use super::*;

    #[test]
    fn regions_have_a_name_and_an_outline_in_degrees() {
        let mut message = VirtualFixturesMsg::default();
        assert_eq!(line(&message), None);
        message.active = 0b01;
        message.kind[..2].copy_from_slice(&[FixtureKind::HalfPlane.number(), 3]);
        message.values[0][..3].copy_from_slice(&[0.0, 2.0, 10.0_f64.to_radians()]);
        message.name[0] = padded_text("lens");
        message.name[1] = padded_text("retina");
        let text = line(&message).unwrap();
        assert_eq!(text, "lens (half-plane), retina (ball) OFF");
        let json = as_json(&message);
        assert_eq!(json[0]["active"], true);
        let corners = json[0]["outline"].as_array().unwrap();
        assert!(corners.iter().all(|corner| corner[1].as_f64().unwrap() >= 10.0));
        assert!(json[1]["outline"].is_null());
    }
}
