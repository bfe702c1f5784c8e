//! Signing: the seal behind an image, and the files that keys are in.
//!
//! A key is a text file: PKCS#8 in PEM, which OpenSSL reads and writes as well
//! (`openssl genpkey -algorithm ed25519`). A technician's key has two more blocks behind it:
//! what the site key says of it, and the site's public key.

use ed25519_dalek::pkcs8::spki::DecodePublicKey;
use ed25519_dalek::pkcs8::spki::der::pem::{LineEnding, decode_vec, encode_string};
use ed25519_dalek::pkcs8::{DecodePrivateKey, EncodePrivateKey, KeypairBytes};
use ed25519_dalek::{Signature, Signer, SigningKey, VerifyingKey};
use iltm_picture::foreign_file;
use iltm_runtime::image::{ImageError, Seal, unseal};
use iltm_runtime::trust::{Certificate, Deed};
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// On which terms a table is signed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SealTerms {
    /// Version of the table.
    pub version: u32,
    /// Once it is confirmed, tables of a lower version never run again; 0: all may.
    pub oldest: u32,
    /// Number of the device that it is for; 0: any.
    pub device: u64,
}

/// Signs a table's file; a seal that it has already is replaced.
///
/// # Errors
/// [`ImageError`] if it is not an image with or without a seal.
pub fn sign(file: &[u8], key: &SigningKey, terms: SealTerms) -> Result<Vec<u8>, ImageError> {
    let (image, _) = unseal(file)?;
    let public = key.verifying_key().to_bytes();
    let head = Seal::head(terms.version, terms.oldest, terms.device, &public);
    let mut signed = [image, &head].concat();
    let signature = key.sign(&signed);
    signed.extend(signature.to_bytes());
    Ok(signed)
}

/// Whether a sealed file's signature is this key's.
#[must_use]
pub fn is_signed_by(file: &[u8], seal: &Seal, key: &VerifyingKey) -> bool {
    let Some(signed) = file.len().checked_sub(seal.signature.len()) else {
        return false;
    };
    let signature = Signature::from_bytes(&seal.signature);
    seal.key == Seal::key_id(key.as_bytes())
        && key.verify_strict(&file[..signed], &signature).is_ok()
}

/// Bytes of a key's file at most: many times one's.
const MOST_BYTES: u64 = 1 << 16;

/// Why a key cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum KeyError {
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        source: io::Error,
    },
    /// There is a file already.
    #[error("{}: there is a file already, which may be the only copy of a key", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The file holds something else.
    #[error("{}: is not an Ed25519 {} key in PEM", path.display(), if *private { "private" } else { "private or public" })]
    NoKey {
        /// The file.
        path: PathBuf,
        /// Whether it had to be a private one.
        private: bool,
    },
    /// A technician's key where the site's is needed.
    #[error("{}: is a technician's key, which signs no tables", path.display())]
    Technician {
        /// The file.
        path: PathBuf,
    },
    /// The system gives no random bytes.
    #[error("the system has no random bytes for a key: {reason}")]
    Random {
        /// What it says.
        reason: String,
    },
}

impl KeyError {
    /// What to do about it.
    #[must_use]
    pub const fn next_step(&self) -> &'static str {
        match self {
            Self::Io { .. } => "Check the name and the permissions.",
            Self::Exists { .. } => "Name another file with -o, or move that one away.",
            Self::NoKey { private: true, .. } => {
                "Give a file that `iltm key new` made: signing takes the private key."
            }
            Self::NoKey { .. } => "Give a file that `iltm key new` made.",
            Self::Technician { .. } => "Give the site's own key.",
            Self::Random { .. } => "Try again later.",
        }
    }
}

/// Makes a new key in a new file that only its owner may read.
///
/// # Errors
/// [`KeyError`].
///
/// # Panics
/// Never: every key can be written as PEM.
pub fn new_key(path: &Path) -> Result<SigningKey, KeyError> {
    let key = random_key()?;
    write_new(path, &pem(&key))?;
    Ok(key)
}

