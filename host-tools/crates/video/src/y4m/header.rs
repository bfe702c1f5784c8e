//! Header of a Y4M stream: one line of tags.

use super::Y4mError;
use iltm_picture::MAX_PIXELS;
use iltm_runtime::FrameSize;

/// First bytes of every stream.
pub(crate) const MAGIC: &[u8] = b"YUV4MPEG2";

/// Longest stream header in bytes, its newline included. `FFmpeg` reads at most
/// 128; comments may be longer.
pub(super) const MAX_HEADER: usize = 4096;

/// How many chroma samples there are.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ChromaSampling {
    /// None: the luma plane is all there is.
    Mono,
    /// One for every square of 2 x 2 pixels; an odd last row or column has its
    /// own.
    Chroma420,
    /// One for every two pixels of a row; an odd last column has its own.
    Chroma422,
    /// One for every pixel.
    Chroma444,
}

/// Which codes are black and white.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum CodeRange {
    /// Luma 16 to 235, chroma 16 to 240, of 8 bits; times four of 10 bits, and so on.
    Limited,
    /// All codes.
    Full,
}

/// A stream header that has been read.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Header {
    line: Vec<u8>,
    size: FrameSize,
    rate: Option<(u32, u32)>,
    sampling: ChromaSampling,
    bits: u32,
    range: CodeRange,
}

impl Header {
    /// A header for progressive video with square pixels and 8 bits.
    ///
    /// `rate` is the frame rate as a fraction.
    #[must_use]
    pub fn new(
        size: FrameSize,
        rate: (u32, u32),
        sampling: ChromaSampling,
        range: CodeRange,
    ) -> Self {
        let colour = match sampling {
            ChromaSampling::Mono => "mono",
            ChromaSampling::Chroma420 => "420jpeg",
            ChromaSampling::Chroma422 => "422",
            ChromaSampling::Chroma444 => "444",
        };
        let name = match range {
            CodeRange::Limited => "LIMITED",
            CodeRange::Full => "FULL",
        };
        let line = format!(
            "YUV4MPEG2 W{} H{} F{}:{} Ip A1:1 C{colour} XCOLORRANGE={name}",
            size.width(),
            size.height(),
            rate.0,
            rate.1,
        );
        Self {
            line: line.into_bytes(),
            size,
            rate: Some(rate),
            sampling,
            bits: 8,
            range,
        }
    }

    /// Reads a header from its line, without the newline.
    ///
    /// # Errors
    /// [`Y4mError`] if a tag is malformed, missing, there twice, or says what
    /// this reader does not support.
    ///
    /// # Fuzzing
    /// Total: any bytes give a header or an error.
    pub fn parse(line: &[u8]) -> Result<Self, Y4mError> {
        let tags = line.strip_prefix(MAGIC).ok_or(Y4mError::NotY4m)?;
        if !matches!(tags.first(), None | Some(b' ')) {
            return Err(Y4mError::NotY4m);
        }
        let mut fields = Fields::default();
        let mut offset = MAGIC.len() as u64;
        for bytes in tags.split(|byte| *byte == b' ') {
            fields.read(Tag { bytes, offset })?;
            offset += bytes.len() as u64 + 1;
        }
        let side = |tag, value: Option<u64>| value.ok_or(Y4mError::NoSize { tag });
        let (width, height) = (side('W', fields.width)?, side('H', fields.height)?);
        let (sampling, bits) = fields.colour.unwrap_or((ChromaSampling::Chroma420, 8));
        let default_range = match sampling {
            ChromaSampling::Mono => CodeRange::Full,
            _ => CodeRange::Limited,
        };
        Ok(Self {
            line: line.to_vec(),
            size: size(width, height)?,
            rate: fields.rate,
            sampling,
            bits,
            range: fields.range.unwrap_or(default_range),
        })
    }

    /// The same for frames of another size.
    #[must_use]
    pub fn resized(&self, size: FrameSize) -> Self {
        let mut line = Vec::with_capacity(self.line.len());
        for (at, tag) in self.line.split(|byte| *byte == b' ').enumerate() {
            if at > 0 {
                line.push(b' ');
            }
            match tag.first() {
                Some(b'W') => line.extend(format!("W{}", size.width()).into_bytes()),
                Some(b'H') => line.extend(format!("H{}", size.height()).into_bytes()),
                _ => line.extend(tag),
            }
        }
        Self {
            line,
            size,
            ..self.clone()
        }
    }

    /// The line as it was read, without the newline.
    #[must_use]
    pub fn line(&self) -> &[u8] {
        &self.line
    }

    /// The size of every frame.
    #[must_use]
    pub const fn size(&self) -> FrameSize {
        self.size
    }

    /// Frames a second, if the header says so.
    #[must_use]
    pub fn rate(&self) -> Option<f64> {
        let (number, over) = self
            .rate
            .filter(|(number, over)| *number > 0 && *over > 0)?;
        Some(f64::from(number) / f64::from(over))
    }

    /// How chroma is sampled.
    #[must_use]
    pub const fn sampling(&self) -> ChromaSampling {
        self.sampling
    }

    /// Colours of a pixel.
    #[must_use]
    pub const fn colours(&self) -> usize {
        match self.sampling {
            ChromaSampling::Mono => 1,
            _ => 3,
        }
    }

    /// Bits of a sample, from 8 on; a sample of more than 8 takes two bytes, the lower one first.
    #[must_use]
    pub const fn bits(&self) -> u32 {
        self.bits
    }

    /// Bytes of a sample.
    #[must_use]
    pub const fn sample_bytes(&self) -> usize {
        if self.bits > 8 { 2 } else { 1 }
    }

