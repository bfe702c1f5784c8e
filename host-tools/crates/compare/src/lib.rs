//! The paper, its relatives and this project's way on the same light.
//!
//! ```text
//! rig           a projector and a camera before a scene whose transport is known
//! truth         what an answer is judged by                       errors
//! source        where a method comes from
//! answer        what a method finds: transport, an inverse, a way to project
//! acquisition   ways to photograph                                  one file a method
//! inversion     ways to invert or to solve frame by frame           one file a method
//! contest       every method once: photographs, time, memory, errors
//! meter         memory that a method held
//! light         the light that a capture or a described scene gives to compare on
//! paper         the paper's experiments
//! table, page   rows for people and programs                        chart
//! ```
//!
//! Light is cell by cell, in camera units, ambient light removed: `c = T p`. Every
//! method gets the same rig and is judged by the same images.

pub mod acquisition;
mod answer;
mod chart;
pub mod contest;
pub mod inversion;
pub mod light;
mod meter;
pub mod page;
pub mod paper;
mod rig;
mod source;
pub mod table;
mod truth;

pub use answer::{Answer, Found, Project, Unfit};
pub use inversion::albedo;
pub use meter::Meter;
pub use rig::Rig;
pub use source::Source;
pub use truth::{Errors, Truth};
