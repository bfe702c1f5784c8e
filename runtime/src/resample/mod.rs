//! Resampling between a frame's pixels and the grid's cells.
//!
//! A frame larger than the grid is compensated as
//! `p(x) = g(x) d'(x) - (U K A d')(x)`: `A` averages the pixels of each cell
//! ([`area`]), `U` interpolates the corrections back ([`interpolation`]). The
//! grid is laid over the whole frame, so a cell's border may cut a pixel; both
//! directions account for that in integers, and frame and grid may be of any
//! sizes.

pub mod area;
pub mod interpolation;
