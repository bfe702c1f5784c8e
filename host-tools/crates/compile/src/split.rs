//! Split of a table: one for each projector, from that of a wide frame of several.
//!
//! A device drives one projector. Its table has the cells of its own frame, and takes the light
//! that is wanted of the other projectors, its neighbours, on a coarser grid
//! ([`Neighbours`](iltm_runtime::image::Neighbours)). With `d` of a wide frame, `A` the restriction
//! to the own cells and `U` from the coarse cells of the neighbours to fine ones, `K d` becomes
//! `A K A^T d_own + A K U d_others`. Both bases are orthonormal, so each of the operator's entries
//! is spread over the functions that its own two overlap; most overlap one.

use crate::CompileError;
use crate::Provenance;
use crate::haar_entries::{HaarEntry, entries_of, haar_entries};
use crate::image::{ImageWriter, neighbours_section, operator_sections, projector_section};
use crate::ladder::{Entry, Part, most_useful_first};
use crate::quantise::{TooStrong, quantise};
use crate::table::load;
use fixed::types::U0F32;
use iltm_picture::FramePart;
use iltm_runtime::Grid;
use iltm_runtime::haar::{Basis, Function};
use iltm_runtime::image::layout::SectionKind;
use iltm_runtime::image::layout::fine_gain;
use iltm_runtime::image::layout::label::NAME_BYTES;
use iltm_runtime::image::{Checked, Label, Meta, Table, TierInfo};
use iltm_runtime::operator::{Channels, Operator, Segment};
use iltm_runtime::placement::ProjectorPixels;
use iltm_solve::{Haar, wanted_images};
use nalgebra::DMatrix;
use rayon::prelude::*;
use thiserror::Error;

/// Cells of a frame along each side of a cell that its neighbours take of it, if nothing else is
/// asked for.
pub const NEIGHBOURS_FACTOR: u16 = 4;

/// Most projectors of a wide frame.
const MOST_PROJECTORS: usize = 8;

/// What a tier may leave out for being split, as a part of its own error: it adds a twentieth.
const LEFT_OUT: f64 = 0.3;

/// The table of one projector.
#[derive(Clone, Debug)]
pub struct SplitTable {
    /// The image, checked.
    pub image: Vec<u8>,
    /// Errors by tier.
    pub tiers: Vec<SplitError>,
}

/// Errors of a tier on the surfaces of one projector, relative, root mean square over natural
/// images: `|correction - that of the wide table's top tier| / gain` over `|light|`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SplitError {
    /// Of the wide table's tier.
    pub wide: f64,
    /// With the light of the neighbours.
    pub together: f64,
    /// While they are silent.
    pub alone: f64,
}

/// Why a table cannot be split.
#[derive(Debug, Error)]
pub enum SplitTableError {
    /// Its columns are not those of so many frames.
    #[error("{cols} columns are not those of {projectors} projectors alike")]
    Columns {
        /// Columns of the table's cells, or of gains that are finer.
        cols: usize,
        /// Projectors.
        projectors: usize,
    },
    /// Its frames have a border, or pixels that are not those of so many.
    #[error(
        "frames {width} pixels wide with a border of {border} are not those of {projectors} projectors"
    )]
    Frames {
        /// Width of the wide frame.
        width: usize,
        /// Border of it.
        border: u16,
        /// Projectors.
        projectors: usize,
    },
    /// It was made from the captures of another number of projectors.
    #[error("the table is for {found} projectors, not {asked}")]
    Projectors {
        /// Asked for.
        asked: usize,
        /// It is for so many.
        found: usize,
    },
    /// It was made from wide slides, which do not tell.
    #[error("the table does not say how many projectors it is for")]
    Unsaid,
    /// It is for one of several projectors already.
    #[error("the table is that of one projector of several already")]
    Split,
    /// The neighbours have too many cells.
    #[error(
        "the neighbours have {cells} cells, and a table takes at most as many as its own and {} with these",
        Grid::MAX_CELLS
    )]
    NeighboursCells {
        /// Their cells.
        cells: usize,
    },
    /// A part cannot be stored.
    #[error(transparent)]
    Compile(#[from] CompileError),
}

