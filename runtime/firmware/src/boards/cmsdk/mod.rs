//! CMSDK peripherals: Arm's Cortex-M System Design Kit (Arm DDI 0479), which all MPS2
//! boards have at the same addresses.

mod uart;

pub use uart::Uart;

use crate::board::{Clock, Idle, Watchdog};
use crate::retained::{Cause, Retained};
use core::cell::Cell;
use core::convert::Infallible;
use core::ptr::with_exposed_provenance_mut;
use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;
use cortex_m_rt::exception;
use embedded_hal::digital::{ErrorType, OutputPin};

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
    pub wake: WakeTimer,
}

/// Hands out the peripherals. The caller makes sure that this happens once: two
/// drivers of one peripheral would disturb each other, though not the memory.
pub(super) fn take() -> Cmsdk {
    // SAFETY: the addresses are those of the peripherals (application notes 386
    // and 500, memory map), and each gets one driver.
    let (timer, wake, uart, watchdog, lamp) = unsafe {
        (
            Registers::at(0x4000_0000),
            Registers::at(TIMER_1),
            Registers::at(uart::UART),
            Registers::at(0x4000_8000),
            Registers::at(0x4002_8000),
        )
    };
    Cmsdk {
        timer: Timer::new(timer),
        uart: Uart::new(uart),
        watchdog: WatchdogTimer {
            registers: watchdog,
        },
        lamp: Lamp { registers: lamp },
        wake: WakeTimer::new(wake),
    }
}

/// The registers of one peripheral, 32 bits each.
#[derive(Clone, Copy)]
struct Registers {
    base: usize,
}

/// Bytes of a CMSDK peripheral.
const SIZE: usize = 0x1000;

impl Registers {
    /// The registers from `base` on.
    ///
    /// # Safety
    /// There is a peripheral at `base` whose [`SIZE`] bytes may be read and
    /// written as words at any time without effect on memory.
    const unsafe fn at(base: usize) -> Self {
        Self { base }
    }

    /// The register at `offset` bytes.
    fn read(self, offset: usize) -> u32 {
        // SAFETY: `at` promises that words of the peripheral may be read; the mask
        // keeps the address aligned and in it.
        unsafe { with_exposed_provenance_mut::<u32>(self.address(offset)).read_volatile() }
    }

    /// Writes the register at `offset` bytes.
    fn write(self, offset: usize, value: u32) {
        // SAFETY: as in `read`.
        unsafe { with_exposed_provenance_mut::<u32>(self.address(offset)).write_volatile(value) }
    }

    const fn address(self, offset: usize) -> usize {
        self.base + (offset & (SIZE - 4))
    }
}

/// Interrupts that the firmware uses.
#[derive(Clone, Copy)]
#[repr(u16)]
enum Interrupt {
    /// UART 0 has received a byte.
    Receive = 0,
    /// UART 0 has sent a byte.
    Transmit = 1,
    /// Timer 1 has come to its end.
    Wake = 9,
}

// SAFETY: the numbers are those of application notes 386 and 500, each once.
unsafe impl InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

/// Handlers by interrupt number.
#[used]
// SAFETY: cortex-m-rt wants the vectors behind the exceptions in this section
// under this name; they are functions that take and return nothing.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".vector_table.interrupts")]
static __INTERRUPTS: [unsafe extern "C" fn(); 32] = {
    let mut vectors: [unsafe extern "C" fn(); 32] = [unexpected; 32];
    vectors[Interrupt::Receive as usize] = receive;
    vectors[Interrupt::Transmit as usize] = transmit;
    vectors[Interrupt::Wake as usize] = wake;
    vectors
};

unsafe extern "C" fn receive() {
    uart::received();
}

unsafe extern "C" fn transmit() {
    uart::transmitted();
}

unsafe extern "C" fn wake() {
    AWAKE.write(timer::INTERRUPT_CLEAR, 1);
}

/// An interrupt that nobody has unmasked.
unsafe extern "C" fn unexpected() {
    crate::fault::restart();
}

/// Registers of a timer.
mod timer {
    pub(super) const CONTROL: usize = 0x0;
    pub(super) const VALUE: usize = 0x4;
    pub(super) const RELOAD: usize = 0x8;
    pub(super) const INTERRUPT_CLEAR: usize = 0xC;
}

