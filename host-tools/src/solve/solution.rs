//! What a method found, in units of [`Prepared`](super::prepare::Prepared).

use super::convergence::Convergence;
use super::forward::Inverse;
use super::inverse::{ChannelInverse, InverseTransport};
use super::observed::Observed;
use super::prepare::Prepared;
use nalgebra::{DMatrix, DVector};

#[derive(Debug)]
pub(super) struct Solution {
    /// The operator that all channels share, zero diagonal.
    pub(super) shared: DMatrix<f64>,
    pub(super) channels: Vec<Channel>,
    /// Non-zero Haar coefficients of the operators as solved for.
    pub(super) coefficients: usize,
    pub(super) convergence: Convergence,
}

/// One channel of a [`Solution`]; its operator is `scale * shared + deviation`.
#[derive(Debug)]
pub(super) struct Channel {
    pub(super) gain: DVector<f64>,
    pub(super) scale: f64,
    pub(super) deviation: Option<DMatrix<f64>>,
}

impl Solution {
    pub(super) fn inverses(&self) -> Vec<Inverse> {
        let inverse = |channel: &Channel| {
            let mut operator = &self.shared * channel.scale;
            if let Some(deviation) = &channel.deviation {
                operator += deviation;
            }
            Inverse {
                gain: channel.gain.clone(),
                operator,
            }
        };
        self.channels.iter().map(inverse).collect()
    }

    /// The inverse for light in camera units.
    pub(super) fn in_camera_units(
        self,
        observed: &Observed<'_>,
        prepared: &Prepared,
    ) -> InverseTransport {
        let channels = self.channels.into_iter().zip(&observed.channels);
        InverseTransport {
            grid: observed.grid,
            live: prepared.live.clone(),
            shared: self.shared / prepared.unit,
            channels: channels
                .map(|(channel, observed)| ChannelInverse {
                    gain: (channel.gain / prepared.unit).iter().copied().collect(),
                    scale: channel.scale,
                    deviation: channel.deviation.map(|deviation| deviation / prepared.unit),
                    ambient: observed.ambient.to_vec(),
                })
                .collect(),
        }
    }
}

/// Zeroes the rows and columns of cells that did not take part.
pub(super) fn drop_dead(operator: &mut DMatrix<f64>, live: &[bool]) {
    for (cell, live) in live.iter().enumerate() {
        if !live {
            operator.row_mut(cell).fill(0.0);
            operator.column_mut(cell).fill(0.0);
        }
    }
}
