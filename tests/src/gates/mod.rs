//! Gates before a solve, studied: random good sessions, of which none may be refused, and the same
//! with every fault, which the right gate must find and answer with the right next step.
//!
//! | what | module |
//! |---|---|
//! | a random scene, its camera and what is photographed | `session` |
//! | faults, how large they are, and what their gate must say | `fault` |
//! | many sessions at once, and the table of [the gates' page] | `study` |
//!
//! [the gates' page]: https://github.com/iltm/iltm/blob/main/docs/gates.md

mod fault;
mod session;
mod study;

pub use fault::{StudiedFault, named_by};
pub use session::{StudiedSession, failing};
pub use study::{FaultCount, Study, StudyResult};
