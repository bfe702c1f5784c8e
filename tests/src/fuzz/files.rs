//! Table files that a device may be sent, good ones and bad ones, and what must become of
//! each: known from how they were made, not from the code under test.

use crate::wedge_table_for;
use ed25519_dalek::{Signer, SigningKey};
use iltm::picture::Response;
use iltm_runtime::link::Digest;
use iltm_runtime::trust::Rejected;
use sha2::{Digest as _, Sha512};
use std::sync::OnceLock;

/// Bytes of a seal; this and the places below are those of `docs/protocol.md` and
/// the table format, written out again.
const SEAL: usize = 96;

/// The devices that there are: files are for one of them.
pub(super) const DEVICES: [u64; 2] = [7, 8];

/// The signing key of this number.
pub(super) fn signer(number: u8) -> SigningKey {
    SigningKey::from_bytes(&[number + 1; 32])
}

/// Public keys that a device may get: two that sign, and one that nobody has.
pub(super) fn keys() -> &'static [[u8; 32]; 3] {
    static KEYS: OnceLock<[[u8; 32]; 3]> = OnceLock::new();
    KEYS.get_or_init(|| {
        let [a, b] = [0, 1].map(|number| signer(number).verifying_key().to_bytes());
        [a, b, [0; 32]]
    })
}

/// What a device is provisioned with.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Owner {
    /// Public key.
    pub(super) key: [u8; 32],
    /// The device's number.
    pub(super) device: u64,
}

/// What a whole table's seal states.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Stated {
    /// Number of the signing key.
    key: u8,
    version: u32,
    oldest: u32,
    device: u64,
    /// Whether the signature is the key's.
    genuine: bool,
}

/// A file.
#[derive(Debug)]
pub(super) struct File {
    /// Its bytes.
    pub(super) bytes: Vec<u8>,
    /// What a device tells it by.
    pub(super) digest: Digest,
    /// The table's own number, where there is one.
    id: u32,
    /// What is wrong with it on any device.
    wrong: Option<Rejected>,
    stated: Option<Stated>,
}

/// What counts of a table that may run.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Facts {
    /// The table's own number.
    pub(super) id: u32,
    /// Version; 0 if it has none.
    pub(super) version: u32,
    /// Tables below this never run again once it is confirmed.
    pub(super) oldest: u32,
    /// Bytes of the file.
    pub(super) length: u32,
}

impl File {
    fn new(bytes: Vec<u8>, wrong: Option<Rejected>, stated: Option<Stated>) -> Self {
        let digest = Digest::of(&Sha512::digest(&bytes));
        let id = bytes.get(12..16).and_then(|id| id.try_into().ok());
        Self {
            digest,
            id: id.map_or(0, u32::from_le_bytes),
            bytes,
            wrong,
            stated,
        }
    }

    fn sealed(image: &[u8], wrong: Option<Rejected>, stated: Stated) -> Self {
        let mut bytes = image.to_vec();
        bytes.extend(b"SEAL\x01\0\0\0");
        bytes.extend(stated.version.to_le_bytes());
        bytes.extend(stated.oldest.to_le_bytes());
        bytes.extend(stated.device.to_le_bytes());
        bytes.extend(&keys()[usize::from(stated.key)][..8]);
        let mut signature = signer(stated.key).sign(&bytes).to_bytes();
        signature[40] ^= u8::from(!stated.genuine);
        bytes.extend(signature);
        Self::new(bytes, wrong, Some(stated))
    }

    /// What a device must say to it that takes no version below `floor`.
    ///
    /// # Errors
    /// Why it must be refused.
    pub(super) fn verdict(&self, owner: Option<Owner>, floor: u32) -> Result<Facts, Rejected> {
        if let Some(wrong) = self.wrong {
            return Err(wrong);
        }
        let mut facts = Facts {
            id: self.id,
            version: self.stated.map_or(0, |stated| stated.version),
            oldest: 0,
            length: self.bytes.len() as u32,
        };
        let Some(owner) = owner else {
            return Ok(facts);
        };
        let stated = self.stated.ok_or(Rejected::Unsigned)?;
        let device = stated.device;
        if keys()[usize::from(stated.key)] != owner.key {
            return Err(Rejected::WrongKey);
        }
        if !stated.genuine {
            return Err(Rejected::Signature);
        }
        if device != 0 && device != owner.device {
            return Err(Rejected::OtherDevice { device });
        }
        if stated.version < floor {
            let version = stated.version;
            return Err(Rejected::Older { version, floor });
        }
        // A table cannot revoke itself: confirmed, it would be lost at the next start.
        facts.oldest = stated.oldest.min(stated.version);
        Ok(facts)
    }
}

