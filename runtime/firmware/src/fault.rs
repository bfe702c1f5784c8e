//! Panic and fault handlers: a note in retained memory, and a restart.
//!
//! The runtime has no panics and the firmware knows of none; should one be left,
//! the display keeps its last frame and the device is back within a frame or two.

use crate::retained::{Cause, Retained};
use core::panic::PanicInfo;
use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};

/// Starts the device anew.
pub fn restart() -> ! {
    SCB::sys_reset()
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    let line = info.location().map_or(0, core::panic::Location::line);
    Retained::get().set_cause(Cause::Panic, line);
    restart()
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    Retained::get().set_cause(Cause::HardFault, frame.pc());
    restart()
}
