//! Board traits: what a board provides.
//!
//! A port is one file that implements [`Board`], and the traits here for its
//! peripherals; `docs/porting.md` walks through one.

use embedded_hal::digital::OutputPin;
use embedded_io::{Read, ReadReady, Write, WriteReady};
use embedded_storage::nor_flash::NorFlash;
use iltm_runtime::frame_buffers::{Broken, Format, InputCounts};
use iltm_runtime::link::SourceFault;
use iltm_runtime::store::{Map, MapError, Slot};
use iltm_runtime::units::Halfword;

/// A board.
pub trait Board: Sized {
    /// Its name in messages, at most 32 bytes.
    const NAME: &'static str;

    /// Time.
    type Clock: Clock;
    /// Milliseconds within which the loop must come round, or the watchdog restarts the
    /// device: a few frames, and more than [`TableFlash::LONGEST_MS`], which is checked
    /// when the firmware is compiled.
    const WATCHDOG_MS: u32;

    /// Where wanted frames come from.
    type Source: FrameSource;
    /// Where projector input goes.
    type Sink: FrameSink;
    /// The line to the technician. Reads and writes must not wait while
    /// [`ReadReady`] and [`WriteReady`] say that there is something to do.
    type Serial: Read + ReadReady + Write + WriteReady;
    /// Where the tables are.
    type Flash: TableFlash;
    /// What restarts a device that hangs.
    type Watchdog: Watchdog;
    /// A light that is on while frames are compensated.
    type Lamp: OutputPin;

    /// What happens while there is nothing to do.
    type Idle: Idle;

    /// Sets the board up and hands out its peripherals, once; `None` after that.
    fn take() -> Option<Peripherals<Self>>;
}

/// The peripherals of a board.
pub struct Peripherals<B: Board> {
    /// See [`Board::Clock`].
    pub clock: B::Clock,
    /// See [`Board::Source`].
    pub source: B::Source,
    /// See [`Board::Sink`].
    pub sink: B::Sink,
    /// See [`Board::Serial`].
    pub serial: B::Serial,
    /// See [`Board::Flash`].
    pub flash: B::Flash,
    /// See [`Board::Watchdog`].
    pub watchdog: B::Watchdog,
    /// See [`Board::Lamp`].
    pub lamp: B::Lamp,
    /// See [`Board::Idle`].
    pub idle: B::Idle,
}

/// A clock that never runs backwards.
pub trait Clock {
    /// Ticks a second, at least a million.
    const HERTZ: u32;

    /// Ticks since some moment before the frame loop began.
    fn ticks(&self) -> u64;
}

/// Wanted frames, double-buffered.
pub trait FrameSource {
    /// Looks whether frames of another format begin, or a fault that prevents
    /// frames; `None` while nothing changes. Called between frames only.
    fn follow(&mut self) -> Option<Result<Format, SourceFault>>;

    /// Takes the next whole frame and returns its number. It stays as it is until
    /// [`release`](Self::release).
    fn claim(&mut self) -> Option<u32>;

    /// The pixels of the claimed frame, or none.
    fn wanted(&self) -> &[u8];

    /// Light of the neighbours' cells that came with the claimed frame ([`Workspace::heard`]
    /// says how it lies); `None` if none did. A board that is never one of several projectors' has
    /// none.
    ///
    /// [`Workspace::heard`]: iltm_runtime::pipeline::Workspace::heard
    fn heard(&self) -> Option<&[Halfword]> {
        None
    }

    /// Gives the claimed frame back.
    ///
    /// # Errors
    /// [`Broken`] if it did not stay as it was.
    fn release(&mut self) -> Result<(), Broken>;

    /// What became of all frames so far.
    fn counts(&self) -> InputCounts;

    /// Bytes of the largest frame there is memory for.
    fn capacity(&self) -> usize;
}

/// Projector input, double-buffered. The display keeps showing the last frame
/// that was published.
pub trait FrameSink {
    /// Frames of this format from now on.
    fn start(&mut self, format: Format);

    /// Whether there is a buffer for a frame.
    fn has_room(&self) -> bool;

    /// The buffer for the frame of this number; empty if there is none.
    fn begin(&mut self, sequence: u32) -> &mut [u8];

    /// Has the buffer shown from the next refresh on.
    fn publish(&mut self);
}

/// Flash with table slots that the processor can read like memory.
///
/// Frames go on while it is written, up to one write or the erase of one sector at a
/// time: a board whose flash cannot be read meanwhile, or whose sectors take longer to
/// erase than a frame has to spare, shows the last frame that much longer.
///
/// [`read`](embedded_storage::nor_flash::ReadNorFlash::read) must give an error where cells
/// cannot be read, as of a unit of flash with ECC whose write was cut; it must not fault.
/// The slot is not read like memory before every byte has been read so.
pub trait TableFlash: NorFlash {
    /// Longest time in milliseconds that one call of `erase` or `write` blocks. The largest
    /// area that one call erases is a records area, the key's area, or
    /// [`Map::sector`] bytes of a slot.
    const LONGEST_MS: u32;

    /// What lies where.
    ///
    /// # Errors
    /// [`MapError`] if the board's own numbers do not fit its flash.
    fn map(&self) -> Result<Map, MapError>;

    /// All bytes of a slot, where they lie.
    ///
    /// They are not written to while somebody holds them: the store forgets the table
    /// of a slot before it changes the slot.
    fn slot(&self, slot: Slot) -> &'static [u8];
}

/// A watchdog.
pub trait Watchdog {
    /// Starts it, or gives it another time: without [`pet`](Self::pet), the device
    /// restarts after at least this many milliseconds and at most twice as many.
    fn start(&mut self, milliseconds: u32);

    /// Puts the restart off.
    fn pet(&mut self);
}

/// A pause of the processor.
pub trait Idle {
    /// Returns after the next interrupt, or after a small part of a frame's period
    /// if a new frame raises none; at once if the board has neither.
    fn idle(&mut self);
}
