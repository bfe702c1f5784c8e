//! Seal behind a signed image: where its bytes are, and taking a file apart.
//!
//! A file is an image, as long as its header says, and nothing more or one seal:
//! who signed it, and on which terms. The signature covers the image and the seal
//! before it. Whether a seal is good is for [`trust`](crate::trust) to say.

use super::bytes::{put, u16_at, u32_at};
use super::layout::{self, header};
use super::{ImageError, SealError};

/// First bytes of every seal.
pub const MAGIC: [u8; 4] = *b"SEAL";

/// Version of the seal described here.
pub const SEAL_VERSION: u16 = 1;

/// The fields of a seal, 96 bytes, little-endian.
pub mod field {
    use core::ops::Range;
    /// [`MAGIC`](super::MAGIC).
    pub const MAGIC: Range<usize> = 0..4;
    /// [`SEAL_VERSION`](super::SEAL_VERSION), `u16`.
    pub const SEAL_VERSION: Range<usize> = 4..6;
    /// Zero.
    pub const RESERVED: Range<usize> = 6..8;
    /// Version of the table, `u32`.
    pub const VERSION: Range<usize> = 8..12;
    /// Oldest version that may still run once this table is confirmed, `u32`; 0: all.
    pub const OLDEST: Range<usize> = 12..16;
    /// The device that it is for, `u64`; 0: all.
    pub const DEVICE: Range<usize> = 16..24;
    /// First bytes of the public key that it was signed with.
    pub const KEY: Range<usize> = 24..32;
    /// Ed25519 signature of the image and the fields before this one.
    pub const SIGNATURE: Range<usize> = HEAD..SIZE;
    /// Length of the fields before the signature.
    pub const HEAD: usize = 32;
    /// Length of a seal.
    pub const SIZE: usize = 96;
}

/// Who signed a table, and on which terms; as stated, which proves nothing.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Seal {
    /// Version of the table.
    pub version: u32,
    /// Once this table is confirmed, tables of a lower version never run again;
    /// 0 revokes none.
    pub oldest: u32,
    /// The device that it is for; 0: any.
    pub device: u64,
    /// First bytes of the public key; see [`Seal::key_id`].
    pub key: [u8; 8],
    /// Ed25519 signature.
    pub signature: [u8; 64],
}

impl Seal {
    /// What names a public key in a seal.
    #[must_use]
    pub const fn key_id(key: &[u8; 32]) -> [u8; 8] {
        let [a, b, c, d, e, f, g, h, ..] = *key;
        [a, b, c, d, e, f, g, h]
    }

    /// The fields before the signature, for a table signed with `key`. What is signed
    /// is the image and then these bytes; the signature follows them.
    #[must_use]
    pub fn head(version: u32, oldest: u32, device: u64, key: &[u8; 32]) -> [u8; field::HEAD] {
        let seal = Self {
            version,
            oldest,
            device,
            key: Self::key_id(key),
            signature: [0; 64],
        };
        let mut head = [0; field::HEAD];
        for (to, from) in head.iter_mut().zip(seal.emit()) {
            *to = from;
        }
        head
    }

    /// Its bytes.
    #[must_use]
    pub fn emit(&self) -> [u8; field::SIZE] {
        let mut bytes = [0; field::SIZE];
        let mut put = |field, value: &[u8]| put(&mut bytes, field, value);
        put(field::MAGIC, &MAGIC);
        put(field::SEAL_VERSION, &SEAL_VERSION.to_le_bytes());
        put(field::VERSION, &self.version.to_le_bytes());
        put(field::OLDEST, &self.oldest.to_le_bytes());
        put(field::DEVICE, &self.device.to_le_bytes());
        put(field::KEY, &self.key);
        put(field::SIGNATURE, &self.signature);
        bytes
    }

    /// The seal in `bytes`.
    ///
    /// # Errors
    /// [`SealError`] if it is of another version or its reserved bytes are not zero.
    /// The magic is not looked at; [`unseal`] has.
    pub fn parse(bytes: &[u8; field::SIZE]) -> Result<Self, SealError> {
        let found = u16_at(bytes, field::SEAL_VERSION).unwrap_or(0);
        if found != SEAL_VERSION {
            return Err(SealError::Version { found });
        }
        if u16_at(bytes, field::RESERVED) != Some(0) {
            return Err(SealError::Reserved);
        }
        Ok(Self {
            version: u32_at(bytes, field::VERSION).unwrap_or(0),
            oldest: u32_at(bytes, field::OLDEST).unwrap_or(0),
            device: u64::from_le_bytes(array(bytes, field::DEVICE)),
            key: array(bytes, field::KEY),
            signature: array(bytes, field::SIGNATURE),
        })
    }
}

fn array<const N: usize>(bytes: &[u8; field::SIZE], field: core::ops::Range<usize>) -> [u8; N] {
    let field = bytes.get(field).unwrap_or_default();
    field.try_into().unwrap_or([0; N])
}

