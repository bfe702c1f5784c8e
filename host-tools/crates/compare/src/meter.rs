//! Memory that a piece of work holds.

/// Reads the program's allocator, which only the program itself can choose.
#[derive(Clone, Copy, Debug)]
pub struct Meter {
    /// Bytes held now.
    pub current: fn() -> usize,
    /// Most bytes held since the last [`Self::reset`].
    pub peak: fn() -> usize,
    /// Starts again from what is held now.
    pub reset: fn(),
}

impl Meter {
    /// Runs `work` and says how many bytes it held at most beyond what was held before.
    pub fn measure<T>(self, work: impl FnOnce() -> T) -> (T, usize) {
        (self.reset)();
        let before = (self.current)();
        let result = work();
        (result, (self.peak)().saturating_sub(before))
    }
}
