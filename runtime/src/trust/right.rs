//! Rights: signed leave to begin an update, to confirm and to roll back on a device with a
//! key.
//!
//! A right is a signature by the site key over what is to be done ([`Deed::message`]), or by a technician's key and
//! then the site key's certificate for that key. It holds for one device and for the
//! sequence number of the next commit record, which is in flash and never returns. What a
//! right allows writes a record, so a right that somebody overheard is worth nothing.

use super::{Terms, ed25519};
use crate::image::put;
use crate::link::Digest;
use crate::yield_budget::YieldBudget;
use core::fmt;
use core::ops::Range;
use serde::{Deserialize, Serialize};

/// What a right is for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Deed {
    /// To erase and write the slot that is not in use.
    Begin {
        /// Bytes of the file.
        length: u32,
        /// Of the file.
        digest: Digest,
    },
    /// To keep the table on trial.
    Confirm {
        /// Its id.
        table: u32,
    },
    /// To leave the table in use.
    Rollback {
        /// Its id.
        table: u32,
    },
}

/// Where the fields are that a right's signature covers.
mod deed {
    use super::Range;
    pub(super) const DOMAIN: Range<usize> = 0..12;
    pub(super) const KIND: Range<usize> = 12..16;
    pub(super) const DEVICE: Range<usize> = 16..24;
    pub(super) const SEQUENCE: Range<usize> = 24..28;
    /// Bytes of the file, or the table's id.
    pub(super) const SUBJECT: Range<usize> = 28..32;
    /// Zero but for a begin.
    pub(super) const DIGEST: Range<usize> = 32..48;
    pub(super) const SIZE: usize = 48;
}

impl Deed {
    /// The bytes that are signed, for the device of this number and its next record.
    #[must_use]
    pub fn message(&self, device: u64, sequence: u32) -> [u8; deed::SIZE] {
        let (kind, subject, digest) = match *self {
            Self::Begin { length, digest } => (1_u32, length, digest),
            Self::Confirm { table } => (2, table, Digest::default()),
            Self::Rollback { table } => (3, table, Digest::default()),
        };
        let mut bytes = [0; deed::SIZE];
        put(&mut bytes, deed::DOMAIN, b"iltm right 1");
        put(&mut bytes, deed::KIND, &kind.to_le_bytes());
        put(&mut bytes, deed::DEVICE, &device.to_le_bytes());
        put(&mut bytes, deed::SEQUENCE, &sequence.to_le_bytes());
        put(&mut bytes, deed::SUBJECT, &subject.to_le_bytes());
        put(&mut bytes, deed::DIGEST, &digest.0);
        bytes
    }
}

/// Bytes of a signature.
pub const SIGNATURE: usize = 64;

/// What the site key says of a technician's key.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Certificate {
    /// The technician's public key.
    pub key: [u8; 32],
    /// The device that it is for; 0: any.
    pub device: u64,
    /// Void on devices that take only tables of a higher version.
    pub version: u32,
    /// The site key's signature over [`Certificate::message`].
    pub signature: [u8; SIGNATURE],
}

/// Where the fields of a certificate are.
mod certificate {
    use super::Range;
    pub(super) const KEY: Range<usize> = 0..32;
    pub(super) const DEVICE: Range<usize> = 32..40;
    pub(super) const VERSION: Range<usize> = 40..44;
    pub(super) const SIGNATURE: Range<usize> = 44..108;
    /// What stands before a certificate's fields where it is signed.
    pub(super) const DOMAIN: [u8; 16] = *b"iltm technician1";
}

impl Certificate {
    /// Bytes of a certificate.
    pub const SIZE: usize = certificate::SIGNATURE.end;

    /// The bytes that are signed.
    #[must_use]
    pub fn message(&self) -> [u8; 60] {
        let mut message = [0; 60];
        let domain = certificate::DOMAIN.len();
        put(&mut message, 0..domain, &certificate::DOMAIN);
        let fields = self.emit();
        let fields = fields.get(..certificate::SIGNATURE.start);
        put(&mut message, domain..60, fields.unwrap_or_default());
        message
    }

