//! Signatures against RFC 8032 and against ed25519-dalek, which shares the points
//! with what is tested but neither the steps nor the checks.

use super::ed25519;
use crate::yield_budget::YieldBudget;
use curve25519_dalek::constants::EIGHT_TORSION;
use curve25519_dalek::{EdwardsPoint, Scalar};
use ed25519_dalek::{Signature, Signer, SigningKey, Verifier, VerifyingKey};
use proptest::prelude::*;
use sha2::{Digest, Sha512};
use std::vec::Vec;

fn verify(key: &[u8; 32], signature: &[u8; 64], message: &[u8]) -> bool {
    ed25519::verify(key, signature, message, &mut YieldBudget::new(&mut || {}))
}

fn strict(key: &[u8; 32], signature: &[u8; 64], message: &[u8]) -> bool {
    let signature = Signature::from_bytes(signature);
    VerifyingKey::from_bytes(key).is_ok_and(|key| key.verify_strict(message, &signature).is_ok())
}

fn lenient(key: &[u8; 32], signature: &[u8; 64], message: &[u8]) -> bool {
    let signature = Signature::from_bytes(signature);
    VerifyingKey::from_bytes(key).is_ok_and(|key| key.verify(message, &signature).is_ok())
}

fn hex<const N: usize>(text: &str) -> [u8; N] {
    let mut digits = text.chars().filter_map(|digit| digit.to_digit(16));
    let mut digit = || digits.next().expect("two digits a byte") as u8;
    core::array::from_fn(|_| digit() << 4 | digit())
}

/// `R` and `s` side by side.
fn joined(r: &EdwardsPoint, s: &[u8; 32]) -> [u8; 64] {
    let halves = [r.compress().to_bytes(), *s];
    core::array::from_fn(|at| halves[at / 32][at % 32])
}

/// `k` of a signature.
fn challenge(r: &EdwardsPoint, key: &EdwardsPoint, message: &[u8]) -> Scalar {
    let mut hash = Sha512::new();
    hash.update(r.compress().as_bytes());
    hash.update(key.compress().as_bytes());
    hash.update(message);
    Scalar::from_bytes_mod_order_wide(&hash.finalize().into())
}