/// Splits the table of frames side by side, from left to right: those that it was made from, or else
/// of so many `projectors` alike. Each takes one cell of its neighbours for `factor` of theirs along
/// each side.
///
/// # Errors
/// [`SplitTableError`] if the table is none of so many frames, or a part cannot be stored.
pub fn split_table(
    image: &[u8],
    projectors: Option<usize>,
    factor: u16,
) -> Result<Vec<SplitTable>, SplitTableError> {
    let own = Checked::new(image, &mut || {}).map_err(CompileError::Image)?;
    let (meta, table) = (*own.meta(), own.table());
    if table.neighbours().is_some() {
        return Err(SplitTableError::Split);
    }
    let images = wanted_images(meta.grid);
    let wide = WideTable {
        functions: table.basis().functions().collect(),
        coefficients: Haar::new(meta.grid).analyse_columns(&images),
        images,
        parts: parts(&table, projectors)?,
        table: &table,
        meta,
    };
    (0..wide.parts.len())
        .map(|own| wide.part(image, own, factor.max(1)))
        .collect()
}

/// The cells of each projector of a table.
fn parts(table: &Table<'_>, asked: Option<usize>) -> Result<Vec<FramePart>, SplitTableError> {
    let grid = table.grid();
    let few = |projectors| (2..=MOST_PROJECTORS).contains(&projectors);
    if let Some(parts) = Provenance::read(table.provenance()).parts(grid) {
        let found = parts.len();
        return match asked {
            Some(asked) if asked != found => Err(SplitTableError::Projectors { asked, found }),
            _ if !few(found) => Err(SplitTableError::Columns {
                cols: grid.cols(),
                projectors: found,
            }),
            _ => Ok(parts),
        };
    }
    let projectors = asked.ok_or(SplitTableError::Unsaid)?;
    let fine = table.fine_gain().map(|fine| fine.size().width());
    for cols in [grid.cols()].into_iter().chain(fine) {
        if !few(projectors) || !cols.is_multiple_of(projectors) {
            return Err(SplitTableError::Columns { cols, projectors });
        }
    }
    let frame = [grid.rows(), grid.cols() / projectors];
    Ok(FramePart::side_by_side(std::iter::repeat_n(
        frame, projectors,
    )))
}

/// The wide table and what all parts need of it.
struct WideTable<'t, 'a> {
    table: &'t Table<'a>,
    meta: Meta,
    /// The cells of each projector.
    parts: Vec<FramePart>,
    functions: Vec<Function>,
    /// Natural images, and their coefficients.
    images: DMatrix<f64>,
    coefficients: DMatrix<f64>,
}

/// A function of the wide frame by those of another grid: index and product of the two.
type Overlaps = Vec<Vec<(u32, f64)>>;

/// Where each of some cells goes: the cells of another grid, and the share of it that lies in each.
type Places = Vec<Vec<(usize, f64)>>;

