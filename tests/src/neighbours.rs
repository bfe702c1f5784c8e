//! Neighbours' light: the runtime's own way through frames with it, on the host, and what it takes on
//! the board (`docs/firmware.md`).

use crate::firmware::elf_of;
use crate::instructions::bench;
use crate::made_up::MadeUp;
use crate::simulated::{learned, photograph, scene};
use crate::stages::stored;
use iltm::compile::image::StoredRow;
use iltm::compile::{NEIGHBOURS_FACTOR, split_table};
use iltm::device::emulator::Board;
use iltm::video::OperatorMemory;
use iltm_runtime::frame_buffers::Format;
use iltm_runtime::image::Table;
use iltm_runtime::operator::Segment;
use iltm_runtime::pipeline::{FullMemory, FullPipeline, RowBuffers, compensate_cells};
use iltm_runtime::units::Halfword;
use iltm_runtime::{FrameSize, Grid};

/// Stages of the firmware for one of several projectors.
pub const OF_SEVERAL: &str = "stages,neighbours";

/// What the runtime makes of a frame with this light of the neighbours' cells, or with none.
pub fn runtime_frame(
    table: &Table<'_>,
    (tier, format): (u8, Format),
    wanted: &[u8],
    light: Option<&[Halfword]>,
) -> Vec<u8> {
    let mut operator = OperatorMemory::new(table);
    operator.hear(light.map(<[Halfword]>::to_vec));
    if format.size() == FrameSize::of_grid(table.grid()) {
        let mut input = vec![0; wanted.len()];
        let workspace = &mut operator.workspace();
        let encoding = format.encoding();
        compensate_cells(table, tier, encoding, wanted, &mut input, workspace).expect("sized");
        return input;
    }
    match table.channels() {
        1 => larger::<1>(table, (tier, format), wanted, &mut operator),
        _ => larger::<3>(table, (tier, format), wanted, &mut operator),
    }
}

fn larger<const C: usize>(
    table: &Table<'_>,
    (tier, format): (u8, Format),
    wanted: &[u8],
    operator: &mut OperatorMemory,
) -> Vec<u8> {
    let (cells, size) = (C * table.grid().cells(), format.size());
    let area = table.area(size).expect("of the projector's aspect");
    let pipeline = FullPipeline::<C>::within(table, size, area).expect("it fits");
    let mut memory = FullMemory {
        gains: &mut vec![[0; 2]; C * size.pixels()],
        ambient: &mut vec![[0; 2]; C * size.pixels()],
        sums: &mut vec![0; cells],
        corrections: &mut vec![0; cells],
        columns: &mut vec![0; 2 * C * size.width()],
        row: RowBuffers {
            line: &mut vec![0; pipeline.line_len()],
            spread: &mut vec![0; area.size.width()],
        },
        values: &mut vec![0; area.size.width()],
    };
    pipeline.prepare(&mut memory).expect("sized");
    let mut input = vec![[0; C]; size.pixels()];
    let (wanted, encoding) = (wanted.as_chunks().0, format.encoding());
    let workspace = &mut operator.workspace();
    pipeline
        .compensate(tier, encoding, wanted, &mut input, &mut memory, workspace)
        .expect("sized");
    input.into_flattened()
}

/// Light of neighbours' cells with no pattern, beyond reference white too.
pub fn random_light(grid: Grid, channels: usize, seed: u64) -> Vec<Halfword> {
    let mut random = fastrand::Rng::with_seed(seed);
    let most = if seed.is_multiple_of(3) {
        u16::MAX
    } else {
        1 << 15
    };
    let samples = grid.cells() * channels;
    (0..samples)
        .map(|_| random.u16(..=most).to_le_bytes())
        .collect()
}

/// What the light of two neighbours takes, instructions of a frame in three channels.
#[derive(Clone, Debug)]
pub struct NeighboursCost {
    /// Cells of the own frame, and of the neighbours'.
    pub cells: [Grid; 2],
    /// Predicted error of what the tier leaves out.
    pub error: f64,
    /// Entries a row with own inputs, and with the neighbours'.
    pub entries: [f64; 2],
    /// Instructions without the neighbours and with them.
    pub instructions: [u64; 2],
}

