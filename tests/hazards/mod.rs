//! The hazards of the design: see the table in `README.md` beside this file. Where a test of the
//! cycle, of the adaptation or of the drives shows the control, the table names that one; the others
//! are here.

mod coverage;
mod documents;
mod drives;
mod models;
mod processes;
mod surroundings;
