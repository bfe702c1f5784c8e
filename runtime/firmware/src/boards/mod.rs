//! The boards there are. A Cargo feature of the same name chooses one.

#[cfg(not(any(feature = "mps2-an500", feature = "mps2-an386")))]
compile_error!("choose a board: build with one of the features mps2-an500, mps2-an386");

pub mod cmsdk;
#[cfg(feature = "mps2-an386")]
mod mps2_an386;
#[cfg(not(feature = "mps2-an386"))]
mod mps2_an500;
pub mod psram;

#[cfg(feature = "mps2-an386")]
pub use mps2_an386::Mps2An386 as Chosen;
#[cfg(not(feature = "mps2-an386"))]
pub use mps2_an500::Mps2An500 as Chosen;