#[test]
fn the_signatures_of_rfc_8032_are_verified() {
    // Section 7.1: TEST 1, TEST 2, TEST 3, TEST SHA(abc).
    let abc: [u8; 64] = Sha512::digest(b"abc").into();
    let vectors: [(&str, &[u8], &str); 4] = [
        (
            "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a",
            b"",
            "e5564300c360ac729086e2cc806e828a84877f1eb8e5d974d873e06522490155
             5fb8821590a33bacc61e39701cf9b46bd25bf5f0595bbe24655141438e7a100b",
        ),
        (
            "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c",
            b"\x72",
            "92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da
             085ac1e43e15996e458f3613d0f11d8c387b2eaeb4302aeeb00d291612bb0c00",
        ),
        (
            "fc51cd8e6218a1a38da47ed00230f0580816ed13ba3303ac5deb911548908025",
            b"\xaf\x82",
            "6291d657deec24024827e69c3abe01a30ce548a284743a445e3680d7db5ac3ac
             18ff9b538d16f290ae67f760984dc6594a7c15e9716ed28dc027beceea1ec40a",
        ),
        (
            "ec172b93ad5e563bf4932c70e1245034c35467ef2efd4d64ebf819683467e2bf",
            &abc,
            "dc2a4459e7369633a52b1bf277839a00201009a3efbf3ecb69bea2186c26b589
             09351fc9ac90b3ecfdfbc7c66431e0303dca179c138ac17ad9bef1177331a704",
        ),
    ];
    for (key, message, signature) in vectors {
        assert!(verify(&hex(key), &hex(signature), message), "{key}");
        assert!(!verify(&hex(key), &hex(signature), b"another"), "{key}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn good_and_altered_signatures_are_judged_as_ed25519_dalek_judges_them(
        secret in any::<[u8; 32]>(),
        message in prop::collection::vec(any::<u8>(), 0..700),
        place in 0..100_usize,
        flip in prop_oneof![Just(0), Just(0x80), any::<u8>()],
    ) {
        let signing = SigningKey::from_bytes(&secret);
        let mut key = signing.verifying_key().to_bytes();
        let mut signature = signing.sign(&message).to_bytes();
        match place {
            0..32 => key[place] ^= flip,
            32..96 => signature[place - 32] ^= flip,
            _ => {}
        }
        let verdict = verify(&key, &signature, &message);
        prop_assert_eq!(verdict, strict(&key, &signature, &message));
        prop_assert_eq!(verdict, place >= 96 || flip == 0);
    }

    #[test]
    fn a_key_with_a_part_of_small_order_is_judged_as_ed25519_dalek_judges_it(
        secret in any::<[u8; 64]>(),
        message in any::<[u8; 8]>(),
        torsion in 0..8_usize,
    ) {
        // Holds where the part of small order times `k` vanishes, one time in eight.
        let a = Scalar::from_bytes_mod_order_wide(&secret);
        let key = EdwardsPoint::mul_base(&a) + EIGHT_TORSION[torsion];
        let nonce = Scalar::from(7_u8);
        let r = EdwardsPoint::mul_base(&nonce);
        let s = nonce + challenge(&r, &key, &message) * a;
        let (key, signature) = (key.compress().to_bytes(), joined(&r, s.as_bytes()));
        prop_assert_eq!(
            verify(&key, &signature, &message),
            strict(&key, &signature, &message)
        );
    }
}

#[test]
fn keys_of_small_order_sign_nothing() {
    // Anybody can make these: the key drops out of the equation for many messages.
    let nonce = Scalar::from(7_u8);
    let signature = joined(&EdwardsPoint::mul_base(&nonce), nonce.as_bytes());
    for key in EIGHT_TORSION.map(|point| point.compress().to_bytes()) {
        let mut taken_elsewhere = 0;
        for message in 0..100_u8 {
            assert!(!verify(&key, &signature, &[message]));
            taken_elsewhere += usize::from(lenient(&key, &signature, &[message]));
        }
        assert!(taken_elsewhere > 0, "the equation holds for some");
    }
}

#[test]
fn a_signature_whose_r_is_of_small_order_is_refused() {
    let a = Scalar::from_bytes_mod_order([0x5A; 32]);
    let key = EdwardsPoint::mul_base(&a);
    let r = EIGHT_TORSION[0];
    let s = challenge(&r, &key, b"any") * a;
    let (key, signature) = (key.compress().to_bytes(), joined(&r, s.as_bytes()));
    assert!(lenient(&key, &signature, b"any"), "the equation holds");
    assert!(!verify(&key, &signature, b"any"));
}

#[test]
fn s_plus_the_order_of_the_group_is_refused() {
    // RFC 8032, section 5.1: 2^252 + 27742317777372353535851937790883648493.
    let order: [u8; 32] = hex("edd3f55c1a631258d69cf7a2def9de14
         00000000000000000000000000000010");
    let signing = SigningKey::from_bytes(&[9; 32]);
    let key = signing.verifying_key().to_bytes();
    let mut signature = signing.sign(b"any").to_bytes();
    assert!(verify(&key, &signature, b"any"));
    let mut carry = 0;
    for (byte, order) in signature[32..].iter_mut().zip(order) {
        let sum = u16::from(*byte) + u16::from(order) + carry;
        (*byte, carry) = (sum as u8, sum >> 8);
    }
    assert_eq!(carry, 0);
    assert!(!verify(&key, &signature, b"any"));
}

#[test]
fn a_key_that_is_no_point_signs_nothing() {
    let signature = SigningKey::from_bytes(&[9; 32]).sign(b"any").to_bytes();
    let no_points: Vec<[u8; 32]> = (0..20)
        .map(|byte| [byte; 32])
        .filter(|key| VerifyingKey::from_bytes(key).is_err())
        .collect();
    assert!(no_points.len() > 3);
    for key in no_points {
        assert!(!verify(&key, &signature, b"any"));
    }
}
