//! Albedo from the gains of an inverse (inverse global illumination).
//!
//! Inverse global illumination (Yu, Debevec, Malik, Hawkins, *Inverse Global
//! Illumination: Recovering Reflectance Models of Real Scenes from Photographs*,
//! SIGGRAPH 1999) asks which albedo made the photographs, all bounces considered. The
//! inverse answers: `T^-1 = E^-1 (R^-1 - F)`, so that `g_i = 1 / (rho_i E_i)` has no
//! bounce in it, but for light of a cell that falls on the cell itself.
//!
//! Photographs never tell how bright the projector is: `E` is known up to one factor
//! `s`, and so is the albedo. Bounds on it: no albedo exceeds 1, and no cell receives
//! more than all light, `sum_j F_ij = s e_i sum_j K_ij <= 1`. A white reference of known
//! albedo in the scene settles it.

use super::gain_only::diagonal;
use super::live::LiveTransport;
use super::{Inversion, Inverted, KnownTransport};
use crate::{Citation, Description, Unfit};
use iltm_solve::inverted;
use nalgebra::{DMatrix, DVector};

/// Albedo of every cell up to one factor, as [`albedo`] finds it.
#[derive(Clone, PartialEq, Debug)]
pub struct Albedo {
    /// `rho_i s`, length `N`: each cell's albedo times the unknown factor of the
    /// irradiance. 0 for cells that are not live or whose gain is not positive.
    pub scaled: DVector<f64>,
    /// Least `s` for which no albedo exceeds 1.
    pub least: f64,
    /// Largest `s` for which no cell receives more than all light; infinite without
    /// light between cells. Below [`Self::least`] if noise or a wrong irradiance makes
    /// the two contradict each other.
    pub most: f64,
}

impl Albedo {
    /// Albedo with a factor of `scale`, length `N`.
    #[must_use]
    pub fn at(&self, scale: f64) -> DVector<f64> {
        &self.scaled / scale
    }

    /// The factor by which a cell has a known `albedo`; `None` if the cell has none that
    /// is found, or the albedo is not positive.
    #[must_use]
    pub fn scale_by_white(&self, cell: usize, albedo: f64) -> Option<f64> {
        let scale = self.scaled.get(cell)? / albedo;
        (scale.is_finite() && scale > 0.0).then_some(scale)
    }
}

/// The albedo that an `inverse` (`T^-1`, `N x N`, camera units; zero rows and columns of
/// cells without light) implies, for an `irradiance` of cells under white, length `N`,
/// in any unit; even if `None`.
///
/// # Panics
/// If sizes disagree.
#[must_use]
pub fn albedo(inverse: &DMatrix<f64>, irradiance: Option<&DVector<f64>>) -> Albedo {
    let cells = inverse.nrows();
    assert_eq!(inverse.ncols(), cells, "one row and one column a cell");
    let even = DVector::from_element(cells, 1.0);
    let irradiance = irradiance.unwrap_or(&even);
    assert_eq!(irradiance.len(), cells, "one irradiance a cell");
    let one = |cell: usize| {
        let light = inverse[(cell, cell)] * irradiance[cell];
        if light > 0.0 { light.recip() } else { 0.0 }
    };
    let scaled = DVector::from_fn(cells, |cell, _| one(cell));
    let received = |cell: usize| {
        let others = inverse[(cell, cell)] - inverse.row(cell).sum();
        irradiance[cell] * others
    };
    // Rounding of an inverse without light between cells is none.
    let lit = (0..cells).filter(|cell| scaled[*cell] > 0.0);
    let strongest = lit
        .map(|cell| (received(cell), 1e-12 / scaled[cell]))
        .filter(|(light, rounding)| light > rounding)
        .fold(0.0, |most: f64, (light, _)| most.max(light));
    Albedo {
        least: scaled.max(),
        most: strongest.recip(),
        scaled,
    }
}

/// Shows `p = d / (rho E)`: right if surfaces had their albedo but no light passed
/// between them.
#[derive(Clone, Copy, Debug)]
pub struct AlbedoAlone;

impl Inversion for AlbedoAlone {
    fn description(&self) -> Description {
        Description {
            name: "albedo alone, d / (rho E)".to_owned(),
            source: Citation {
                authors: "Yu, Debevec, Malik, Hawkins",
                title: "Inverse Global Illumination: Recovering Reflectance Models of Real Scenes \
                    from Photographs",
                venue: "SIGGRAPH",
                year: 1999,
            },
            how: "The diagonal of the inverse holds each cell's albedo with all bounces removed, \
                up to the projector's brightness. Not a way to compensate: shown with the gains \
                alone.",
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let live = LiveTransport::new(&known)?;
        let inverse = inverted(known.transport, known.live).ok_or(Unfit::Singular)?;
        let found = albedo(&inverse, None);
        let gains = DVector::from_fn(live.len(), |k, _| {
            let cell = live.chosen[k];
            inverse[(cell, cell)]
        });
        let darkest = live.chosen.iter().map(|cell| found.scaled[*cell]);
        let darkest = darkest.fold(f64::INFINITY, f64::min);
        let Albedo { least, most, .. } = found;
        let factor = if least <= most {
            format!("by a factor of {least:.2} to {most:.2}")
        } else {
            format!("by a factor that noise hides (at least {least:.2}, at most {most:.2})")
        };
        let remark =
            format!("albedo {darkest:.3} to {least:.3} if white is even, to be divided {factor}");
        Ok(diagonal(&live, &gains, remark))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::KnownScene;
    use iltm_runtime::Grid;
    use iltm_scene::coaxial::{CoaxialScene, Panels};

    fn scene() -> CoaxialScene {
        let grid = Grid::new(6, 8).unwrap();
        CoaxialScene::new(grid, &Panels::m_shape(grid, 75.0), 0.7).textured(0.25, 0.95, 1)
    }

    fn found(scene: &CoaxialScene, irradiance: Option<&DVector<f64>>) -> Albedo {
        let before = KnownScene::scene(scene);
        albedo(
            &inverted(&before.transport, &before.live).unwrap(),
            irradiance,
        )
    }

    #[test]
    fn under_even_light_a_white_reference_gives_every_albedo() {
        let scene = scene();
        let found = found(&scene, None);
        let scale = found.scale_by_white(5, scene.albedo[5]).unwrap();
        assert!((found.at(scale) - &scene.albedo).amax() < 1e-12);
    }

    #[test]
    fn light_that_falls_off_is_taken_out_when_it_is_known_in_any_unit() {
        let scene = scene().vignetted(0.5);
        let unit = 3.0;
        let found = found(&scene, Some(&(&scene.irradiance / unit)));
        assert!((found.at(unit) - &scene.albedo).amax() < 1e-12);
    }

    #[test]
    fn without_a_reference_the_factor_is_between_its_bounds() {
        let scene = scene();
        let found = found(&scene, None);
        assert!(found.least < 1.0 && 1.0 < found.most);
        assert!((found.least - scene.albedo.max()).abs() < 1e-12);
        let received = scene.form_factors.column_sum().max();
        assert!((found.most - received.recip()).abs() < 1e-9);
    }

    #[test]
    fn without_light_between_cells_only_one_bound_is_left() {
        let before = KnownScene::flat(3, 4);
        let inverse = inverted(&before.transport, &before.live).unwrap();
        let found = albedo(&inverse, None);
        assert!(found.most.is_infinite());
        assert!((&found.scaled - before.transport.diagonal()).amax() < 1e-12);
        assert_eq!(found.scale_by_white(1, 0.9), None);
    }
}
