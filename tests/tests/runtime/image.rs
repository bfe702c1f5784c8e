//! Table image and its signature: changed files are refused, and what the host signs is what
//! the runtime admits. Images with changed contents and right checksums are for the fuzz
//! target `contents` (`foreign_bytes`).

use iltm::compile::sign::is_signed_by;
use iltm::picture::Response;
use iltm_runtime::image::{ImageError, Table, unseal};
use iltm_runtime::trust::{Rejected, Terms, Trust, admit};
use iltm_tests::{signed, signing_key, wedge_table, wedge_table_for};
use proptest::prelude::*;

#[test]
fn every_change_of_a_single_byte_is_refused() {
    for channels in [1, 3] {
        let image = wedge_table_for(Response::Linear, 3, 4, channels);
        Table::check(&image).expect("the image itself is good");
        let mut changed = image.clone();
        for at in 0..image.len() {
            for flip in 1..=u8::MAX {
                changed[at] = image[at] ^ flip;
                assert!(Table::check(&changed).is_err(), "byte {at} ^ {flip}");
            }
            changed[at] = image[at];
        }
    }
}

#[test]
fn an_image_cut_short_anywhere_is_refused_as_truncated() {
    let image = wedge_table(5, 6, 3);
    for length in 0..image.len() {
        let refused = Table::check(&image[..length]).expect_err("cut short");
        let truncated = matches!(refused, ImageError::Truncated { given, .. } if given == length);
        assert!(truncated, "{length} bytes: {refused}");
    }
}

#[test]
fn bytes_behind_an_image_are_refused() {
    let mut image = wedge_table(2, 2, 1);
    let stated = image.len();
    image.push(0);
    let given = image.len();
    let refused = Table::check(&image).expect_err("one byte too many");
    assert_eq!(refused, ImageError::Length { stated, given });
}

#[test]
fn the_runtime_admits_what_is_signed_here_and_nothing_that_was_altered() {
    let key = signing_key(5);
    let mut file = signed(&wedge_table(4, 4, 1), &key, 7, 3, 9);
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
    let other = signing_key(6).verifying_key();
    assert!(!is_signed_by(&file, &seal, &other));
    let version = file.len() - 96 + 8;
    file[version] += 1;
    let error = admit(&file, &terms, &mut || ()).expect_err("altered");
    assert_eq!(error, Rejected::Signature);
}

#[test]
fn signing_again_replaces_the_seal() {
    let image = wedge_table(4, 4, 1);
    let key = signing_key(5);
    let once = signed(&image, &key, 7, 3, 9);
    assert_eq!(once.len(), image.len() + 96);
    let again = signed(&once, &key, 8, 3, 9);
    assert_eq!(again, signed(&image, &key, 8, 3, 9));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4_000))]

    #[test]
    fn random_bytes_are_refused_without_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..2_000)) {
        prop_assert!(Table::check(&bytes).is_err());
    }
}
