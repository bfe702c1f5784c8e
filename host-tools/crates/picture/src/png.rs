//! PNG files: pictures read and written.
//!
//! A picture keeps its size, its 8 or 16 bits and its grey or RGB; an alpha channel that is
//! opaque all over, as screenshots have it, is left out. A palette, and
//! grey of fewer than 8 bits, become RGB and grey of 8 bits, since the result has
//! colours that they have not. Samples are what the file holds; colour profiles
//! and gamma chunks are not applied and not written.

use crate::{MAX_PIXELS, Picture, Samples};
use iltm_runtime::FrameSize;
use png::{BitDepth, ColorType, Compression, Decoder, Encoder, Filter, Transformations};
use std::collections::BTreeSet;
use std::io::{Cursor, Read, Write};

/// First bytes of every PNG file.
pub const SIGNATURE: [u8; 8] = *b"\x89PNG\r\n\x1a\n";

/// Most bytes of a file: all pixels uncompressed, and then some.
const MAX_FILE: u64 = 7 * MAX_PIXELS as u64;

/// Why a PNG picture could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum PngError {
    /// The file could not be read.
    #[error("reading the picture: {source}")]
    Read {
        /// What the operating system says.
        source: std::io::Error,
    },
    /// The bytes are not those of a whole PNG picture.
    #[error("not a readable PNG picture: {reason}")]
    Malformed {
        /// What the decoder says.
        reason: String,
    },
    /// The picture is larger than any that is worked on.
    #[error(
        "the picture says that it has {width} x {height} pixels; \
         at most 65535 a side and {MAX_PIXELS} together are read"
    )]
    TooLarge {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
    },
    /// The picture is transparent somewhere.
    #[error("the picture has transparency, which a projector cannot show")]
    Alpha,
    /// The picture is an animation.
    #[error("the picture is an animation of {frames} frames")]
    Animated {
        /// Frames it says it has.
        frames: u32,
    },
    /// The picture could not be written.
    #[error("writing the picture: {reason}")]
    Write {
        /// What the encoder or the operating system says.
        reason: String,
    },
}

impl PngError {
    /// What to do about it.
    #[must_use]
    pub const fn next_step(&self) -> &'static str {
        match self {
            Self::Read { .. } => "Check that the file can be read to its end.",
            Self::Malformed { .. } => "Copy or export the picture again, as PNG with 8 or 16 bits.",
            Self::TooLarge { .. } => "Scale the picture down to the projector's own size.",
            Self::Alpha => {
                "Flatten the picture onto a background, for example with \
                 `magick IN.png -background black -alpha remove -alpha off OUT.png`."
            }
            Self::Animated { .. } => "Convert it to video: `ffmpeg -i IN.png OUT.y4m`.",
            Self::Write { .. } => "Check that the disk has room.",
        }
    }
}

/// Reads a picture.
///
/// # Errors
/// [`PngError`] if it is malformed, too large, transparent or animated.
///
/// # Fuzzing
/// Total: any bytes give a picture or an error.
pub fn read(input: impl Read) -> Result<Picture, PngError> {
    let mut file = Vec::new();
    let taken = input.take(MAX_FILE).read_to_end(&mut file);
    taken.map_err(|source| PngError::Read { source })?;
    let malformed = |error: png::DecodingError| PngError::Malformed {
        reason: error.to_string(),
    };
    let mut decoder = Decoder::new(Cursor::new(file));
    decoder.set_transformations(Transformations::EXPAND);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let size = size(decoder.read_header_info().map_err(malformed)?)?;
    let mut reader = decoder.read_info().map_err(malformed)?;
    if let Some(animation) = reader.info().animation_control() {
        return Err(PngError::Animated {
            frames: animation.num_frames,
        });
    }
    let (colour, depth) = reader.output_color_type();
    let length = reader.output_buffer_size().unwrap_or(0);
    let mut bytes = vec![0; length];
    reader.next_frame(&mut bytes).map_err(malformed)?;
    let sample = if depth == BitDepth::Sixteen { 2 } else { 1 };
    match colour {
        ColorType::Rgba => bytes = opaque(&bytes, 4 * sample, sample)?,
        ColorType::GrayscaleAlpha => bytes = opaque(&bytes, 2 * sample, sample)?,
        _ => {}
    }
    let samples = match depth {
        BitDepth::Sixteen => {
            let (halves, _) = bytes.as_chunks::<2>();
            Samples::Sixteen(halves.iter().copied().map(u16::from_be_bytes).collect())
        }
        _ => Samples::Eight(bytes),
    };
    Picture::new(size, samples).ok_or_else(|| PngError::Malformed {
        reason: "it has another number of samples than its header says".to_owned(),
    })
}

