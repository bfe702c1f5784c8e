//! Table of the hard cases: all of them, by what is hard.

mod coverage;
mod grids;
mod numbers;
mod optics;
mod photographs;
mod sampling;
mod transport;

use super::case::Case;

/// Every case with the heading it belongs under.
pub fn all() -> Vec<(&'static str, Vec<Case>)> {
    vec![
        ("Strong and singular transport", transport::CASES.to_vec()),
        (
            "Cells that take no part, or only in part",
            coverage::CASES.to_vec(),
        ),
        ("Optics", optics::CASES.to_vec()),
        ("Noise and number of photographs", sampling::CASES.to_vec()),
        ("Grids", grids::CASES.to_vec()),
        ("Photographs", photographs::CASES.to_vec()),
        ("Numbers that are none", numbers::CASES.to_vec()),
    ]
}
