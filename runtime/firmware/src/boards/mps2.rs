//! MPS2+ boards of Arm, as QEMU has them: with a Cortex-M7 (application note 500,
//! `mps2-an500`) or a Cortex-M4F (application note 386, `mps2-an386`).
//!
//! They differ in the processor and in where the PSRAM is, which `build.rs` knows. The
//! PSRAM stands for table flash and frame memory.

use super::cmsdk::{self, Lamp, Timer, Uart, WakeTimer, WatchdogTimer};
use super::psram::{PsramFlash, PsramSink, PsramSource};
use crate::board::{Board, Peripherals};

/// The board.
pub struct Mps2;

impl Board for Mps2 {
    const NAME: &'static str = if cfg!(feature = "mps2-an386") {
        "mps2-an386"
    } else {
        "mps2-an500"
    };

    /// Six frames at 24 a second.
    const WATCHDOG_MS: u32 = 250;

    type Clock = Timer;
    type Source = PsramSource;
    type Sink = PsramSink;
    type Serial = Uart;
    type Flash = PsramFlash;
    type Watchdog = WatchdogTimer;
    type Lamp = Lamp;
    type Idle = WakeTimer;

    fn take() -> Option<Peripherals<Self>> {
        // The first to take the core's peripherals has the board's as well. The
        // caches stay off: frame buffers are shared with hardware that does not see
        // them. The emulator has none; on silicon, an MPU region that keeps the
        // PSRAM from being cached lets them be switched on here.
        cortex_m::Peripherals::take()?;
        let cmsdk = cmsdk::take();
        let (flash, source, sink) = super::psram::take();
        Some(Peripherals {
            clock: cmsdk.timer,
            source,
            sink,
            serial: cmsdk.uart,
            flash,
            watchdog: cmsdk.watchdog,
            lamp: cmsdk.lamp,
            idle: cmsdk.wake,
        })
    }
}
