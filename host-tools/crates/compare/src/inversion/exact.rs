//! The inverse itself.

use super::{Inversion, Inverted, Known};
use crate::{Answer, Source, Unfit};
use iltm_picture::progress::Progress;
use iltm_solve::inverted;

/// `T^-1` by LU factorisation.
#[derive(Clone, Copy, Debug)]
pub struct Exact;

impl Inversion for Exact {
    fn name(&self) -> String {
        "exact inverse".to_owned()
    }

    fn source(&self) -> Source {
        Source {
            authors: "Golub, Van Loan",
            title: "Matrix Computations, section 3.2",
            venue: "Johns Hopkins University Press",
            year: 2013,
        }
    }

    fn how(&self) -> &'static str {
        "LU factorisation of the transport between live cells: O(N^3) once, O(N^2) a frame."
    }

    fn invert(&self, known: Known<'_>, _progress: &dyn Progress) -> Result<Inverted, Unfit> {
        let inverse = inverted(known.transport, known.live).ok_or(Unfit::Singular)?;
        let live = known.live.iter().filter(|live| **live).count() as f64;
        Ok(Inverted {
            answer: Answer::Inverse(inverse),
            multiplications: Some(live * live),
            photographs: 0,
            remark: String::new(),
        })
    }
}
