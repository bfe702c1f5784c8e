//! The inverse light transport that a solve returns, and what a method found on the way,
//! in units of [`Prepared`](super::prepare::Prepared).

use super::convergence::Convergence;
use super::forward::Inverse;
use super::interreflection::Interreflection;
use super::observed::Observed;
use super::prepare::Prepared;
use super::report::SolveReport;
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
    pub shared: Interreflection,
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
    pub deviation: Option<Interreflection>,
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
            Some(deviation) => &shared + deviation,
            None => shared,
        };
        Inverse::new(DVector::from_column_slice(&channel.gain), operator)
    }
}

impl InverseTransport {
    /// Gives each cell only a share of the light that it was to show, as where projectors overlap;
    /// one factor a cell.
    pub fn share(&mut self, shares: &[f64]) {
        self.shared.scale_rows(shares);
        for channel in &mut self.channels {
            let gains = channel.gain.iter_mut().zip(shares);
            gains.for_each(|(gain, share)| *gain *= share);
            if let Some(deviation) = &mut channel.deviation {
                deviation.scale_rows(shares);
            }
        }
    }
}

/// What a solve found.
#[derive(Clone, Debug)]
pub struct Solved {
    /// The inverse from all photographs.
    pub inverse: InverseTransport,
    /// How it came about.
    pub report: SolveReport,
    /// Inverses to judge it by; no photograph is held out of two.
    pub trials: Vec<Trial>,
}

/// An inverse that has not seen some of the photographs.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Which, by column of the patterns.
    pub held_out: Vec<usize>,
    /// The inverse. It does not undo the projector's blur.
    pub inverse: InverseTransport,
    /// What cells that took no part throw on the others, as projector input, by cell and photograph,
    /// one a channel; `None` if all took part.
    pub thrown: Vec<Option<DMatrix<f64>>>,
}

/// What a method found.
#[derive(Debug)]
pub(super) struct Solution {
    /// The operator that all channels share, zero diagonal. Columns of cells that
    /// are not live belong to the light that falls on them
    /// ([`Prepared::unseen`](super::prepare::Prepared::unseen)), their rows are
    /// zero.
    pub(super) shared: Interreflection,
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
    pub(super) deviation: Option<Interreflection>,
}

/// An inverse together with what cells that are not live throw on the others.
#[derive(Debug)]
pub(super) struct Candidate {
    pub(super) inverse: Inverse,
    /// Columns of the operator that belong to cells that are not live; `None` if
    /// all are.
    thrown: Option<Interreflection>,
}

impl Candidate {
    /// Light of one channel in the photographs `chosen`.
    pub(super) fn light(
        &self,
        prepared: &Prepared,
        channel: usize,
        chosen: &[usize],
    ) -> Option<DMatrix<f64>> {
        let mut projected = prepared.patterns[channel].select_columns(chosen);
        if let Some(thrown) = self.thrown(prepared, channel, chosen) {
            projected += thrown;
        }
        self.inverse.light(&projected)
    }

    /// What cells that are not live throw on the others in the photographs `chosen`.
    pub(super) fn thrown(
        &self,
        prepared: &Prepared,
        channel: usize,
        chosen: &[usize],
    ) -> Option<DMatrix<f64>> {
        let (thrown, unseen) = (self.thrown.as_ref()?, prepared.unseen.as_ref()?);
        Some(thrown * &unseen[channel].select_columns(chosen))
    }
}

impl Solution {
    /// From whole inverses `T_c^-1`, `N x N`, one a channel; what channels have in
    /// common becomes the shared operator.
    pub(super) fn from_inverses(
        inverses: Vec<DMatrix<f64>>,
        live: &[bool],
        coefficients: usize,
        convergence: Convergence,
    ) -> Self {
        let cells = live.len();
        let (mut operators, mut gains) = (Vec::new(), Vec::new());
        for mut inverse in inverses {
            drop_dead(&mut inverse, live);
            gains.push(inverse.diagonal());
            inverse.fill_diagonal(0.0);
            operators.push(-inverse);
        }
        let mut shared = DMatrix::zeros(cells, cells);
        for operator in &operators {
            shared += operator / operators.len() as f64;
        }
        let alone = operators.len() == 1;
        let channel = |(operator, gain)| Channel {
            gain,
            scale: 1.0,
            deviation: (!alone).then(|| Interreflection::Dense(operator - &shared)),
        };
        let channels = operators.into_iter().zip(gains).map(channel).collect();
        Self {
            shared: Interreflection::Dense(shared),
            channels,
            coefficients,
            convergence,
        }
    }

    pub(super) fn candidates(&self, live: &[bool]) -> Vec<Candidate> {
        let candidate = |channel: &Channel| {
            let mut operator = &self.shared * channel.scale;
            if let Some(deviation) = &channel.deviation {
                operator = &operator + deviation;
            }
            let thrown = live.contains(&false).then(|| {
                let dead: Vec<bool> = live.iter().map(|live| !live).collect();
                operator.between(live, &dead)
            });
            let operator = operator.of_live(live);
            Candidate {
                inverse: Inverse::new(channel.gain.clone(), operator),
                thrown,
            }
        };
        self.channels.iter().map(candidate).collect()
    }

    /// The inverse for light in camera units; `deblurred` is what stands for the
    /// operators and channels if it undoes the projector's blur.
    pub(super) fn in_camera_units(
        self,
        observed: &Observed<'_>,
        prepared: &Prepared,
        deblurred: Option<(Interreflection, Vec<Channel>)>,
    ) -> InverseTransport {
        let (shared, channels) = deblurred.unwrap_or((self.shared, self.channels));
        let live = &prepared.live;
        let in_camera_units = |operator: Interreflection| {
            let mut operator = operator.of_live(live);
            operator *= prepared.unit.recip();
            operator
        };
        let channels = channels.into_iter().zip(&observed.channels);
        InverseTransport {
            grid: observed.grid,
            live: prepared.live.clone(),
            shared: in_camera_units(shared),
            channels: channels
                .map(|(channel, observed)| ChannelInverse {
                    gain: (channel.gain / prepared.unit).iter().copied().collect(),
                    scale: channel.scale,
                    deviation: channel.deviation.map(in_camera_units),
                    ambient: observed.ambient.to_vec(),
                })
                .collect(),
        }
    }
}

/// Zeroes the rows of cells that did not take part.
pub(super) fn drop_dead_rows(operator: &mut DMatrix<f64>, live: &[bool]) {
    for (cell, _) in live.iter().enumerate().filter(|(_, live)| !**live) {
        operator.row_mut(cell).fill(0.0);
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
