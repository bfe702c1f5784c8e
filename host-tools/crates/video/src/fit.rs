//! Placing of frames on the projector that a table was made with.
//!
//! [`ProjectorPixels`] has the rule that host and device share: a frame of the
//! projector's aspect has its cells inside the border. Here is what only a host can do
//! beside that: a frame of the size inside the border is put there, and [`Fit`] says what
//! becomes of a frame of another aspect. No pixel is resampled.

use super::VideoError;
use super::y4m::{ChromaSampling, CodeRange, Header, YuvFrame};
use iltm_picture::{MAX_PIXELS, Picture, Samples};
use iltm_runtime::placement::{PixelArea, ProjectorPixels};
use iltm_runtime::{FrameSize, image::Table};

/// What becomes of a frame whose aspect is not the projector's.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Fit {
    /// Black bars make it the projector's aspect.
    Letterbox,
    /// What is too wide or too high is cut off, the same on both sides.
    Crop,
    /// It stays as it is and is shown stretched over the projector's picture.
    Stretch,
}

impl std::str::FromStr for Fit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "letterbox" => Ok(Self::Letterbox),
            "crop" => Ok(Self::Crop),
            "stretch" => Ok(Self::Stretch),
            _ => Err("letterbox, crop or stretch".to_owned()),
        }
    }
}

/// Where frames of one size go.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PlacedFrames {
    given: FrameSize,
    shown: FrameSize,
    /// Of the given frame's first pixel in the shown one; negative where it is cut off.
    left: isize,
    top: isize,
    area: PixelArea,
}

impl PlacedFrames {
    /// Where frames of a size go with a table: where its cells are.
    ///
    /// A frame of one pixel a cell stays that, and any frame does of a table that does not
    /// know its projector.
    ///
    /// # Errors
    /// [`VideoError::Aspect`], [`VideoError::SmallerThanGrid`], and
    /// [`VideoError::NothingToFit`] for a [`Fit`] without a projector.
    pub fn new(table: &Table<'_>, frame: FrameSize, fit: Option<Fit>) -> Result<Self, VideoError> {
        let placed = match table.projector() {
            None if fit.is_some() => return Err(VideoError::NothingToFit),
            Some(projector) if frame != FrameSize::of_grid(table.grid()) => {
                Self::on(projector, frame, fit)?
            }
            _ => Self::whole(frame),
        };
        if placed.area.size.holds(table.grid()) {
            return Ok(placed);
        }
        Err(VideoError::SmallerThanGrid {
            frame: placed.area.size,
            grid: table.grid(),
        })
    }

    /// Frames that are the cells and nothing around them.
    pub(super) const fn whole(frame: FrameSize) -> Self {
        Self {
            given: frame,
            shown: frame,
            left: 0,
            top: 0,
            area: PixelArea::all(frame),
        }
    }

    /// Where frames of a size go on a projector.
    ///
    /// # Errors
    /// [`VideoError::Aspect`].
    pub fn on(
        projector: ProjectorPixels,
        frame: FrameSize,
        fit: Option<Fit>,
    ) -> Result<Self, VideoError> {
        let inner = projector.inner();
        let shown = if projector.has_aspect_of(frame) {
            Some(frame)
        } else if frame == inner {
            Some(projector.size())
        } else {
            fit.and_then(|fit| fitted(projector, frame, fit))
        };
        let placed = shown.and_then(|shown| {
            let start =
                |given: usize, shown: usize| (shown.cast_signed() - given.cast_signed()) / 2;
            Some(Self {
                given: frame,
                shown,
                left: start(frame.width(), shown.width()),
                top: start(frame.height(), shown.height()),
                area: projector.area(shown)?,
            })
        });
        placed.ok_or(VideoError::Aspect { frame, projector })
    }

    /// The size of the frames that come out.
    #[must_use]
    pub const fn shown(&self) -> FrameSize {
        self.shown
    }

    /// Where in them the cells lie.
    #[must_use]
    pub const fn area(&self) -> PixelArea {
        self.area
    }

    /// Where on the cells the picture lies, columns and rows, each from and up to.
    pub(super) fn on_area(&self) -> [[usize; 2]; 2] {
        let part = |start: isize, given: usize, first: usize, count: usize| {
            let within = |at: isize| at.clamp(0, count.cast_signed()).cast_unsigned();
            let start = start - first.cast_signed();
            [within(start), within(start + given.cast_signed())]
        };
        let PixelArea { left, top, size } = self.area;
        [
            part(self.left, self.given.width(), left, size.width()),
            part(self.top, self.given.height(), top, size.height()),
        ]
    }

    /// Whether frames come out in the same size and at the same place; their cells may lie
    /// elsewhere.
    pub(super) fn moves_like(&self, other: &Self) -> bool {
        let all_but_cells = |it: &Self| (it.given, it.shown, it.left, it.top);
        all_but_cells(self) == all_but_cells(other)
    }

    /// Whether frames come out as large as they came in.
    fn keeps(&self) -> bool {
        self.given == self.shown
    }

