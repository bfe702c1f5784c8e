//! The firmware: the runtime, live on a Cortex-M board.
//!
//! | module | what lives there |
//! |---|---|
//! | [`board`] | what a board provides: the only thing to write for another one |
//! | [`boards`] | the boards there are |
//! | [`device`] | the frame loop |
//! | [`stage`] | one frame through a table, or past it |
//! | [`tables`] | which slot's table is used, and why not |
//! | [`memory`] | the workspace of a frame |
//! | [`vitals`] | what the device knows of itself |
//! | [`logger`] | defmt frames on their way to the serial line |
//! | [`stack`] | how deep the stack has been |
//! | [`retained`] | what outlives a restart |
//! | [`fault`] | what happens when nothing else can |
//!
//! Everything that can be decided without hardware is in the `iltm-runtime`
//! crate, tested on the host; here it meets the hardware. Unsafe code is in
//! [`boards`], [`stack`], [`retained`] and [`logger`] alone.
#![no_std]

pub mod board;
pub mod boards;
pub mod device;
pub mod fault;
pub mod logger;
pub mod memory;
pub mod retained;
pub mod stack;
pub mod stage;
pub mod tables;
pub mod vitals;
