//! Gains alone: compensation without interreflection, and none at all, what every method should beat.

use super::live::LiveTransport;
use super::{Inversion, Inverted, KnownTransport};
use crate::{Citation, Description, Unfit};
use nalgebra::{DMatrix, DVector};

/// `p = d / flood`: each cell and channel for itself, from one photograph of white.
#[derive(Clone, Copy, Debug)]
pub struct FloodGain;

/// `p = s d` with one `s` for all cells, the one that shows white best.
#[derive(Clone, Copy, Debug)]
pub struct Uncompensated;

const SOURCE: Citation = Citation {
    authors: "Nayar, Peri, Grossberg, Belhumeur",
    title: "A Projection System with Radiometric Compensation for Screen Imperfections",
    venue: "PROCAMS",
    year: 2003,
};

impl Inversion for FloodGain {
    fn description(&self) -> Description {
        Description {
            name: "gain of each cell, d / flood".to_owned(),
            source: SOURCE,
            how: "Divides by the light in one photograph of white, cell by cell, as if no cell lit \
                another: right for what white shows, wrong for all else. The floor for methods \
                that know about light between cells.",
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let live = LiveTransport::new(&known)?;
        let flood = flood(&known, &live)?;
        let remark = "one photograph of white in all".to_owned();
        Ok(diagonal(&live, &flood.map(f64::recip), remark))
    }
}

impl Inversion for Uncompensated {
    fn description(&self) -> Description {
        Description {
            name: "no compensation".to_owned(),
            source: SOURCE,
            how: "Shows the picture as it is; one factor takes the camera's unit to the \
                projector's.",
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let live = LiveTransport::new(&known)?;
        let flood = live.transport.column_sum();
        // Least squares of s * flood against even light.
        let factor = flood.sum() / flood.norm_squared();
        if !factor.is_finite() {
            return Err(Unfit::Condition("white shows no light".to_owned()));
        }
        let gain = DVector::from_element(live.len(), factor);
        Ok(diagonal(&live, &gain, format!("factor {factor:.3}")))
    }
}

/// Light of each live cell in one photograph of white. Not from the transport: a sum of
/// its columns has the noise of them all.
///
/// # Errors
/// [`Unfit::Condition`] if some cell shows none.
pub(super) fn flood(
    known: &KnownTransport<'_>,
    live: &LiveTransport,
) -> Result<DVector<f64>, Unfit> {
    let white = DMatrix::from_element(known.live.len(), 1, 1.0);
    let white = known.rig.clone().photograph(&white);
    let flood = white.column(0).select_rows(&live.chosen);
    live.positive(flood, "under white")
}

/// The answer `p_i = gain_i d_i`.
pub(super) fn diagonal(live: &LiveTransport, gain: &DVector<f64>, remark: String) -> Inverted {
    Inverted::matrix(
        live.whole(&DMatrix::from_diagonal(gain)),
        live.len() as f64,
        remark,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::KnownScene;

    /// Even light on a sphere needs `(1 - r) / r` whatever the method.
    #[test]
    fn even_light_is_right_without_knowing_of_interreflection() {
        let before = KnownScene::sphere(3, 4, 0.6);
        let even = DVector::from_element(12, 0.9);
        for drive in [
            before.drive(&FloodGain, &even),
            before.drive(&Uncompensated, &even),
        ] {
            assert!(drive.iter().all(|p| (p - 0.6).abs() < 1e-12), "{drive}");
        }
    }
}
