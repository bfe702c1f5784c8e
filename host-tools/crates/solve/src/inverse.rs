//! The inverse light transport that a solve returns.

use super::forward::Inverse;
use iltm_runtime::Grid;
use nalgebra::{DMatrix, DVector};

/// `T_c^-1 = diag(g_c) - K_c` for every channel `c`.
///
/// The projector input for a wanted image `d` (camera units, linear light) is
/// `p = g_c .* (d - a_c) - K_c (d - a_c)`, with `p` relative to the projector's
/// white.
#[derive(Clone, Debug)]
pub struct InverseTransport {
    /// Cells of the projector.
    pub grid: Grid,
    /// Whether the cell took part in the solve, length `N`. A cell that did not
    /// has a zero row and column in every operator.
    pub live: Vec<bool>,
    /// The interreflection operator that all channels share, `N x N`, projector
    /// white per camera unit. Its diagonal is zero unless it undoes the
    /// projector's blur as well.
    pub shared: DMatrix<f64>,
    /// One entry (grey) or three (red, green, blue).
    pub channels: Vec<ChannelInverse>,
}

/// One colour channel of an [`InverseTransport`].
#[derive(Clone, Debug)]
pub struct ChannelInverse {
    /// The diagonal `g`, length `N`, projector white per camera unit.
    pub gain: Vec<f64>,
    /// `K_c = scale * shared + deviation`: the projector's gain in this channel.
    pub scale: f64,
    /// What this channel's operator adds to the shared one, `N x N`; `None`
    /// when it is zero (a grey scene).
    pub deviation: Option<DMatrix<f64>>,
    /// Observed light under black `a`, length `N`, camera units.
    pub ambient: Vec<f64>,
}

impl InverseTransport {
    /// `diag(g_c) - K_c` of one channel.
    ///
    /// # Panics
    /// If there is no such channel.
    #[must_use]
    pub fn channel(&self, index: usize) -> Inverse {
        let channel = &self.channels[index];
        let shared = &self.shared * channel.scale;
        let operator = match &channel.deviation {
            Some(deviation) => shared + deviation,
            None => shared,
        };
        Inverse::new(DVector::from_column_slice(&channel.gain), operator)
    }
}
