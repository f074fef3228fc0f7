//! Fits, and networks that were trained elsewhere.

use std::ffi::CString;
use std::fs::File;
use std::io::BufWriter;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use i2ris::model::file::{MixtureParameters, OutputSpec, OutputUnit};
use i2ris::units::{MAX_MOTORS, MAX_OUTPUTS};
use i2ris_calibration::em::{self, EmOptions};
use i2ris_calibration::fit::network::{NetworkFile, import};
use i2ris_calibration::fit::{Components, FitOptions};
use i2ris_calibration::progress::{Progress, Silent};
use i2ris_calibration::quality::SpikeOptions;
use i2ris_calibration::recording::{ColumnMap, Recording, RecordingWriter, Row};
use i2ris_calibration::report::CalibrationReport;
use i2ris_calibration::table::DataTable;
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::{PyRuntimeError, PyUserWarning};
use pyo3::prelude::*;

use crate::model::Model;
use crate::refused;

/// Period of checking for Ctrl-C.
const LOOK: Duration = Duration::from_millis(100);

/// Progress of a fit, and whether it is to end.
#[derive(Default)]
struct Watched {
    part: Mutex<(String, f64, f64)>,
    steps: AtomicUsize,
    done: AtomicUsize,
    stop: AtomicBool,
}

/// Unwinds a fit that was interrupted.
struct Interrupted;

impl Watched {
    /// A fit ends only with its result: Ctrl-C unwinds it silently.
    fn look(&self) {
        if self.stop.load(Ordering::Relaxed) {
            resume_unwind(Box::new(Interrupted));
        }
    }

    fn share(&self) -> (String, f64) {
        let part = self.part.lock().map(|part| part.clone()).unwrap_or_default();
        let steps = self.steps.load(Ordering::Relaxed).max(1) as f64;
        let done = (self.done.load(Ordering::Relaxed) as f64 / steps).min(1.0);
        (part.0, part.1 + done * (part.2 - part.1))
    }
}

impl Progress for Watched {
    fn part(&self, name: &str, from: f64, to: f64) {
        self.look();
        self.begin(1);
        if let Ok(mut part) = self.part.lock() {
            *part = (name.to_owned(), from, to);
        }
    }

    fn begin(&self, steps: usize) {
        self.look();
        self.steps.store(steps, Ordering::Relaxed);
        self.done.store(0, Ordering::Relaxed);
    }

    fn step(&self) {
        self.look();
        self.done.fetch_add(1, Ordering::Relaxed);
    }

    fn end(&self) {}
}

/// Runs work outside the interpreter, reports its progress, and ends it on Ctrl-C.
fn watched<T: Send>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Watched) -> T + Send,
) -> PyResult<T> {
    let watched = Watched::default();
    std::thread::scope(|scope| {
        let (done, finished) = channel();
        let watched = &watched;
        scope.spawn(move || {
            let result = catch_unwind(AssertUnwindSafe(|| work(watched)));
            // The receiver may be gone.
            let _ = done.send(result);
        });
        let finished = Mutex::new(finished);
        loop {
            let result = py.detach(|| match finished.lock() {
                Ok(finished) => finished.recv_timeout(LOOK),
                Err(_) => Err(RecvTimeoutError::Disconnected),
            });
            match result {
                Ok(Ok(value)) => return Ok(value),
                Ok(Err(_)) | Err(RecvTimeoutError::Disconnected) => {
                    return Err(PyRuntimeError::new_err("the fit ended before its result"));
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
            let reported = py.check_signals().and_then(|()| match progress {
                Some(progress) => progress.call1(watched.share()).map(drop),
                None => Ok(()),
            });
            if let Err(error) = reported {
                watched.stop.store(true, Ordering::Relaxed);
                py.detach(|| finished.lock().map(|finished| finished.recv()).is_ok());
                return Err(error);
            }
        }
    })
}

/// Fits a model to a recording, as `i2ris calibrate fit` does. Returns the model, the report as
/// JSON, as text and as a page.
#[pyfunction]
#[pyo3(signature = (path, *, family, components, max_components, restarts, seed,
                    hold_out, keep_spikes, force, robot_id, recorded_at, latency, progress))]
