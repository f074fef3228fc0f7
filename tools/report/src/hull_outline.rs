//! The calibrated hull and the directions of the motors in the plane of pitch and yaw.

use std::path::Path;

use crate::view::short_id;
use i2ris::model::file::OutputUnit;
use i2ris::model::{Model, ModelId};
use i2ris::units::MAX_MOTORS;

/// Points on every side of the hull: its sides are straight in counts, not in angles.
const POINTS_PER_SIDE: usize = 12;

/// The hull of a model in the plane of pitch and yaw.
#[derive(Debug, Clone, PartialEq)]
pub struct Outline {
    /// The edge of the hull: pitch and yaw, degrees, closed. Empty: unknown.
    pub points: Vec<[f64; 2]>,
    /// For each motor the weights of pitch and yaw in the bend that is its own: one that the other
    /// motor does not change, as far as the snake is linear. With motors at 45 deg to the axes
    /// neither pitch nor yaw shows a clean loop.
    pub along: [[f64; 2]; MAX_MOTORS],
}

impl Default for Outline {
    /// Motor 0 bends in pitch, motor 1 in yaw: what is shown without a model.
    fn default() -> Self {
        Self { points: Vec::new(), along: [[1.0, 0.0], [0.0, 1.0]] }
    }
}

impl Outline {
    /// The page's name for the bend of a motor.
    pub fn name(&self, motor: usize) -> &'static str {
        match (*self == Self { points: self.points.clone(), ..Self::default() }, motor) {
            (true, 0) => "pitch",
            (true, _) => "yaw",
            (false, _) => "own bend",
        }
    }
}

/// Why there is no outline.
#[derive(Debug, thiserror::Error)]
pub enum OutlineError {
    #[error("no hull: {0}; or name the file with --model")]
    Model(#[from] i2ris::model::ModelError),
    #[error(
        "no hull: {file} is model {found}, but the controller uses {used}; name the right file \
         with --model"
    )]
    Other { file: String, found: String, used: String },
    #[error("no hull: the model does not predict pitch and yaw")]
    NoAngles,
}

/// The outline of the model in `file`, if it is the model `used`. Fails if the file cannot be read,
/// contains another model, or a model without angles.
pub fn outline_of(file: &Path, used: ModelId) -> Result<Outline, OutlineError> {
    let model = Model::load(file)?;
    if model.id() != used {
        let (found, used) = (short_id(model.id()), short_id(used));
        return Err(OutlineError::Other { file: file.display().to_string(), found, used });
    }
    Ok(Outline {
        points: edge(&model)?,
        along: own_directions(&model).unwrap_or(Outline::default().along),
    })
}

/// The rows of the inverse Jacobian in the middle of the hull, scaled so that they give degrees.
fn own_directions(model: &Model) -> Option<[[f64; 2]; MAX_MOTORS]> {
    let mut memory = model.new_memory();
    let centre = model.hull().centre();
    model.advance(&mut memory, &centre);
    let [[a, b], [c, d], _] = model.jacobian(&centre, &memory);
    let determinant = a * d - b * c;
    let lengths = [a.hypot(c), b.hypot(d)];
    // Motors that bend the snake in nearly the same direction have no own direction.
    if determinant.abs() < 0.1 * lengths[0] * lengths[1] || !determinant.is_normal() {
        return None;
    }
    let scale = lengths.map(|length| length / determinant);
    Some([[d * scale[0], -b * scale[0]], [-c * scale[1], a * scale[1]]])
}

/// The angles after a motion of the motors from the middle of the hull to its edge. On the return
/// they differ by the width of the hysteresis loop.
fn edge(model: &Model) -> Result<Vec<[f64; 2]>, OutlineError> {
    let angles =
        model.file().outputs.iter().filter(|output| output.unit == OutputUnit::Deg).count();
    if (model.outputs(), angles, model.motors()) != (2, 2, 2) {
        return Err(OutlineError::NoAngles);
    }
    let mut memory = model.new_memory();
    model.advance(&mut memory, &model.hull().centre());
    let corners: Vec<_> = model.hull().corners().collect();
    let next = corners.iter().cycle().skip(1);
    let mut points = Vec::with_capacity(corners.len() * POINTS_PER_SIDE + 1);
    for (from, to) in corners.iter().zip(next) {
        for step in 0..POINTS_PER_SIDE {
            let share = step as f64 / POINTS_PER_SIDE as f64;
            let counts = [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])];
            let mean = model.predict(&counts, &memory).mean;
            points.push([mean[0].to_degrees(), mean[1].to_degrees()]);
        }
    }
    points.extend(points.first().copied());
    Ok(points)
}

