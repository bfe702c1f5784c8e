//! Devices and hosts: the protocol, tables on their way to a device, what it does with them
//! whatever happens, and its firmware in the emulator. One module for a matter:
//! `cargo test -p iltm-tests --test device upload` runs the tests of one.

mod firmware;
mod firmware_trouble;
mod firmware_update;
mod found_by_fuzzing;
mod identity;
mod link;
mod neighbours;
mod power_cuts;
mod protocol;
mod rights;
mod slots;
mod upload;
mod worn;
