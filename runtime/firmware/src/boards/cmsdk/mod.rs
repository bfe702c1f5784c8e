//! Peripherals of Arm's Cortex-M System Design Kit (CMSDK, Arm DDI 0479), which
//! all MPS2 boards have at the same addresses.

mod interrupts;
mod lamp;
mod nap;
mod registers;
mod timer;
mod uart;
mod watchdog;

pub use lamp::Lamp;
pub use nap::Nap;
pub use timer::Timer;
pub use uart::Uart;
pub use watchdog::WatchdogTimer;

use registers::Registers;

/// Clock of the peripherals and of the processor.
const HERTZ: u32 = 25_000_000;

/// The peripherals, set up.
pub struct Cmsdk {
    /// Timer 0, running.
    pub timer: Timer,
    /// UART 0, with its interrupts on.
    pub uart: Uart,
    /// The watchdog, not yet started.
    pub watchdog: WatchdogTimer,
    /// The first user light.
    pub lamp: Lamp,
    /// Timer 1, running.
    pub nap: Nap,
}

/// Hands out the peripherals. The caller makes sure that this happens once: two
/// drivers of one peripheral would disturb each other, though not the memory.
pub(super) fn take() -> Cmsdk {
    // SAFETY: the addresses are those of the peripherals (application notes 386
    // and 500, memory map), and each gets one driver.
    let (timer, nap, uart, watchdog, lamp) = unsafe {
        (
            Registers::at(0x4000_0000),
            Registers::at(nap::TIMER),
            Registers::at(uart::UART),
            Registers::at(0x4000_8000),
            Registers::at(0x4002_8000),
        )
    };
    Cmsdk {
        timer: Timer::new(timer),
        uart: Uart::new(uart),
        watchdog: WatchdogTimer::new(watchdog),
        lamp: Lamp::new(lamp),
        nap: Nap::new(nap),
    }
}
