//! Accuracy ladder: what each tier of a table leaves out, what it costs on the reference
//! board, and how long it takes on the machine that writes the report.

use iltm_compile::cost::{self, BUDGET};
use iltm_picture::{Response, statistics::median};
use iltm_runtime::{
    FrameSize, Grid,
    image::{
        Table, TierInfo,
        layout::{ALIGNMENT, entry, tier},
    },
    operator::{Operator, Segment},
    pipeline::{
        Encoding, FrameError, FrameJob, FullMemory, RowBuffers, compensate_cells,
        compensate_pixels, prepare_pixels,
    },
    placement::PixelArea,
    units::Halfword,
};
use iltm_solve::natural_images;
use iltm_video::OperatorMemory;
use std::time::Instant;

/// Runs of which the median counts: odd, and few enough to take no time.
const RUNS: usize = 51;

/// One tier as its table has it: nothing is measured.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct TierCost {
    /// The tier.
    pub tier: u8,
    /// Predicted error of what the tier leaves out, relative to the wanted light.
    pub left_out: f64,
    /// The same together with the inverse's own error: root of the sum of squares.
    pub total: f64,
    /// Operator entries read a frame.
    pub entries: u32,
    /// Multiplications by them a frame, all channels.
    pub multiplications: u32,
    /// Bytes of the operator that a frame reads.
    pub bytes: u64,
    /// Bytes of a table that has this tier and, of the others, gain only.
    pub table_bytes: u64,
    /// Instructions of a frame of the grid's size on the reference board
    /// ([`cost`]).
    pub instructions: u64,
}

impl TierCost {
    /// Share of a frame's time that the instructions take, by
    /// [`BUDGET`]: one instruction a cycle.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.instructions as f64 / BUDGET as f64
    }
}

/// All tiers of a table, gain only first.
#[must_use]
pub fn tier_costs(table: &Table<'_>) -> Vec<TierCost> {
    let own = table.inverse_error().to_num::<f64>();
    let size = FrameSize::of_grid(table.grid());
    let tiers = (0_u8..).zip(table.tiers());
    let step = |(tier, info): (u8, &TierInfo)| {
        let left_out: f64 = info.predicted_error.to_num();
        TierCost {
            tier,
            left_out,
            total: left_out.hypot(own),
            entries: info.entries,
            multiplications: info.multiplications,
            bytes: operator_bytes(table, tier),
            table_bytes: table_bytes(table, tier),
            instructions: cost::stages(table, tier, size).total(),
        }
    };
    tiers.map(step).collect()
}

/// One tier, and how long it took here.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct TimedTier {
    /// What the table says.
    pub cost: TierCost,
    /// Microseconds that one core of this machine took for a frame of the grid's
    /// size.
    pub microseconds: f64,
}

/// All tiers of a table, gain only first. Takes some milliseconds to measure.
///
/// # Errors
/// Those of [`microseconds`].
pub fn ladder(table: &Table<'_>) -> Result<Vec<TimedTier>, FrameError> {
    let timed = tier_costs(table).into_iter().zip(microseconds(table)?);
    let tier = |(cost, microseconds)| TimedTier { cost, microseconds };
    Ok(timed.map(tier).collect())
}

fn operator_bytes(table: &Table<'_>, tier: u8) -> u64 {
    let used = segments(table).iter().filter(|own| own.tier == tier);
    used.map(|segment| segment.bytes() as u64).sum()
}

fn table_bytes(table: &Table<'_>, kept: u8) -> u64 {
    let others = segments(table).iter().filter(|own| own.tier != kept);
    let section = |bytes: usize| entry::SIZE + bytes.next_multiple_of(ALIGNMENT);
    let sections: usize = others.map(|segment| section(segment.bytes())).sum();
    let tiers = table.tiers().len() - if kept == 0 { 1 } else { 2 };
    (table.bytes() - sections - tiers * tier::SIZE) as u64
}

