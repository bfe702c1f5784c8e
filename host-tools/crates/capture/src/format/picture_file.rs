//! Picture files from strangers, PNG, TIFF, JPEG, `OpenEXR` and netpbm: opened with limits,
//! decoded without alpha.
//!
//! A format is told by a file's first bytes. What EXIF says about orientation is
//! ignored on purpose: some cameras turn that flag with gravity between two
//! shots, others never; the rows as the sensor read them are the only thing that
//! is the same in all photographs of a camera that stands still.

use super::error::CaptureError;
use image::codecs::jpeg::JpegDecoder;
use image::codecs::openexr::OpenExrDecoder;
use image::codecs::png::PngDecoder;
use image::codecs::pnm::PnmDecoder;
use image::codecs::tiff::TiffDecoder;
use image::{DynamicImage, ImageDecoder, ImageResult, Limits};
use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Pixels a picture may have: the largest medium-format sensors.
pub(crate) const MAX_PIXELS: u64 = 160_000_000;

/// Bytes of memory a picture may take while it is decoded: [`MAX_PIXELS`] in colour with 16
/// bits, twice.
const MAX_MEMORY: u64 = 2 << 30;

/// Bytes a picture's file may have.
const MAX_FILE: u64 = 1 << 30;

/// Bytes from which pictures are decoded one after the other, whoever asks for them.
const LARGE: u64 = 128 << 20;

/// Held while a large picture is decoded.
static DECODING_LARGE: Mutex<()> = Mutex::new(());

/// Bytes the decoder may allocate beside the pixels themselves.
const DECODER_BYTES: u64 = 32 << 20;

/// Kind of a photograph's file, told by its first bytes: cameras and people
/// rename files, and an extension says nothing about what is inside.
#[derive(Clone, Copy, PartialEq, Eq, Debug, strum::Display)]
pub enum FileFormat {
    /// PNG, 8 or 16 bit.
    #[strum(to_string = "PNG")]
    Png,
    /// TIFF, 8 or 16 bit, or floating point.
    #[strum(to_string = "TIFF")]
    Tiff,
    /// JPEG, 8 bit, curved by the camera and compressed with loss.
    #[strum(to_string = "JPEG")]
    Jpeg,
    /// `OpenEXR`, floating point, linear by definition.
    #[strum(to_string = "OpenEXR")]
    OpenExr,
    /// PGM, PPM or PAM (netpbm), 8 or 16 bit, of any full scale.
    #[strum(to_string = "PGM or PPM")]
    Netpbm,
}

impl FileFormat {
    /// File name extensions that the formats are commonly given, lower case.
    pub const EXTENSIONS: [&'static str; 9] = [
        "png", "tif", "tiff", "jpg", "jpeg", "exr", "pgm", "ppm", "pnm",
    ];

    /// All of them in words, for messages.
    pub const NAMES: &'static str = "PNG, TIFF, JPEG, OpenEXR, PGM or PPM";

    /// Bytes that [`FileFormat::of`] looks at.
    pub(crate) const SIGNATURE: usize = 8;

    /// The format of a file that begins so; `None` if it is none of them.
    ///
    /// ```
    /// use iltm_capture::FileFormat;
    /// assert_eq!(FileFormat::of(b"P5 640 480 4095\n"), Some(FileFormat::Netpbm));
    /// assert_eq!(FileFormat::of(b"GIF89a"), None);
    /// ```
    #[must_use]
    pub fn of(first: &[u8]) -> Option<Self> {
        match first {
            [0x89, b'P', b'N', b'G', b'\r', b'\n', 0x1a, b'\n', ..] => Some(Self::Png),
            [b'I', b'I', 42 | 43, 0, ..] | [b'M', b'M', 0, 42 | 43, ..] => Some(Self::Tiff),
            [0xff, 0xd8, 0xff, ..] => Some(Self::Jpeg),
            [0x76, 0x2f, 0x31, 0x01, ..] => Some(Self::OpenExr),
            [
                b'P',
                b'2' | b'3' | b'5' | b'6' | b'7',
                b' ' | b'\t' | b'\r' | b'\n' | b'#',
                ..,
            ] => Some(Self::Netpbm),
            _ => None,
        }
    }
}

/// What to do about a picture that cannot be read.
pub(crate) const EXPORT: &str = "Copy or export the picture again: photographs as PNG, TIFF, \
     JPEG, OpenEXR, PGM or PPM, patterns as PNG with 8 bit.";

/// A picture file and who named it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Source<'a> {
    /// The file.
    pub(crate) path: &'a Path,
    /// "pattern" or "photograph".
    pub(crate) what: &'static str,
    /// Line of the manifest that names it.
    pub(crate) line: u64,
}

