//! Devices at the other end of a serial line, real and emulated.
//!
//! | step | file |
//! |---|---|
//! | the line: a serial port, or anything else that carries bytes both ways | [`port`] |
//! | requests, answers, events | [`client`] |
//! | requests about tables | [`tables`] |
//! | a table's file on its way, whatever breaks | [`upload`] |
//! | ports that may be asked | [`candidates`] |
//! | ports that a device answers at | [`ports`] |
//! | what was said, in words | [`transcript`] |
//! | log messages, with the firmware's ELF file | [`logs`] |
//! | the emulated board, its serial line as a port | [`emulator`] |
//! | the emulated board's memory, which is a file here | [`memory`] |
//! | frames for it | [`frames`], [`playback`] |
//!
//! What goes over the line is defined in [`iltm_runtime::link`], which the device
//! uses as well.

pub mod candidates;
pub mod client;
#[cfg(unix)]
pub mod emulator;
mod error;
#[cfg(unix)]
pub mod frames;
pub mod logs;
#[cfg(unix)]
pub mod memory;
#[cfg(unix)]
pub mod playback;
pub mod port;
pub mod ports;
pub mod tables;
mod talk;
pub mod transcript;
pub mod upload;
pub mod user;

pub use client::{Client, Incoming, Patience};
pub use error::{DeviceError, cure};
pub use port::{Line, Port};
