//! Frames from files and pipes, through the runtime's pipelines, and back.
//!
//! In: PNG pictures and Y4M streams, and a table. Out: the same frames compensated, in the
//! kind and size that they came in.
//!
//! | what | file |
//! |---|---|
//! | pictures and streams through a table, the front door | [`compensate`] |
//! | a table that is replaced while a stream runs, a budget of time | [`live`], [`watch`] |
//! | where frames go on the projector | [`PlacedFrames`], [`Fit`] |
//! | inputs told apart, and a few frames of one | [`Input`], [`sampled_frames`] |
//! | Y4M streams | [`y4m`] |
//! | YUV to RGB and back | [`yuv`] |
//! | reading, working and writing at the same time | `stream` |
//! | bands of rows of planar frames and of pictures | `bands`, `planar` |
//! | frames of one size through one table, on all cores or on a graphics processor | `engine` |
//! | codes to light and drives to codes by lookup | `curves` |
//! | a moving scene made by arithmetic, to show and test with | [`test_scene`] |
//! | errors | [`VideoError`] |
//!
//! The pixels are worked on by [`iltm_runtime::pipeline`], so that every frame
//! is what the device would show; here is only what brings them to it fast.
//!
//! How fast, 1920 x 1080 4:2:0 Y4M from pipe to pipe, three channels, fine gains,
//! ambient light, response and all tiers, as `cargo bench -p iltm --bench compensate`
//! prints it on two virtual cores with AVX-512: medians of five runs in a quiet
//! spell. Processor time is of all threads and includes the other ends of the pipes.
//!
//! | grid | frames/s | processor time a frame |
//! |---|---|---|
//! | 13 x 21 | 218 | 8.2 ms |
//! | 16 x 24 | 232 | 7.7 ms |
//! | 48 x 64 | 201 | 9.1 ms |
//!
//! A quarter of that time is for lookup tables (codes to light, drives to codes), a fifth for
//! the kernel's pipes. With AVX-512, which also looks up light in registers, it is .83 of what
//! it is with AVX2, and with that .7 to .8 of what it is with SSE2; which one is used is chosen
//! when the program runs. Memory is 47 MB after 10 frames and after 3,000.

mod bands;
pub mod compensate;
mod curves;
mod engine;
mod error;
mod fit;
mod input;
pub mod live;
mod neighbours;
pub mod pipe;
mod planar;
mod stream;
pub mod test_scene;
pub mod watch;
pub mod y4m;
pub mod yuv;

pub use compensate::{CompensateOptions, Compensator, FrameTotals};
pub use engine::OperatorMemory;
pub use error::VideoError;
pub use fit::{Fit, PlacedFrames};
pub use input::{Input, sampled_frames};
pub use neighbours::{FrameSplitter, OwnFrame, wide_size};

#[cfg(test)]
mod tests;