/// A picture whose header is read and whose pixels are not.
pub(crate) struct Opened {
    path: PathBuf,
    format: FileFormat,
    decoder: Decoder,
}

/// What reads the pixels.
enum Decoder {
    /// The image crate, and how many copies of the pixels it has at the end.
    Image(Box<dyn ImageDecoder>, u64),
    /// Floating point grey, which the image crate has no type for.
    GreyFloat(Box<GreyFloat>),
}

/// A floating point grey TIFF.
struct GreyFloat {
    size: (u32, u32),
    decoder: tiff::decoder::Decoder<BufReader<File>>,
}

impl Opened {
    /// Opens a picture of any [`FileFormat`] and reads its header.
    ///
    /// # Errors
    /// [`CaptureError::MissingFile`], [`CaptureError::Io`],
    /// [`CaptureError::Picture`] or [`CaptureError::TooLarge`].
    pub(crate) fn open(source: Source<'_>) -> Result<Self, CaptureError> {
        let path = source.path.to_owned();
        let io = |source| CaptureError::Io {
            path: path.clone(),
            source,
        };
        let metadata = match std::fs::metadata(&path) {
            Ok(metadata) => metadata,
            Err(error) if error.kind() == ErrorKind::NotFound => {
                return Err(CaptureError::MissingFile {
                    path,
                    what: source.what,
                    line: source.line,
                });
            }
            Err(source) => return Err(io(source)),
        };
        let refuse = |reason: String| CaptureError::Picture {
            path: path.clone(),
            reason,
            next_step: EXPORT,
        };
        // Opening a pipe would wait for a writer for ever.
        if !metadata.is_file() {
            return Err(refuse("it is not a regular file".to_owned()));
        }
        if metadata.len() > MAX_FILE {
            return Err(refuse(format!("it has more than {MAX_FILE} bytes")));
        }
        let mut file = File::open(&path).map_err(io)?;
        let format = sniff(&mut file).map_err(io)?;
        let Some(format) = format else {
            return Err(refuse(format!("it is not a {}", FileFormat::NAMES)));
        };
        let decoder = Decoder::new(format, file).map_err(refuse)?;
        let (width, height) = decoder.size();
        if u64::from(width) * u64::from(height) > MAX_PIXELS {
            return Err(CaptureError::TooLarge {
                path,
                width,
                height,
                limit: MAX_PIXELS,
            });
        }
        let bytes = decoder.memory();
        if bytes > MAX_MEMORY {
            return Err(refuse(format!(
                "decoding it takes {} MB of memory; at most {} are used",
                bytes >> 20,
                MAX_MEMORY >> 20
            )));
        }
        if width == 0 || height == 0 {
            return Err(refuse("it has no pixels".to_owned()));
        }
        Ok(Self {
            path,
            format,
            decoder,
        })
    }

    /// What kind of file it is.
    pub(crate) fn format(&self) -> FileFormat {
        self.format
    }

    /// Width and height in pixels, at least 1.
    pub(crate) fn size(&self) -> (u32, u32) {
        self.decoder.size()
    }

    /// Colour channels without alpha, 1 or 3.
    pub(crate) fn channels(&self) -> usize {
        self.decoder.channels()
    }

    /// Bits of a sample: 8, 16, or 32 for floating point.
    pub(crate) fn bits(&self) -> u8 {
        match &self.decoder {
            Decoder::Image(decoder, _) => {
                let colour = decoder.color_type();
                8 * colour.bytes_per_pixel() / colour.channel_count()
            }
            Decoder::GreyFloat(_) => 32,
        }
    }

    /// Bytes of memory that decoding it takes, its pixels included.
    pub(crate) fn memory(&self) -> u64 {
        self.decoder.memory()
    }

    /// Decodes the pixels.
    ///
    /// An alpha channel is dropped if it is opaque everywhere, as drawing
    /// programs write it; a see-through pixel has no value of its own, so it is
    /// refused.
    ///
    /// # Errors
    /// [`CaptureError::Picture`].
    pub(crate) fn decode(self) -> Result<Samples, CaptureError> {
        let Self {
            path,
            format,
            decoder,
        } = self;
        let refuse = |(reason, next_step)| CaptureError::Picture {
            path: path.clone(),
            reason,
            next_step,
        };
        let (width, channels) = (decoder.size().0 as usize, decoder.channels());
        let large = decoder.memory() > LARGE;
        // Nothing is behind the lock that a thread could have left half done.
        let _one = large.then(|| {
            DECODING_LARGE
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
        });
        let samples = match decoder {
            Decoder::Image(decoder, _) => DynamicImage::from_decoder(decoder)
                .map_err(|error| (unreadable(format, &error), EXPORT))
                .and_then(|decoded| without_alpha(decoded, width)),
            Decoder::GreyFloat(grey) => grey.decode().map_err(|reason| (reason, EXPORT)),
        };
        let samples = samples.map_err(refuse)?;
        if let Samples::Float(values) = &samples
            && let Some(at) = values.iter().position(|value| !value.is_finite())
        {
            let (row, col) = (at / channels / width, at / channels % width);
            let reason = format!("the value at row {row}, column {col} is not a finite number");
            let next_step = "Export the picture again, without undefined pixels.";
            return Err(refuse((reason, next_step)));
        }
        Ok(samples)
    }
}

