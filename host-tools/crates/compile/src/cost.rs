//! Cost of a frame on the reference board, in instructions.
//!
//! A model of counts: QEMU's of the firmware for a Cortex-M7 (`docs/firmware.md`). Each
//! of the three stages of a frame is a sum over what it works on:
//!
//! | stage | works on |
//! |---|---|
//! | first | pixels of each channel, nodes of the Haar levels |
//! | operator | rows and pairs of entries of the tier's segments, cells of neighbours |
//! | last | nodes of the levels, pixels of each channel |
//!
//! Rows, pairs, sums to clear, and what turns of a loop save have the numbers of instructions of
//! the kernel's loops, read off `runtime/src/kernel/arm`. All other numbers were fitted by least squares
//! to the 40 kinds of frames of `docs/costs.csv` (`cargo run --release -p iltm-tests
//! --bin counts -- costs`) and to `docs/instructions.csv`: no frame there is off by more than
//! 2 %. Those of `docs/stages.csv`, to which nothing was fitted, are off by up to
//! 1.9 %. `tests/tests/runtime/costs.rs` holds the model to 2 % of every one. Clipped
//! samples are not in it: how many there are depends on the picture. Each takes two
//! instructions more at black, eight at white.
//!
//! Instructions are not cycles: a Cortex-M7 can do two at once, and waits for memory.
//! [`BUDGET`] takes one cycle for each.

use crate::ladder::Part;
use iltm_runtime::{
    FrameSize, Grid,
    image::{Neighbours, Table},
    operator::{Channels, Segment},
};

/// Cycles a second of the part that shares of a frame's time are given for.
pub const CLOCK: u64 = 216_000_000;

/// Frames a second that they are given for.
pub const RATE: u64 = 60;

/// Instructions that a frame may take at [`RATE`] on a part of [`CLOCK`] that does one
/// a cycle.
pub const BUDGET: u64 = CLOCK / RATE;

/// What of a table, beside its operator, a frame's instructions depend on.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shape {
    /// Cells.
    pub grid: Grid,
    /// 1 or 3.
    pub channels: u8,
    /// Whether there is ambient light.
    pub ambient: bool,
    /// Whether codes are in proportion to drives: the projector is linear.
    pub linear: bool,
    /// Size of the frame.
    pub size: FrameSize,
    /// Cells of other projectors whose light comes with each frame.
    pub neighbours: Option<Grid>,
}

/// Instructions of a frame's stages.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Stages {
    /// From pixels to input coefficients, or to means of the cells where the frame is
    /// larger than the grid.
    pub first: f64,
    /// The operator; for larger frames also both transforms.
    pub operator: f64,
    /// To pixels: corrections, gain, clip, codes.
    pub last: f64,
}

impl Stages {
    /// Instructions of the whole frame.
    #[must_use]
    pub fn total(&self) -> u64 {
        (self.first + self.operator + self.last).round() as u64
    }
}

impl Shape {
    /// That of a table, for frames of a size.
    #[must_use]
    pub fn of(table: &Table<'_>, size: FrameSize) -> Self {
        Self {
            grid: table.grid(),
            channels: table.channels(),
            ambient: table.ambient_row(0, 0).is_some(),
            linear: table.codes(0).is_none(),
            size,
            neighbours: table.neighbours().map(Neighbours::grid),
        }
    }

