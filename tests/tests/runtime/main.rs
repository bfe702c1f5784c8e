//! Runtime: tables and frames through it, hard and foreign ones among them, and what they
//! cost in instructions. One module for a matter: `cargo test -p iltm-tests --test runtime
//! tables` runs the tests of one.

mod costs;
mod foreign_bytes;
mod governor;
mod hard_frames;
mod image;
mod split;
mod stages;
mod tables;
mod whole_frames;