/// The pixels without their last sample, which must be opaque; of so many bytes each.
fn opaque(bytes: &[u8], pixel: usize, sample: usize) -> Result<Vec<u8>, PngError> {
    let mut colours = Vec::with_capacity(bytes.len() / pixel * (pixel - sample));
    for pixel in bytes.chunks_exact(pixel) {
        let (colour, alpha) = pixel.split_at(pixel.len() - sample);
        if alpha.iter().any(|byte| *byte != u8::MAX) {
            return Err(PngError::Alpha);
        }
        colours.extend_from_slice(colour);
    }
    Ok(colours)
}

fn size(info: &png::Info<'_>) -> Result<FrameSize, PngError> {
    let (width, height) = info.size();
    let narrow = |side: u32| u16::try_from(side).unwrap_or(0);
    FrameSize::new(narrow(width), narrow(height))
        .filter(|size| size.pixels() <= MAX_PIXELS)
        .ok_or(PngError::TooLarge { width, height })
}

/// Writes a picture.
///
/// # Errors
/// [`PngError::Write`].
pub fn write(output: impl Write, picture: &Picture) -> Result<(), PngError> {
    write_by(output, picture, false)
}

fn write_by(output: impl Write, picture: &Picture, quickly: bool) -> Result<(), PngError> {
    let write = || {
        let (width, height) = (picture.size().width(), picture.size().height());
        let mut encoder = Encoder::new(output, width as u32, height as u32);
        encoder.set_color(match picture.channels() {
            1 => ColorType::Grayscale,
            _ => ColorType::Rgb,
        });
        encoder.set_depth(match picture.samples() {
            Samples::Eight(_) => BitDepth::Eight,
            Samples::Sixteen(_) => BitDepth::Sixteen,
        });
        if quickly {
            encoder.set_compression(Compression::Fast);
            encoder.set_filter(Filter::Adaptive);
        }
        let mut writer = encoder.write_header()?;
        match picture.samples() {
            Samples::Eight(samples) => writer.write_image_data(samples)?,
            Samples::Sixteen(samples) => {
                let bytes: Vec<u8> = samples.iter().flat_map(|code| code.to_be_bytes()).collect();
                writer.write_image_data(&bytes)?;
            }
        }
        writer.finish()
    };
    write().map_err(|error: png::EncodingError| PngError::Write {
        reason: error.to_string(),
    })
}

/// The bytes of a PNG file that holds a picture.
#[must_use]
pub fn encode(picture: &Picture) -> Vec<u8> {
    let mut bytes = Vec::new();
    // Writing to memory does not fail.
    let _ = write(&mut bytes, picture);
    bytes
}

/// The same of a photograph: noise is most of it, so that compressing it well takes long and saves
/// little.
#[must_use]
pub fn encode_photograph(picture: &Picture) -> Vec<u8> {
    let mut bytes = Vec::new();
    // Writing to memory does not fail.
    let _ = write_by(&mut bytes, picture, true);
    bytes
}

/// The bytes of a PNG file, with a palette where that holds all colours of a picture, which
/// makes it a fraction as large.
#[must_use]
pub fn encode_small(picture: &Picture) -> Vec<u8> {
    let (3, Samples::Eight(samples)) = (picture.channels(), picture.samples()) else {
        return encode(picture);
    };
    let (pixels, _) = samples.as_chunks::<3>();
    let colours: BTreeSet<&[u8; 3]> = pixels.iter().collect();
    if colours.len() > 256 {
        return encode(picture);
    }
    let palette: Vec<&[u8; 3]> = colours.into_iter().collect();
    let index = |pixel| palette.partition_point(|colour| *colour < pixel) as u8;
    let indices: Vec<u8> = pixels.iter().map(index).collect();
    let palette = palette.into_iter().flatten().copied().collect();
    encode_indexed(picture.size(), palette, &indices)
}

/// The bytes of a PNG file with a palette, three codes a colour, and an index into it for
/// each pixel.
#[must_use]
pub fn encode_indexed(size: FrameSize, palette: Vec<u8>, indices: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, size.width() as u32, size.height() as u32);
    encoder.set_color(ColorType::Indexed);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::High);
    // Indices are no light that neighbours predict.
    encoder.set_filter(png::Filter::NoFilter);
    encoder.set_palette(palette);
    let written = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(indices)?;
        writer.finish()
    });
    // Writing to memory does not fail.
    let _ = written;
    bytes
}