    /// What a frame takes that reads `segments`, all those of a tier; none of gain only.
    #[must_use]
    pub fn stages(&self, segments: &[Segment<'_>]) -> Stages {
        let channels = f64::from(self.channels);
        let of_grid = self.size == FrameSize::of_grid(self.grid);
        let pixels = if of_grid {
            self.own_pixels()
        } else {
            self.larger_pixels()
        };
        if segments.is_empty() {
            // Both are asked for and have nothing to do.
            return Stages {
                first: 100.0,
                operator: 40.0,
                last: pixels,
            };
        }
        let levels = levels(self.grid);
        let synthesis = channels * self.synthesis(&levels);
        let operator = self.operator(segments) + channels * self.of_neighbours();
        if of_grid {
            return Stages {
                first: channels * self.analysis(&levels),
                operator,
                last: pixels + synthesis,
            };
        }
        Stages {
            first: channels * self.averages(),
            operator: channels * self.cells(&levels) + operator + synthesis,
            last: pixels + channels * self.interpolation(),
        }
    }

    /// Gain, clip and code of a frame of the grid's size.
    fn own_pixels(&self) -> f64 {
        let channels = f64::from(self.channels);
        let sample = if self.channels == 1 { 13.99 } else { 12.99 };
        let sample = sample + if self.ambient { 2.01 } else { 0.0 } + self.turns();
        200.0 + channels * (146.0 + sample * self.grid.cells() as f64)
    }

    /// More a sample of what a linear projector shows: its loop takes two a turn, not four.
    fn turns(&self) -> f64 {
        if self.linear { 0.5 } else { 0.0 }
    }

    /// The same of a larger one.
    fn larger_pixels(&self) -> f64 {
        let channels = f64::from(self.channels);
        let sample = if self.channels == 1 { 12.59 } else { 12.28 };
        let sample = sample + if self.ambient { 2.04 } else { 0.0 } + self.turns();
        let rows = 220.0 * self.size.height() as f64;
        channels * (552.0 + rows + sample * self.size.pixels() as f64)
    }

    /// From pixels to input coefficients, one channel.
    fn analysis(&self, levels: &[LevelCost]) -> f64 {
        let Some((finest, coarser)) = levels.split_first() else {
            return 0.0;
        };
        let node = if self.ambient { 34.5 } else { 26.6 };
        // In colour the loop takes two nodes a turn.
        let node = if self.channels == 1 { node } else { node - 1.0 };
        let finest = node * finest.plain
            + 135.4 * finest.halves
            + 304.2 * finest.weighted
            + 230.2 * finest.calls;
        let coarser = coarser.iter().map(|level| {
            222.6
                + 20.0 * level.plain
                + 24.8 * level.halves
                + 304.2 * level.weighted
                + 59.2 * level.calls
                + 197.3 * level.rows
        });
        104.3 + finest + coarser.sum::<f64>()
    }

    /// From input coefficients' sums to corrections of the cells, one channel.
    fn synthesis(&self, levels: &[LevelCost]) -> f64 {
        let copies = if self.channels == 1 { 0.0 } else { 1.0 };
        let level = |level: &LevelCost| {
            156.6
                + 8.71 * level.plain
                + 58.1 * level.halves
                + 99.3 * level.weighted
                + 76.3 * level.calls
                + 72.4 * level.rows
        };
        let levels = levels.iter().map(level).sum::<f64>();
        copies * self.grid.cells() as f64 + levels - 140.0
    }

    /// Rows and pairs of the segments.
    fn operator(&self, segments: &[Segment<'_>]) -> f64 {
        let of_segment = |segment: &Segment<'_>| {
            let groups = segment.groups().count() as f64;
            let row = |pairs| row_instructions(pairs, segment.channels, self.channels);
            let rows = segment.rows().map(|rows| row(rows.pairs()));
            258.5 + 61.8 * groups + rows.sum::<f64>()
        };
        let sums = 0.375 * f64::from(self.channels) * self.grid.cells() as f64;
        340.0 + sums + segments.iter().map(of_segment).sum::<f64>()
    }

    /// From the light of the neighbours' cells to input coefficients, one channel.
    fn of_neighbours(&self) -> f64 {
        let Some(grid) = self.neighbours else {
            return 0.0;
        };
        let level = |level: &LevelCost| {
            193.0
                + 44.9 * level.halves
                + 288.3 * level.weighted
                + 64.9 * level.calls
                + 171.2 * level.rows
        };
        let cell = if self.ambient { 25.76 } else { 21.66 };
        60.0 + cell * grid.cells() as f64 + levels(grid).iter().map(level).sum::<f64>()
    }

    /// Means of the cells of a larger frame, one channel. A row of pixels that a border
    /// of cells cuts is added to both.
    fn averages(&self) -> f64 {
        let (rows, height) = (self.grid.rows(), self.size.height());
        let cut = (1..rows).filter(|row| !(row * height).is_multiple_of(rows));
        let width = self.size.width() as f64;
        let pixel = if self.ambient { 6.04 } else { 4.02 };
        (height + cut.count()) as f64 * (178.5 + pixel * width)
            + 6.57 * width * rows as f64
            + 69.9 * self.grid.cells() as f64
    }

    /// From means of the cells to input coefficients, and copies of the corrections, one
    /// channel.
    fn cells(&self, levels: &[LevelCost]) -> f64 {
        let level = |level: &LevelCost| {
            290.8
                + 20.0 * level.plain
                + 125.6 * level.halves
                + 423.2 * level.weighted
                + 18.7 * level.rows
        };
        27.3 * self.grid.cells() as f64 + levels.iter().map(level).sum::<f64>()
    }

    /// Corrections between the cells' centres, one channel.
    fn interpolation(&self) -> f64 {
        let (width, cols) = (self.size.width(), self.grid.cols());
        // Runs between centres are of two lengths where cells do not end with pixels.
        let run = if width.is_multiple_of(cols) {
            36.8
        } else {
            42.3
        };
        let row = 307.6 + 1.78 * width as f64 + run * cols as f64;
        self.size.height() as f64 * row
    }
}

/// What a frame of `tier` takes.
#[must_use]
pub fn stages(table: &Table<'_>, tier: u8, size: FrameSize) -> Stages {
    let segments = table
        .operator()
        .map_or(&[][..], |operator| operator.segments());
    let own = segments.iter().filter(|segment| segment.tier == tier);
    Shape::of(table, size).stages(&own.copied().collect::<Vec<_>>())
}

/// How a level's nodes merge, by what the loops make of them.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
struct LevelCost {
    /// Nodes of four equal quarters.
    plain: f64,
    /// Nodes of two halves, or of one alone.
    halves: f64,
    /// Nodes of unequal quarters.
    weighted: f64,
    /// Calls of the loop for plain nodes.
    calls: f64,
    /// Rows of nodes of a level that is not plain throughout.
    rows: f64,
}

/// The nodes along one axis: `full` cells each, the last one `last`.
#[derive(Clone, Copy, Debug)]
struct AxisCost {
    nodes: usize,
    full: usize,
    last: usize,
}

/// Pairs of nodes along an axis: of equal nodes, of unequal ones, and those alone.
#[derive(Clone, Copy, Debug)]
struct Pairs {
    equal: f64,
    unequal: f64,
    alone: f64,
}

impl AxisCost {
    const fn of_cells(cells: usize) -> Self {
        Self {
            nodes: cells,
            full: 1,
            last: 1,
        }
    }

