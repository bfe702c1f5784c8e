//! Boards that the firmware runs on. A Cargo feature chooses one.

#[cfg(not(any(feature = "mps2-an500", feature = "mps2-an386")))]
compile_error!("choose a board: build with one of the features mps2-an500, mps2-an386");

pub mod cmsdk;
mod mps2;
pub mod psram;

pub use mps2::Mps2 as Chosen;
