//! Firmware binary: the product.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use iltm_firmware::boards::Chosen;
use iltm_firmware::device::start;
use iltm_firmware::hooks::NoHooks;

#[entry]
fn main() -> ! {
    start::<Chosen, _>(|| NoHooks)
}
