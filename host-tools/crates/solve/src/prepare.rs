//! Checks what was observed and brings them to the solver's units.

use super::blur::blur;
use super::error::SolveError;
use super::forward::product;
use super::observability::{self, LeftOut, WhyLeftOut};
use super::observed::{CellNoise, Observed};
use iltm_capture::Role;
use nalgebra::DMatrix;
use std::ops::Range;
use std::sync::Arc;

/// Weight of a photograph in which a cell is dark, at most: below that noise the
/// model's own error rules.
const MOST_WEIGHT: f64 = 10.0;

/// Cells over which a projector may spread a cell's light.
const MOST_BLUR: f64 = 4.0;

/// Mean light under white, of full scale, that can come from a camera; squares and
/// reciprocals of others leave the range of numbers.
const LEVELS: Range<f64> = 1e-12..1e12;

/// Observations that a solve can rely on: sizes agree, everything is finite,
/// at least one cell is live.
#[derive(Debug)]
pub(super) struct Prepared {
    /// Cells that are seen and give back light of their own in every channel.
    pub(super) live: Vec<bool>,
    /// The others.
    pub(super) left_out: Vec<LeftOut>,
    /// What the projector showed in each channel, `N x m`.
    pub(super) shown: Vec<Arc<DMatrix<f64>>>,
    /// `L` of each channel, `N x m`, after the projector's blur; rows of cells that are
    /// not live are zero.
    pub(super) patterns: Vec<Arc<DMatrix<f64>>>,
    /// `C_c` with the mean flood light of all channels scaled to 1, `N x m`;
    /// rows of cells that are not live are zero.
    pub(super) light: Vec<DMatrix<f64>>,
    /// What cells that are not live throw on the others is explained by: the
    /// light that falls on them in each channel, `N x m`, rows of live cells zero. `None` if
    /// all are live.
    ///
    /// A cell at the border of a scene may be too small for the camera, or out of
    /// its sight, and still light the rest. Its light is not known, but what is
    /// projected there is, and its column of `K` is as sparse and non-negative as
    /// any other's. Light that it only passes on needs no column: eliminating it
    /// leaves an operator of the same kind between the live cells.
    pub(super) unseen: Option<Vec<Arc<DMatrix<f64>>>>,
    /// Standard deviation of an element of `light` by channel and cell.
    pub(super) noise: Vec<Vec<CellNoise>>,
    /// Weight of each squared residual, `N x m`, mean 1 in each row.
    pub(super) weights: DMatrix<f64>,
    pub(super) roles: Vec<Role>,
    /// Camera units of one unit of `light`.
    pub(super) unit: f64,
    /// `B`, `N x N`, already applied to `patterns`; `None` if in focus.
    pub(super) blur: Option<DMatrix<f64>>,
}

impl Prepared {
    /// # Errors
    /// [`SolveError`] for sizes that disagree, numbers that are not finite, a
    /// wrong number of channels, or no live cell.
    pub(super) fn new(observed: &Observed<'_>) -> Result<Self, SolveError> {
        check_sizes(observed)?;
        check_finite(observed)?;
        let blur = (observed.blur > 0.0).then(|| blur(observed.grid, observed.blur));
        // Grey patterns are the same in all channels, which share one matrix then.
        let of_channels = |make: &dyn Fn(usize) -> DMatrix<f64>| {
            let mut made: Vec<Arc<DMatrix<f64>>> = Vec::new();
            for (channel, of) in observed.channels.iter().enumerate() {
                let mut before = observed.channels[..channel].iter();
                match before.position(|before| before.patterns == of.patterns) {
                    Some(same) => made.push(Arc::clone(&made[same])),
                    None => made.push(Arc::new(make(channel))),
                }
            }
            made
        };
        let shown = of_channels(&|channel| observed.channels[channel].patterns.clone());
        let landed = match &blur {
            Some(blur) => of_channels(&|channel| product(blur, &shown[channel])),
            None => shown.clone(),
        };
        let left_out = observability::left_out(observed, &landed);
        let mut live = vec![true; observed.grid.cells()];
        for out in &left_out {
            live[out.cell] = false;
        }
        if !live.contains(&true) {
            return Err(SolveError::NoLiveCells { cells: live.len() });
        }
        let keep = |matrix: &DMatrix<f64>| {
            DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |cell, k| {
                if live[cell] { matrix[(cell, k)] } else { 0.0 }
            })
        };
        let patterns = of_channels(&|channel| keep(&landed[channel]));
        let unseen = (live.contains(&false))
            .then(|| of_channels(&|channel| &*landed[channel] - &*patterns[channel]));
        let mut light: Vec<_> = observed
            .channels
            .iter()
            .map(|channel| keep(channel.light))
            .collect();
        let unit = flood_level(&light, &patterns);
        if !LEVELS.contains(&unit) {
            return Err(SolveError::Level { level: unit });
        }
        for light in &mut light {
            *light /= unit;
        }
        let noise: Vec<Vec<CellNoise>> = observed
            .channels
            .iter()
            .map(|channel| {
                let in_units = |noise: &CellNoise| CellNoise {
                    lit: noise.lit / unit,
                    unlit: noise.unlit / unit,
                };
                channel.noise.iter().map(in_units).collect()
            })
            .collect();
        Ok(Self {
            weights: weights(&shown, &noise),
            unseen,
            live,
            left_out,
            shown,
            patterns,
            light,
            noise,
            roles: observed.roles.to_vec(),
            unit,
            blur,
        })
    }

    pub(super) fn cells(&self) -> usize {
        self.live.len()
    }

    /// Cells that a projector shows.
    pub(super) fn shown_cells(&self) -> usize {
        let left_out = self.left_out.iter();
        let missing = left_out.filter(|out| out.why == WhyLeftOut::NoProjector);
        self.cells() - missing.count()
    }

    pub(super) fn live_cells(&self) -> usize {
        self.live.iter().filter(|live| **live).count()
    }

    /// Light of one channel with that of [`Self::unseen`], of the photographs
    /// `chosen`: what the columns of `K` belong to.
    pub(super) fn sources(&self, channel: usize, chosen: &[usize]) -> DMatrix<f64> {
        let light = self.light[channel].select_columns(chosen);
        match &self.unseen {
            Some(unseen) => light + unseen[channel].select_columns(chosen),
            None => light,
        }
    }

    /// The light of one channel that falls on every cell, live or not, in the photographs
    /// `chosen`.
    pub(super) fn landed(&self, channel: usize, chosen: &[usize]) -> DMatrix<f64> {
        let patterns = self.patterns[channel].select_columns(chosen);
        match &self.unseen {
            Some(unseen) => patterns + unseen[channel].select_columns(chosen),
            None => patterns,
        }
    }

    /// The photographs whose role passes `filter`, by index.
    pub(super) fn with_role(&self, filter: impl Fn(Role) -> bool) -> Vec<usize> {
        let roles = self.roles.iter().enumerate();
        roles
            .filter(|(_, role)| filter(**role))
            .map(|(k, _)| k)
            .collect()
    }
}

