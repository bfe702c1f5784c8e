//! Haar-domain pruning, for few multiplications a frame: the frame's own largest coefficients, or the
//! operator's most useful elements.

use super::live::LiveTransport;
use super::wavelet_inverse::haar_multiplications;
use super::{Inversion, Inverted, KnownTransport};
use crate::rig::clear_dead;
use crate::{Answer, Citation, Description, Unfit};
use iltm_solve::{Haar, inverted, natural_images};
use nalgebra::{DMatrix, DVector};

/// The largest Haar coefficients of each frame go through the operator's columns.
#[derive(Clone, Copy, Debug)]
pub struct LargestInputs {
    /// Coefficients of a frame.
    pub count: usize,
}

/// The operator keeps the elements with the largest `|K^_ij| sigma_j`, `sigma_j` the
/// size of a coefficient in natural images; the same for all frames.
#[derive(Clone, Copy, Debug)]
pub struct StoredElements {
    /// As many elements as so many whole columns have: the multiplications of
    /// [`LargestInputs`] with this count.
    pub columns: usize,
}

/// `T^-1 = diag(g) - W K^ W^T`.
struct Coded {
    gain: DVector<f64>,
    operator: DMatrix<f64>,
    haar: Haar,
}

impl Coded {
    fn new(known: &KnownTransport<'_>) -> Result<Self, Unfit> {
        let inverse = inverted(known.transport, known.live).ok_or(Unfit::Singular)?;
        let gain = inverse.diagonal();
        let haar = Haar::new(known.grid);
        let operator = haar.analyse_operator(&(DMatrix::from_diagonal(&gain) - inverse));
        Ok(Self {
            gain,
            operator,
            haar,
        })
    }

    /// Elements of the operator that are more than rounding.
    fn stored(&self) -> usize {
        let rounding = 1e-12 * self.operator.amax();
        self.operator.iter().filter(|v| v.abs() > rounding).count()
    }

    /// Multiplications of so many whole columns.
    fn columns(&self, count: usize) -> usize {
        let cells = self.gain.len();
        (count.min(cells) * self.stored()).div_ceil(cells)
    }

    /// The input for `wanted` light by its `count` largest coefficients.
    fn project(&self, wanted: &DVector<f64>, count: usize) -> DVector<f64> {
        let coefficients = self.haar.analyse(wanted);
        let mut order: Vec<usize> = (0..coefficients.len()).collect();
        let size = |k: usize| coefficients[k].abs();
        order.sort_by(|a, b| size(*b).total_cmp(&size(*a)));
        let mut light = DVector::zeros(coefficients.len());
        for k in &order[..count] {
            light.axpy(coefficients[*k], &self.operator.column(*k), 1.0);
        }
        self.gain.component_mul(wanted) - self.haar.synthesise(&light)
    }
}

