//! Models, and memories that advance tick by tick.

use std::path::PathBuf;
use std::sync::Arc;

use i2ris::model::{Memory, Query};
use i2ris::units::{MAX_MOTORS, MAX_OUTPUTS, MotorVec};
use numpy::ndarray::{Array2, ArrayView2};
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::refused;

/// A checked model, as the controller loads it.
#[pyclass(frozen, module = "i2ris_native")]
pub struct Model(pub Arc<i2ris::model::Model>);

impl Model {
    fn si(&self) -> f64 {
        self.0.file().outputs.first().map_or(1.0, |output| output.unit.si())
    }

    fn predicted(&self, memory: &Memory, counts: &MotorVec) -> Vec<f64> {
        let mean = self.0.predict(counts, memory).mean;
        mean.iter().take(self.0.outputs()).map(|angle| angle / self.si()).collect()
    }

    /// The counts for a goal in units of the file, from a memory.
    fn inverted(&self, memory: &Memory, start: MotorVec, goal: &[f64]) -> (MotorVec, bool) {
        let si = self.si();
        let angle = |output: usize| goal.get(output).map_or(0.0, |angle| angle * si);
        let goal = std::array::from_fn::<_, MAX_OUTPUTS, _>(angle);
        let inverse = self.0.invert(&goal, memory, &Query::new(start));
        (inverse.counts, inverse.clipped)
    }
}

/// Entries of a row, padded with 0.
fn motors(rows: &ArrayView2<'_, f64>, row: usize) -> MotorVec {
    std::array::from_fn::<_, MAX_MOTORS, _>(|motor| rows.get((row, motor)).copied().unwrap_or(0.0))
}

#[pymethods]
impl Model {
    /// Reads and examines a model file.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let loaded = py.detach(|| i2ris::model::Model::load(&path));
        Ok(Self(Arc::new(loaded.map_err(refused)?)))
    }

    /// Writes the model file: byte for byte that of the command line.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        self.0.file().write(&path).map_err(refused)
    }

    #[getter]
    fn id(&self) -> String {
        self.0.id().to_string()
    }

    #[getter]
    fn motors(&self) -> usize {
        self.0.motors()
    }

    #[getter]
    fn outputs(&self) -> Vec<String> {
        self.0.file().outputs.iter().map(|output| output.name.clone()).collect()
    }

    /// The whole file as JSON.
    fn json(&self) -> PyResult<String> {
        let text = self.0.file().canonical_form().map_err(refused)?;
        String::from_utf8(text).map_err(refused)
    }

    /// Share of the motion that the inverse misses, and travel over that of the path.
    fn examine(&self, py: Python<'_>) -> (f64, f64) {
        let found = py.detach(|| self.0.examine());
        (found.error, found.travel)
    }

    /// Angles along a path of the motors, and their standard deviations, deg. `times_s`: time from
    /// the previous row to each row.
    #[pyo3(signature = (counts, times_s=None))]
    fn predict<'py>(
        &self,
        py: Python<'py>,
        counts: PyReadonlyArray2<'py, f64>,
        times_s: Option<Vec<f64>>,
    ) -> (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>) {
        let counts = counts.as_array().to_owned();
        let (angles, deviations) = py.detach(|| {
            let mut memory = self.0.new_memory();
            let shape = (counts.nrows(), self.0.outputs());
            let (mut angles, mut deviations) = (Array2::zeros(shape), Array2::zeros(shape));
            for row in 0..counts.nrows() {
                let at = motors(&counts.view(), row);
                let times_s = times_s.as_ref();
                let time_s = times_s.and_then(|times_s| times_s.get(row)).copied().unwrap_or(0.0);
                self.0.advance_over(&mut memory, &at, time_s);
                let found = self.0.predict(&at, &memory);
                for (output, deviation) in found.deviation().iter().enumerate().take(shape.1) {
                    angles[(row, output)] = found.mean[output] / self.si();
                    deviations[(row, output)] = deviation / self.si();
                }
            }
            (angles, deviations)
        });
        (angles.into_pyarray(py), deviations.into_pyarray(py))
    }

    /// Counts along a path of the angles, deg, after a path of the motors.
    fn invert<'py>(
        &self,
        py: Python<'py>,
        angles: PyReadonlyArray2<'py, f64>,
        history: PyReadonlyArray2<'py, f64>,
    ) -> Bound<'py, PyArray2<f64>> {
        let (angles, history) = (angles.as_array().to_owned(), history.as_array().to_owned());
        let counts = py.detach(|| {
            let mut tracker = Tracker::after(&self.0, &history.view());
            let mut counts = Array2::zeros((angles.nrows(), self.0.motors()));
            for (row, goal) in angles.outer_iter().enumerate() {
                let (found, _) = tracker.next(&goal.to_vec());
                for (motor, found) in found.iter().take(self.0.motors()).enumerate() {
                    counts[(row, motor)] = *found;
                }
            }
            counts
        });
        counts.into_pyarray(py)
    }

    /// A memory that advances tick by tick, after a path of the motors.
    fn tracker(&self, history: PyReadonlyArray2<'_, f64>) -> Tracker {
        Tracker::after(&self.0, &history.as_array())
    }

    fn __reduce__<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let bytes = slf.get().0.file().canonical_form().map_err(refused)?;
        let make = slf.get_type().getattr("_from_json")?;
        Ok((make, (PyBytes::new(slf.py(), &bytes),)))
    }

    #[staticmethod]
    fn _from_json(text: &[u8]) -> PyResult<Self> {
        let text = std::str::from_utf8(text).map_err(refused)?;
        let file = i2ris::model::file::ModelFile::parse(text).map_err(refused)?;
        Ok(Self(Arc::new(i2ris::model::Model::from_file(file).map_err(refused)?)))
    }
}

