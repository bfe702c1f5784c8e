//! Ground truth: the scene itself, which answers are judged by.

use super::Answer;
use crate::rig::clear_dead;
use iltm_runtime::Grid;
use iltm_solve::{inverted, wanted_images};
use nalgebra::{DMatrix, DVector};

/// A scene's transport, its inverse, and images to show in it.
#[derive(Clone, Debug)]
pub struct GroundTruth {
    /// Cells of the projector.
    pub grid: Grid,
    /// Cells that are lit and seen, length `N`.
    pub live: Vec<bool>,
    /// `T`, `N x N`, camera units; zero rows and columns of cells that are not live.
    pub transport: DMatrix<f64>,
    /// `T^-1` between live cells, zero elsewhere. Where projectors overlap there is no one inverse, and it
    /// is that which shares the light.
    pub inverse: DMatrix<f64>,
    /// Whether projectors overlap, so that answers are judged by what they show alone.
    pub overlap: bool,
    /// Brightest even grey that every live cell reaches, camera units.
    pub white: f64,
    /// Wanted images, `N x n`, camera units.
    pub images: DMatrix<f64>,
    /// Second bounce under flood light, length `N`.
    pub second_bounce: DVector<f64>,
}

/// How far an answer is from the truth; all relative.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Errors {
    /// `||M - T^-1|| / ||T^-1||`, Frobenius; `None` of what is no matrix.
    pub inverse: Option<f64>,
    /// Error of the second bounce under flood light; `None` of what is no matrix.
    pub second_bounce: Option<f64>,
    /// Mean over images of `||T clip(p) - d|| / ||d||`, inputs clipped to 0 to 1.
    pub compensation: f64,
}

impl GroundTruth {
    /// The truth about a scene of `transport`; `None` if it has no inverse between live
    /// cells, or no brightness.
    #[must_use]
    pub fn new(grid: Grid, transport: DMatrix<f64>, live: Vec<bool>) -> Option<Self> {
        let inverse = inverted(&transport, &live)?;
        let images = wanted_images(grid);
        let mut truth = Self::with((grid, transport, live), inverse, images)?;
        truth.second_bounce = truth.second_bounce_by(&truth.inverse, &truth.flood());
        Some(truth)
    }

    /// The same of projectors that overlap, with an `inverse` that shares the light and wanted images of
    /// which overlapping cells have the same, `N x n`, 0 to 1.
    #[must_use]
    pub fn of_overlapping(
        (grid, transport, live): (Grid, DMatrix<f64>, Vec<bool>),
        inverse: DMatrix<f64>,
        images: DMatrix<f64>,
    ) -> Option<Self> {
        let truth = Self::with((grid, transport, live), inverse, images)?;
        Some(Self {
            overlap: true,
            ..truth
        })
    }

    fn with(
        (grid, mut transport, live): (Grid, DMatrix<f64>, Vec<bool>),
        inverse: DMatrix<f64>,
        mut images: DMatrix<f64>,
    ) -> Option<Self> {
        clear_dead(&mut transport, &live);
        let drive = inverse.column_sum().max();
        if !(drive.is_finite() && drive > 0.0) {
            return None;
        }
        let white = drive.recip();
        images *= white;
        for (mut row, live) in images.row_iter_mut().zip(&live) {
            if !live {
                row.fill(0.0);
            }
        }
        Some(Self {
            grid,
            live,
            transport,
            inverse,
            overlap: false,
            white,
            images,
            second_bounce: DVector::zeros(grid.cells()),
        })
    }

    /// How many cells are lit and seen.
    #[must_use]
    pub fn live_cells(&self) -> usize {
        self.live.iter().filter(|live| **live).count()
    }

    /// Light under white, length `N`.
    #[must_use]
    pub fn flood(&self) -> DVector<f64> {
        self.transport.column_sum()
    }

