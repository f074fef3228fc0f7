//! Description of the views: a small TOML file written by a person.
//!
//! Lengths are millimetres, so a change of the magnification changes one number.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::fibre::{Background, DetectorSettings, EntrySide};

/// The two joint axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum JointAxis {
    /// Pitch.
    Pitch,
    /// Yaw.
    Yaw,
}

/// The description of all views.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct VisionSetup {
    /// Images of both views belong together if their stamps differ by no more than this, ms.
    /// Below half the time between two images, so that each has one partner.
    #[serde(default = "default_pair_within_ms")]
    pub pair_within_ms: f64,
    /// One view or two.
    #[serde(rename = "view")]
    pub views: Vec<View>,
}

/// One view.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct View {
    /// Its name in messages, and in the file name of overlays.
    pub name: String,
    /// The joint axis that it shows.
    pub axis: JointAxis,
    /// Whether the positive direction of the axis bends clockwise in the image.
    #[serde(default)]
    pub reversed: bool,
    /// Angle from the joint axis to what the view shows, from pitch towards yaw, deg.
    #[serde(default)]
    pub turn_deg: f64,
    /// Scale at the base, px/mm.
    pub px_per_mm: f64,
    /// Distance from the base to the lens's entrance pupil, mm; omit it for a telecentric lens.
    /// With two views the angles are corrected for the perspective: up to 0.3 deg at 85 mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance_mm: Option<f64>,
    /// `bright`: dark fibre on bright ground; `dark`: bright fibre on dark ground.
    pub ground: Background,
    /// The side of the image where the base comes in.
    pub side: EntrySide,
    /// Position along that side from the left or upper corner, and maximum distance from it, px.
    /// Anywhere if omitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub near_px: Option<[f64; 2]>,
    /// Thickness of the base and of the bending section.
    pub body_width_mm: f64,
    /// Thickness of the fibre at the tip.
    pub fibre_width_mm: f64,
    /// Length of the straight base that the image shows.
    pub base_length_mm: f64,
    /// Length of the bending section.
    pub arc_length_mm: f64,
    /// Length of the straight stretch at the tip.
    pub tip_length_mm: f64,
}

#[derive(Debug, thiserror::Error)]
#[error("{path}: {reason}")]
pub struct VisionSetupError {
    path: PathBuf,
    reason: String,
}

impl VisionSetupError {
    fn new(path: &Path, reason: impl ToString) -> Self {
        Self { path: path.to_owned(), reason: reason.to_string() }
    }
}

fn default_pair_within_ms() -> f64 {
    12.0
}

impl VisionSetup {
    pub fn load(path: &Path) -> Result<Self, VisionSetupError> {
        let failed = |reason: &dyn ToString| VisionSetupError::new(path, reason.to_string());
        let text = std::fs::read_to_string(path).map_err(|error| failed(&error))?;
        let setup: Self = toml::from_str(&text).map_err(|error| failed(&error))?;
        let checked = setup.check();
        checked.map_err(|(place, reason)| failed(&format!("{place}: {reason}")))?;
        Ok(setup)
    }

    pub fn save(&self, path: &Path) -> Result<(), VisionSetupError> {
        let text = toml::to_string(self).map_err(|error| VisionSetupError::new(path, error))?;
        let text = format!("# Views of the camera process; `i2ris vision --help`.\n{text}");
        std::fs::write(path, text).map_err(|error| VisionSetupError::new(path, error))
    }

    fn check(&self) -> Result<(), (String, &'static str)> {
        if !(self.pair_within_ms > 0.0 && self.pair_within_ms <= 1000.0) {
            return Err(("pair_within_ms".into(), "must be above 0 and at most 1000"));
        }
        if !(1..=2).contains(&self.views.len()) {
            return Err(("view".into(), "there must be one or two"));
        }
        for view in &self.views {
            view.check()
                .map_err(|(field, reason)| (format!("view {}: {field}", view.name), reason))?;
        }
        match self.views.as_slice() {
            [view] if view.turn_deg.abs() > 0.5 => {
                let reason = "must be 0 with one view: only a second view shows the part of the \
                              other axis";
                Err((format!("view {}: turn_deg", view.name), reason))
            }
            [a, b] if a.name == b.name => {
                let reason = "must differ from the name of the other view";
                Err((format!("view {}: name", a.name), reason))
            }
            [a, b] if (a.plane_rad() - b.plane_rad()).sin().abs() < 0.25 => {
                let reason =
                    "both views show nearly the same axis; they must be 15 deg apart or more";
                Err((format!("views {} and {}", a.name, b.name), reason))
            }
            _ => Ok(()),
        }
    }
}