/// A model with its memory.
#[pyclass(module = "i2ris_native")]
pub struct Tracker {
    model: Model,
    memory: Memory,
    at: MotorVec,
}

impl Tracker {
    fn after(model: &Arc<i2ris::model::Model>, history: &ArrayView2<'_, f64>) -> Self {
        let mut memory = model.new_memory();
        let mut at = model.hull().centre();
        for row in 0..history.nrows() {
            at = motors(history, row);
            model.advance(&mut memory, &at);
        }
        Self { model: Model(Arc::clone(model)), memory, at }
    }

    /// Moves to the counts for a goal. Whole counts, like those of drives.
    fn next(&mut self, goal: &[f64]) -> (MotorVec, bool) {
        let (counts, clipped) = self.model.inverted(&self.memory, self.at, goal);
        self.at = counts.map(f64::round);
        self.model.0.advance(&mut self.memory, &self.at);
        (self.at, clipped)
    }
}

/// Refuses values that are not one finite number for each.
fn check(name: &str, values: &[f64], wanted: usize) -> PyResult<()> {
    match values.len() == wanted && values.iter().all(|value| value.is_finite()) {
        true => Ok(()),
        false => Err(refused(format!(
            "{name}: must be {wanted} finite number(s), one for each, and is {values:?}"
        ))),
    }
}

#[pymethods]
impl Tracker {
    /// Moves the motors to these counts, `time_s` after the previous call.
    #[pyo3(signature = (counts, time_s=0.0))]
    fn advance(&mut self, counts: Vec<f64>, time_s: f64) -> PyResult<()> {
        check("counts", &counts, self.model.0.motors())?;
        self.at = std::array::from_fn(|motor| counts.get(motor).copied().unwrap_or(0.0));
        self.model.0.advance_over(&mut self.memory, &self.at, time_s);
        Ok(())
    }

    /// Angles at the present position, deg.
    fn predict(&self) -> Vec<f64> {
        self.model.predicted(&self.memory, &self.at)
    }

    /// The counts for angles, deg, and whether they were clipped. Nothing moves.
    fn invert(&self, angles: Vec<f64>) -> PyResult<(Vec<f64>, bool)> {
        check("angles", &angles, self.model.0.outputs())?;
        let (counts, clipped) = self.model.inverted(&self.memory, self.at, &angles);
        Ok((counts[..self.model.0.motors()].to_vec(), clipped))
    }

    /// Whether enough motion has been seen.
    #[getter]
    fn known(&self) -> bool {
        self.model.0.is_memory_known(&self.memory)
    }
}

/// Counts at which a network steps along a path, and number of steps before each row.
#[pyfunction]
pub fn steps_by_travel<'py>(
    py: Python<'py>,
    counts: PyReadonlyArray2<'py, f64>,
    step_counts: f64,
) -> (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<i64>>) {
    let rows = counts.as_array();
    let width = rows.ncols();
    let mut steps: Vec<f64> = Vec::new();
    let mut before = Vec::new();
    let mut last: Option<MotorVec> = None;
    for row in 0..rows.nrows() {
        let to = motors(&rows, row);
        let mut at = last.unwrap_or_else(|| {
            steps.extend(&to[..width]);
            to
        });
        i2ris::model::network::steps_by_travel(&at.clone(), &to, step_counts, |position| {
            steps.extend(&position[..width]);
            at = *position;
        });
        last = Some(at);
        before.push((steps.len() / width.max(1)) as i64);
    }
    let count = steps.len() / width.max(1);
    let steps = Array2::from_shape_vec((count, width), steps).unwrap_or_default();
    (steps.into_pyarray(py), before.into_pyarray(py))
}
