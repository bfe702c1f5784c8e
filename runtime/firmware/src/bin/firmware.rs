//! The product.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use iltm_firmware::boards::Chosen;
use iltm_firmware::device::start;
use iltm_firmware::rehearsal::Live;

#[entry]
fn main() -> ! {
    start::<Chosen, _>(|| Live)
}