impl Decoder {
    /// Reads the header of a file of this format.
    fn new(format: FileFormat, file: File) -> Result<Self, String> {
        let mut limits = Limits::no_limits();
        limits.max_alloc = Some(MAX_MEMORY + DECODER_BYTES);
        let words = |error: image::ImageError| unreadable(format, &error);
        if format == FileFormat::Tiff
            && let Some(grey) = GreyFloat::new(file.try_clone().map_err(|e| e.to_string())?)?
        {
            return Ok(Self::GreyFloat(Box::new(grey)));
        }
        if format == FileFormat::Jpeg && !jpeg_ends(&file).map_err(|error| error.to_string())? {
            return Err("not a readable JPEG: its end is missing".to_owned());
        }
        let mut file = BufReader::new(file);
        file.rewind().map_err(|error| error.to_string())?;
        let boxed: ImageResult<Box<dyn ImageDecoder>> = match format {
            FileFormat::Png => {
                PngDecoder::with_limits(file, limits.clone()).map(|decoder| Box::new(decoder) as _)
            }
            FileFormat::Tiff => TiffDecoder::new(file).map(|decoder| Box::new(decoder) as _),
            FileFormat::Jpeg => JpegDecoder::new(file).map(|decoder| Box::new(decoder) as _),
            FileFormat::OpenExr => OpenExrDecoder::new(file).map(|decoder| Box::new(decoder) as _),
            FileFormat::Netpbm => PnmDecoder::new(file).map(|decoder| Box::new(decoder) as _),
        };
        let mut decoder = boxed.map_err(words)?;
        decoder.set_limits(limits).map_err(words)?;
        let copies = match format {
            FileFormat::Tiff | FileFormat::OpenExr => 2,
            FileFormat::Png | FileFormat::Jpeg | FileFormat::Netpbm => 1,
        };
        Ok(Self::Image(decoder, copies))
    }

    fn size(&self) -> (u32, u32) {
        match self {
            Self::Image(decoder, _) => decoder.dimensions(),
            Self::GreyFloat(grey) => grey.size,
        }
    }

    /// Bytes of memory that decoding takes.
    fn memory(&self) -> u64 {
        match self {
            Self::Image(decoder, copies) => decoder.total_bytes().saturating_mul(*copies),
            // At most 8 bytes of the file's and 4 of ours.
            Self::GreyFloat(grey) => 12 * u64::from(grey.size.0) * u64::from(grey.size.1),
        }
    }

    fn channels(&self) -> usize {
        match self {
            Self::Image(decoder, _) if decoder.color_type().has_color() => 3,
            _ => 1,
        }
    }
}

impl GreyFloat {
    /// Opens a TIFF; `None` if its pixels are of another kind or its header is
    /// not readable, which the image crate then says in its own words.
    fn new(file: File) -> Result<Option<Self>, String> {
        let mut file = BufReader::new(file);
        file.rewind().map_err(|error| error.to_string())?;
        let Ok(mut decoder) = tiff::decoder::Decoder::new(file) else {
            return Ok(None);
        };
        let formats = decoder.find_tag_unsigned_vec::<u16>(tiff::tags::Tag::SampleFormat);
        let float = tiff::tags::SampleFormat::IEEEFP.to_u16();
        let (Ok(Some(formats)), Ok(tiff::ColorType::Gray(_)), Ok(size)) =
            (formats, decoder.colortype(), decoder.dimensions())
        else {
            return Ok(None);
        };
        if formats != [float] || u64::from(size.0) * u64::from(size.1) > MAX_PIXELS {
            return Ok(None);
        }
        let mut limits = tiff::decoder::Limits::default();
        limits.decoding_buffer_size = (MAX_PIXELS * 8) as usize;
        limits.intermediate_buffer_size = (MAX_PIXELS * 8) as usize;
        let decoder = decoder.with_limits(limits);
        Ok(Some(Self { size, decoder }))
    }

