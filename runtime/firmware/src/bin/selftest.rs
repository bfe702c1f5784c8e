//! Self-test binary: the product's frame loop under orders of a test.
//!
//! The orders are words in the self-test's part of the PSRAM, which the test has
//! written before the start; the findings go there too. With a
//! [`frames`](order::FRAMES) order the self-test plays the source and the display
//! of the frames itself, by the board's clock, so that under an emulator which
//! counts instructions every run is the same; when that many have been due, it
//! ends the emulation through semihosting.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use cortex_m_semihosting::debug;
use iltm_firmware::board::{Board, Clock};
use iltm_firmware::boards::{Chosen, psram};
use iltm_firmware::device::start;
use iltm_firmware::hooks::{FrameHooks, FrameOutcome};
use iltm_firmware::stack;
use iltm_firmware::telemetry::Telemetry;
use iltm_runtime::FrameSize;
use iltm_runtime::frame_buffers::layout::{BUFFERS, descriptor};
use iltm_runtime::frame_buffers::{
    ControlWords, Display, Format, Layout, NativeWords, Source, psram as map,
};
use iltm_runtime::image::crc32;
use iltm_runtime::pipeline::Encoding;

/// Indices of the orders.
mod order {
    /// A tier for all frames, plus 1; 0 leaves the choice to the governor.
    pub(super) const TIER: usize = 0;
    /// Number of the frame during which the loop hangs; 0 for none. Cleared when
    /// it does.
    pub(super) const HANG: usize = 1;
    /// Frames to play; 0 leaves them to somebody else.
    pub(super) const FRAMES: usize = 2;
    /// Width in the low half and height in the high half of frames to play.
    pub(super) const SIZE: usize = 3;
    /// Channels of frames to play.
    pub(super) const CHANNELS: usize = 4;
    /// Microseconds from frame to frame.
    pub(super) const PERIOD: usize = 5;
    /// First of the frames that are slowed down, and the first after them.
    pub(super) const SLOW_FROM: usize = 6;
    /// See [`SLOW_FROM`].
    pub(super) const SLOW_UNTIL: usize = 7;
    /// Ticks that a slow frame takes longer.
    pub(super) const SLOW_BY: usize = 8;
    /// Ticks that it takes longer for every tier.
    pub(super) const SLOW_BY_TIER: usize = 9;
    /// CRC-32 of every output that is to be shown.
    pub(super) const OUTPUT: usize = 10;
    /// Number of the frame that the source writes into while it is worked on; 0 for
    /// none.
    pub(super) const TEAR: usize = 11;
    /// Number of the frame during which the firmware panics; 0 for none. Cleared
    /// when it does.
    pub(super) const PANIC: usize = 12;
    /// CRC-32 of every output that is to be shown from some frame on.
    pub(super) const NEW_OUTPUT: usize = 13;
    /// Starts after which the first frame hangs. Each takes one off.
    pub(super) const HANGS: usize = 14;
}

/// Indices of the findings.
mod finding {
    /// Outputs shown.
    pub(super) const SHOWN: usize = 32;
    /// Outputs shown that had neither of the CRCs that were ordered.
    pub(super) const WRONG: usize = 33;
    /// Frames over the budget.
    pub(super) const OVER: usize = 34;
    /// Late, dropped and broken frames by the device's own count.
    pub(super) const LATE: usize = 35;
    pub(super) const DROPPED: usize = 36;
    pub(super) const BROKEN: usize = 37;
    /// Bytes of stack used.
    pub(super) const STACK: usize = 38;
    /// Longest frame, ticks.
    pub(super) const WORST: usize = 39;
    /// Changes of tier.
    pub(super) const CHANGES: usize = 40;
    /// Outputs shown that had the CRC of the new outputs.
    pub(super) const NEW: usize = 41;
    /// Times that a new output was followed by an old one, or an old one by a new one.
    pub(super) const TURNS: usize = 42;
    /// Number of the frame at the last turn.
    pub(super) const TURN: usize = 43;
    /// Frames shown whose number was not the next.
    pub(super) const SKIPPED: usize = 44;
    /// From here on, one word a change: frame in the low half, then tiers before
    /// and after.
    pub(super) const CHANGE: usize = 64;
}

/// Frames played by the self-test itself.
struct Play {
    source: Source<NativeWords<'static>>,
    display: Option<Display<NativeWords<'static>>>,
    layout: Layout,
    period: u64,
    /// When the next frame is due.
    due: Option<u64>,
    left: u32,
    /// Number of the last output, and whether it was a new one.
    last: Option<(u32, bool)>,
}

struct Orders {
    words: NativeWords<'static>,
    play: Option<Play>,
}

impl Orders {
    fn new(words: NativeWords<'static>) -> Self {
        let mut orders = Self { words, play: None };
        orders.play = orders.play();
        orders
    }

