//! Projector response: between light and the codes that a projector is sent.

use iltm_runtime::{
    image::Table,
    response::{INDEX_SHIFT, code_at, linear_code_8},
    units::Drive,
};

/// The 8-bit codes of a table's projector, both ways, one curve a channel.
#[derive(Clone, Debug)]
pub struct ProjectorCurves {
    /// Code of every 13-bit drive.
    codes: Vec<Vec<u8>>,
    /// Drive of every code, 0 to 1.
    drives: Vec<Vec<f64>>,
}

impl ProjectorCurves {
    /// Those of `table`.
    #[must_use]
    pub fn new(table: &Table<'_>) -> Self {
        let channels = 0..usize::from(table.channels());
        let codes: Vec<Vec<u8>> = channels
            .map(|channel| {
                let code = |index: u16| {
                    let drive = Drive::from_bits(index << INDEX_SHIFT);
                    let own = table.codes(channel);
                    own.map_or_else(|| linear_code_8(drive), |codes| code_at(codes, drive))
                };
                let last = Drive::ONE.to_bits() >> INDEX_SHIFT;
                (0..=last).map(code).collect()
            })
            .collect();
        let drives = codes.iter().map(|codes| drives(codes)).collect();
        Self { codes, drives }
    }

    /// The code for a drive of 0 to 1; what is outside is clamped.
    #[must_use]
    pub fn code(&self, channel: usize, drive: f64) -> u8 {
        let codes = &self.codes[channel];
        let last = codes.len() - 1;
        let index = (drive.clamp(0.0, 1.0) * last as f64).round() as usize;
        codes[index.min(last)]
    }

    /// The drive that a code stands for, 0 to 1: the middle of those that have it.
    #[must_use]
    pub fn drive(&self, channel: usize, code: u8) -> f64 {
        self.drives[channel][usize::from(code)]
    }
}

/// The middle of the drives of each code; where a code has none, as at the steep start
/// of a gamma, between its neighbours.
fn drives(codes: &[u8]) -> Vec<f64> {
    let last = codes.len() - 1;
    let mut known: Vec<(usize, f64)> = Vec::new();
    for run in (0..=last)
        .collect::<Vec<_>>()
        .chunk_by(|a, b| codes[*a] == codes[*b])
    {
        let (first, end) = (run[0], run[run.len() - 1]);
        // Black and white are what they are, whatever else rounds to them.
        let middle = match (first, end) {
            (0, _) => 0.0,
            (_, end) if end == last => 1.0,
            (first, end) => (first + end) as f64 / (2 * last) as f64,
        };
        known.push((codes[first].into(), middle));
    }
    (0..=usize::from(u8::MAX))
        .map(|code| {
            let above = known.partition_point(|(other, _)| *other < code);
            let after = known.get(above).copied();
            let before = above.checked_sub(1).map(|below| known[below]);
            match (before, after) {
                (_, Some((other, drive))) if other == code => drive,
                (Some((low, from)), Some((high, to))) => {
                    let share = (code - low) as f64 / (high - low) as f64;
                    from + share * (to - from)
                }
                (Some((_, drive)), None) | (None, Some((_, drive))) => drive,
                (None, None) => 0.0,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verify::test_scene::scene;
    use iltm_compile::{CompileOptions, compile};
    use iltm_picture::Response;

    #[test]
    fn codes_and_drives_of_every_response_are_each_others_inverse() {
        for response in [Response::Linear, Response::Srgb, Response::Gamma(2.2)] {
            let options = CompileOptions {
                projector: response.into(),
                ..CompileOptions::default()
            };
            let compiled = compile(&scene(1), None, &options).unwrap();
            let curves = ProjectorCurves::new(&Table::check(&compiled.image).unwrap());
            for code in 0..=u8::MAX {
                let exact = response.light(f64::from(code) / 255.0);
                let drive = curves.drive(0, code);
                assert!(
                    (drive - exact).abs() < 6e-4,
                    "{response} {code}: {drive} {exact}"
                );
                // At the steep start of a gamma several codes are one drive.
                let back = response.light(f64::from(curves.code(0, exact)) / 255.0);
                assert!(
                    (back - exact).abs() < 0.5 / 8_192.0 + 1.0 / 255.0,
                    "{response} {code}: {back}"
                );
                let near = curves.code(0, exact).abs_diff(code) <= 1;
                assert!(near || exact < 1.0 / 8_192.0, "{response} {code}");
            }
        }
    }
}