    /// Its bytes.
    #[must_use]
    pub fn emit(&self) -> [u8; Self::SIZE] {
        let mut bytes = [0; Self::SIZE];
        put(&mut bytes, certificate::KEY, &self.key);
        put(&mut bytes, certificate::DEVICE, &self.device.to_le_bytes());
        put(
            &mut bytes,
            certificate::VERSION,
            &self.version.to_le_bytes(),
        );
        put(&mut bytes, certificate::SIGNATURE, &self.signature);
        bytes
    }

    /// The certificate in these bytes.
    #[must_use]
    pub fn parse(bytes: &[u8; Self::SIZE]) -> Self {
        let (key, rest) = split(bytes);
        let (device, rest) = split(rest);
        let (version, rest) = split(rest);
        let (signature, _) = split(rest);
        Self {
            key,
            device: u64::from_le_bytes(device),
            version: u32::from_le_bytes(version),
            signature,
        }
    }
}

/// The first `N` bytes, and the rest; zeros where there are fewer.
fn split<const N: usize>(bytes: &[u8]) -> ([u8; N], &[u8]) {
    let (first, rest) = bytes.split_first_chunk().unwrap_or((&[0; N], &[]));
    (*first, rest)
}

/// Why a right is none. Its numbers go over the wire: do not reorder.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum NoRight {
    /// The request came without one, or with bytes that are none.
    Missing,
    /// Its signature is false; or it is for another device, another request, or was used.
    Signature,
    /// The technician's certificate is not signed with the device's key.
    Certificate,
    /// The technician's certificate is for another device.
    OtherDevice {
        /// The device that it is for.
        device: u64,
    },
    /// The technician's certificate has been revoked.
    Revoked {
        /// Its version.
        version: u32,
        /// Lowest version that counts.
        floor: u32,
    },
}

impl fmt::Display for NoRight {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => {
                f.write_str("the device has a key and wants to be shown the right to do that")
            }
            Self::Signature => {
                f.write_str("the right to do that is not signed for this device now")
            }
            Self::Certificate => {
                f.write_str("the technician's key is not certified by the device's key")
            }
            Self::OtherDevice { device } => {
                write!(f, "the technician's key is for the device {device}")
            }
            Self::Revoked { version, floor } => write!(
                f,
                "the technician's key is revoked: its version is {version}, and none below {floor} counts"
            ),
        }
    }
}

impl core::error::Error for NoRight {}

/// Whether `right` allows a deed on a device with these terms, whose next commit record has
/// this sequence number. A device without a key allows everything.
///
/// Two signatures are verified for a technician, one for the owner; `yield_now` is called
/// as by [`examine`](super::examine).
///
/// # Errors
/// [`NoRight`].
pub fn allows(
    right: &[u8],
    deed: &Deed,
    sequence: u32,
    terms: &Terms,
    yield_now: &mut (impl FnMut() + ?Sized),
) -> Result<(), NoRight> {
    let Some(site) = &terms.trust.key else {
        return Ok(());
    };
    let (signature, rest) = right
        .split_first_chunk::<SIGNATURE>()
        .ok_or(NoRight::Missing)?;
    let mut budget = YieldBudget::new(yield_now);
    let mut key = site;
    let certificate;
    if !rest.is_empty() {
        let rest = rest.try_into().map_err(|_| NoRight::Missing)?;
        certificate = Certificate::parse(rest);
        let Certificate {
            device, version, ..
        } = certificate;
        if device != 0 && device != terms.trust.device {
            return Err(NoRight::OtherDevice { device });
        }
        if version < terms.floor {
            let floor = terms.floor;
            return Err(NoRight::Revoked { version, floor });
        }
        let message = certificate.message();
        if !ed25519::verify(site, &certificate.signature, &message, &mut budget) {
            return Err(NoRight::Certificate);
        }
        key = &certificate.key;
    }
    let message = deed.message(terms.trust.device, sequence);
    if ed25519::verify(key, signature, &message, &mut budget) {
        Ok(())
    } else {
        Err(NoRight::Signature)
    }
}