    const fn merged(self) -> Self {
        let even = self.nodes.is_multiple_of(2);
        Self {
            nodes: self.nodes.div_ceil(2),
            full: 2 * self.full,
            last: if even {
                self.full + self.last
            } else {
                self.last
            },
        }
    }

    const fn pairs(self) -> Pairs {
        let even = self.nodes.is_multiple_of(2);
        let whole = self.nodes / 2;
        let unequal = (even && self.full != self.last) as usize;
        Pairs {
            equal: (whole - unequal) as f64,
            unequal: unequal as f64,
            alone: if even { 0.0 } else { 1.0 },
        }
    }
}

/// The levels of a grid's basis, finest first.
fn levels(grid: Grid) -> Vec<LevelCost> {
    let (mut rows, mut cols) = (
        AxisCost::of_cells(grid.rows()),
        AxisCost::of_cells(grid.cols()),
    );
    let mut levels = Vec::new();
    while rows.nodes > 1 || cols.nodes > 1 {
        let (down, along) = (rows.pairs(), cols.pairs());
        let all = |pairs: Pairs| pairs.equal + pairs.unequal + pairs.alone;
        let plain = down.equal * along.equal;
        let halves =
            all(down) * all(along) - (down.equal + down.unequal) * (along.equal + along.unequal);
        let whole = all(down) * all(along) - plain < 0.5;
        levels.push(LevelCost {
            plain,
            halves,
            weighted: all(down) * all(along) - plain - halves,
            calls: match (whole, along.equal > 0.0) {
                (true, _) => 1.0,
                (false, true) => down.equal,
                (false, false) => 0.0,
            },
            rows: if whole { 0.0 } else { all(down) },
        });
        (rows, cols) = (rows.merged(), cols.merged());
    }
    levels
}

/// Instructions that entries of an operator cost, about.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Price {
    /// A row that has any.
    pub(crate) row: f64,
    /// A pair of neighbours, or an entry without one.
    pub(crate) pair: f64,
}

