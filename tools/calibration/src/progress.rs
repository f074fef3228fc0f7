//! Progress of long work.

/// Receives progress. Calls come from several threads at once.
pub trait Progress: Sync {
    /// Work of so many steps begins.
    fn begin(&self, steps: usize);
    /// One step is done.
    fn step(&self);
    /// The work is over.
    fn end(&self);
}

/// Reports nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _steps: usize) {}
    fn step(&self) {}
    fn end(&self) {}
}
