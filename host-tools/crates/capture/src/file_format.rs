//! The kinds of picture files that a camera, a raw converter or a script writes.

use std::fmt;

/// Kind of a photograph's file, told by its first bytes: cameras and people
/// rename files, and an extension says nothing about what is inside.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum FileFormat {
    /// PNG, 8 or 16 bit.
    Png,
    /// TIFF, 8 or 16 bit, or floating point.
    Tiff,
    /// JPEG, 8 bit, curved by the camera and compressed with loss.
    Jpeg,
    /// `OpenEXR`, floating point, linear by definition.
    OpenExr,
    /// PGM, PPM or PAM (netpbm), 8 or 16 bit, of any full scale.
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
    pub(super) const SIGNATURE: usize = 8;

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

impl fmt::Display for FileFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Png => "PNG",
            Self::Tiff => "TIFF",
            Self::Jpeg => "JPEG",
            Self::OpenExr => "OpenEXR",
            Self::Netpbm => "PGM or PPM",
        })
    }
}