#[allow(clippy::too_many_arguments, reason = "the options of the command line")]
pub fn fit(
    py: Python<'_>,
    path: PathBuf,
    family: &str,
    components: Option<usize>,
    max_components: usize,
    restarts: usize,
    seed: u64,
    hold_out: &str,
    keep_spikes: bool,
    force: bool,
    robot_id: String,
    recorded_at: Option<String>,
    latency: bool,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Model, String, String, String)> {
    let options = FitOptions {
        robot_id,
        recorded_at,
        choice: family.parse().map_err(refused)?,
        earlier: None,
        components: components.map_or(Components::UpTo(max_components), Components::Exactly),
        em: EmOptions { restarts, seed, ..EmOptions::default() },
        hold_out: hold_out.parse().map_err(refused)?,
        spikes: SpikeOptions { keep: keep_spikes, ..SpikeOptions::default() },
        force,
        drives: Vec::new(),
    };
    let made = watched(py, progress, |watched| {
        let (recording, read) =
            Recording::read(&path, &ColumnMap::default()).map_err(|error| error.to_string())?;
        let named = |error| format!("recording {}: {error}", path.display());
        let (recording, taken_off) = match latency {
            true => recording.aligned().map_err(|late| named(late.to_string()))?,
            false => (recording, Some(0.0)),
        };
        let outcome = i2ris_calibration::fit::fit(&recording, &options, watched)
            .map_err(|error| named(error.to_string()))?;
        let mut report = CalibrationReport::new(&recording, &read, &options, &outcome);
        report.latency_taken_off_s = taken_off;
        let json = serde_json::to_string_pretty(&report).map_err(|error| error.to_string())?;
        Ok((Model(outcome.model), json, report.to_string(), report.html()))
    })?;
    made.map_err(|sentence: String| refused(sentence))
}

/// Weights, means and covariances of a mixture.
type Mixture = (Vec<f64>, Vec<Vec<f64>>, Vec<Vec<Vec<f64>>>);

/// Fits a Gaussian mixture to rows of numbers.
#[pyfunction]
pub fn fit_mixture(
    py: Python<'_>,
    rows: PyReadonlyArray2<'_, f64>,
    components: usize,
    restarts: usize,
) -> PyResult<Mixture> {
    let rows = rows.as_array();
    let table = DataTable::from_rows(rows.ncols(), rows.outer_iter().map(|row| row.to_vec()));
    let options = EmOptions { restarts, ..EmOptions::default() };
    let found = py.detach(|| em::fit_mixture(&table, components, &options, &Silent));
    let MixtureParameters { weights, means, covariances } = found.map_err(refused)?.parameters;
    Ok((weights, means, covariances))
}

/// Creates a model from a network that was trained elsewhere, like `i2ris calibrate fit --network
/// FILE`.
#[pyfunction]
pub fn import_network(
    py: Python<'_>,
    network: PathBuf,
    recording: PathBuf,
    robot_id: String,
    hold_out: &str,
) -> PyResult<Model> {
    let hold_out = hold_out.parse().map_err(refused)?;
    let options = FitOptions { robot_id, hold_out, ..FitOptions::default() };
    let made = py.detach(|| {
        let file = NetworkFile::read(&network).map_err(|error| error.to_string())?;
        let (recording, _) = Recording::read(&recording, &ColumnMap::default())
            .map_err(|error| error.to_string())?;
        let (recording, latency) = recording.without_latency();
        let model = import(&file, &recording, &options)
            .map_err(|error| format!("network {}: {error}", network.display()))?;
        Ok::<_, String>((model, latency.err().map(|late| late.kept())))
    });
    let (model, warning) = made.map_err(refused)?;
    if let Some(warning) = warning {
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &CString::new(warning)?, 2)?;
    }
    Ok(Model(model.into()))
}

/// Writes a recording in the common format. Values that are not finite were not measured.
#[pyfunction]
pub fn write_recording(
    path: PathBuf,
    time_s: Option<PyReadonlyArray1<'_, f64>>,
    counts: PyReadonlyArray2<'_, f64>,
    angles: PyReadonlyArray2<'_, f64>,
    names: Vec<String>,
) -> PyResult<()> {
    let (counts, angles) = (counts.as_array(), angles.as_array());
    let times = time_s.as_ref().map(PyReadonlyArray1::as_array);
    let output = |name: &String| OutputSpec { name: name.clone(), unit: OutputUnit::Deg };
    let outputs: Vec<OutputSpec> = names.iter().map(output).collect();
    let write = || -> std::io::Result<()> {
        let file = BufWriter::new(File::create(&path)?);
        let mut writer = RecordingWriter::new(file, times.is_some(), counts.ncols(), &outputs)?;
        for row in 0..counts.nrows() {
            let at = |motor: usize| counts.get((row, motor)).copied().unwrap_or(0.0);
            let angle = |output: usize| angles.get((row, output)).copied().unwrap_or(f64::NAN);
            let time = times.and_then(|times| times.get(row).copied());
            let counts = std::array::from_fn::<_, MAX_MOTORS, _>(at);
            writer.row(&Row::new(time, counts, std::array::from_fn::<_, MAX_OUTPUTS, _>(angle)))?;
        }
        writer.finish().map(drop)
    };
    write().map_err(|error| refused(format!("cannot write recording {}: {error}", path.display())))
}
