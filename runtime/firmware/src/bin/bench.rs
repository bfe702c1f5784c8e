//! Instruction counter: what a frame takes, stage by stage, at every tier.
//!
//! The table lies in slot A, the frame in the frame memory, its size in the first
//! word of the self-test's part (width in the low half, height in the high half),
//! all written before the start. Under an emulator that counts instructions
//! (`-icount shift=0`) a tick is 40 of them. Findings go to standard output through
//! semihosting, a line a tier: tier, then instructions of the stages and of the
//! whole frame, then samples clipped.
//!
//! If the second word is not 0, slot A holds a site's public key and a right of so many bytes
//! to confirm table 1 on device 1, and the only finding is what the device takes to look at it.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use cortex_m_semihosting::{debug, hprintln};
use iltm_firmware::board::{Board, Clock, TableFlash};
use iltm_firmware::boards::{Chosen, psram};
use iltm_firmware::fault;
use iltm_firmware::memory::{MAX_PIXELS, Memory};
use iltm_runtime::FrameSize;
use iltm_runtime::frame_buffers::ControlWords;
use iltm_runtime::image::{Table, content, unseal};
use iltm_runtime::pipeline::{Encoding, FrameError, FullPipeline, GridPipeline};
use iltm_runtime::store::Slot;
use iltm_runtime::trust::{Deed, Terms, Trust, allows};
use iltm_runtime::units::ClippedSamples;
use static_cell::ConstStaticCell;

/// Instructions a tick: a nanosecond each, at 25 MHz.
const INSTRUCTIONS: u64 = 40;

/// Frames that are counted come in and go out like video.
const ENCODING: Encoding = Encoding::Display;

static INPUT: ConstStaticCell<[u8; 3 * MAX_PIXELS]> = ConstStaticCell::new([0; 3 * MAX_PIXELS]);

/// Moments between the stages.
struct Laps<'c, K: Clock> {
    clock: &'c K,
    ticks: [u64; 4],
    lap: usize,
}

impl<'c, K: Clock> Laps<'c, K> {
    fn new(clock: &'c K) -> Self {
        let mut laps = Self {
            clock,
            ticks: [0; 4],
            lap: 0,
        };
        laps.mark();
        laps
    }

    fn mark(&mut self) {
        self.ticks[self.lap] = self.clock.ticks();
        self.lap += 1;
    }

    /// Instructions of the three stages and of all.
    fn instructions(&self) -> [u64; 4] {
        let between = |from: usize, to: usize| (self.ticks[to] - self.ticks[from]) * INSTRUCTIONS;
        [between(0, 1), between(1, 2), between(2, 3), between(0, 3)]
    }
}

/// Not inlined: the compiler would share instructions between this and the other, and
/// a record of what was executed could not tell them apart.
#[inline(never)]
fn grid<const C: usize>(
    table: &Table<'_>,
    tier: u8,
    wanted: &[u8],
    input: &mut [u8],
    memory: &mut Memory,
    clock: &impl Clock,
) -> Result<([u64; 4], ClippedSamples), FrameError> {
    let pipeline = GridPipeline::<C>::new(table)?;
    let (wanted, input) = (wanted.as_chunks().0, input.as_chunks_mut().0);
    // Any light will do: the frame's bytes.
    let heard = table
        .neighbours()
        .and_then(|others| wanted.as_flattened().as_chunks().0.get(..others.samples()));
    let mut workspace = memory.workspace(heard);
    let mut laps = Laps::new(clock);
    // The basis of the neighbours' cells is worked out with the first frame.
    for _ in 0..=u8::from(heard.is_some()) {
        laps = Laps::new(clock);
        if pipeline.operates(tier) {
            pipeline.analyse(ENCODING, wanted, &mut workspace)?;
        }
        laps.mark();
        if pipeline.operates(tier) {
            pipeline.operate(tier, &mut workspace)?;
        }
        laps.mark();
    }
    let clipped = pipeline.finish(tier, ENCODING, wanted, input, &mut workspace)?;
    laps.mark();
    Ok((laps.instructions(), clipped))
}

