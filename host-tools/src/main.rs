//! The `iltm` command.

use iltm::compare::Meter;
use peak_alloc::PeakAlloc;
use std::process::ExitCode;

/// The system's allocator, counting: `iltm compare` says what each method held.
#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

fn main() -> ExitCode {
    iltm::cli::run(Meter {
        current: || MEMORY.current_usage(),
        peak: || MEMORY.peak_usage(),
        reset: || MEMORY.reset_peak_usage(),
    })
}
