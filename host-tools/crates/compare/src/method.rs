//! Compensation methods: where one comes from, what it does, and what it finds.

use iltm_solve::inverted;
use nalgebra::{DMatrix, DVector};
use std::fmt;
use thiserror::Error;

/// A publication.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Citation {
    /// Family names.
    pub authors: &'static str,
    /// Title.
    pub title: &'static str,
    /// Where it appeared.
    pub venue: &'static str,
    /// When.
    pub year: u16,
}

impl Citation {
    /// The paper that this project follows.
    pub const THE_PAPER: Self = Self {
        authors: "Chu, Ng, Pahwa, Quek, Huang",
        title: "Compressive Inverse Light Transport",
        venue: "BMVC",
        year: 2011,
    };
    /// Bounces from the inverse of a transport that is measured one light at a time.
    pub const INVERSE_LIGHT_TRANSPORT: Self = Self {
        authors: "Seitz, Matsushita, Kutulakos",
        title: "A Theory of Inverse Light Transport",
        venue: "ICCV",
        year: 2005,
    };
}

impl fmt::Display for Citation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            authors,
            title,
            venue,
            year,
        } = self;
        write!(f, "{authors}: {title}. {venue}, {year}")
    }
}

/// What is said of a method beside its numbers.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Description {
    /// Its name in tables.
    pub name: String,
    /// Where it comes from.
    pub source: Citation,
    /// What it does, a sentence or two, with what it needs that others do not.
    pub how: &'static str,
}

/// What a way to photograph ends with.
#[derive(Clone, Debug)]
pub enum Acquired {
    /// Forward transport `T`, `N x N`.
    Forward(DMatrix<f64>),
    /// Inverse transport `T^-1`, `N x N`.
    Inverse(DMatrix<f64>),
}

impl Acquired {
    /// `T^-1` between `live` cells, `N x N`; `None` if there is none.
    pub(crate) fn inverse(self, live: &[bool]) -> Option<DMatrix<f64>> {
        match self {
            Self::Forward(transport) => inverted(&transport, live),
            Self::Inverse(inverse) => Some(inverse),
        }
    }
}

/// The projector's input, length `N`, relative to its white, for wanted light in camera
/// units, length `N`. What is outside 0 to 1 will be clipped.
pub type Projection = dyn Fn(&DVector<f64>) -> DVector<f64>;

/// A way to project wanted light.
pub enum Answer {
    /// `p = M d`: a matrix `N x N` that is applied to every frame.
    Inverse(DMatrix<f64>),
    /// Work that depends on the frame.
    Frames(Box<Projection>),
}

impl fmt::Debug for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Inverse(_) => "Inverse",
            Self::Frames(_) => "Frames",
        })
    }
}

impl Answer {
    /// The projector's input for wanted light, both length `N`, before it is clipped.
    pub(crate) fn input(&self, wanted: &DVector<f64>) -> DVector<f64> {
        match self {
            Self::Inverse(matrix) => matrix * wanted,
            Self::Frames(project) => project(wanted),
        }
    }

    /// What a projector shows for wanted light, both length `N`: clipped to 0 to 1, and
    /// no light where the answer is not a number.
    #[must_use]
    pub fn shown(&self, wanted: &DVector<f64>) -> DVector<f64> {
        self.input(wanted)
            .map(|p| if p > 0.0 { p.min(1.0) } else { 0.0 })
    }
}

/// Why a method gives no answer for this scene.
#[derive(Clone, PartialEq, Debug, Error)]
pub enum Unfit {
    /// The method's own condition is not met.
    #[error("{0}")]
    Condition(String),
    /// What it found has no inverse.
    #[error("what it found has no inverse")]
    Singular,
    /// The project's own solver refused.
    #[error(transparent)]
    Solve(#[from] iltm_solve::SolveError),
}
