//! Signed tables: what is signed on the host is what the runtime admits.

use ed25519_dalek::SigningKey;
use iltm::compile::sign::{SealTerms, is_signed_by, sign};
use iltm_runtime::image::unseal;
use iltm_runtime::trust::{Rejected, Terms, Trust, admit};
use iltm_tests::wedge_table;

const TERMS: SealTerms = SealTerms {
    version: 7,
    oldest: 3,
    device: 9,
};

#[test]
fn the_runtime_admits_what_is_signed_here_and_nothing_that_was_altered() {
    let key = SigningKey::from_bytes(&[5; 32]);
    let mut file = sign(&wedge_table(4, 4, 1), &key, TERMS).expect("an image");
    let trust = Trust {
        key: Some(key.verifying_key().to_bytes()),
        device: 9,
    };
    let terms = Terms { trust, floor: 7 };
    let (_, accepted) = admit(&file, &terms, &mut || ()).expect("signed");
    assert_eq!((accepted.version, accepted.oldest), (7, 3));
    let (_, seal) = unseal(&file).expect("sealed");
    let seal = seal.expect("sealed");
    assert!(is_signed_by(&file, &seal, &key.verifying_key()));
    let other = SigningKey::from_bytes(&[6; 32]).verifying_key();
    assert!(!is_signed_by(&file, &seal, &other));
    let version = file.len() - 96 + 8;
    file[version] += 1;
    let error = admit(&file, &terms, &mut || ()).expect_err("altered");
    assert_eq!(error, Rejected::Signature);
}

#[test]
fn signing_again_replaces_the_seal() {
    let image = wedge_table(4, 4, 1);
    let key = SigningKey::from_bytes(&[5; 32]);
    let once = sign(&image, &key, TERMS).expect("an image");
    assert_eq!(once.len(), image.len() + 96);
    let terms = SealTerms {
        version: 8,
        ..TERMS
    };
    let again = sign(&once, &key, terms).expect("an image with a seal");
    assert_eq!(again, sign(&image, &key, terms).expect("an image"));
}
