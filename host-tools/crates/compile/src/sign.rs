//! Signing: the seal behind an image, and the files that keys are in.
//!
//! A key is a text file: PKCS#8 in PEM, which OpenSSL reads and writes as well
//! (`openssl genpkey -algorithm ed25519`).

use ed25519_dalek::pkcs8::spki::DecodePublicKey;
use ed25519_dalek::pkcs8::spki::der::pem::LineEnding;
use ed25519_dalek::pkcs8::{DecodePrivateKey, EncodePrivateKey, KeypairBytes};
use ed25519_dalek::{Signature, Signer, SigningKey, VerifyingKey};
use iltm_runtime::image::{ImageError, Seal, unseal};
use std::fs::{self, OpenOptions};
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
    let mut secret = [0; 32];
    getrandom::fill(&mut secret).map_err(|error| KeyError::Random {
        reason: error.to_string(),
    })?;
    let key = SigningKey::from_bytes(&secret);
    // Without the public key in it: OpenSSL does not read the version that has one.
    let pem = KeypairBytes {
        secret_key: secret,
        public_key: None,
    };
    let pem = pem.to_pkcs8_pem(LineEnding::LF).expect("a key has a form");
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    let write = || {
        let mut file = options.open(path)?;
        file.write_all(pem.as_bytes())?;
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
    })?;
    Ok(key)
}

/// Reads a private key.
///
/// # Errors
/// [`KeyError`].
pub fn read_key(path: &Path) -> Result<SigningKey, KeyError> {
    let text = text(path)?;
    SigningKey::from_pkcs8_pem(&text).map_err(|_| KeyError::NoKey {
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
    let private = SigningKey::from_pkcs8_pem(&text).map(|key| key.verifying_key());
    private
        .or_else(|_| VerifyingKey::from_public_key_pem(&text))
        .map_err(|_| KeyError::NoKey {
            path: path.to_owned(),
            private: false,
        })
}

fn text(path: &Path) -> Result<String, KeyError> {
    fs::read_to_string(path).map_err(|source| match source.kind() {
        io::ErrorKind::InvalidData => KeyError::NoKey {
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
