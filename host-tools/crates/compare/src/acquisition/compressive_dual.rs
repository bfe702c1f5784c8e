//! Compressive dual photography, decoded greedily as its authors do.

use super::Acquisition;
use super::sensing::Sensing;
use crate::{Found, Rig, Source, Unfit};
use iltm_picture::progress::Progress;
use rayon::prelude::*;

/// Sen and Darabi's paper, which two ways to photograph share: this greedy one and the
/// solver's two-stage method by l1.
pub(super) const SEN_DARABI: Source = Source {
    authors: "Sen, Darabi",
    title: "Compressive Dual Photography",
    venue: "Computer Graphics Forum (Eurographics)",
    year: 2009,
};

/// Bernoulli patterns, each row of the doubly transformed transport by regularised
/// orthogonal matching pursuit on its own.
///
/// The paper transforms the projector's side; the camera's side as well is what the
/// comparison asks for, and what makes rows sparse together. Its number of coefficients
/// is set by hand; here photographs held out choose it row by row.
#[derive(Clone, Copy, Debug)]
pub struct CompressiveDual {
    photographs: usize,
    seed: u64,
}

impl CompressiveDual {
    /// On so many photographs, white among them; `seed` chooses the patterns.
    #[must_use]
    pub const fn new(photographs: usize, seed: u64) -> Self {
        Self { photographs, seed }
    }
}

impl Acquisition for CompressiveDual {
    fn name(&self) -> String {
        format!("compressive dual photography by ROMP, {}", self.photographs)
    }

    fn source(&self) -> Source {
        SEN_DARABI
    }

    fn how(&self) -> &'static str {
        "White and Bernoulli photographs; each row of the transport, Haar-coded on both sides, \
         is built up coefficient by coefficient, those first that explain most (regularised \
         orthogonal matching pursuit); then the transport is inverted."
    }

    fn acquire(&self, rig: &mut Rig, _progress: &dyn Progress) -> Result<Found, Unfit> {
        let sensing = Sensing::take(rig, self.photographs, self.seed)?;
        let rows = 0..rig.grid().cells();
        let responses: Vec<_> = rows
            .into_par_iter()
            .map(|row| sensing.decode(row, &[]))
            .collect();
        Ok(Found::Forward(sensing.transport(&responses, rig.live())))
    }
}