/// Timer 0 as the clock. It counts down through 32 bits, in 171 seconds. It must be read
/// more often than that, or a round is lost.
pub struct Timer {
    registers: Registers,
    last: Cell<u64>,
}

impl Timer {
    fn new(registers: Registers) -> Self {
        registers.write(timer::RELOAD, u32::MAX);
        registers.write(timer::VALUE, u32::MAX);
        registers.write(timer::CONTROL, 1);
        Self {
            registers,
            last: Cell::new(0),
        }
    }
}

impl Clock for Timer {
    const HERTZ: u32 = HERTZ;

    fn ticks(&self) -> u64 {
        let last = self.last.get();
        let low = !self.registers.read(timer::VALUE);
        // The low halves alone tell how far it has come since.
        let now = last + u64::from(low.wrapping_sub(last as u32));
        self.last.set(now);
        now
    }
}

/// Address of timer 1.
const TIMER_1: usize = 0x4000_1000;

/// Looks for frames a second.
const LOOKS: u32 = 5_000;

/// Count, and interrupt at the end of every round.
const ROUNDS: u32 = 0b1001;

/// The handler's view of timer 1.
// SAFETY: timer 1 of application notes 386 and 500; clearing its interrupt is all
// that is done after `new`.
const AWAKE: Registers = unsafe { Registers::at(TIMER_1) };

/// Sleep until the next interrupt, at most a fifth of a millisecond.
///
/// The host puts frames into the frame memory without an interrupt, so timer 1
/// wakes the processor to look. A board whose frames come with an interrupt needs
/// no such timer.
pub struct WakeTimer(());

impl WakeTimer {
    fn new(registers: Registers) -> Self {
        let round = HERTZ / LOOKS - 1;
        registers.write(timer::RELOAD, round);
        registers.write(timer::VALUE, round);
        registers.write(timer::CONTROL, ROUNDS);
        // SAFETY: the handler shares nothing with the loop.
        unsafe { NVIC::unmask(Interrupt::Wake) };
        Self(())
    }
}

impl Idle for WakeTimer {
    fn idle(&mut self) {
        cortex_m::asm::wfi();
    }
}

/// Offset of the lights in the board's own registers.
const LIGHTS: usize = 0x0;

/// The first user light.
pub struct Lamp {
    registers: Registers,
}

impl ErrorType for Lamp {
    type Error = Infallible;
}

impl OutputPin for Lamp {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.registers.write(LIGHTS, 0);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.registers.write(LIGHTS, 1);
        Ok(())
    }
}

/// Registers of the watchdog.
mod watchdog {
    pub(super) const LOAD: usize = 0x0;
    pub(super) const CONTROL: usize = 0x8;
    pub(super) const INTERRUPT_CLEAR: usize = 0xC;
    pub(super) const LOCK: usize = 0xC00;
}

/// Written to [`watchdog::LOCK`], lets the other registers be written.
const UNLOCK: u32 = 0x1ACC_E551;

/// Count, interrupt at the first end, reset at the second.
const RESET: u32 = 0b11;

/// The watchdog. It counts down twice: the first time ends in a non-maskable interrupt,
/// which leaves a note of where the program was; the second time in a reset.
pub struct WatchdogTimer {
    registers: Registers,
}

impl WatchdogTimer {
    fn unlocked(&self, work: impl FnOnce(Registers)) {
        self.registers.write(watchdog::LOCK, UNLOCK);
        work(self.registers);
        self.registers.write(watchdog::LOCK, 0);
    }
}

impl Watchdog for WatchdogTimer {
    fn start(&mut self, milliseconds: u32) {
        let ticks = milliseconds.saturating_mul(HERTZ / 1_000);
        self.unlocked(|registers| {
            registers.write(watchdog::LOAD, ticks);
            registers.write(watchdog::CONTROL, RESET);
        });
    }

    fn pet(&mut self) {
        self.unlocked(|registers| registers.write(watchdog::INTERRUPT_CLEAR, 1));
    }
}

/// The watchdog has not been petted for one of its two rounds.
#[exception]
unsafe fn NonMaskableInt() {
    // The loop will not come back by itself: whatever pets the watchdog now would
    // only hide that. The second round resets the board.
    Retained::get().set_cause(Cause::Watchdog, 0);
    loop {
        cortex_m::asm::nop();
    }
}
