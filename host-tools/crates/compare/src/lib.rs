//! Benchmark of compensation methods: the paper, its relatives and this project's way on the
//! same light.
//!
//! ```text
//! rig              a projector and a camera before a scene whose transport is known
//! ground_truth     what an answer is judged by                       errors
//! method           where a method comes from, and what it finds: transport, an inverse, a
//!                  way to project
//! acquisition      ways to photograph                                one file a kind
//! inversion        ways to invert or to solve frame by frame         one file a kind
//! benchmark        every method once: photographs, time, memory, errors
//! benchmark_scene  the light that a capture or a described scene gives to compare on
//! paper            the paper's experiments
//! table, page      rows for people and programs                      chart
//! ```
//!
//! Light is cell by cell, in camera units, ambient light removed: `c = T p`. Every
//! method gets the same rig and is judged by the same images.

pub mod acquisition;
pub mod benchmark;
pub mod benchmark_scene;
mod chart;
mod ground_truth;
pub mod inversion;
#[cfg(test)]
mod known_scene;
mod method;
pub mod page;
pub mod paper;
mod rig;
pub mod table;

pub use benchmark::Meter;
pub use ground_truth::{Errors, GroundTruth};
pub use inversion::albedo;
pub use method::{Acquired, Answer, Citation, Description, Projection, Unfit};
pub use rig::Rig;
