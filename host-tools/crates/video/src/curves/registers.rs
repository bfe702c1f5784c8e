//! Looking up light by 8-bit code in the processor's registers.
//!
//! A table of 256 times 16 bits fills 8 of the 32 vectors of AVX-512, which picks 32 elements
//! from two of them in one instruction.

use iltm_runtime::units::Light;
use pulp::{NullaryFnOnce, cast, x86::V4};
use std::arch::x86_64::__m512i;

/// Codes that are looked up together.
const LANES: usize = 32;

/// The light of every code; `false`, and nothing done, on a processor without AVX-512.
pub(super) fn decode(by_code: &[Light; 256], codes: &[u8], light: &mut [Light]) -> bool {
    let simd = V4::try_new();
    if let Some(simd) = simd {
        simd.vectorize(Decode {
            simd,
            by_code,
            codes,
            light,
        });
    }
    simd.is_some()
}

struct Decode<'r> {
    simd: V4,
    by_code: &'r [Light; 256],
    codes: &'r [u8],
    light: &'r mut [Light],
}

impl NullaryFnOnce for Decode<'_> {
    type Output = ();

    #[allow(
        clippy::inline_always,
        reason = "compiled into `vectorize`, which allows the instructions"
    )]
    #[inline(always)]
    fn call(self) {
        let (words, vectors) = (self.simd.avx512bw, self.simd.avx512f);
        let table: [__m512i; 8] = cast(self.by_code.map(Light::to_bits));
        // Whether one bit of each index is set.
        let [upper_quarter, upper_half] =
            [1 << 6, 1 << 7].map(|bit| vectors._mm512_set1_epi16(bit));
        let (codes, last_codes) = self.codes.as_chunks::<LANES>();
        let (light, last_light) = self.light.as_chunks_mut::<LANES>();
        for (codes, light) in codes.iter().zip(light) {
            let index = words._mm512_cvtepu8_epi16(cast(*codes));
            // Each picks by the lowest six bits of the index.
            let pick = |pair: usize| {
                let (lower, upper) = (table[2 * pair], table[2 * pair + 1]);
                words._mm512_permutex2var_epi16(lower, index, upper)
            };
            let quarter = words._mm512_test_epi16_mask(index, upper_quarter);
            let half = words._mm512_test_epi16_mask(index, upper_half);
            let [low, high] = [0, 2]
                .map(|pair| words._mm512_mask_blend_epi16(quarter, pick(pair), pick(pair + 1)));
            let picked: [u16; LANES] = cast(words._mm512_mask_blend_epi16(half, low, high));
            *light = picked.map(Light::from_bits);
        }
        for (code, light) in last_codes.iter().zip(last_light) {
            *light = self.by_code[usize::from(*code)];
        }
    }
}