impl Price {
    /// That of a part of the operator of a table of 1 or 3 channels.
    pub(crate) fn of(part: Part, of_table: u8) -> Self {
        let channels = match part {
            Part::Shared => Channels::All,
            Part::Channel(channel) => Channels::One(channel),
        };
        let row = row_instructions(0, channels, of_table);
        Self {
            row,
            pair: (row_instructions(8, channels, of_table) - row) / 8.0,
        }
    }
}

/// Instructions of the kernel's loop for one row of so many pairs: its head and its
/// end, loads of several words, three (seven) for each pair.
fn row_instructions(pairs: u16, channels: Channels, of_table: u8) -> f64 {
    let p = u32::from(pairs);
    let odd = |bit: u32| p >> bit & 1;
    let long = pairs > 8;
    let instructions = match (channels, of_table) {
        (Channels::All, 3) if long => 28 + 32 * (p / 4) + 15 * odd(1) + 8 * odd(0),
        (Channels::All, 3) => 17 + 7 * p + p.div_ceil(2),
        (channels, _) => {
            // A channel's own part is scaled and added to what is there.
            let end = if channels == Channels::All { 6 } else { 11 };
            end + if long {
                11 + 28 * (p / 8) + 13 * odd(2) + 7 * odd(1) + 4 * odd(0)
            } else {
                3 * p + p.div_ceil(4)
            }
        }
    };
    f64::from(instructions)
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // Small whole numbers are exact.
mod tests {
    use super::*;

    fn level_counts(rows: u16, cols: u16) -> Vec<(f64, f64, f64)> {
        let levels = levels(Grid::new(rows, cols).unwrap());
        let counts = levels.iter();
        counts
            .map(|level| (level.plain, level.halves, level.weighted))
            .collect()
    }

    #[test]
    fn levels_of_a_power_of_two_have_equal_quarters_only() {
        assert_eq!(level_counts(4, 4), [(4.0, 0.0, 0.0), (1.0, 0.0, 0.0)]);
        let levels = levels(Grid::new(4, 4).unwrap());
        assert!(
            levels
                .iter()
                .all(|level| level.calls == 1.0 && level.rows == 0.0)
        );
    }

    #[test]
    fn levels_of_odd_sides_have_halves_and_then_unequal_quarters() {
        // 3 x 5 cells: 1 x 2 pairs of pairs, 1 alone below them and 1 beside, 1 corner.
        // Then 2 x 3 nodes of 2 + 1 rows; then 1 x 2 nodes.
        assert_eq!(
            level_counts(3, 5),
            [(2.0, 4.0, 0.0), (0.0, 1.0, 1.0), (0.0, 1.0, 0.0)]
        );
    }

    #[test]
    fn as_many_details_as_cells_but_one() {
        for (rows, cols) in [(1, 1), (1, 7), (13, 21), (45, 80), (31, 33)] {
            let grid = Grid::new(rows, cols).unwrap();
            let nodes = levels(grid).len();
            let basis = iltm_runtime::haar::Basis::new(grid);
            let deepest = basis.functions().map(|f| usize::from(f.level)).max();
            // The constant counts as one level above the coarsest.
            assert_eq!(deepest, Some(nodes));
        }
    }

    #[test]
    fn rows_take_what_the_loops_of_the_kernel_have_instructions() {
        // One channel, one pair: `ldmia`, three for the pair, six to end the row.
        assert_eq!(row_instructions(1, Channels::All, 1), 10.0);
        // Eight pairs: two `ldmia`.
        assert_eq!(row_instructions(8, Channels::All, 1), 32.0);
        // Ten pairs: two words, a zero, a count; eight at once, two at once.
        assert_eq!(row_instructions(10, Channels::All, 1), 17.0 + 28.0 + 7.0);
        // Three channels, two pairs: two `ldrh`, `ldmia`, seven each, 15 to end the row.
        assert_eq!(row_instructions(2, Channels::All, 3), 32.0);
        // A channel's own row is scaled and added: five more.
        assert_eq!(row_instructions(1, Channels::One(2), 3), 15.0);
    }
}
