//! The `iltm` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    iltm::cli::run()
}
