//! From an [`InverseTransport`](iltm_solve::InverseTransport) to a table image.
//!
//! | step | file |
//! |---|---|
//! | light of the brightest uniform grey | [`white`] |
//! | which white was asked for, and which it became | [`wish`] |
//! | a white that suits the user's own content | [`content_white`] |
//! | what video looks like, for choosing and predicting | [`content`] |
//! | `K` in the Haar domain, most useful entries first, cut into tiers | [`ladder`] |
//! | `i16` entries with a power of two a row | [`quantise`] |
//! | gains, also finer than the cells | [`gain`] |
//! | projector codes by drive | [`response`] |
//! | bytes | [`image`] |
//! | what a frame takes on the board | [`cost`] |
//! | the seal behind them | [`sign`] |
//!
//! The image is checked by the runtime's own reader before it is returned, so
//! what leaves here is known to load.

pub mod content_white;
pub mod cost;
pub mod gain;
pub mod image;
pub mod ladder;
pub mod learn;
pub mod quantise;
pub mod response;
pub mod sign;
mod table;
#[cfg(test)]
mod test_scene;
pub mod white;
pub mod wish;

pub use gain::FineGains;
pub use iltm_solve::content;
pub use ladder::Ladder;
pub use table::{CompileError, CompileOptions, Compiled, compile};
