//! The product.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use iltm_firmware::boards::Chosen;
use iltm_firmware::device::{Live, start};

#[entry]
fn main() -> ! {
    start::<Chosen, _>(|| Live)
}
