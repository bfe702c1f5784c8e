//! Cell pixels: the cells that can be measured, and the camera pixels that are averaged
//! for each.

use crate::format::sequence::Sequence;
use crate::registration::cell_map::{NO_CELL, Registration};
use nalgebra::DMatrix;

/// A cell that was left out of a measurement, or of what is made of it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct LeftOut<W = Why> {
    /// Its index, `row * cols + col`.
    pub cell: usize,
    /// Why.
    pub why: W,
}

/// Why a cell was not measured.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Why {
    /// Too few camera pixels see it, and it alone.
    TooFewPixels {
        /// How many do.
        pixels: u32,
    },
    /// Its pixels reach the camera's full scale in the flood photograph.
    Saturated {
        /// How many of them.
        saturated: u32,
        /// All of them.
        pixels: u32,
    },
}

/// Camera pixels that a cell must keep: one could be a defect of the sensor.
const MIN_PIXELS: u32 = 2;

/// Share of a cell's pixels that may be saturated. These are not used, but more
/// of them mean that the rest is close to saturation too.
const SATURATED_PIXELS: f64 = 0.1;

/// The cells that can be measured, and their pixels.
pub(crate) struct CellPixels {
    /// Pixels of each cell, none of one that is not live, length `N`.
    of_cell: Vec<Vec<u32>>,
    pub(crate) live: Vec<bool>,
    pub(crate) left_out: Vec<LeftOut>,
}

impl CellPixels {
    /// Chooses the pixels to average: registered ones that are not `saturated`
    /// under white.
    pub(crate) fn choose(registration: &Registration, saturated: &[bool]) -> Self {
        let cells = registration.centre.len();
        let mut of_cell: Vec<Vec<u32>> = vec![Vec::new(); cells];
        let mut lost = vec![0_u32; cells];
        for (pixel, &cell) in (0_u32..).zip(&registration.cell_of_pixel) {
            if cell == NO_CELL {
                continue;
            }
            if saturated[pixel as usize] {
                lost[cell as usize] += 1;
            } else {
                of_cell[cell as usize].push(pixel);
            }
        }
        let why = |cell: usize| {
            let (pixels, saturated) = (of_cell[cell].len() as u32, lost[cell]);
            let all = pixels + saturated;
            if f64::from(saturated) > SATURATED_PIXELS * f64::from(all) {
                return Some(Why::Saturated {
                    saturated,
                    pixels: all,
                });
            }
            (pixels < MIN_PIXELS).then_some(Why::TooFewPixels { pixels })
        };
        let left_out: Vec<LeftOut> = (0..cells)
            .filter_map(|cell| why(cell).map(|why| LeftOut { cell, why }))
            .collect();
        let mut live = vec![true; cells];
        for out in &left_out {
            live[out.cell] = false;
            of_cell[out.cell].clear();
        }
        Self {
            of_cell,
            live,
            left_out,
        }
    }

    /// Those of cells from several choices, each by the choice and the cell's number there; `None` for
    /// a cell that nothing lights.
    pub(crate) fn joined(cells: &[Option<(&Self, usize)>]) -> Self {
        let why = |own: &Option<(&Self, usize)>| {
            let (all, cell) = (*own)?;
            let mut out = all.left_out.iter();
            out.find(|out| out.cell == cell).map(|out| out.why)
        };
        Self {
            of_cell: (cells.iter())
                .map(|own| own.map_or_else(Vec::new, |(all, cell)| all.of_cell[cell].clone()))
                .collect(),
            live: (cells.iter())
                .map(|own| own.is_some_and(|(all, cell)| all.live[cell]))
                .collect(),
            left_out: (cells.iter().enumerate())
                .filter_map(|(cell, own)| {
                    Some(LeftOut {
                        cell,
                        why: why(own)?,
                    })
                })
                .collect(),
        }
    }

    /// Pixels of each cell, `N` slices; empty for a cell that is not live.
    pub(crate) fn of_cells(&self) -> impl Iterator<Item = &[u32]> {
        self.of_cell.iter().map(Vec::as_slice)
    }

    /// Number of pixels of each cell, length `N`.
    pub(crate) fn counts(&self) -> Vec<u32> {
        self.of_cells().map(|pixels| pixels.len() as u32).collect()
    }

    /// Mean of a plane over each cell; 0 for a cell that is not live.
    pub(crate) fn mean(&self, plane: &[f32]) -> Vec<f64> {
        let mean = |pixels: &[u32]| {
            let sum: f64 = pixels.iter().map(|&p| f64::from(plane[p as usize])).sum();
            sum / pixels.len().max(1) as f64
        };
        self.of_cells().map(mean).collect()
    }
}

/// Mean of the photographs of black in each cell, length `N`.
pub(crate) fn black(sequence: &Sequence, light: &DMatrix<f64>) -> Vec<f64> {
    let share = 1.0 / sequence.black.len() as f64;
    let of_cell = |cell: usize| -> f64 {
        let black = sequence.black.iter().map(|&shot| light[(cell, shot)]);
        share * black.sum::<f64>()
    };
    (0..light.nrows()).map(of_cell).collect()
}