    fn decode(mut self) -> Result<Samples, String> {
        use tiff::decoder::DecodingResult;
        let decoded = self.decoder.read_image();
        let decoded = decoded.map_err(|error| format!("not a readable TIFF: {error}"))?;
        let values: Vec<f32> = match decoded {
            DecodingResult::F32(values) => values,
            DecodingResult::F64(values) => values.into_iter().map(|value| value as f32).collect(),
            DecodingResult::F16(values) => values.into_iter().map(f32::from).collect(),
            _ => return Err("its pixels are not what its header says".to_owned()),
        };
        let pixels = self.size.0 as usize * self.size.1 as usize;
        if values.len() != pixels {
            return Err(format!(
                "it has {} values for {pixels} pixels",
                values.len()
            ));
        }
        Ok(Samples::Float(values))
    }
}

/// Format of a file by its first bytes.
fn sniff(file: &mut File) -> std::io::Result<Option<FileFormat>> {
    let mut first = Vec::new();
    file.by_ref()
        .take(FileFormat::SIGNATURE as u64)
        .read_to_end(&mut first)?;
    Ok(FileFormat::of(&first))
}

/// Whether a JPEG has an end after its last scan: the decoder fills up what a
/// broken transfer cut off with grey and says nothing.
fn jpeg_ends(mut file: &File) -> std::io::Result<bool> {
    let mut bytes = Vec::new();
    file.seek(SeekFrom::Start(0))?;
    file.read_to_end(&mut bytes)?;
    let last = |marker: [u8; 2]| bytes.windows(2).rposition(|two| two == marker);
    Ok(last([0xff, 0xd9]) > last([0xff, 0xda]))
}

/// Values of a picture, row by row, channels side by side.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum Samples {
    /// 0 to 255.
    Eight(Vec<u8>),
    /// 0 to 65,535.
    Sixteen(Vec<u16>),
    /// Finite; 1 is full scale.
    Float(Vec<f32>),
}

impl Samples {
    /// Codes for a projector; `None` of floating point numbers, which are none.
    pub(crate) fn codes(self) -> Option<iltm_picture::Samples> {
        match self {
            Self::Eight(codes) => Some(iltm_picture::Samples::Eight(codes)),
            Self::Sixteen(codes) => Some(iltm_picture::Samples::Sixteen(codes)),
            Self::Float(_) => None,
        }
    }
}

/// The samples of a picture so many pixels wide whose alpha, if any, is full everywhere;
/// otherwise what is wrong, and what to do about it.
fn without_alpha(decoded: DynamicImage, width: usize) -> Result<Samples, (String, &'static str)> {
    match decoded {
        DynamicImage::ImageLuma8(picture) => Ok(Samples::Eight(picture.into_raw())),
        DynamicImage::ImageRgb8(picture) => Ok(Samples::Eight(picture.into_raw())),
        DynamicImage::ImageLuma16(picture) => Ok(Samples::Sixteen(picture.into_raw())),
        DynamicImage::ImageRgb16(picture) => Ok(Samples::Sixteen(picture.into_raw())),
        DynamicImage::ImageRgb32F(picture) => Ok(Samples::Float(picture.into_raw())),
        DynamicImage::ImageLumaA8(picture) => {
            opaque(picture.into_raw(), 2, width).map(Samples::Eight)
        }
        DynamicImage::ImageRgba8(picture) => {
            opaque(picture.into_raw(), 4, width).map(Samples::Eight)
        }
        DynamicImage::ImageLumaA16(picture) => {
            opaque(picture.into_raw(), 2, width).map(Samples::Sixteen)
        }
        DynamicImage::ImageRgba16(picture) => {
            opaque(picture.into_raw(), 4, width).map(Samples::Sixteen)
        }
        DynamicImage::ImageRgba32F(picture) => {
            opaque(picture.into_raw(), 4, width).map(Samples::Float)
        }
        other => Err((format!("its pixels are {:?}", other.color()), EXPORT)),
    }
}

/// The samples without the last of every `step`, the alpha, in the memory that they had.
fn opaque<T: Copy + PartialEq + image::Primitive>(
    mut samples: Vec<T>,
    step: usize,
    width: usize,
) -> Result<Vec<T>, (String, &'static str)> {
    let seen_through = |pixel: &[T]| pixel.last() != Some(&T::DEFAULT_MAX_VALUE);
    if let Some(at) = samples.chunks_exact(step).position(seen_through) {
        let (row, col) = (at / width, at % width);
        let reason = format!("pixel at row {row}, column {col} is transparent");
        return Err((reason, "Export the picture without an alpha channel."));
    }
    let mut at = 0;
    samples.retain(|_| {
        at += 1;
        at % step != 0
    });
    Ok(samples)
}

fn unreadable(format: FileFormat, error: &image::ImageError) -> String {
    format!("not a readable {format}: {error}")
}