#[cfg(test)]
mod tests {
    use i2ris::model::file::{FamilyParameters, HullParameters, ModelFile};

    use super::*;

    /// Pitch is 0.01 deg per count of motor 0, yaw 0.02 deg per count of motor 1.
    fn linear(unit: OutputUnit) -> Model {
        with_gain(unit, [[0.01, 0.0], [0.0, 0.02]])
    }

    fn with_gain(unit: OutputUnit, gain: [[f64; 2]; 2]) -> Model {
        let family = FamilyParameters::Linear {
            gain: gain.map(|row| row.to_vec()).to_vec(),
            offset: vec![0.0, 1.0],
            covariance: vec![vec![0.01, 0.0], vec![0.0, 0.01]],
        };
        let corners = [[-500.0, -300.0], [500.0, -300.0], [500.0, 300.0], [-500.0, 300.0]];
        let hull = HullParameters { corners: corners.map(Vec::from).to_vec() };
        let file = i2ris_testing::cycle::model(unit).file().clone();
        Model::from_file(ModelFile { family, hull, ..file }).unwrap()
    }

    #[test]
    fn corners_become_angles_and_the_outline_is_closed() {
        let points = edge(&linear(OutputUnit::Deg)).unwrap();
        assert_eq!(
            (points.len(), points[0]),
            (4 * POINTS_PER_SIDE + 1, points[4 * POINTS_PER_SIDE])
        );
        let near = |wanted: [f64; 2]| {
            points.iter().any(|p| (p[0] - wanted[0]).hypot(p[1] - wanted[1]) < 1e-9)
        };
        assert!(
            [[-5.0, -5.0], [5.0, -5.0], [5.0, 7.0], [-5.0, 7.0]].into_iter().all(near),
            "{points:?}"
        );
    }

    #[test]
    fn the_own_bend_ignores_the_other_motor() {
        let gain = [[0.02, 0.015], [-0.01, 0.02]];
        let along = own_directions(&with_gain(OutputUnit::Deg, gain)).unwrap();
        let outline = Outline { along, ..Outline::default() };
        let angles = |q: [f64; 2]| gain.map(|row| row[0] * q[0] + row[1] * q[1]);
        let own = |[pitch, yaw]: [f64; 2]| along[0][0] * pitch + along[0][1] * yaw;
        let bend = own(angles([300.0, 50.0]));
        assert!((bend - own(angles([300.0, -200.0]))).abs() < 1e-9);
        assert!((bend - 300.0 * 0.02_f64.hypot(0.01)).abs() < 1e-9, "in degrees: {bend}");
        assert_eq!((outline.name(0), Outline::default().name(1)), ("own bend", "yaw"));
        assert!(
            own_directions(&with_gain(OutputUnit::Deg, [[0.01, 0.01], [0.01, 0.0101]])).is_none()
        );
    }

    #[test]
    fn outline_needs_angles_and_the_model_in_use() {
        assert!(matches!(edge(&linear(OutputUnit::Mm)), Err(OutlineError::NoAngles)));
        let folder = tempfile::tempdir().unwrap();
        let (file, model) = (folder.path().join("model.json"), linear(OutputUnit::Deg));
        std::fs::write(&file, serde_json::to_string(model.file()).unwrap()).unwrap();
        assert!(outline_of(&file, model.id()).is_ok());
        let error = outline_of(&file, ModelId([7; 32])).unwrap_err().to_string();
        assert!(
            error.contains("the controller uses 07070707") && error.contains("--model"),
            "{error}"
        );
        assert!(outline_of(&folder.path().join("none.json"), model.id()).is_err());
    }
}
