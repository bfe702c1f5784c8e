//! Interrupt by ctrl-C, or by a request to terminate: no command leaves anything half-made.
//!
//! A command that talks to a device, a camera or a screen calls [`catch`] and looks at
//! [`stopped`], so that it can leave them as they should be. Any other command, and a second
//! interrupt, ends the process at once: temporary files are removed, and the exit code is that
//! of [`Kind::Interrupted`]. Two interrupts within [`ONE`] are one: `timeout` sends each twice,
//! to the process and to its group.

use super::failure::{Failure, Kind};
use super::output::Output;
use iltm_picture::unfinished;
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// A second interrupt sooner than this is the first one, sent again.
const ONE: Duration = Duration::from_millis(200);

/// Whether a command looks at [`STOPPED`].
static CAUGHT: AtomicBool = AtomicBool::new(false);
static STOPPED: AtomicBool = AtomicBool::new(false);
/// Whether the process is about to end.
static ENDING: AtomicBool = AtomicBool::new(false);

/// What ctrl-C does from now on, until a command [catches](catch) it.
pub(super) fn begin(output: &Output) {
    let output = output.clone();
    // Where the system has no such thing, ctrl-C does what it does anyway.
    let mut first: Option<Instant> = None;
    let _ = ctrlc::set_handler(move || {
        if CAUGHT.load(Ordering::SeqCst) {
            STOPPED.store(true, Ordering::SeqCst);
            if first.get_or_insert_with(Instant::now).elapsed() < ONE {
                return;
            }
        }
        ENDING.store(true, Ordering::SeqCst);
        unfinished::remove_all();
        let message = "stopped before the end; nothing half-made was left";
        let next_step = "Run the same command again.";
        let code = Kind::Interrupted.code();
        output.failure(&Failure::new(Kind::Interrupted, message, next_step));
        process::exit(code.into());
    });
}

/// From now on the first ctrl-C makes [`stopped`] true instead of ending the process.
pub(super) fn catch() {
    CAUGHT.store(true, Ordering::SeqCst);
}

/// Whether the user wants an end.
pub(super) fn stopped() -> bool {
    STOPPED.load(Ordering::SeqCst)
}

/// Waits for the end of a process that is ending: what fails now fails because its temporary
/// files have gone.
pub(super) fn wait_if_ending() {
    while ENDING.load(Ordering::SeqCst) {
        thread::park();
    }
}