    /// Which codes are black and white.
    #[must_use]
    pub const fn range(&self) -> CodeRange {
        self.range
    }

    /// Width and height of each chroma plane; zero without chroma.
    #[must_use]
    pub const fn chroma(&self) -> (usize, usize) {
        match self.sampling {
            ChromaSampling::Mono => (0, 0),
            ChromaSampling::Chroma420 => (
                self.size.width().div_ceil(2),
                self.size.height().div_ceil(2),
            ),
            ChromaSampling::Chroma422 => (self.size.width().div_ceil(2), self.size.height()),
            ChromaSampling::Chroma444 => (self.size.width(), self.size.height()),
        }
    }

    /// Bytes of a frame's planes, all together.
    #[must_use]
    pub const fn frame_bytes(&self) -> usize {
        let (width, height) = self.chroma();
        self.sample_bytes() * (self.size.pixels() + 2 * width * height)
    }
}

fn size(width: u64, height: u64) -> Result<FrameSize, Y4mError> {
    let too_large = Y4mError::TooLarge { width, height };
    let (Ok(narrow_width), Ok(narrow_height)) = (u16::try_from(width), u16::try_from(height))
    else {
        return Err(too_large);
    };
    match FrameSize::new(narrow_width, narrow_height) {
        Some(size) if size.pixels() <= MAX_PIXELS => Ok(size),
        _ => Err(too_large),
    }
}

/// One tag of the line.
#[derive(Clone, Copy)]
struct Tag<'l> {
    bytes: &'l [u8],
    offset: u64,
}

impl Tag<'_> {
    fn text(self) -> String {
        String::from_utf8_lossy(self.bytes).into_owned()
    }

    fn error(self, reason: &'static str) -> Y4mError {
        Y4mError::Tag {
            tag: self.text(),
            offset: self.offset,
            reason,
        }
    }

    /// Stores what the tag says, unless another did before.
    fn store<T>(self, slot: &mut Option<T>, value: T) -> Result<(), Y4mError> {
        match slot.replace(value) {
            None => Ok(()),
            Some(_) => Err(self.error("is there for the second time")),
        }
    }
}

/// What the tags say that matters here.
#[derive(Default)]
struct Fields {
    width: Option<u64>,
    height: Option<u64>,
    rate: Option<(u32, u32)>,
    /// Chroma and bits of a sample.
    colour: Option<(ChromaSampling, u32)>,
    range: Option<CodeRange>,
}

impl Fields {
    fn read(&mut self, tag: Tag<'_>) -> Result<(), Y4mError> {
        let Some((name, value)) = tag.bytes.split_first() else {
            return Ok(());
        };
        match name {
            b'W' => tag.store(&mut self.width, side(tag, value)?),
            b'H' => tag.store(&mut self.height, side(tag, value)?),
            b'F' => {
                self.rate = rate(value);
                Ok(())
            }
            b'C' => tag.store(&mut self.colour, colour(tag, value)?),
            b'I' => match value {
                b"p" | b"?" => Ok(()),
                b"t" | b"b" | b"m" => Err(Y4mError::Interlaced {
                    tag: tag.text(),
                    offset: tag.offset,
                }),
                _ => Err(tag.error("is not a kind of interlacing")),
            },
            b'X' => match value.strip_prefix(b"COLORRANGE=") {
                Some(b"LIMITED") => tag.store(&mut self.range, CodeRange::Limited),
                Some(b"FULL") => tag.store(&mut self.range, CodeRange::Full),
                Some(_) => Err(tag.error("is neither LIMITED nor FULL")),
                None => Ok(()),
            },
            _ => Ok(()),
        }
    }
}

fn side(tag: Tag<'_>, value: &[u8]) -> Result<u64, Y4mError> {
    if value.is_empty() || !value.iter().all(u8::is_ascii_digit) {
        return Err(tag.error("is not a number of pixels"));
    }
    // More digits than fit are as much too large as the largest that fits.
    let number = value.iter().fold(0_u64, |number, digit| {
        number
            .saturating_mul(10)
            .saturating_add(u64::from(digit - b'0'))
    });
    if number == 0 {
        return Err(tag.error("is zero; a frame has at least one pixel"));
    }
    Ok(number)
}

/// A fraction such as `30000:1001`.
fn rate(value: &[u8]) -> Option<(u32, u32)> {
    let (number, over) = std::str::from_utf8(value).ok()?.split_once(':')?;
    Some((number.parse().ok()?, over.parse().ok()?))
}

fn colour(tag: Tag<'_>, value: &[u8]) -> Result<(ChromaSampling, u32), Y4mError> {
    use ChromaSampling::{Chroma420, Chroma422, Chroma444, Mono};
    match value {
        b"420" | b"420jpeg" | b"420mpeg2" | b"420paldv" => Ok((Chroma420, 8)),
        b"422" => Ok((Chroma422, 8)),
        b"444" => Ok((Chroma444, 8)),
        b"mono" => Ok((Mono, 8)),
        b"420p10" => Ok((Chroma420, 10)),
        b"422p10" => Ok((Chroma422, 10)),
        b"444p10" => Ok((Chroma444, 10)),
        b"mono10" => Ok((Mono, 10)),
        b"420p12" => Ok((Chroma420, 12)),
        b"422p12" => Ok((Chroma422, 12)),
        b"444p12" => Ok((Chroma444, 12)),
        b"mono12" => Ok((Mono, 12)),
        _ => Err(Y4mError::Colour {
            tag: tag.text(),
            offset: tag.offset,
        }),
    }
}
