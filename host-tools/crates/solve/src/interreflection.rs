//! Interreflection operators `K`, `N x N`: what each cell gets from the light of the others.
//!
//! An operator holds every element, or [`Links`] between blocks of cells and cells where those
//! are fewer by far. Whoever applies it, adds or scales it, or asks for its Haar coefficients
//! need not know which.

use super::forward::product;
use super::haar::Haar;
use super::links::Links;
use iltm_runtime::Grid;
use nalgebra::{DMatrix, DVector};
use std::ops::{Add, Mul, MulAssign};

/// An interreflection operator `K`, `N x N`.
#[derive(Clone, Debug)]
pub enum Interreflection {
    /// Every element.
    Dense(DMatrix<f64>),
    /// What cells get from blocks of cells.
    Links(Links),
}

/// An element of `W^T K W`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Coefficient {
    /// Output function, by the numbers of [`Haar`].
    pub row: u32,
    /// Input function.
    pub col: u32,
    /// The element, in the units of `K`.
    pub value: f64,
}

impl Interreflection {
    /// `K` of a scene without interreflection.
    #[must_use]
    pub fn none(grid: Grid) -> Self {
        Self::Links(Links::none(grid))
    }

    /// `N`.
    #[must_use]
    pub fn cells(&self) -> usize {
        match self {
            Self::Dense(elements) => elements.nrows(),
            Self::Links(links) => links.cells(),
        }
    }

    /// Every element, `N x N`.
    #[must_use]
    pub fn dense(&self) -> DMatrix<f64> {
        match self {
            Self::Dense(elements) => elements.clone(),
            Self::Links(links) => links.dense(),
        }
    }

    /// Multiplies what each cell gets by a factor of the cell.
    pub(super) fn scale_rows(&mut self, factors: &[f64]) {
        match self {
            Self::Dense(elements) => {
                for (mut row, factor) in elements.row_iter_mut().zip(factors) {
                    row *= *factor;
                }
            }
            Self::Links(links) => links.scale_rows(factors),
        }
    }

    /// `K^T`.
    pub(super) fn transpose(&self) -> Self {
        match self {
            Self::Dense(elements) => Self::Dense(elements.transpose()),
            Self::Links(links) => Self::Links(links.transpose()),
        }
    }

    /// Whether no cell gets any light.
    #[must_use]
    pub fn is_none(&self) -> bool {
        match self {
            Self::Dense(elements) => elements.iter().all(|element| *element == 0.0),
            Self::Links(links) => links.is_none(),
        }
    }

    /// Whether every element is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        match self {
            Self::Dense(elements) => elements.iter().all(|element| element.is_finite()),
            Self::Links(links) => links.is_finite(),
        }
    }

    /// The elements of `W^T K W` but those of less than 1e-12 of the largest, which are the
    /// rounding of the transform itself, in no particular order.
    ///
    /// # Panics
    /// If the basis is that of a smaller grid.
    #[must_use]
    pub fn haar_coefficients(&self, haar: &Haar) -> Vec<Coefficient> {
        let mut found = match self {
            Self::Dense(elements) => {
                let transformed = haar.analyse_operator(elements);
                let mut found = Vec::with_capacity(transformed.len());
                for (col, column) in transformed.column_iter().enumerate() {
                    for (row, value) in column.iter().enumerate() {
                        found.push(Coefficient {
                            row: row as u32,
                            col: col as u32,
                            value: *value,
                        });
                    }
                }
                found
            }
            Self::Links(links) => links.haar_coefficients(),
        };
        let largest = found
            .iter()
            .fold(0.0_f64, |most, c| most.max(c.value.abs()));
        found.retain(|coefficient| coefficient.value.abs() > 1e-12 * largest);
        found
    }

    /// Without the rows and columns of cells that did not take part.
    pub(super) fn of_live(self, live: &[bool]) -> Self {
        if live.contains(&false) {
            self.between(live, live)
        } else {
            self
        }
    }

    /// The rows of the cells `to` and the columns of the cells `from` of it, the others zero.
    #[must_use]
    pub(super) fn between(&self, to: &[bool], from: &[bool]) -> Self {
        match self {
            Self::Dense(elements) => Self::Dense(DMatrix::from_fn(
                elements.nrows(),
                elements.ncols(),
                |row, col| {
                    if to[row] && from[col] {
                        elements[(row, col)]
                    } else {
                        0.0
                    }
                },
            )),
            Self::Links(links) => Self::Links(links.between(to, from)),
        }
    }
}

impl From<DMatrix<f64>> for Interreflection {
    fn from(elements: DMatrix<f64>) -> Self {
        Self::Dense(elements)
    }
}

/// The light that arrives, a column each.
impl Mul<&DMatrix<f64>> for &Interreflection {
    type Output = DMatrix<f64>;

    fn mul(self, light: &DMatrix<f64>) -> DMatrix<f64> {
        match self {
            Interreflection::Dense(elements) => product(elements, light),
            Interreflection::Links(links) => links.apply(light),
        }
    }
}

impl Mul<&DVector<f64>> for &Interreflection {
    type Output = DVector<f64>;

    fn mul(self, light: &DVector<f64>) -> DVector<f64> {
        let light = DMatrix::from_column_slice(light.len(), 1, light.as_slice());
        (self * &light).column(0).into_owned()
    }
}

impl Mul<f64> for &Interreflection {
    type Output = Interreflection;

    fn mul(self, factor: f64) -> Interreflection {
        let mut scaled = self.clone();
        scaled *= factor;
        scaled
    }
}

impl MulAssign<f64> for Interreflection {
    fn mul_assign(&mut self, factor: f64) {
        match self {
            Self::Dense(elements) => *elements *= factor,
            Self::Links(links) => links.scale(factor),
        }
    }
}

impl Add for &Interreflection {
    type Output = Interreflection;

    fn add(self, other: Self) -> Interreflection {
        match (self, other) {
            (Interreflection::Links(a), Interreflection::Links(b)) => {
                Interreflection::Links(a.plus(b))
            }
            (a, b) => Interreflection::Dense(a.dense() + b.dense()),
        }
    }
}
