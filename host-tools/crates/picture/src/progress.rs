//! Progress of long work, told to whoever waits for it.
//!
//! The library only reports; whether that becomes a bar on a terminal, an event
//! in a JSON stream or nothing is decided in `cli/`.

/// Receives the steps of one piece of long work.
pub trait Progress: Sync {
    /// A step named `what` starts; it has `total` parts (0: not known).
    fn begin(&self, what: &str, total: u64);
    /// `parts` more parts of the current step are done.
    fn advance(&self, parts: u64);
    /// The current step is done.
    fn end(&self);
}

/// Shows nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _what: &str, _total: u64) {}
    fn advance(&self, _parts: u64) {}
    fn end(&self) {}
}
