//! Serial lines that fail by order, to try clients and devices on.
//!
//! Only with the feature `fault-tools`.
//!
//! | what for | simulator |
//! |---|---|
//! | a client in this process, on a line that harms frames | [`LossyLine`] around any [`Line`](super::Line) |
//! | any client program, on a port that harms frames | [`LossyProxy`] before any port |
//! | a device in this process, at a line of a given speed on a clock of its own | [`PacedLine`] with a [`FarEnd`] |
//!
//! Harm is done to *frames*: what is between two zero bytes, whatever else the
//! protocol says. It follows from a seed; the n-th frame of a way meets the same fate
//! each time. Its kinds and rates are a [`Harm`].
//!
//! ```
//! # use iltm_device::fault::{FarEnd, Faults, Harm, LossyLine, PacedLine};
//! # use iltm_device::{Client, DeviceError, Patience};
//! # use std::time::Duration;
//! # #[derive(Default)]
//! # struct Silent;
//! # impl FarEnd for Silent {
//! #     fn turn(&mut self, _: &[u8], _: Duration) {}
//! #     fn pending(&self) -> &[u8] { &[] }
//! #     fn sent(&mut self, _: usize) {}
//! # }
//! # let device = Silent::default();
//! // A fifth of all frames is harmed, both ways, on a simulated line.
//! let line = PacedLine::new(device, 921_600);
//! let mut line = LossyLine::new(line, Faults::both_ways(Harm::evenly(200), 1));
//! match Client::greet(&mut line, Patience::default()) {
//!     Ok(client) => println!("{:?}", client.device()),
//!     Err(DeviceError::NoAnswer { tries, .. }) => println!("{tries} tries"),
//!     Err(error) => println!("{error}"),
//! }
//! println!("{:?} to the device, {:?} back", line.to_device(), line.to_host());
//! println!("{:?} on the line's clock", line.line().elapsed());
//! ```

mod harm;
mod lossy;
mod paced;
#[cfg(unix)]
mod proxy;
#[cfg(test)]
mod tests;
mod way;
mod wire;

pub use harm::{Faults, Harm, Tally};
pub use lossy::LossyLine;
pub use paced::{FarEnd, PacedLine};
#[cfg(unix)]
pub use proxy::LossyProxy;
