//! The hazards of the design: see the table in `README.md` in this folder. If a test of the cycle,
//! the adaptation or the drives shows the control, the table names it; the other tests are here.

mod coverage;
mod documents;
mod drives;
mod models;
mod processes;
mod surroundings;