/// Makes a technician's key in a new file that only its owner may read: with it, whoever
/// has it may flash tables that the site key signed, confirm and roll back, on one device
/// (or on any, 0), until versions above `version` count there.
///
/// # Errors
/// [`KeyError`].
pub fn new_technician(
    path: &Path,
    site: &SigningKey,
    device: u64,
    version: u32,
) -> Result<SigningKey, KeyError> {
    let key = random_key()?;
    let mut certificate = Certificate {
        key: key.verifying_key().to_bytes(),
        device,
        version,
        signature: [0; 64],
    };
    certificate.signature = site.sign(&certificate.message()).to_bytes();
    let site = site.verifying_key();
    let text = [
        pem(&key),
        block(CERTIFICATE, &certificate.emit()),
        block(SITE, site.as_bytes()),
    ];
    write_new(path, &text.concat())?;
    Ok(key)
}

/// Label of the block with a technician's certificate.
const CERTIFICATE: &str = "ILTM CERTIFICATE";

/// Label of the block with the public key that certifies it.
const SITE: &str = "ILTM SITE KEY";

fn block(label: &str, bytes: &[u8]) -> String {
    encode_string(label, LineEnding::LF, bytes).expect("a block has a form")
}

/// The block with this label, as it is written.
fn block_text<'t>(text: &'t str, label: &str) -> Option<&'t str> {
    let end = format!("-----END {label}-----");
    let start = text.find(&format!("-----BEGIN {label}-----"))?;
    let length = text.get(start..)?.find(&end)? + end.len();
    text.get(start..start + length)
}

/// The bytes of the block with this label.
fn find_block(text: &str, label: &str) -> Option<Vec<u8>> {
    let (_, bytes) = decode_vec(block_text(text, label)?.as_bytes()).ok()?;
    Some(bytes)
}

fn random_key() -> Result<SigningKey, KeyError> {
    let mut secret = [0; 32];
    getrandom::fill(&mut secret).map_err(|error| KeyError::Random {
        reason: error.to_string(),
    })?;
    Ok(SigningKey::from_bytes(&secret))
}

fn pem(key: &SigningKey) -> String {
    // Without the public key in it: OpenSSL does not read the version that has one.
    let pair = KeypairBytes {
        secret_key: key.to_bytes(),
        public_key: None,
    };
    let pem = pair.to_pkcs8_pem(LineEnding::LF).expect("a key has a form");
    pem.to_string()
}

fn write_new(path: &Path, text: &str) -> Result<(), KeyError> {
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let write = || {
        let mut file = options.open(path)?;
        file.write_all(text.as_bytes())?;
        file.sync_all()
    };
    write().map_err(|source| match source.kind() {
        io::ErrorKind::AlreadyExists => KeyError::Exists {
            path: path.to_owned(),
        },
        _ => KeyError::Io {
            path: path.to_owned(),
            source,
        },
    })
}

/// Whoever may show a device with a key the right to do something: the site, or a
/// technician.
#[derive(Debug)]
pub struct RightSigner {
    key: SigningKey,
    certificate: Option<Certificate>,
    site: VerifyingKey,
}

impl RightSigner {
    /// Reads the site's key or a technician's.
    ///
    /// # Errors
    /// [`KeyError`].
    pub fn read(path: &Path) -> Result<Self, KeyError> {
        let key = any_key(path)?;
        let text = text(path)?;
        let Some(certificate) = find_block(&text, CERTIFICATE) else {
            let site = key.verifying_key();
            return Ok(Self {
                key,
                certificate: None,
                site,
            });
        };
        let certificate = certificate.as_slice().try_into().ok();
        let certificate = certificate.map(Certificate::parse);
        let site = find_block(&text, SITE);
        let site = site.and_then(|site| VerifyingKey::try_from(site.as_slice()).ok());
        match (certificate, site) {
            (Some(certificate), Some(site)) => Ok(Self {
                key,
                certificate: Some(certificate),
                site,
            }),
            _ => Err(KeyError::NoKey {
                path: path.to_owned(),
                private: true,
            }),
        }
    }

    /// The public key that the device must have, which signs its tables.
    #[must_use]
    pub const fn site(&self) -> &VerifyingKey {
        &self.site
    }

    /// The right to do something on the device of this number, whose next commit record
    /// has this sequence number.
    #[must_use]
    pub fn right(&self, deed: &Deed, device: u64, sequence: u32) -> Vec<u8> {
        let signature = self.key.sign(&deed.message(device, sequence));
        let mut right = signature.to_bytes().to_vec();
        right.extend(self.certificate.iter().flat_map(Certificate::emit));
        right
    }
}

/// Reads the private key that tables are signed with.
///
/// # Errors
/// [`KeyError`].
pub fn read_key(path: &Path) -> Result<SigningKey, KeyError> {
    if find_block(&text(path)?, CERTIFICATE).is_some() {
        let path = path.to_owned();
        return Err(KeyError::Technician { path });
    }
    any_key(path)
}

