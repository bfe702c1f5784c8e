//! Hard cases: what must hold where the light or the mathematics is unkind.
//!
//! ```text
//! photographs            what a camera sees of a scene (`iltm::scene::coaxial`)
//! observations           what a solver is given of it
//! closed_loop, theory    the error on the wall, and the one that theory allows
//! case, cases, page      the cases and the page that lists them
//! ```

pub mod case;
pub mod cases;
pub mod closed_loop;
pub mod observations;
pub mod page;
pub mod photographs;
pub mod theory;

use iltm_runtime::Grid;

/// Rows and columns of most cases: the paper's.
pub const GRID: (u16, u16) = (13, 21);

/// A grid of that size.
pub fn grid((rows, cols): (u16, u16)) -> Grid {
    crate::grid(rows, cols)
}