/// Three whole images.
fn images() -> &'static [Vec<u8>; 3] {
    static IMAGES: OnceLock<[Vec<u8>; 3]> = OnceLock::new();
    IMAGES.get_or_init(|| [1, 2, 3].map(|cols| wedge_table_for(Response::Linear, 1, cols, 1)))
}

/// All of them; [`GOOD`] of them first, which some device takes.
pub(super) fn files() -> &'static [File] {
    static FILES: OnceLock<Vec<File>> = OnceLock::new();
    FILES.get_or_init(make)
}

/// How many files are whole and rightly signed, or not signed.
pub(super) const GOOD: usize = 11;

fn make() -> Vec<File> {
    let [a, b, c] = images();
    let stated = |key, version, oldest, device| Stated {
        key,
        version,
        oldest,
        device,
        genuine: true,
    };
    let sealed = |image: &[u8], stated| File::sealed(image, None, stated);
    let bad = |bytes: &[u8], wrong| File::new(bytes.to_vec(), Some(wrong), None);
    let [here, there] = DEVICES;
    let mut altered = b.clone();
    *altered.last_mut().expect("a whole image") ^= 1;
    let whole = sealed(b, stated(0, 2, 0, here)).bytes;
    let with = |at: usize, byte: u8| {
        let mut bytes = whole.clone();
        bytes[b.len() + at] = byte;
        bytes
    };
    vec![
        File::new(a.clone(), None, None),
        sealed(a, stated(0, 1, 0, 0)),
        sealed(b, stated(0, 2, 0, here)),
        sealed(c, stated(0, 3, 3, here)),
        // The same image as before, signed anew.
        sealed(a, stated(0, 3, 2, 0)),
        sealed(c, stated(0, u32::MAX, u32::MAX, 0)),
        sealed(b, stated(1, 9, 0, 0)),
        sealed(c, stated(0, 4, 0, there)),
        File::new(c.clone(), None, None),
        // A version that its own floor revokes.
        sealed(b, stated(0, 4, 6, 0)),
        File::new(b.clone(), None, None),
        // From here on they are never taken, but for the first by a device without key.
        sealed(
            b,
            Stated {
                genuine: false,
                ..stated(0, 5, 0, here)
            },
        ),
        File::sealed(&altered, Some(Rejected::Damaged), stated(0, 5, 0, here)),
        bad(&b[..b.len() - 8], Rejected::Truncated),
        bad(&whole[..whole.len() - 1], Rejected::Truncated),
        bad(&with(4, 2), Rejected::Format),
        bad(&with(6, 1), Rejected::Contents),
        bad(&with(0, b'Z'), Rejected::Damaged),
        bad(&[b.as_slice(), &[0; 4]].concat(), Rejected::Damaged),
        bad(b"", Rejected::Truncated),
        bad(b"This is something else altogether.", Rejected::NotATable),
    ]
}

/// What a device must make of a slot when it starts: the table that may run, if any.
/// `noted` is the length of the file there, where a device knows it.
pub(super) fn judge(
    slot: &[u8],
    noted: Option<u32>,
    owner: Option<Owner>,
    floor: u32,
) -> Option<Facts> {
    let image = images().iter().find(|image| slot.starts_with(image))?;
    let behind = &slot[image.len()..];
    let length = match noted {
        Some(noted) => noted as usize,
        None if behind.starts_with(b"SEAL") => image.len() + SEAL,
        None => image.len(),
    };
    let bytes = slot.get(..length)?;
    if owner.is_some() {
        let file = files().iter().find(|file| file.bytes == bytes)?;
        return file.verdict(owner, floor).ok();
    }
    // Nobody looks who signed it, or whether: only that it is a seal.
    let seal = bytes.get(image.len()..)?;
    let version = match seal {
        [] => 0,
        [b'S', b'E', b'A', b'L', 1, 0, 0, 0, a, b, c, d, ..] if seal.len() == SEAL => {
            u32::from_le_bytes([*a, *b, *c, *d])
        }
        _ => return None,
    };
    Some(Facts {
        id: u32::from_le_bytes(image.get(12..16)?.try_into().ok()?),
        version,
        oldest: 0,
        length: length as u32,
    })
}
