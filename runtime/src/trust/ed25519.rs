//! Ed25519 signatures (RFC 8032), verified in steps.
//!
//! The same answers as ed25519-dalek's `verify_strict`, which does its work in one
//! piece of some million instructions: `s` below the order of the group, neither
//! the key nor `R` of small order, and `R` equal, byte by byte, to the encoding of
//! `[s] B - [k] A`. The points and scalars are curve25519-dalek's; here are only the
//! order of the steps and the pauses between them. All of it is public, so nothing
//! takes care to run in constant time.

use crate::yield_budget::{YieldBudget, cost};
use curve25519_dalek::constants::ED25519_BASEPOINT_POINT;
use curve25519_dalek::edwards::{CompressedEdwardsY, EdwardsPoint};
use curve25519_dalek::scalar::Scalar;
use curve25519_dalek::traits::Identity;
use sha2::{Digest, Sha512};

/// Bytes hashed at a time: some thousand instructions.
const PIECE: usize = 128;

/// Whether `signature` is the one of `key` over `message`.
pub(super) fn verify(
    key: &[u8; 32],
    signature: &[u8; 64],
    message: &[u8],
    budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
) -> bool {
    let (Some((r, _)), Some((_, s))) = (
        signature.split_first_chunk::<32>(),
        signature.split_last_chunk::<32>(),
    ) else {
        return false;
    };
    let Some(s) = Option::<Scalar>::from(Scalar::from_canonical_bytes(*s)) else {
        return false;
    };
    let Some(a) = CompressedEdwardsY(*key).decompress() else {
        return false;
    };
    budget.spend(1, cost::ROOT);
    if a.is_small_order() {
        return false;
    }
    budget.spend(2, cost::POINT);
    let k = challenge(r, key, message, budget);
    let expected = combination(&k, -a, &s, budget);
    // Equal encodings are equal points, so `R` need not be decoded to learn its order.
    let small = expected.is_small_order();
    budget.spend(2, cost::POINT);
    let equal = expected.compress().as_bytes() == r;
    budget.spend(1, cost::ROOT);
    equal && !small
}

/// `k`: the hash of `R`, the key and the message, modulo the order of the group.
fn challenge(
    r: &[u8; 32],
    key: &[u8; 32],
    message: &[u8],
    budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
) -> Scalar {
    let mut hash = Sha512::new();
    hash.update(r);
    hash.update(key);
    for piece in message.chunks(PIECE) {
        hash.update(piece);
        budget.spend(piece.len(), cost::HASH_BYTE);
    }
    let hash = hash.finalize().into();
    budget.spend(1, cost::POINT);
    let k = Scalar::from_bytes_mod_order_wide(&hash);
    budget.spend(1, cost::POINT);
    k
}

/// `[k] point + [s] B`, a bit of both a step, the highest first.
fn combination(
    k: &Scalar,
    point: EdwardsPoint,
    s: &Scalar,
    budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
) -> EdwardsPoint {
    let base = ED25519_BASEPOINT_POINT;
    let both = point + base;
    let mut sum = EdwardsPoint::identity();
    for (k, s) in k.as_bytes().iter().rev().zip(s.as_bytes().iter().rev()) {
        for bit in (0..u8::BITS).rev() {
            sum = sum + sum;
            budget.spend(1, cost::POINT);
            match ((k >> bit) & 1, (s >> bit) & 1) {
                (0, 0) => continue,
                (0, _) => sum += base,
                (_, 0) => sum += point,
                _ => sum += both,
            }
            budget.spend(1, cost::POINT);
        }
    }
    sum
}