impl<'a> WideTable<'_, 'a> {
    /// The operator of a tier.
    fn segments(&self, tier: u8) -> impl Iterator<Item = &Segment<'a>> {
        let segments = self.table.operator().map_or(&[][..], Operator::segments);
        segments.iter().filter(move |segment| segment.tier == tier)
    }

    /// The cells that a projector takes of its neighbours', one for `factor` of theirs along each side:
    /// as many of each, however large its frame.
    fn others(&self, own: usize, factor: u16) -> [usize; 2] {
        let others = || self.parts.iter().enumerate().filter(|(at, _)| *at != own);
        let side = |of: fn(&FramePart) -> usize| {
            let most = others().map(|(_, part)| of(part)).max().unwrap_or(1);
            let least = others().map(|(_, part)| of(part)).min().unwrap_or(1);
            most.div_ceil(factor.into()).min(least)
        };
        [side(|part| part.rows), side(|part| part.columns.len())]
    }

    /// Where the wide frame's cells go on those of the projector's own frame.
    fn to_own(&self, own: usize) -> Places {
        let cols = self.meta.grid.cols();
        let cells = 0..self.meta.grid.cells();
        let place = |cell| self.parts[own].own(cols, cell).map(|own| (own, 1.0));
        cells
            .map(|cell| place(cell).into_iter().collect())
            .collect()
    }

    /// Where they go on the coarse ones of the others, so many rows and columns of each.
    fn to_others(&self, own: usize, [rows, cols]: [usize; 2]) -> Places {
        let all = cols * (self.parts.len() - 1);
        let mut places = vec![Vec::new(); self.meta.grid.cells()];
        let others = self.parts.iter().enumerate().filter(|(at, _)| *at != own);
        for (number, (_, part)) in others.enumerate() {
            let (down, across) = (spread(part.rows, rows), spread(part.columns.len(), cols));
            for (at, cell) in part.places(self.meta.grid.cols()).enumerate() {
                let (row, col) = (at / part.columns.len(), at % part.columns.len());
                places[cell] = (down[row].iter())
                    .flat_map(|(r, down)| {
                        let across = across[col].iter();
                        across.map(move |(c, across)| (r * all + number * cols + c, down * across))
                    })
                    .collect();
            }
        }
        places
    }

    /// The functions of the wide frame by those of a grid.
    fn overlaps(&self, grid: Grid, places: &Places) -> Overlaps {
        const AT_ONCE: usize = 256;
        let haar = Haar::new(grid);
        let chunks = self.functions.par_chunks(AT_ONCE).map(|functions| {
            let mut cells = DMatrix::zeros(grid.cells(), functions.len());
            for (mut column, function) in cells.column_iter_mut().zip(functions) {
                let norm = (function.squared_norm() as f64).sqrt();
                let (height, width) = function.extent();
                let (top, left) = (usize::from(function.row), usize::from(function.col));
                for row in top..top + height {
                    for col in left..left + width {
                        let value = function.at(row, col) as f64 / norm;
                        for (at, share) in &places[row * self.meta.grid.cols() + col] {
                            column[*at] += value * share;
                        }
                    }
                }
            }
            let found = haar.analyse_columns(&cells);
            let of_function = |column: usize| {
                let values = found.column(column);
                let values = values.iter().enumerate();
                let values = values.filter(|(_, value)| value.abs() > 1e-9);
                values.map(|(at, value)| (at as u32, *value)).collect()
            };
            (0..functions.len()).map(of_function).collect::<Vec<_>>()
        });
        chunks.collect::<Vec<_>>().concat()
    }

    /// The table of one projector.
    fn part(&self, image: &[u8], own: usize, factor: u16) -> Result<SplitTable, SplitTableError> {
        let of_each = self.others(own, factor);
        let [rows, cols] = [of_each[0], of_each[1] * (self.parts.len() - 1)];
        let part = &self.parts[own];
        let grid =
            |rows: usize, cols: usize| Grid::new(rows.try_into().ok()?, cols.try_into().ok()?).ok();
        let grids = grid(part.rows, part.columns.len()).zip(grid(rows, cols));
        let grids = grids.filter(|(own, others)| {
            let (own, others) = (own.cells(), others.cells());
            others <= own && others + own <= Grid::MAX_CELLS
        });
        let cells = rows * cols;
        let (own_grid, others) = grids.ok_or(SplitTableError::NeighboursCells { cells })?;
        let [to_own, to_others] = [self.to_own(own), self.to_others(own, of_each)];
        let outputs = self.overlaps(own_grid, &to_own);
        let mut inputs = outputs.clone();
        let first = own_grid.cells() as u32;
        for (inputs, others) in inputs.iter_mut().zip(self.overlaps(others, &to_others)) {
            inputs.extend(others.iter().map(|(at, value)| (first + at, *value)));
        }
        let part = SplitPart {
            wide: self,
            own,
            grid: own_grid,
            others,
            content: self.content([(own_grid, &to_own), (others, &to_others)]),
            outputs,
            inputs,
            to_others,
        };
        part.table(image)
    }

    /// Coefficients of the natural images on the own cells and those of the neighbours.
    fn content(&self, grids: [(Grid, &Places); 2]) -> DMatrix<f64> {
        let count = grids.iter().map(|(grid, _)| grid.cells()).sum();
        let mut all = DMatrix::zeros(count, self.images.ncols());
        let mut start = 0;
        for (grid, places) in grids {
            let mut cells = DMatrix::zeros(grid.cells(), self.images.ncols());
            let mut weights = vec![0.0; grid.cells()];
            for (light, places) in self.images.row_iter().zip(places) {
                for (at, weight) in places {
                    weights[*at] += weight;
                    let mut mean = cells.row_mut(*at);
                    mean += light * *weight;
                }
            }
            for (mut row, weight) in cells.row_iter_mut().zip(weights) {
                row /= weight;
            }
            let coefficients = Haar::new(grid).analyse_columns(&cells);
            let mut rows = all.rows_mut(start, grid.cells());
            rows.copy_from(&coefficients);
            start += grid.cells();
        }
        all
    }

    /// The pixels of one of the projectors whose frames make a wide one.
    fn pixels(&self, own: usize) -> Result<Option<ProjectorPixels>, SplitTableError> {
        let Some(pixels) = self.table.projector() else {
            return Ok(None);
        };
        let part = self.parts[own].pixels(self.meta.grid, pixels.size());
        let own = part.and_then(|part| part.frame());
        let own = own.filter(|_| pixels.border() == 0);
        let own = own.ok_or(SplitTableError::Frames {
            width: pixels.size().width(),
            border: pixels.border(),
            projectors: self.parts.len(),
        })?;
        Ok(Some(ProjectorPixels::whole(own)))
    }
}

