//! Hard cases: what must hold where the mathematics or the light is unkind.

pub mod capture;
pub mod closed_loop;
pub mod form_factors;
pub mod scene;