/// The image and the seal, if there is one, of the bytes of a whole file.
///
/// Nothing of the image is looked at but its header, and nothing of the seal is
/// believed.
///
/// # Errors
/// - [`ImageError::NotATable`], [`ImageError::Version`] as for an image alone.
/// - [`ImageError::Truncated`] if the image or the seal is cut short.
/// - [`ImageError::Length`] if what follows the image is not a seal.
/// - [`ImageError::Seal`] if it is one that this runtime cannot read.
pub fn unseal(file: &[u8]) -> Result<(&[u8], Option<Seal>), ImageError> {
    let given = file.len();
    let truncated = |needed: usize| ImageError::Truncated { needed, given };
    let head = file.get(..header::SIZE).ok_or(truncated(header::SIZE))?;
    if head.get(header::MAGIC) != Some(&layout::MAGIC) {
        return Err(ImageError::NotATable);
    }
    let found = u16_at(head, header::VERSION).unwrap_or(0);
    if found != layout::FORMAT_VERSION {
        return Err(ImageError::Version { found });
    }
    let stated = u32_at(head, header::LENGTH).unwrap_or(0) as usize;
    let (image, rest) = file.split_at_checked(stated).ok_or(truncated(stated))?;
    if rest.is_empty() {
        return Ok((image, None));
    }
    if !rest.iter().zip(MAGIC).all(|(byte, magic)| *byte == magic) {
        return Err(ImageError::Length { stated, given });
    }
    match rest.split_first_chunk::<{ field::SIZE }>() {
        None => Err(truncated(stated.saturating_add(field::SIZE))),
        Some((seal, [])) => Ok((image, Some(Seal::parse(seal).map_err(ImageError::Seal)?))),
        Some(_) => Err(ImageError::Length { stated, given }),
    }
}

/// The file at the start of a slot that may be longer: as many bytes as the header
/// says, and a seal's if one follows. The whole slot where that is more than it has.
#[must_use]
pub fn content(slot: &[u8]) -> &[u8] {
    let stated = u32_at(slot, header::LENGTH).map_or(usize::MAX, |length| length as usize);
    let Some(rest) = slot.get(stated..) else {
        return slot;
    };
    let seal = if rest.starts_with(&MAGIC) {
        field::SIZE
    } else {
        0
    };
    slot.get(..stated.saturating_add(seal)).unwrap_or(slot)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::made_up::{flat, image};
    use proptest::prelude::*;
    use std::vec::Vec;

    fn seal() -> Seal {
        Seal {
            version: 0x0102_0304,
            oldest: 0x0506_0708,
            device: 0x1112_1314_1516_1718,
            key: *b"key-name",
            signature: core::array::from_fn(|index| index as u8),
        }
    }

    fn sealed() -> (Vec<u8>, Vec<u8>) {
        let image = image(&flat(2, 3));
        let file = [&image[..], &seal().emit()].concat();
        (image, file)
    }

    #[test]
    fn a_seal_is_where_the_layout_says() {
        let bytes = seal().emit();
        assert_eq!(bytes[..8], *b"SEAL\x01\0\0\0");
        assert_eq!(bytes[8..16], [4, 3, 2, 1, 8, 7, 6, 5]);
        assert_eq!(bytes[16..24], [24, 23, 22, 21, 20, 19, 18, 17]);
        assert_eq!(bytes[24..32], *b"key-name");
        assert_eq!(bytes[32..], seal().signature);
        assert_eq!(Seal::parse(&bytes), Ok(seal()));
    }

    #[test]
    fn the_head_that_is_signed_is_the_start_of_the_seal() {
        let key = *b"key-name and twenty-four more...";
        let head = Seal::head(seal().version, seal().oldest, seal().device, &key);
        assert_eq!(head, seal().emit()[..32]);
    }

    #[test]
    fn a_file_comes_apart_into_image_and_seal() {
        let (image, file) = sealed();
        assert_eq!(unseal(&image), Ok((&image[..], None)));
        assert_eq!(unseal(&file), Ok((&image[..], Some(seal()))));
    }

    #[test]
    fn what_follows_an_image_is_one_whole_seal_or_nothing() {
        let (image, file) = sealed();
        let (stated, needed) = (image.len(), file.len());
        for given in stated + 1..needed {
            let truncated = ImageError::Truncated { needed, given };
            assert_eq!(unseal(&file[..given]), Err(truncated));
        }
        for more in [[&file[..], &[0]].concat(), [&image[..], &[0; 96]].concat()] {
            let given = more.len();
            assert_eq!(unseal(&more), Err(ImageError::Length { stated, given }));
        }
    }

    #[test]
    fn a_seal_of_another_version_or_with_reserved_bytes_is_refused() {
        let (image, mut file) = sealed();
        file[image.len() + field::RESERVED.start] = 1;
        assert_eq!(unseal(&file), Err(ImageError::Seal(SealError::Reserved)));
        file[image.len() + field::SEAL_VERSION.start] = 2;
        let version = SealError::Version { found: 2 };
        assert_eq!(unseal(&file), Err(ImageError::Seal(version)));
    }

    #[test]
    fn a_slot_holds_the_file_at_its_start() {
        let (image, file) = sealed();
        for filling in [0x00, 0xFF] {
            let slot = |file: &[u8]| [file, &[filling; 500]].concat();
            assert_eq!(content(&slot(&image)), image);
            assert_eq!(content(&slot(&file)), file);
        }
        assert_eq!(content(&file[..40]), &file[..40], "cut short");
        assert_eq!(content(&[0xFF; 64]), [0xFF; 64], "erased");
    }

    proptest! {
        #[test]
        fn any_bytes_come_apart_or_give_an_error(
            bytes in prop::collection::vec(any::<u8>(), 0..200),
            length in 0_u32..250,
            magic in any::<bool>(),
        ) {
            let mut bytes = bytes;
            if magic && bytes.len() > header::SIZE {
                bytes[header::MAGIC].copy_from_slice(&layout::MAGIC);
                bytes[header::VERSION].copy_from_slice(&layout::FORMAT_VERSION.to_le_bytes());
                bytes[header::LENGTH].copy_from_slice(&length.to_le_bytes());
            }
            if let Ok((image, seal)) = unseal(&bytes) {
                let seal = seal.map_or(Vec::new(), |seal| seal.emit().to_vec());
                prop_assert_eq!([image, &seal].concat(), &bytes[..]);
            }
            prop_assert!(bytes.starts_with(content(&bytes)));
        }
    }
}