    /// The second bounce of light `l`, by an inverse `M` (the paper's Eq. 17): with
    /// `A = F1 M` and `F1 = diag(M)^-1`, the first bounce is `A l`, the second
    /// `A (l - A l)`.
    #[must_use]
    pub fn second_bounce_by(&self, inverse: &DMatrix<f64>, light: &DVector<f64>) -> DVector<f64> {
        let first = |light: &DVector<f64>| {
            let mut lit = inverse * light;
            for (cell, value) in lit.iter_mut().enumerate() {
                let gain = inverse[(cell, cell)];
                *value = if self.live[cell] && gain != 0.0 {
                    *value / gain
                } else {
                    0.0
                };
            }
            lit
        };
        first(&(light - first(light)))
    }

    /// How far an answer is off.
    #[must_use]
    pub fn judge(&self, answer: &Answer) -> Errors {
        let error = |wanted: DVector<f64>| {
            (&self.transport * answer.shown(&wanted) - &wanted).norm() / wanted.norm()
        };
        let images = self.images.column_iter();
        let sum: f64 = images.map(|image| error(image.into_owned())).sum();
        let matrix = match answer {
            Answer::Inverse(matrix) => Some(matrix).filter(|_| !self.overlap),
            Answer::Frames(_) => None,
        };
        Errors {
            inverse: matrix.map(|matrix| (matrix - &self.inverse).norm() / self.inverse.norm()),
            second_bounce: matrix.map(|matrix| self.second_bounce_error(matrix)),
            compensation: sum / self.images.ncols() as f64,
        }
    }

    /// Error of the second bounce that an inverse finds in the flood light, relative to
    /// the true second bounce; 0 where there is none and none is found.
    #[must_use]
    pub fn second_bounce_error(&self, inverse: &DMatrix<f64>) -> f64 {
        let found = self.second_bounce_by(inverse, &self.flood());
        let off = (found - &self.second_bounce).norm();
        if off == 0.0 {
            0.0
        } else {
            off / self.second_bounce.norm()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::KnownScene;
    use iltm_scene::coaxial::{CoaxialScene, Panels};

    fn truth() -> GroundTruth {
        KnownScene::panels(6, 8).truth()
    }

    #[test]
    fn the_truth_itself_errs_by_no_more_than_clipping() {
        let truth = truth();
        let errors = truth.judge(&Answer::Inverse(truth.inverse.clone()));
        assert_eq!(errors.inverse, Some(0.0));
        assert_eq!(errors.second_bounce, Some(0.0));
        assert!(errors.compensation < 0.02, "{errors:?}");
    }

    #[test]
    fn light_on_cells_that_are_not_live_is_nobodys_error() {
        let whole = truth();
        let mut live = whole.live.clone();
        live[3] = false;
        let inverse = inverted(&whole.transport, &live).unwrap();
        let (grid, transport, images) = (whole.grid, whole.transport, wanted_images(whole.grid));
        let light = (grid, transport, live);
        let truth = GroundTruth::of_overlapping(light, inverse.clone(), images).unwrap();
        let errors = truth.judge(&Answer::Inverse(inverse));
        assert!(errors.compensation < 0.02, "{errors:?}");
        assert_eq!((errors.inverse, errors.second_bounce), (None, None));
    }

    /// `T = (I - R F)^-1 R E`: the second bounce under white is `R F R E 1`.
    #[test]
    fn the_second_bounce_is_that_of_the_radiosity_series() {
        let truth = truth();
        let grid = truth.grid;
        let scene = CoaxialScene::new(grid, &Panels::m_shape(grid, 75.0), 0.7);
        let first = scene.albedo.component_mul(&scene.irradiance);
        let second = (&scene.form_factors * first).component_mul(&scene.albedo);
        assert!((&truth.second_bounce - &second).norm() < 1e-12 * second.norm());
    }

    #[test]
    fn showing_nothing_errs_by_all_of_the_light() {
        let nothing = Answer::Frames(Box::new(|wanted| wanted * 0.0));
        let errors = truth().judge(&nothing);
        assert!((errors.compensation - 1.0).abs() < 1e-12);
        assert_eq!(errors.inverse, None);
    }
}
