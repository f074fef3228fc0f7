//! Polls the models of the controller in a background thread, and draws the model in use: its hull
//! and the directions of the motors in the plane of pitch and yaw.

use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use i2ris::ipc::Domain;
use i2ris::ipc::client::{Client, ClientError};
use i2ris::ipc::payload::{ModelSlot, unpadded_text};
use i2ris::model::file::OutputUnit;
use i2ris::model::{Model, ModelId};
use i2ris::units::{MAX_MOTORS, Nanos};

use crate::statistics::interpolate;
use crate::view::{LoadedModel, Models, short_id};

/// How long to wait for a controller that is just starting.
const CONNECT: Nanos = Nanos::from_millis(200);
/// Polling period: other programs stage models without notice.
const PERIOD: Duration = Duration::from_secs(3);
/// Points on every side of the hull: its sides are straight in counts, not in angles.
const POINTS_PER_SIDE: usize = 12;

/// The models that were last read, and the hull of the one in use.
#[derive(Debug, Clone, Default)]
pub struct Known {
    pub models: Models,
    pub outline: Arc<Outline>,
}

fn loaded(slot: &ModelSlot) -> Option<LoadedModel> {
    let id = ModelId(slot.model_id);
    (slot.flags & ModelSlot::PRESENT != 0).then(|| LoadedModel {
        id,
        name: format!("{} {}", unpadded_text(&slot.family), short_id(id)),
        file: unpadded_text(&slot.file),
        memory_known: slot.flags & ModelSlot::MEMORY_KNOWN != 0,
    })
}

/// Polls the models every few seconds, and on request. It cannot change anything.
#[derive(Debug)]
pub struct ModelPoller {
    known: Arc<Mutex<Known>>,
    requests: SyncSender<()>,
}

impl ModelPoller {
    pub fn start(domain: &Domain) -> Self {
        let known = Arc::new(Mutex::new(Known::default()));
        let (requests, receiver) = sync_channel(1);
        thread::spawn({
            let (domain, known) = (domain.clone(), Arc::clone(&known));
            move || poll_until_disconnected(&domain, &receiver, &known)
        });
        Self { known, requests }
    }

    /// Polls now. A second request while one is pending has no effect.
    pub fn poll_now(&self) {
        let _ = self.requests.try_send(());
    }

    pub fn known(&self) -> Known {
        self.known.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// Runs until the poller is dropped.
fn poll_until_disconnected(domain: &Domain, requests: &Receiver<()>, known: &Mutex<Known>) {
    let mut drawn: Option<ModelId> = None;
    while requests.recv_timeout(PERIOD) != Err(RecvTimeoutError::Disconnected) {
        let answer = ask(domain);
        let mut new = known.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let hull_problem = new.models.hull_problem.take();
        new.models = answer.unwrap_or_else(|error| {
            let problem = Some(format!("cannot read the models: {error}"));
            Models { problem, ..Models::default() }
        });
        new.models.hull_problem = hull_problem;
        let used = new.models.used.as_ref();
        if used.map(|used| used.id) != drawn {
            drawn = used.map(|used| used.id);
            let outline = used.map(|used| outline_of(Path::new(&used.file), used.id)).transpose();
            new.models.hull_problem = outline.as_ref().err().map(ToString::to_string);
            new.outline = Arc::new(outline.ok().flatten().unwrap_or_default());
        }
        *known.lock().unwrap_or_else(PoisonError::into_inner) = new;
    }
}

fn ask(domain: &Domain) -> Result<Models, ClientError> {
    let slots = Client::connect(domain, CONNECT)?.models()?.slots;
    let [used, staged, previous] = slots.each_ref().map(loaded);
    Ok(Models { known: true, used, staged, previous, ..Models::default() })
}

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

#[derive(Debug, thiserror::Error)]
pub enum OutlineError {
    #[error("no hull: {0}")]
    Model(#[from] i2ris::model::ModelError),
    #[error(
        "no hull: {file} is model {found}, but the controller uses {used}; load it again: \
         `i2ris model use`"
    )]
    Other { file: String, found: String, used: String },
    #[error("no hull: the model does not predict pitch and yaw")]
    NoAngles,
}

/// Fails if the file cannot be read, contains a model other than `used`, or one without angles.
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
            let mean = model.predict(&interpolate(from, to, share), &memory).mean;
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
    use crate::statistics::distance;

    /// Pitch is 0.01 deg per count of motor 0, yaw 0.02 deg per count of motor 1.
    const GAIN: [[f64; 2]; 2] = [[0.01, 0.0], [0.0, 0.02]];

    fn linear(unit: OutputUnit, gain: [[f64; 2]; 2]) -> Model {
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
        let points = edge(&linear(OutputUnit::Deg, GAIN)).unwrap();
        let last = 4 * POINTS_PER_SIDE;
        assert_eq!((points.len(), points[0]), (last + 1, points[last]));
        for wanted in [[-5.0, -5.0], [5.0, -5.0], [5.0, 7.0], [-5.0, 7.0]] {
            assert!(points.iter().any(|point| distance(point, &wanted) < 1e-9), "{points:?}");
        }
    }

    #[test]
    fn the_own_bend_ignores_the_other_motor() {
        let gain = [[0.02, 0.015], [-0.01, 0.02]];
        let along = own_directions(&linear(OutputUnit::Deg, gain)).unwrap();
        let outline = Outline { along, ..Outline::default() };
        let angles = |q: [f64; 2]| gain.map(|row| row[0] * q[0] + row[1] * q[1]);
        let own = |[pitch, yaw]: [f64; 2]| along[0][0] * pitch + along[0][1] * yaw;
        let bend = own(angles([300.0, 50.0]));
        assert!((bend - own(angles([300.0, -200.0]))).abs() < 1e-9);
        assert!((bend - 300.0 * 0.02_f64.hypot(0.01)).abs() < 1e-9, "in degrees: {bend}");
        assert_eq!((outline.name(0), Outline::default().name(1)), ("own bend", "yaw"));
        assert!(own_directions(&linear(OutputUnit::Deg, [[0.01, 0.01], [0.01, 0.0101]])).is_none());
    }

    #[test]
    fn outline_needs_angles_and_the_model_in_use() {
        assert!(matches!(edge(&linear(OutputUnit::Mm, GAIN)), Err(OutlineError::NoAngles)));
        let folder = tempfile::tempdir().unwrap();
        let (file, model) = (folder.path().join("model.json"), linear(OutputUnit::Deg, GAIN));
        std::fs::write(&file, serde_json::to_string(model.file()).unwrap()).unwrap();
        assert!(outline_of(&file, model.id()).is_ok());
        let error = outline_of(&file, ModelId([7; 32])).unwrap_err().to_string();
        let is_told = error.contains("the controller uses 07070707") && error.contains("model use");
        assert!(is_told, "{error}");
        assert!(outline_of(&folder.path().join("none.json"), model.id()).is_err());
    }
}