fn segments<'t>(table: &'t Table<'_>) -> &'t [Segment<'t>] {
    table.operator().map_or(&[], Operator::segments)
}

/// Microseconds that one core takes for a frame of the grid's own size, for each
/// tier: the median over some natural images.
///
/// Numbers of this machine, not of the device.
///
/// # Errors
/// [`FrameError`] if the table has another number of channels than one or three.
pub fn microseconds(table: &Table<'_>) -> Result<Vec<f64>, FrameError> {
    microseconds_at(table, table.grid())
}

/// The same for frames of one pixel a cell of another, finer grid.
///
/// # Errors
/// [`FrameError`] if that grid is not as fine as the table's on both axes.
pub fn microseconds_at(table: &Table<'_>, pixels: Grid) -> Result<Vec<f64>, FrameError> {
    let channels = usize::from(table.channels());
    let size = FrameSize::of_grid(pixels);
    let of_grid = pixels == table.grid();
    let code = |light: &f64| (Response::Srgb.value(*light) * 255.0).round() as u8;
    let images: Vec<Vec<u8>> = natural_images(pixels)
        .column_iter()
        .map(|image| {
            let codes = image.iter().map(code);
            codes
                .flat_map(|code| std::iter::repeat_n(code, channels))
                .collect()
        })
        .collect();
    let mut input = vec![0_u8; size.pixels() * channels];
    let mut memory = OperatorMemory::new(table);
    let mut frame = FrameMemory::new(table, size);
    let mut medians = Vec::new();
    for row in (0..size.height()).take_while(|_| !of_grid) {
        prepare_pixels(table, size, row, &mut frame.lent())?;
    }
    for tier in 0..=table.top_tier() {
        let encoding = Encoding::Display;
        let mut runs = Vec::with_capacity(RUNS);
        for image in images.iter().cycle().take(RUNS) {
            let mut workspace = memory.workspace();
            let start = Instant::now();
            if of_grid {
                compensate_cells(table, tier, encoding, image, &mut input, &mut workspace)?;
            } else {
                let job = FrameJob {
                    table,
                    size,
                    area: PixelArea::all(size),
                    tier,
                    encoding,
                };
                compensate_pixels(&job, image, &mut input, &mut frame.lent(), &mut workspace)?;
            }
            runs.push(start.elapsed().as_secs_f64() * 1e6);
        }
        medians.extend(median(runs));
    }
    Ok(medians)
}

/// What the runtime's [`FullMemory`] borrows.
pub(crate) struct FrameMemory {
    pub(crate) gains: Vec<Halfword>,
    pub(crate) ambient: Vec<Halfword>,
    sums: Vec<u64>,
    corrections: Vec<i32>,
    columns: Vec<u32>,
    line: Vec<i32>,
    spread: Vec<i32>,
    values: Vec<u16>,
}

impl FrameMemory {
    /// Enough for frames of `size`.
    pub(crate) fn new(table: &Table<'_>, size: FrameSize) -> Self {
        let channels = usize::from(table.channels());
        let (samples, width) = (size.pixels() * channels, size.width());
        let cells = table.grid().cells() * channels;
        let fine = table.fine_gain().map_or(0, |fine| fine.size().width());
        Self {
            gains: vec![Halfword::default(); samples],
            ambient: vec![Halfword::default(); samples],
            sums: vec![0; cells],
            corrections: vec![0; cells],
            columns: vec![0; 2 * width * channels],
            line: vec![0; table.grid().cols().max(fine)],
            spread: vec![0; width],
            values: vec![0; width],
        }
    }

    pub(crate) fn lent(&mut self) -> FullMemory<'_> {
        FullMemory {
            gains: &mut self.gains,
            ambient: &mut self.ambient,
            sums: &mut self.sums,
            corrections: &mut self.corrections,
            columns: &mut self.columns,
            row: RowBuffers {
                line: &mut self.line,
                spread: &mut self.spread,
            },
            values: &mut self.values,
        }
    }
}