fn any_key(path: &Path) -> Result<SigningKey, KeyError> {
    let text = text(path)?;
    let block = block_text(&text, "PRIVATE KEY").unwrap_or(&text);
    SigningKey::from_pkcs8_pem(block).map_err(|_| KeyError::NoKey {
        path: path.to_owned(),
        private: true,
    })
}

/// Reads a public key, of a private or a public one's file.
///
/// # Errors
/// [`KeyError`].
pub fn read_public_key(path: &Path) -> Result<VerifyingKey, KeyError> {
    let text = text(path)?;
    let block = block_text(&text, "PRIVATE KEY").unwrap_or(&text);
    let private = SigningKey::from_pkcs8_pem(block).map(|key| key.verifying_key());
    private
        .or_else(|_| VerifyingKey::from_public_key_pem(&text))
        .map_err(|_| KeyError::NoKey {
            path: path.to_owned(),
            private: false,
        })
}

fn text(path: &Path) -> Result<String, KeyError> {
    foreign_file::read_text(path, MOST_BYTES).map_err(|source| match source.kind() {
        io::ErrorKind::InvalidData | io::ErrorKind::FileTooLarge => KeyError::NoKey {
            path: path.to_owned(),
            private: false,
        },
        _ => KeyError::Io {
            path: path.to_owned(),
            source,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_runtime::trust::{NoRight, Terms, Trust, allows};
    use std::fs;

    #[test]
    fn a_new_key_is_read_again_and_never_overwritten() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("iltm.key");
        let key = new_key(&path).expect("a new file");
        assert_eq!(read_key(&path).expect("a key"), key);
        assert_eq!(read_public_key(&path).expect("a key"), key.verifying_key());
        assert!(matches!(new_key(&path), Err(KeyError::Exists { .. })));
        assert_eq!(read_key(&path).expect("a key"), key);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = fs::metadata(&path).expect("there").permissions().mode();
            assert_eq!(mode & 0o777, 0o600);
        }
    }

    #[test]
    fn a_technicians_key_shows_rights_that_the_runtime_accepts_and_signs_no_tables() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = |name: &str| folder.path().join(name);
        let site = new_key(&path("site.key")).expect("a new file");
        new_technician(&path("anna.key"), &site, 9, 40).expect("a new file");
        let deed = Deed::Confirm { table: 77 };
        let allowed = |name: &str, device, floor, sequence| {
            let signer = RightSigner::read(&path(name)).expect("a key");
            assert_eq!(signer.site(), &site.verifying_key());
            let key = Some(site.verifying_key().to_bytes());
            let terms = Terms {
                trust: Trust { key, device },
                floor,
            };
            let right = signer.right(&deed, device, 5);
            allows(&right, &deed, sequence, &terms, &mut || {})
        };
        for name in ["site.key", "anna.key"] {
            assert_eq!(allowed(name, 9, 40, 5), Ok(()), "{name}");
            assert_eq!(allowed(name, 9, 40, 6), Err(NoRight::Signature), "{name}");
        }
        assert_eq!(allowed("site.key", 8, 41, 5), Ok(()));
        let other = NoRight::OtherDevice { device: 9 };
        assert_eq!(allowed("anna.key", 8, 40, 5), Err(other));
        let revoked = NoRight::Revoked {
            version: 40,
            floor: 41,
        };
        assert_eq!(allowed("anna.key", 9, 41, 5), Err(revoked));
        let refused = read_key(&path("anna.key"));
        assert!(matches!(refused, Err(KeyError::Technician { .. })));
        assert!(read_public_key(&path("anna.key")).is_ok());
    }

    #[test]
    fn a_public_key_alone_verifies_and_does_not_sign() {
        // The public key of RFC 8410, section 10.1.
        let pem = "-----BEGIN PUBLIC KEY-----\n\
            MCowBQYDK2VwAyEAGb9ECWmEzf6FQbrBZ9w7lshQhqowtrbLDFw4rXAxZuE=\n\
            -----END PUBLIC KEY-----\n";
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("public.pem");
        fs::write(&path, pem).expect("writable");
        let key = read_public_key(&path).expect("a public key");
        assert_eq!(key.as_bytes()[..4], [0x19, 0xBF, 0x44, 0x09]);
        assert!(matches!(read_key(&path), Err(KeyError::NoKey { .. })));
    }
}
