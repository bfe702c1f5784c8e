//! The `iltm` command.

use std::process::ExitCode;

#[cfg(not(feature = "count-memory"))]
fn main() -> ExitCode {
    iltm::cli::run(None)
}

#[cfg(feature = "count-memory")]
fn main() -> ExitCode {
    use iltm::compare::Meter;
    use peak_alloc::PeakAlloc;

    /// The system's allocator, counting: `iltm compare` says what each method held.
    #[global_allocator]
    static MEMORY: PeakAlloc = PeakAlloc;

    iltm::cli::run(Some(Meter {
        current: || MEMORY.current_usage(),
        peak: || MEMORY.peak_usage(),
        reset: || MEMORY.reset_peak_usage(),
    }))
}
