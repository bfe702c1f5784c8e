//! Line faults: serial lines that fail by order, to test clients and devices against.
//!
//! | simulator | file | what for |
//! |---|---|---|
//! | [`LossyLine`] around any [`Line`](iltm::device::Line) | `lossy_line`, and `direction` for one of its two directions | a client in this process, on a line that damages frames |
//! | [`LossyProxy`] before any port | `lossy_proxy` | any client program, on a port that damages frames |
//! | [`PacedLine`] with a [`FarEnd`] | `paced_line`, and `wire` for one of its two directions | a device in this process, at a line of a given speed on a clock of its own |
//!
//! Faults befall *frames*: what is between two zero bytes, whatever else the protocol
//! says. They follow from a seed; the n-th frame of a direction has the same fault each
//! time. Rates and counts are in `faults`.
//!
//! ```
//! # use iltm::device::{Client, DeviceError, Patience};
//! # use iltm_tests::line_faults::{FarEnd, FaultRates, Faults, LossyLine, PacedLine};
//! # use std::time::Duration;
//! # #[derive(Default)]
//! # struct Silent;
//! # impl FarEnd for Silent {
//! #     fn turn(&mut self, _: &[u8], _: Duration) {}
//! #     fn pending(&self) -> &[u8] { &[] }
//! #     fn sent(&mut self, _: usize) {}
//! # }
//! # let device = Silent::default();
//! // A fifth of all frames is faulty, in both directions, on a simulated line.
//! let line = PacedLine::new(device, 921_600);
//! let mut line = LossyLine::new(line, Faults::both_ways(FaultRates::evenly(200), 1));
//! match Client::greet(&mut line, Patience::default()) {
//!     Ok(client) => println!("{:?}", client.device()),
//!     Err(DeviceError::NoAnswer { tries, .. }) => println!("{tries} tries"),
//!     Err(error) => println!("{error}"),
//! }
//! println!("{:?} to the device, {:?} back", line.to_device(), line.to_host());
//! println!("{:?} on the line's clock", line.line().elapsed());
//! ```

mod direction;
mod faults;
mod lossy_line;
mod lossy_proxy;
mod paced_line;
#[cfg(test)]
mod tests;
mod wire;

pub use faults::{FaultCounts, FaultRates, Faults};
pub use lossy_line::LossyLine;
pub use lossy_proxy::LossyProxy;
pub use paced_line::{FarEnd, PacedLine};