/// Counts frames of the middle projector of the cube room at so many cells: its operator as it is
/// solved from photographs and split, with values so small that hardly any sample is clipped.
pub fn costs((rows, cols): (u16, u16)) -> Vec<NeighboursCost> {
    let scene = scene(
        "cube-room",
        &[
            ("rows = 12", &format!("rows = {rows}")),
            ("cols = 16", &format!("cols = {cols}")),
        ],
    );
    let capture = tempfile::tempdir().expect("a folder for photographs");
    photograph(&scene, 60, 1, capture.path());
    let parts = split_table(
        &learned(capture.path()).compiled.image,
        Some(3),
        NEIGHBOURS_FACTOR,
    );
    let part = &parts.expect("three alike")[1];
    let table = Table::check(&part.image).expect("split checked it");
    let operator = table.operator().expect("walls light each other");
    let others = table.neighbours().expect("two").grid();
    let bench_elf = elf_of(Board::An500, OF_SEVERAL, "bench");
    let size = FrameSize::of_grid(table.grid());
    let cost = |segment: &Segment<'_>| {
        let mut with = stored(segment);
        with.sort_by_key(|row| row.index);
        let own = table.grid().cells();
        let mut without = with.clone();
        for row in &mut without {
            row.entries.retain(|(at, _)| usize::from(*at) < own);
        }
        without.retain(|row| !row.entries.is_empty());
        let entries = |rows: &[StoredRow]| {
            let entries = rows.iter().map(|row| row.entries.len());
            entries.sum::<usize>() as f64 / own as f64
        };
        let of_own = entries(&without);
        let of_others = entries(&with) - of_own;
        let instructions = [without, with].map(|rows| {
            let mut made = MadeUp::nearly_plain(table.grid(), 3, true);
            made.response = true;
            made.tiers = vec![rows];
            made
        });
        let [alone, mut together] = instructions;
        together.neighbours = Some((others, [1, 1], vec![330; 3 * others.cells()]));
        let count = |made: MadeUp| {
            let lines = bench(&bench_elf, &made.image(), size, None);
            let [.., frame, _] = lines.last().expect("tier 1");
            *frame
        };
        let tier = usize::from(segment.tier);
        NeighboursCost {
            cells: [table.grid(), others],
            error: table.tiers()[tier].predicted_error.to_num(),
            entries: [of_own, of_others],
            instructions: [count(alone), count(together)],
        }
    };
    operator.segments().iter().map(cost).collect()
}

/// Prints what [`costs`] counts.
pub fn print(cells: (u16, u16)) {
    for cost in costs(cells) {
        let [alone, with] = cost.instructions;
        println!(
            "{} x 3 with {} cells of neighbours, 1/{:.0}: {:.1} and {:.2} entries a row, {alone} and \
             {with} instructions: {:.1} % more",
            cost.cells[0],
            cost.cells[1],
            cost.error.recip(),
            cost.entries[0],
            cost.entries[1],
            100.0 * (with as f64 / alone as f64 - 1.0)
        );
    }
}

/// Prints what two neighbours take whose light the table has no entries for: the transform of their
/// cells.
pub fn print_fixed() {
    let own = crate::grid(96, 128);
    let others = crate::grid(24, 64);
    let bench_elf = elf_of(Board::An500, OF_SEVERAL, "bench");
    let mut made = MadeUp::random(own, 3, 4, 1);
    let count = |made: &MadeUp| {
        let lines = bench(&bench_elf, &made.image(), FrameSize::of_grid(own), None);
        let [.., frame, _] = lines.last().expect("tier 1");
        *frame
    };
    let alone = count(&made);
    made.neighbours = Some((others, [1, 1], vec![330; 3 * others.cells()]));
    let more = count(&made) - alone;
    println!(
        "{own} x 3 with {others} cells of neighbours: {more} instructions for their transform"
    );
}
