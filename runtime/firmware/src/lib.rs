//! Firmware: the runtime, live on a Cortex-M board.
//!
//! | module | what lives there |
//! |---|---|
//! | [`board`] | what a board provides: the only thing to write for another one |
//! | [`boards`] | the boards there are |
//! | [`device`] | the loop: frames, then the serial line |
//! | [`frames`] | from the source through the table in use to the display |
//! | [`frame_path`] | one frame through a table, or past it |
//! | [`table_slots`] | the tables of both slots, and the one in use |
//! | [`hooks`] | what a self-test may do to the loop |
//! | [`memory`] | the workspace of a frame |
//! | [`telemetry`] | what the device knows of itself |
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
pub mod frame_path;
pub mod frames;
pub mod hooks;
pub mod logger;
pub mod memory;
pub mod retained;
pub mod stack;
pub mod table_slots;
pub mod telemetry;