/// Light is noisy: photographs in which a cell is dark say more about what it
/// gets from others. Every pattern that does not light a cell counts as many
/// times as its noise variance is smaller than that of those which do. A picture lies between:
/// the variance of light grows with it.
fn weights(shown: &[Arc<DMatrix<f64>>], noise: &[Vec<CellNoise>]) -> DMatrix<f64> {
    let (cells, photographs) = shown[0].shape();
    let share = 1.0 / shown.len() as f64;
    let mut weights = DMatrix::from_element(cells, photographs, 1.0);
    for (cell, mut row) in weights.row_iter_mut().enumerate() {
        let variance = |of: fn(&CellNoise) -> f64| -> f64 {
            noise.iter().map(|channel| of(&channel[cell]).powi(2)).sum()
        };
        let (lit, unlit) = (variance(|noise| noise.lit), variance(|noise| noise.unlit));
        if (lit / unlit).is_nan() {
            continue;
        }
        for (photograph, weight) in row.iter_mut().enumerate() {
            let light: f64 = shown
                .iter()
                .map(|shown| share * shown[(cell, photograph)])
                .sum();
            if light < 1.0 {
                let own = unlit + light.max(0.0) * (lit - unlit);
                *weight = (lit / own).clamp(1.0, MOST_WEIGHT);
            }
        }
        let mean = row.mean();
        row /= mean;
    }
    weights
}

/// Mean light of all channels where the projector shows white: total light over
/// total projected share.
fn flood_level(light: &[DMatrix<f64>], patterns: &[Arc<DMatrix<f64>>]) -> f64 {
    let light = light.iter().map(DMatrix::sum).sum::<f64>();
    light / patterns.iter().map(|patterns| patterns.sum()).sum::<f64>()
}

fn check_sizes(observed: &Observed<'_>) -> Result<(), SolveError> {
    let (cells, photographs) = (observed.grid.cells(), observed.roles.len());
    let check = |what, given: (usize, usize), wanted: (usize, usize)| {
        if given == wanted {
            return Ok(());
        }
        Err(SolveError::Size {
            what,
            rows: wanted.0,
            cols: wanted.1,
            given_rows: given.0,
            given_cols: given.1,
        })
    };
    check("live cells", (observed.live.len(), 1), (cells, 1))?;
    if !matches!(observed.channels.len(), 1 | 3) {
        return Err(SolveError::Channels {
            given: observed.channels.len(),
        });
    }
    for channel in &observed.channels {
        check("patterns", channel.patterns.shape(), (cells, photographs))?;
        check("observations", channel.light.shape(), (cells, photographs))?;
        check(
            "ambient light values",
            (channel.ambient.len(), 1),
            (cells, 1),
        )?;
        check("noise estimates", (channel.noise.len(), 1), (cells, 1))?;
    }
    Ok(())
}

fn check_finite(observed: &Observed<'_>) -> Result<(), SolveError> {
    let check = |what, channel, matrix: &DMatrix<f64>| match matrix
        .iter()
        .position(|value| !value.is_finite())
    {
        None => Ok(()),
        Some(index) => Err(SolveError::NotFinite {
            what,
            cell: index % matrix.nrows(),
            photograph: index / matrix.nrows(),
            channel,
        }),
    };
    if !(0.0..=MOST_BLUR).contains(&observed.blur) {
        return Err(SolveError::Option {
            option: "the projector's blur",
            value: observed.blur,
            must: "from 0 to 4 cells",
        });
    }
    for (index, channel) in observed.channels.iter().enumerate() {
        check("pattern", index, channel.patterns)?;
        check("light", index, channel.light)?;
        let cells = channel.ambient.len();
        check(
            "ambient light",
            index,
            &DMatrix::from_column_slice(cells, 1, channel.ambient),
        )?;
        let noise = |cell: usize, _| channel.noise[cell].lit + channel.noise[cell].unlit;
        check("noise", index, &DMatrix::from_fn(cells, 1, noise))?;
    }
    Ok(())
}
