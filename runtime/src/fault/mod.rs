//! Things that fail by order, to test boards, clients and this crate against.
//!
//! Only with the feature `fault-tools`, and for hosts: it allocates.
//!
//! | what fails | simulator |
//! |---|---|
//! | NOR flash: power cuts, bit rot, worn sectors, rules broken by its user | [`NorSimulator`] |
//! | a serial line | `iltm::device::fault` of the host tools |
//!
//! Whatever is random follows from a seed: a failure that was printed with its seed
//! and its step can be repeated.

mod nor;

pub use nor::{ERASE_STAGES, Misread, NorError, NorSimulator, Operation, Violations, Wear, Work};