impl Inversion for LargestInputs {
    fn description(&self) -> Description {
        Description {
            name: format!("largest {} Haar coefficients of the frame", self.count),
            source: Citation {
                authors: "Ng, Ramamoorthi, Hanrahan",
                title: "All-Frequency Shadows Using Non-Linear Wavelet Lighting Approximation",
                venue: "ACM Transactions on Graphics (SIGGRAPH)",
                year: 2003,
            },
            how: "Gains for each cell; only the frame's largest Haar coefficients go through the \
                operator, each with its whole column. The operator is stored whole, and the \
                largest have to be looked for in every frame.",
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let live = LiveTransport::new(&known)?;
        let coded = Coded::new(&known)?;
        let cells = known.live.len();
        let fixed = live.len() as f64 + haar_multiplications(cells);
        let count = self.count.min(cells);
        let lit = DVector::from_fn(cells, |cell, _| f64::from(u8::from(known.live[cell])));
        Ok(Inverted {
            multiplications: Some(fixed + coded.columns(self.count) as f64),
            photographs: 0,
            remark: format!("{} elements stored", coded.stored()),
            answer: Answer::Frames(Box::new(move |wanted| {
                coded.project(wanted, count).component_mul(&lit)
            })),
        })
    }
}

impl Inversion for StoredElements {
    fn description(&self) -> Description {
        Description {
            name: format!("stored elements, as many as {} columns", self.columns),
            source: Citation::THE_PAPER,
            how: "Gains for each cell; of the operator in Haar only the elements that matter most \
                in natural images are stored (this project's tables). Which they are is settled \
                before the show, so that a frame is one sparse product.",
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let live = LiveTransport::new(&known)?;
        let coded = Coded::new(&known)?;
        let kept = coded.columns(self.columns);
        let Coded {
            gain,
            operator,
            haar,
        } = coded;
        let content = haar.analyse_columns(&natural_images(known.grid));
        let cells = known.live.len();
        let value = |place: usize| operator.as_slice()[place];
        let worth: Vec<f64> = (0..cells * cells)
            .map(|place| value(place).abs() * content.row(place / cells).norm())
            .collect();
        let mut places: Vec<usize> = (0..cells * cells).filter(|k| worth[*k] > 0.0).collect();
        places.sort_by(|a, b| worth[*b].total_cmp(&worth[*a]).then(a.cmp(b)));
        places.truncate(kept);
        let mut stored = DMatrix::zeros(cells, cells);
        for place in &places {
            stored[(place % cells, place / cells)] = value(*place);
        }
        let mut matrix = DMatrix::from_diagonal(&gain) - haar.synthesise_operator(&stored);
        clear_dead(&mut matrix, known.live);
        let fixed = live.len() as f64 + haar_multiplications(cells);
        Ok(Inverted::matrix(
            matrix,
            fixed + places.len() as f64,
            format!("{} elements stored", places.len()),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::KnownScene;

    #[test]
    fn with_everything_kept_both_are_the_inverse() {
        let before = KnownScene::textured(5, 7);
        assert!(before.error(&StoredElements { columns: 35 }) < 1e-12);
        let wanted = DVector::from_fn(35, |cell, _| 0.2 + 0.1 * ((cell * 7) % 5) as f64);
        let exact = inverted(&before.transport, &before.live).unwrap() * &wanted;
        let drive = before.drive(&LargestInputs { count: 35 }, &wanted);
        assert!((drive - &exact).norm() < 1e-12 * exact.norm());
    }

    /// An even picture is one coefficient.
    #[test]
    fn one_coefficient_is_enough_for_an_even_picture() {
        let before = KnownScene::panels(5, 7);
        let even = DVector::from_element(35, 0.4);
        let drive = before.drive(&LargestInputs { count: 1 }, &even);
        assert!((&before.transport * drive - &even).norm() < 1e-12);
    }

    #[test]
    fn more_elements_show_natural_images_better() {
        let before = KnownScene::panels(8, 12);
        let truth = before.truth();
        let error = |method: &dyn Inversion| truth.judge(&before.answer(method)).compensation;
        assert!(error(&StoredElements { columns: 16 }) < error(&StoredElements { columns: 0 }));
        assert!(error(&LargestInputs { count: 32 }) < error(&LargestInputs { count: 4 }));
    }

    /// What is known of images beforehand is worth more than what one image shows.
    #[test]
    fn at_equal_multiplications_stored_elements_show_natural_images_better() {
        let before = KnownScene::panels(8, 12);
        let truth = before.truth();
        let cost = |method: &dyn Inversion| {
            let found = method.invert(before.known()).unwrap();
            let error = truth.judge(&found.answer).compensation;
            (found.multiplications, error)
        };
        let (whole, few) = (
            cost(&LargestInputs { count: 16 }),
            cost(&StoredElements { columns: 16 }),
        );
        assert_eq!(whole.0, few.0);
        assert!(few.1 < whole.1, "{few:?} {whole:?}");
    }
}
