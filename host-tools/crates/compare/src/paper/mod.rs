//! Reproduction of the paper's experiments, with intervals, and what came of its claims.
//!
//! Chu, Ng, Pahwa, Quek, Huang, *Compressive Inverse Light Transport* (BMVC 2011).
//!
//! ```text
//! scenes        the M-shaped panels, uniform and textured, as the paper's simulations
//! sparsity      Fig. 1: coefficients that hold the energy of T and of T^-1
//! feasible      Fig. 2: where Theorem 3.1 promises something
//! second_bounce Figs. 3 and 4: pictures
//! seeds         Fig. 4's comparison over many patterns, with intervals
//! complexity    time against cells and photographs
//! results       the page that shows all of it                    claims, sections
//! ```

mod claims;
mod complexity;
mod feasible;
mod results;
mod scenes;
mod second_bounce;
mod sections;
pub mod seeds;
mod sparsity;

pub use results::{PaperError, files};
pub use scenes::Condition;

/// A file to write: its name and its contents.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct File {
    /// Name, without folder.
    pub name: String,
    /// Contents.
    pub bytes: Vec<u8>,
}

impl File {
    /// A file of this name and with these contents.
    pub fn new(name: &str, contents: impl Into<Vec<u8>>) -> Self {
        Self {
            name: name.to_owned(),
            bytes: contents.into(),
        }
    }
}
