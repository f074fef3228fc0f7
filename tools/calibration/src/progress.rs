//! Progress of long work.

/// Receives progress. Calls come from several threads at once.
pub trait Progress: Sync {
    /// Starts a part of the work, with one or more pieces: its name, and its range, 0 to 1.
    fn part(&self, name: &str, from: f64, to: f64);
    /// Starts a piece of this many steps.
    fn begin(&self, steps: usize);
    /// One step is done.
    fn step(&self);
    /// The piece is over.
    fn end(&self);
}

/// Reports nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn part(&self, _name: &str, _from: f64, _to: f64) {}
    fn begin(&self, _steps: usize) {}
    fn step(&self) {}
    fn end(&self) {}
}