/// Where the cells along a side of `fine` go on one of `coarse`.
fn spread(fine: usize, coarse: usize) -> Places {
    let share = |at: usize, place: usize| {
        // Both sides in units of `1 / (fine coarse)`.
        let from = (at * coarse).max(place * fine);
        let to = ((at + 1) * coarse).min((place + 1) * fine);
        (to > from).then(|| (place, (to - from) as f64 / coarse as f64))
    };
    let of_cell = |at| (0..coarse).filter_map(|place| share(at, place)).collect();
    (0..fine).map(of_cell).collect()
}

/// One projector, and the wide frame's functions by its own.
struct SplitPart<'w, 't, 'a> {
    wide: &'w WideTable<'t, 'a>,
    own: usize,
    /// Its cells, and those that it takes of its neighbours'.
    grid: Grid,
    others: Grid,
    /// Coefficients of the natural images, one row an input.
    content: DMatrix<f64>,
    outputs: Overlaps,
    inputs: Overlaps,
    /// Where the wide frame's cells go on the neighbours'.
    to_others: Places,
}

impl SplitPart<'_, '_, '_> {
    fn table(&self, image: &[u8]) -> Result<SplitTable, SplitTableError> {
        let wide = self.wide;
        let (table, meta) = (wide.table, wide.meta);
        let basis = Basis::new(self.grid);
        let others = Basis::new(self.others);
        let functions: Vec<Function> = basis.functions().chain(others.functions()).collect();
        let mut quantised = Vec::new();
        let mut errors = Vec::new();
        let right = self.wide_corrections(table.top_tier());
        for tier in 1..=table.top_tier() {
            let entries = self.entries(tier);
            errors.push(self.errors(tier, &entries, &right));
            let segments = quantise(&functions, tier, &entries, |_| 1.0)
                .map_err(|TooStrong { row }| CompileError::TooStrong { row })?;
            quantised.extend(segments);
        }
        let sections = operator_sections(functions.len(), &quantised);
        let operator = load(&basis, functions.len(), &sections, meta.channel_scales)?;
        let costs = (0..=table.top_tier()).map(|tier| operator.cost(tier, meta.channels));
        let tiers = table.tiers().iter().zip(costs).enumerate();
        let tiers = tiers.flat_map(|(tier, (info, (entries, multiplications)))| {
            let more = tier.checked_sub(1).map_or(0.0, |above_gains| {
                let SplitError { wide, together, .. } = errors[above_gains];
                (together.powi(2) - wide.powi(2)).max(0.0)
            });
            let error = (info.predicted_error.to_num::<f64>().powi(2) + more).sqrt();
            TierInfo {
                predicted_error: U0F32::saturating_from_num(error),
                entries,
                multiplications,
            }
            .emit()
        });
        let tiers: Vec<u8> = tiers.collect();
        let head = Meta {
            grid: self.grid,
            bounds: operator.bounds(),
            label: self.label(),
            ..meta
        };
        let mut part = ImageWriter::of_image(image);
        part.replace(SectionKind::Meta, Some(head.emit().to_vec()));
        part.replace(SectionKind::Tiers, Some(tiers));
        let own = &wide.parts[self.own];
        let cells = (own, meta.grid.cols());
        self.cut(&mut part, SectionKind::Gain, cells, 0);
        if let Some(fine) = table.fine_gain() {
            let (size, projectors) = (fine.size(), wide.parts.len());
            let samples = own.pixels(meta.grid, size);
            let samples = samples.ok_or(SplitTableError::Columns {
                cols: size.width(),
                projectors,
            })?;
            let samples = (&samples, size.width());
            self.cut(&mut part, SectionKind::FineGain, samples, fine_gain::SIZE);
        }
        self.cut(&mut part, SectionKind::Ambient, cells, 0);
        let pixels = wide.pixels(self.own)?.map(projector_section);
        part.replace(SectionKind::Projector, pixels);
        part.replace(SectionKind::Operator, None);
        for (selector, bytes) in &sections {
            part.section(SectionKind::Operator, *selector, bytes.clone());
        }
        // Gains alone take no light of others: a device need not wait for it.
        if table.operator().is_some() {
            let around = [self.own as u8, (wide.parts.len() - 1 - self.own) as u8];
            let section = neighbours_section(self.others, around, self.ambient_of_others());
            part.replace(SectionKind::Neighbours, Some(section));
        }
        let image = part.finish();
        Table::check(&image).map_err(CompileError::Image)?;
        Ok(SplitTable {
            image,
            tiers: errors,
        })
    }

    /// The operator of a tier by the own functions, without what is worth least.
    fn entries(&self, tier: u8) -> Vec<Entry> {
        let found = self.all_entries(tier);
        let images = self.content.ncols() as f64;
        let rows = self.content.row_iter();
        let sigma: Vec<f64> = rows.map(|row| row.norm() / images.sqrt()).collect();
        let channels = self.wide.meta.channels;
        let scales = self.scales();
        let squares: f64 = scales.iter().map(|scale| scale * scale).sum();
        let worth = |entry: &Entry| {
            let weight = match entry.part {
                Part::Shared => squares,
                Part::Channel(channel) => scales[usize::from(channel)].powi(2),
            };
            weight * (entry.value * sigma[entry.col as usize]).powi(2)
        };
        let mut entries = most_useful_first(found, worth, channels);
        let error = self.wide.table.tiers()[usize::from(tier)].predicted_error;
        let may = LEFT_OUT * error.to_num::<f64>() * self.light();
        let mut left_out = 0.0;
        while let Some(last) = entries.last() {
            left_out += worth(last) / f64::from(channels);
            if left_out > may * may {
                break;
            }
            entries.pop();
        }
        entries
    }

    /// All of a tier, from whatever a device would read.
    fn all_entries(&self, tier: u8) -> Vec<Entry> {
        let mut found = Vec::new();
        for segment in self.wide.segments(tier) {
            let part = match segment.channels {
                Channels::All => Part::Shared,
                Channels::One(channel) => Part::Channel(channel),
            };
            let entry = |(row, col, value)| Entry {
                part,
                row,
                col,
                value,
            };
            let stored = entries_of(&self.wide.functions, segment);
            found.extend(self.spread(&stored).into_iter().map(entry));
        }
        found
    }

    /// Entries between functions of the wide frame as entries between the own ones.
    fn spread(&self, stored: &[HaarEntry]) -> Vec<(u32, u32, f64)> {
        let count = self.content.nrows();
        // By inputs first, a row of the wide frame's after the other.
        let rows: Vec<&[HaarEntry]> = stored.chunk_by(|a, b| a.row == b.row).collect();
        let by_inputs = rows.par_iter().map_init(
            || vec![0.0; count],
            |sums, row| {
                if self.outputs[row[0].row].is_empty() {
                    return Vec::new();
                }
                let terms = row.iter().flat_map(|entry| {
                    let spread = self.inputs[entry.col].iter();
                    spread.map(|(at, share)| (*at, share * entry.value))
                });
                sum_up(sums, terms)
            },
        );
        let by_inputs: Vec<Vec<(u32, f64)>> = by_inputs.collect();
        let mut of_output: Vec<Vec<(usize, f64)>> = vec![Vec::new(); self.grid.cells()];
        for (index, row) in rows.iter().enumerate() {
            for (at, share) in &self.outputs[row[0].row] {
                of_output[*at as usize].push((index, *share));
            }
        }
        let spread = of_output.par_iter().enumerate().map_init(
            || vec![0.0; count],
            |sums, (output, rows)| {
                let terms = rows.iter().flat_map(|(index, share)| {
                    let inputs = by_inputs[*index].iter();
                    inputs.map(move |(at, value)| (*at, share * value))
                });
                let of_row = sum_up(sums, terms).into_iter();
                let entry = |(at, value)| (output as u32, at, value);
                of_row.map(entry).collect::<Vec<_>>()
            },
        );
        spread.collect::<Vec<_>>().concat()
    }

    /// What multiplies the operator in each channel.
    fn scales(&self) -> Vec<f64> {
        let scales = self.wide.meta.channel_scales.iter();
        let scales = scales.take(self.wide.meta.channels.into());
        scales.map(|scale| scale.to_num()).collect()
    }

    /// The drive of the natural images by gain alone, root of the sum of squares of an image.
    fn light(&self) -> f64 {
        let own = self.content.rows(0, self.grid.cells());
        self.gain() * own.norm() / (own.ncols() as f64).sqrt()
    }

    /// Mean gain of cells that the projector can light.
    fn gain(&self) -> f64 {
        let table = self.wide.table;
        let unit = f64::from(table.gain_fraction()).exp2();
        let FramePart { columns, rows } = &self.wide.parts[self.own];
        let rows = (0..*rows).flat_map(|row| {
            let channels = 0..usize::from(table.channels());
            channels.flat_map(move |channel| table.gain_row(row, channel).enumerate())
        });
        let gains = rows.filter(|(col, gain)| columns.contains(col) && *gain > 0);
        let (sum, count) = gains.fold((0.0, 0), |(sum, count), (_, gain)| {
            (sum + f64::from(gain) / unit, count + 1)
        });
        sum / f64::from(count.max(1))
    }

    /// Errors of these entries in the place of the wide table's, by channel against the corrections that
    /// are `right`.
    fn errors(&self, tier: u8, entries: &[Entry], right: &[DMatrix<f64>]) -> SplitError {
        let own = self.grid.cells() as u32;
        let scales = self.scales();
        let mut squares = [0.0; 3];
        let of_wide = self.wide_corrections(tier);
        for (channel, (scale, of_wide)) in scales.iter().zip(of_wide).enumerate() {
            let counts = |part: Part| match part {
                Part::Shared => true,
                Part::Channel(one) => usize::from(one) == channel,
            };
            let mut found = [(); 2].map(|()| DMatrix::zeros(own as usize, self.content.ncols()));
            for entry in entries.iter().filter(|entry| counts(entry.part)) {
                let light = self.content.row(entry.col as usize) * (scale * entry.value);
                let [together, alone] = &mut found;
                let mut row = together.row_mut(entry.row as usize);
                row += &light;
                if entry.col < own {
                    let mut row = alone.row_mut(entry.row as usize);
                    row += light;
                }
            }
            let [together, alone] = found;
            for (square, found) in squares.iter_mut().zip([of_wide, together, alone]) {
                *square += (found - &right[channel]).norm_squared() / self.content.ncols() as f64;
            }
        }
        let error = |square: f64| (square / scales.len() as f64).sqrt() / self.light();
        let [wide, together, alone] = squares.map(error);
        SplitError {
            wide,
            together,
            alone,
        }
    }

    /// Corrections of the natural images by the wide table at a tier, coefficients of the own
    /// frame by channel.
    fn wide_corrections(&self, tier: u8) -> Vec<DMatrix<f64>> {
        let wide = self.wide;
        let segments: Vec<Segment<'_>> = wide.segments(tier).copied().collect();
        let of_channel = |entries: Vec<HaarEntry>| {
            let mut corrections = DMatrix::zeros(self.grid.cells(), self.content.ncols());
            for entry in entries {
                for (at, share) in &self.outputs[entry.row] {
                    let mut row = corrections.row_mut(*at as usize);
                    row += wide.coefficients.row(entry.col) * (entry.value * share);
                }
            }
            corrections
        };
        let entries = haar_entries(wide.table, &segments).into_iter();
        entries.map(of_channel).collect()
    }

    /// Name of the wide table, and which of its projectors this is.
    fn label(&self) -> Label {
        let label = self.wide.meta.label;
        let number = format!(" {}/{}", self.own + 1, self.wide.parts.len());
        let mut name = label.name().to_owned();
        while name.len() + number.len() > NAME_BYTES {
            name.pop();
        }
        Label::new(&(name + &number), label.date())
    }

    /// Cuts a section of values of a grid with so many columns, behind a head that says rows and columns
    /// if it has `head` bytes, to those of the projector's own part.
    fn cut(
        &self,
        part: &mut ImageWriter,
        kind: SectionKind,
        (own, cols): (&FramePart, usize),
        head: usize,
    ) {
        let Some(bytes) = part.bytes(kind) else {
            return;
        };
        let value = size_of::<u16>() * usize::from(self.wide.meta.channels);
        let (first, values) = bytes.split_at(head);
        let mut cut = first.to_vec();
        for (place, count) in [
            (fine_gain::ROWS, own.rows),
            (fine_gain::COLS, own.columns.len()),
        ] {
            if let Some(stated) = cut.get_mut(place) {
                stated.copy_from_slice(&(count as u16).to_le_bytes());
            }
        }
        let columns = own.columns.start * value..own.columns.end * value;
        for row in values.chunks_exact(cols * value).take(own.rows) {
            cut.extend_from_slice(&row[columns.clone()]);
        }
        part.replace(kind, Some(cut));
    }

    /// Ambient light of the neighbours' cells, the mean of what they cover; none in a dark room.
    fn ambient_of_others(&self) -> Vec<u16> {
        let wide = self.wide;
        let channels = usize::from(wide.meta.channels);
        let cols = wide.meta.grid.cols();
        let mut sums = vec![(0.0, 0.0); self.others.cells() * channels];
        for row in 0..wide.meta.grid.rows() {
            for channel in 0..channels {
                let Some(ambient) = wide.table.ambient_row(row, channel) else {
                    return Vec::new();
                };
                for (light, places) in ambient.zip(&self.to_others[row * cols..]) {
                    for (at, share) in places {
                        let (sum, weight) = &mut sums[at * channels + channel];
                        *sum += f64::from(light.to_bits()) * share;
                        *weight += share;
                    }
                }
            }
        }
        let means = sums
            .iter()
            .map(|(sum, weight)| (sum / weight).round() as u16);
        means.collect()
    }
}

/// Adds up what terms say of places, and empties the memory again.
fn sum_up(sums: &mut [f64], terms: impl Iterator<Item = (u32, f64)>) -> Vec<(u32, f64)> {
    let mut touched = Vec::new();
    for (at, value) in terms {
        let sum = &mut sums[at as usize];
        if *sum == 0.0 {
            touched.push(at);
        }
        *sum += value;
    }
    touched.sort_unstable();
    touched.dedup();
    let taken = touched.into_iter().map(|at| {
        let value = std::mem::take(&mut sums[at as usize]);
        (at, value)
    });
    taken.filter(|(_, value)| *value != 0.0).collect()
}
