//! From a described scene to the photographs that a camera would take of it.

pub mod exchange;
pub mod form_factor;
pub mod geometry;
