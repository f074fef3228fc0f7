//! The compiled part of `i2ris.model` and `i2ris.benchmark`: the code of the command line under
//! Python.
//!
//! Arrays are checked in Python (`i2ris/model.py`); errors in their contents are reported here with
//! the sentence of the command line. Long work runs without the interpreter's lock.

mod benchmark;
mod fit;
mod model;

use pyo3::prelude::*;

pyo3::create_exception!(
    i2ris_native,
    ModelError,
    pyo3::exceptions::PyValueError,
    "A recording, a model or a network is refused; the text is the sentence of the command line."
);

/// An error with its sentence.
fn refused(error: impl std::fmt::Display) -> PyErr {
    ModelError::new_err(error.to_string())
}

#[pymodule]
mod i2ris_native {
    #[pymodule_export]
    use super::ModelError;
    #[pymodule_export]
    use super::benchmark::{Snake, motions, record, tick_times, track};
    #[pymodule_export]
    use super::fit::{fit, fit_mixture, import_network, write_recording};
    #[pymodule_export]
    use super::model::{Model, Tracker, steps_by_travel};
}
