//! Devices at the other end of a serial line, real and emulated.
//!
//! In: a port's name or an emulated board, requests, table files, frames to play. Out:
//! answers, events and log messages, and the frames that an emulated board shows.
//!
//! | what | file |
//! |---|---|
//! | the line: a serial port, or anything else that carries bytes both ways | [`port`] |
//! | ports of this machine and of emulated boards, and which of them may be asked | [`port_scan`] |
//! | ports that a device answers at, and at which speed | [`discovery`] |
//! | requests and answers as frames on a line | `transport` |
//! | a conversation: hello, status, subscription to events | [`client`] |
//! | requests about tables | [`tables`] |
//! | whoever signs what a device with a key is asked | [`Authority`] |
//! | a table's file on its way, whatever breaks | [`upload`] |
//! | frames on a line in words, for support | [`transcript`] |
//! | log messages, with the firmware's ELF file | [`logs`] |
//! | the emulated board, its serial line as a port | [`emulator`] |
//! | the emulated board's memory, which is a file here | [`memory`] |
//! | frames for it, and those that it shows | [`frame_source`], [`playback`] |
//! | settings and state of the user | [`user`] |
//! | errors | [`DeviceError`] |
//!
//! What goes over the line is defined in [`iltm_runtime::link`], which the device
//! uses as well.

mod authority;
pub mod client;
pub mod discovery;
#[cfg(unix)]
pub mod emulator;
mod error;
#[cfg(unix)]
pub mod frame_source;
pub mod logs;
#[cfg(unix)]
pub mod memory;
#[cfg(unix)]
pub mod playback;
pub mod port;
pub mod port_scan;
pub mod tables;
pub mod transcript;
mod transport;
pub mod upload;
pub mod user;

pub use authority::Authority;
pub use client::Client;
pub use error::{DeviceError, rejection_next_step};
pub use port::{Line, Port};
pub use transport::{Incoming, Patience};