    /// A picture in its place, black around it; `None` if it has another size.
    #[must_use]
    pub fn picture(&self, picture: Picture) -> Option<Picture> {
        if picture.size() != self.given {
            return None;
        }
        if self.keeps() {
            return Some(picture);
        }
        self.moved(&picture, self.shown, (self.left, self.top))
    }

    /// The part of a picture that falls on the cells, black where nothing does; `None` if
    /// it has another size.
    #[must_use]
    pub fn on_cells(&self, picture: &Picture) -> Option<Picture> {
        let PixelArea { left, top, size } = self.area;
        let start = (self.left - left.cast_signed(), self.top - top.cast_signed());
        self.moved(picture, size, start)
    }

    fn moved(&self, picture: &Picture, to: FrameSize, start: (isize, isize)) -> Option<Picture> {
        fn placed<S: Copy + Default>(
            from: (&[S], FrameSize),
            to: FrameSize,
            start: (isize, isize),
            channels: usize,
        ) -> Vec<S> {
            let mut samples = vec![S::default(); to.pixels() * channels];
            let plane = |size: FrameSize| (size.width() * channels, size.height());
            let start = (start.0 * channels.cast_signed(), start.1);
            place((from.0, plane(from.1)), (&mut samples, plane(to)), start);
            samples
        }
        if picture.size() != self.given {
            return None;
        }
        let (from, channels) = (picture.size(), picture.channels());
        let samples = match picture.samples() {
            Samples::Eight(samples) => Samples::Eight(placed((samples, from), to, start, channels)),
            Samples::Sixteen(samples) => {
                Samples::Sixteen(placed((samples, from), to, start, channels))
            }
        };
        Picture::new(to, samples)
    }

    /// A frame of a stream in its place, black around it. Chroma that has one sample for
    /// several pixels may move by one of them.
    pub(super) fn frame(&self, given: &Header, shown: &Header, frame: YuvFrame) -> YuvFrame {
        if self.keeps() {
            return frame;
        }
        let bytes = shown.sample_bytes();
        let above = shown.bits() - 8;
        let black: u16 = match shown.range() {
            CodeRange::Limited => 16 << above,
            CodeRange::Full => 0,
        };
        let mut samples = vec![0; shown.frame_bytes()];
        let (luma, chroma) = samples.split_at_mut(bytes * self.shown.pixels());
        let fill = |plane: &mut [u8], code: u16| {
            for sample in plane.chunks_exact_mut(bytes) {
                sample.copy_from_slice(&code.to_le_bytes()[..bytes]);
            }
        };
        fill(luma, black);
        fill(chroma, 128 << above);
        let (from_luma, from_chroma) = frame.samples.split_at(bytes * self.given.pixels());
        // Sides in bytes.
        let plane = |(width, height): (usize, usize)| (bytes * width, height);
        let start = |left: isize, top| (bytes.cast_signed() * left, top);
        let sides = |size: FrameSize| plane((size.width(), size.height()));
        place(
            (from_luma, sides(self.given)),
            (luma, sides(self.shown)),
            start(self.left, self.top),
        );
        let (from, to) = (plane(given.chroma()), plane(shown.chroma()));
        let (left, top) = match shown.sampling() {
            ChromaSampling::Chroma420 => (self.left.div_euclid(2), self.top.div_euclid(2)),
            ChromaSampling::Chroma422 => (self.left.div_euclid(2), self.top),
            ChromaSampling::Mono | ChromaSampling::Chroma444 => (self.left, self.top),
        };
        let parts = from_chroma.chunks_exact((from.0 * from.1).max(1));
        let places = chroma.chunks_exact_mut((to.0 * to.1).max(1));
        for (part, place_of) in parts.zip(places) {
            place((part, from), (place_of, to), start(left, top));
        }
        YuvFrame {
            parameters: frame.parameters,
            samples,
        }
    }
}

/// The size in which a frame is shown.
fn fitted(projector: ProjectorPixels, frame: FrameSize, fit: Fit) -> Option<FrameSize> {
    let size = match fit {
        Fit::Stretch => Some(frame),
        Fit::Letterbox => projector.around(frame),
        Fit::Crop => projector.within(frame),
    };
    size.filter(|size| size.pixels() <= MAX_PIXELS)
}

/// Copies the part of a plane that falls into another; sides are samples a row and rows.
fn place<S: Copy>(
    (from, (from_width, from_height)): (&[S], (usize, usize)),
    (to, (to_width, to_height)): (&mut [S], (usize, usize)),
    (left, top): (isize, isize),
) {
    let cut = |start: isize| start.min(0).unsigned_abs();
    let past = |start: isize| start.max(0).cast_unsigned();
    let rows = from.chunks_exact(from_width.max(1)).take(from_height);
    let lines = to.chunks_exact_mut(to_width.max(1)).take(to_height);
    for (row, line) in rows.skip(cut(top)).zip(lines.skip(past(top))) {
        let samples = row.iter().skip(cut(left));
        for (slot, sample) in line.iter_mut().skip(past(left)).zip(samples) {
            *slot = *sample;
        }
    }
}