    fn play(&self) -> Option<Play> {
        let left = Some(self.words.load(order::FRAMES)).filter(|frames| *frames > 0)?;
        let size = self.words.load(order::SIZE);
        let format = Format::new(
            FrameSize::new(size as u16, (size >> 16) as u16)?,
            self.words.load(order::CHANNELS) as u8,
            Encoding::Display,
            self.words.load(order::PERIOD),
        )?;
        let control = psram::outside_words();
        let region = map::FRAMES.len();
        Some(Play {
            source: Source::announce(control, region, format).ok()?,
            display: None,
            layout: Layout::new(format, region).ok()?,
            period: u64::from(format.period_us()) * u64::from(<Chosen as Board>::Clock::HERTZ)
                / 1_000_000,
            due: None,
            left,
            last: None,
        })
    }

    fn add(&self, finding: usize, count: u32) {
        let sum = self.words.load(finding).wrapping_add(count);
        self.words.store(finding, sum);
    }

    /// Brings source and display up to `now`.
    fn outside(&mut self, now: u64) {
        let Some(play) = &mut self.play else {
            return;
        };
        if !play.source.attached() {
            return;
        }
        let display = play
            .display
            .get_or_insert_with(|| Display::new(psram::outside_words(), play.layout));
        let due = play.due.get_or_insert(now);
        while *due <= now && play.left > 0 {
            // The pixels are there already: the test has written them.
            if let Some(filling) = play.source.begin() {
                play.source.finish(filling, false);
            }
            *due += play.period;
            play.left -= 1;
        }
        let mut shown = 0;
        let mut wrong = 0;
        let [mut new, mut turns, mut skipped] = [0; 3];
        while let Some(output) = display.advance() {
            shown += 1;
            let crc = crc32(&[psram::outside_pixels(display.pixels(&output))]);
            let is_new = crc == self.words.load(order::NEW_OUTPUT);
            let right = is_new || crc == self.words.load(order::OUTPUT);
            wrong += u32::from(!right || !display.is_whole(&output));
            new += u32::from(is_new);
            let sequence = output.sequence();
            if let Some((last, was_new)) = play.last.replace((sequence, is_new)) {
                skipped += u32::from(sequence != last.wrapping_add(1));
                if is_new != was_new {
                    turns += 1;
                    self.words.store(finding::TURN, sequence);
                }
            }
        }
        // A period after the last frame, nothing is on its way any more.
        let over = play.left == 0 && *due <= now;
        self.add(finding::SHOWN, shown);
        self.add(finding::WRONG, wrong);
        self.add(finding::NEW, new);
        self.add(finding::TURNS, turns);
        self.add(finding::SKIPPED, skipped);
        if over {
            self.words.store(finding::STACK, stack::depth().used);
            debug::exit(debug::EXIT_SUCCESS);
        }
    }
}

/// The source begins another frame in the buffer of this one.
fn tear(sequence: u32) {
    let words = psram::outside_words();
    for buffer in 0..BUFFERS {
        let start = descriptor::input(buffer) + descriptor::START;
        if words.load(start) == sequence {
            words.store(start, sequence + 1);
        }
    }
}

impl FrameHooks for Orders {
    fn round(&mut self, clock: &impl Clock) {
        self.outside(clock.ticks());
    }

    fn tier(&mut self, tier: u8) -> u8 {
        match self.words.load(order::TIER) {
            0 => tier,
            forced => (forced - 1) as u8,
        }
    }

    fn during_frame(&mut self, sequence: u32, tier: u8, clock: &impl Clock) {
        if sequence == self.words.load(order::HANG) {
            self.words.store(order::HANG, 0);
            loop {
                cortex_m::asm::nop();
            }
        }
        let hangs = self.words.load(order::HANGS);
        if hangs > 0 {
            self.words.store(order::HANGS, hangs - 1);
            loop {
                cortex_m::asm::nop();
            }
        }
        if sequence == self.words.load(order::PANIC) {
            self.words.store(order::PANIC, 0);
            panic!("by order");
        }
        if sequence == self.words.load(order::TEAR) {
            tear(sequence);
        }
        let slow = self.words.load(order::SLOW_FROM)..self.words.load(order::SLOW_UNTIL);
        if slow.contains(&sequence) {
            let by_tier = self.words.load(order::SLOW_BY_TIER) * u32::from(tier);
            let wait = u64::from(self.words.load(order::SLOW_BY) + by_tier);
            let start = clock.ticks();
            while clock.ticks() - start < wait {}
        }
        // Frames that came in meanwhile found this one's buffer taken.
        self.outside(clock.ticks());
    }

    fn after_frame(&mut self, outcome: FrameOutcome, telemetry: &Telemetry) {
        self.add(finding::OVER, u32::from(outcome.over));
        let frames = telemetry.frame_counts();
        self.words.store(finding::LATE, frames.late);
        self.words.store(finding::DROPPED, frames.dropped);
        self.words.store(finding::BROKEN, frames.broken);
        let worst = self.words.load(finding::WORST).max(outcome.ticks);
        self.words.store(finding::WORST, worst);
        if let Some(change) = outcome.change {
            let count = self.words.load(finding::CHANGES);
            let [from, to] = [change.from, change.to].map(u32::from);
            let word = (outcome.sequence & 0xFFFF) | from << 16 | to << 24;
            self.words.store(finding::CHANGE + count as usize, word);
            self.words.store(finding::CHANGES, count + 1);
        }
    }
}

#[entry]
fn main() -> ! {
    start::<Chosen, _>(|| Orders::new(psram::self_test_words()))
}
