//! Out-of-focus projection, light of low frequency: every method behind a projector that is out of focus.

use super::live::LiveTransport;
use super::{Inversion, Inverted, KnownTransport};
use crate::rig::clear_dead;
use crate::{Answer, Description, Unfit};
use iltm_solve::blur;
use nalgebra::DMatrix;

/// A method that is given the transport `T B` of a projector out of focus, photographed
/// one light at a time with the rig's noise. A cell then gets more light from its
/// neighbours than of its own: `T B` is not diagonally dominant.
pub struct OutOfFocus {
    /// Standard deviation of the blur `B`, cells.
    pub deviation: f64,
    /// The method.
    pub method: Box<dyn Inversion>,
}

impl Inversion for OutOfFocus {
    fn description(&self) -> Description {
        let method = self.method.description();
        Description {
            name: format!("out of focus by {}: {}", self.deviation, method.name),
            source: method.source,
            how: "The same through a projector out of focus: light of low frequency, with a \
                transport that is not diagonally dominant. Inputs are clipped before the blur, so \
                that no method gets more contrast than the lens lets through.",
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let mut spread = blur(known.grid, self.deviation);
        clear_dead(&mut spread, known.live);
        let rig = known.rig.behind(&spread);
        let each = DMatrix::identity(spread.nrows(), spread.nrows());
        let transport = rig.clone().photograph(&each);
        let blurred = KnownTransport {
            transport: &transport,
            rig: &rig,
            ..known
        };
        let live = LiveTransport::new(&blurred)?;
        let others = strongest_others(&live.transport);
        let inverted = self.method.invert(blurred)?;
        let answer = inverted.answer;
        Ok(Inverted {
            // What a sharp projector would have to show for the same light.
            answer: Answer::Frames(Box::new(move |wanted| &spread * answer.shown(wanted))),
            remark: [
                &format!("up to {others:.1} times a cell's own light from others"),
                inverted.remark.as_str(),
            ]
            .into_iter()
            .filter(|words| !words.is_empty())
            .collect::<Vec<_>>()
            .join(", "),
            ..inverted
        })
    }
}

/// Most light that a cell gets from others' inputs, of what it gets from its own; below 1
/// the matrix is diagonally dominant.
fn strongest_others(transport: &DMatrix<f64>) -> f64 {
    let rows = transport.row_iter().enumerate();
    rows.map(|(cell, row)| row.lp_norm(1) / row[cell].abs() - 1.0)
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::super::{Bounded, Exact, Neumann, Tikhonov};
    use super::*;
    use crate::known_scene::KnownScene;
    use nalgebra::DVector;

    fn through(method: impl Inversion + 'static) -> OutOfFocus {
        OutOfFocus {
            deviation: 0.7,
            method: Box::new(method),
        }
    }

    /// Even light of half the brightness is within every lens's range, but for the
    /// border, where light falls beside the frame.
    #[test]
    fn light_that_the_lens_lets_through_is_shown_exactly() {
        let before = KnownScene::panels(9, 12);
        let input = DVector::from_fn(108, |cell, _| 0.5 + 0.2 * ((cell % 12) as f64 / 4.0).sin());
        let wanted = &before.transport * blur(before.grid, 0.7) * &input;
        let light = &before.transport * before.drive(&through(Exact), &wanted);
        assert!((light - &wanted).norm() < 1e-9 * wanted.norm());
    }

    #[test]
    fn the_series_diverges_and_bounds_beat_regularisation_beats_clipping() {
        let before = KnownScene::panels(9, 12);
        let truth = before.truth();
        let error = |method: OutOfFocus| {
            let inverted = method.invert(before.known()).unwrap();
            let errors = truth.judge(&inverted.answer);
            (errors.compensation, inverted.remark)
        };
        let (series, remark) = error(through(Neumann { order: 8 }));
        assert!(remark.contains("diverges"), "{remark}");
        let (clipped, _) = error(through(Exact));
        let (regularised, _) = error(through(Tikhonov));
        let (bounded, _) = error(through(Bounded));
        assert!(bounded < regularised && regularised < clipped && regularised < series);
    }
}