impl View {
    fn check(&self) -> Result<(), (&'static str, &'static str)> {
        let lengths = [
            ("px_per_mm", self.px_per_mm, 1.0, 10_000.0),
            ("body_width_mm", self.body_width_mm, 0.01, 50.0),
            ("fibre_width_mm", self.fibre_width_mm, 0.01, self.body_width_mm),
            ("base_length_mm", self.base_length_mm, 0.01, 500.0),
            ("arc_length_mm", self.arc_length_mm, 0.01, 500.0),
            ("tip_length_mm", self.tip_length_mm, 0.01, 500.0),
            ("distance_mm", self.distance_mm.unwrap_or(100.0), 1.0, 1e6),
        ];
        for (field, value, least, most) in lengths {
            // A comparison with NaN is false.
            if !(value >= least && value <= most) {
                return Err((field, "is out of range (a fibre is at most as thick as the body)"));
            }
        }
        if !self.turn_deg.is_finite() || self.turn_deg.abs() > 60.0 {
            let reason = "must be between -60 and 60; name the other axis or set reversed";
            return Err(("turn_deg", reason));
        }
        let name_is_plain =
            self.name.chars().all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_');
        if !name_is_plain || !(1..=16).contains(&self.name.len()) {
            return Err(("name", "must be 1 to 16 letters, digits, - or _"));
        }
        if self.near_px.is_some_and(|near| near.iter().any(|v| !v.is_finite())) {
            return Err(("near_px", "must be two numbers"));
        }
        Ok(())
    }

    /// Parameters of the detector.
    pub fn settings(&self) -> DetectorSettings {
        let k = self.px_per_mm;
        DetectorSettings {
            ground: self.ground,
            side: self.side,
            near: self.near_px,
            body_width: k * self.body_width_mm,
            fibre_width: k * self.fibre_width_mm,
            base_length: k * self.base_length_mm,
            arc_length: k * self.arc_length_mm,
            tip_length: k * self.tip_length_mm,
        }
    }

    /// The direction that bends counter-clockwise in the image, from pitch towards yaw, rad.
    pub fn plane_rad(&self) -> f64 {
        let axis = if self.axis == JointAxis::Pitch { 0.0 } else { 90.0 };
        let reversed = if self.reversed { 180.0 } else { 0.0 };
        f64::to_radians(axis + self.turn_deg + reversed)
    }

    /// Sets the nearest axis, and the rest as turn, from a direction as of [`View::plane_rad`].
    pub fn set_plane(&mut self, plane_rad: f64) {
        let deg = plane_rad.to_degrees().rem_euclid(360.0);
        let quarter = ((deg / 90.0).round() as u8) % 4;
        self.axis = if quarter.is_multiple_of(2) { JointAxis::Pitch } else { JointAxis::Yaw };
        self.reversed = quarter >= 2;
        let turn = deg - 90.0 * (deg / 90.0).round();
        // A thousandth of a degree is far below what can be measured.
        self.turn_deg = (turn * 1000.0).round() / 1000.0;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const TEXT: &str = "
        [[view]]
        name = 'top'
        axis = 'pitch'
        px_per_mm = 200.0
        ground = 'bright'
        side = 'left'
        body_width_mm = 0.9
        fibre_width_mm = 0.25
        base_length_mm = 1.7
        arc_length_mm = 2.4
        tip_length_mm = 1.4
    ";

    fn load(text: &str) -> Result<VisionSetup, VisionSetupError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("vision.toml");
        std::fs::write(&path, text).unwrap();
        VisionSetup::load(&path)
    }

    #[test]
    fn file_is_parsed_and_survives_saving() {
        let setup = load(TEXT).unwrap();
        assert_eq!(setup.views[0].settings().body_width, 180.0);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        setup.save(&path).unwrap();
        assert_eq!(VisionSetup::load(&path).unwrap(), setup);
    }

    #[test]
    fn invalid_setups_are_refused_with_place_and_reason() {
        let two = |a: &str, b: &str| format!("{a}{}", b.replace("'top'", "'side'"));
        for (text, word) in [
            (TEXT.replace("200.0", "nan"), "px_per_mm"),
            (TEXT.replace("0.25", "1.5"), "fibre_width_mm"),
            (TEXT.replace("'top'", "'a/b'"), "name"),
            (TEXT.replace("axis = 'pitch'", "axis = 'pitch'\nturn_deg = 3.0"), "turn_deg"),
            (TEXT.replace("axis = 'pitch'", "axis = 'roll'"), "roll"),
            (two(TEXT, TEXT), "same axis"),
            (format!("{TEXT}\nblur = 3"), "blur"),
            (format!("pair_within_ms = 0.0\n{TEXT}"), "pair_within_ms"),
            ("view = []".to_owned(), "one or two"),
        ] {
            let message = load(&text).unwrap_err().to_string();
            assert!(message.contains(word) && message.contains("vision.toml"), "{message}");
        }
    }

    /// The JSON Schema of the views in `config/schema` follows from the code.
    /// After a change of the views: run this test with `I2RIS_UPDATE_SCHEMA=1` and commit the file.
    #[test]
    fn the_schema_file_is_up_to_date() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/schema/vision.json");
        let schema = serde_json::Value::from(schemars::schema_for!(VisionSetup));
        let text = serde_json::to_string_pretty(&schema).unwrap() + "\n";
        if std::env::var_os("I2RIS_UPDATE_SCHEMA").is_some() {
            std::fs::write(&path, &text).unwrap();
        }
        assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
    }

    proptest! {
        #[test]
        fn axis_direction_and_turn_stand_for_any_plane(deg in -400.0..400.0_f64) {
            let mut view = load(TEXT).unwrap().views.remove(0);
            view.set_plane(deg.to_radians());
            prop_assert!((view.plane_rad() - deg.to_radians()).sin().abs() < 2e-5);
            prop_assert!((view.plane_rad() - deg.to_radians()).cos() > 0.0);
            prop_assert!(view.turn_deg.abs() <= 45.0);
        }
    }
}
