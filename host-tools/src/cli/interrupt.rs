//! Interrupt by ctrl-C, for commands that go on until somebody stops them.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

static STOPPED: AtomicBool = AtomicBool::new(false);

/// From now on ctrl-C (and a request to terminate) makes [`stopped`] true instead
/// of ending the process, so that the terminal and other processes can be left as
/// they should be.
pub(super) fn catch() {
    static CAUGHT: OnceLock<()> = OnceLock::new();
    CAUGHT.get_or_init(|| {
        // Where the system has no such thing, ctrl-C does what it does anyway.
        let _ = ctrlc::set_handler(|| STOPPED.store(true, Ordering::SeqCst));
    });
}

/// Whether the user wants an end.
pub(super) fn stopped() -> bool {
    STOPPED.load(Ordering::SeqCst)
}