#[inline(never)]
fn full<const C: usize>(
    table: &Table<'_>,
    tier: u8,
    size: FrameSize,
    wanted: &[u8],
    input: &mut [u8],
    memory: &mut Memory,
    clock: &impl Clock,
) -> Result<([u64; 4], ClippedSamples), FrameError> {
    let pipeline = FullPipeline::<C>::new(table, size)?;
    let (wanted, input) = (wanted.as_chunks().0, input.as_chunks_mut().0);
    let (mut frame, mut workspace) = memory.full(0, C, table.grid().cells(), size.width());
    pipeline.prepare(&mut frame)?;
    let mut laps = Laps::new(clock);
    if pipeline.operates(tier) {
        pipeline.average_frame(ENCODING, wanted, &mut frame)?;
    }
    laps.mark();
    if pipeline.operates(tier) {
        pipeline.correct(tier, frame.sums, frame.corrections, &mut workspace)?;
    }
    laps.mark();
    let clipped = pipeline.finish_frame(tier, ENCODING, wanted, input, &mut frame)?;
    laps.mark();
    Ok((laps.instructions(), clipped))
}

/// Instructions that a right takes; `None` if it is none.
#[inline(never)]
fn right(slot: &[u8], length: usize, clock: &impl Clock) -> Option<u64> {
    let (key, rest) = slot.split_first_chunk::<32>()?;
    let trust = Trust {
        key: Some(*key),
        device: 1,
    };
    let terms = Terms { trust, floor: 0 };
    let right = rest.get(..length)?;
    let start = clock.ticks();
    let allowed = allows(right, &Deed::Confirm { table: 1 }, 0, &terms, &mut || {});
    let ticks = clock.ticks() - start;
    allowed.is_ok().then_some(ticks * INSTRUCTIONS)
}

#[entry]
fn main() -> ! {
    let (Some(board), Some(memory), Some(input)) =
        (Chosen::take(), Memory::take(), INPUT.try_take())
    else {
        fault::restart();
    };
    let words = psram::self_test_words().load(0);
    let length = psram::self_test_words().load(1) as usize;
    if length > 0 {
        match right(board.flash.slot(Slot::A), length, &board.clock) {
            Some(instructions) => hprintln!("{}", instructions),
            None => hprintln!("no right"),
        }
        debug::exit(debug::EXIT_SUCCESS);
        fault::restart();
    }
    let size = FrameSize::new(words as u16, (words >> 16) as u16);
    let image = unseal(content(board.flash.slot(Slot::A)));
    let table = image.ok().and_then(|(image, _)| Table::check(image).ok());
    let (Some(table), Some(size)) = (table, size) else {
        hprintln!("no table or no frame");
        debug::exit(debug::EXIT_FAILURE);
        fault::restart();
    };
    let bytes = size.pixels() * usize::from(table.channels());
    let wanted = psram::outside_pixels(0..bytes);
    let input = &mut input[..bytes];
    for tier in 0..=table.top_tier() {
        let alike = size == FrameSize::of_grid(table.grid());
        let clock = &board.clock;
        let counted = match (table.channels(), alike) {
            (1, true) => grid::<1>(&table, tier, wanted, input, memory, clock),
            (_, true) => grid::<3>(&table, tier, wanted, input, memory, clock),
            (1, false) => full::<1>(&table, tier, size, wanted, input, memory, clock),
            (_, false) => full::<3>(&table, tier, size, wanted, input, memory, clock),
        };
        match counted {
            Ok(([first, second, third, whole], clipped)) => {
                hprintln!(
                    "{} {} {} {} {} {}",
                    tier,
                    first,
                    second,
                    third,
                    whole,
                    clipped.total()
                );
            }
            Err(_) => hprintln!("tier {} cannot be counted", tier),
        }
    }
    debug::exit(debug::EXIT_SUCCESS);
    fault::restart();
}
