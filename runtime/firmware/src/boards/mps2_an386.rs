//! Arm MPS2+ with a Cortex-M4F (application note 386), as QEMU's `mps2-an386`.
//!
//! Like the mps2-an500 but for the processor and for where its PSRAM is, which
//! `build.rs` knows. The PSRAM stands for table flash and frame memory.

use super::cmsdk::{self, Lamp, Nap, Timer, Uart, WatchdogTimer};
use super::psram::{PsramFlash, PsramSink, PsramSource};
use crate::board::{Board, Peripherals};

/// The board.
pub struct Mps2An386;

impl Board for Mps2An386 {
    const NAME: &'static str = "mps2-an386";

    type Clock = Timer;
    type Source = PsramSource;
    type Sink = PsramSink;
    type Serial = Uart;
    type Flash = PsramFlash;
    type Watchdog = WatchdogTimer;
    type Lamp = Lamp;
    type Rest = Nap;

    fn take() -> Option<Peripherals<Self>> {
        // The first to take the core's peripherals has the board's as well.
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
            rest: cmsdk.nap,
        })
    }
}
