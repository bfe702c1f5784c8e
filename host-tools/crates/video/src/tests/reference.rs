//! The full-resolution way against `p = g d' - U K A d'` in `f64`, computed from
//! the definitions: dense matrices, no integers, no recurrences.

use super::*;
use iltm_runtime::haar::Basis;

/// Fraction bits of light and drive.
const UNIT: f64 = 32_768.0;

/// Weights of `U` along an axis: for each pixel, the weight of every cell.
fn interpolation(cells: usize, pixels: usize) -> Vec<Vec<f64>> {
    let weights = |pixel: usize| {
        let place = (pixel as f64 + 0.5) * cells as f64 / pixels as f64 - 0.5;
        let place = place.clamp(0.0, cells as f64 - 1.0);
        (0..cells)
            .map(|cell| (1.0 - (place - cell as f64).abs()).max(0.0))
            .collect()
    };
    (0..pixels).map(weights).collect()
}

/// Weights of `A` along an axis: for each cell, the share of every pixel.
fn average(cells: usize, pixels: usize) -> Vec<Vec<f64>> {
    let step = pixels as f64 / cells as f64;
    let weights = |cell: usize| {
        let (start, end) = (cell as f64 * step, (cell + 1) as f64 * step);
        let share = |pixel: usize| {
            let (from, to) = (pixel as f64, pixel as f64 + 1.0);
            (to.min(end) - from.max(start)).max(0.0) / step
        };
        (0..pixels).map(share).collect()
    };
    (0..cells).map(weights).collect()
}

/// `rows * values * cols^T`: a picture resampled along both axes.
fn resample(values: &[f64], rows: &[Vec<f64>], cols: &[Vec<f64>]) -> Vec<f64> {
    let width = cols[0].len();
    let along = |row: &[f64], weights: &[f64]| -> f64 {
        row.iter()
            .zip(weights)
            .map(|(value, weight)| value * weight)
            .sum()
    };
    let narrow: Vec<Vec<f64>> = values
        .chunks(width)
        .map(|row| cols.iter().map(|weights| along(row, weights)).collect())
        .collect();
    let mut result = Vec::new();
    for weights in rows {
        for col in 0..cols.len() {
            result.push(
                narrow
                    .iter()
                    .zip(weights)
                    .map(|(row, weight)| row[col] * weight)
                    .sum(),
            );
        }
    }
    result
}

/// `K x` of one channel, from the definition of the stored operator.
fn operate(table: &MadeUp, channel: usize, cells: &[f64]) -> Vec<f64> {
    let basis = Basis::new(table.grid);
    let functions: Vec<_> = basis.functions().collect();
    let cols = table.grid.cols();
    let at = |function: usize, cell: usize| functions[function].at(cell / cols, cell % cols) as f64;
    let mut result = vec![0.0; cells.len()];
    let rows = table.tiers.last().into_iter().flatten();
    let entries = rows.flat_map(|row| row.entries.iter().map(move |entry| (row, entry)));
    for (row, (col, value)) in entries {
        let col = usize::from(*col);
        let shift = f64::from(functions[col].input_shift()) + f64::from(row.shift);
        let input: f64 = cells
            .iter()
            .enumerate()
            .map(|(cell, light)| light * at(col, cell))
            .sum();
        // Light has 15 fraction bits, a correction 23.
        let output = input * f64::from(*value) * (-8.0 - shift).exp2();
        for (cell, result) in result.iter_mut().enumerate() {
            *result += output * at(row.index.into(), cell) * table.scales[channel].to_num::<f64>();
        }
    }
    result
}

/// Drive of every pixel of one channel, not clipped.
fn reference(table: &MadeUp, channel: usize, frame: FrameSize, light: &[f64]) -> Vec<f64> {
    let (rows, cols) = (table.grid.rows(), table.grid.cols());
    let up = |rows, cols| {
        (
            interpolation(rows, frame.height()),
            interpolation(cols, frame.width()),
        )
    };
    let own = |values: &[u16], unit: f64| -> Vec<f64> {
        let own = values.iter().skip(channel).step_by(table.channels);
        own.map(|value| f64::from(*value) / unit).collect()
    };
    let (up_rows, up_cols) = up(rows, cols);
    let gain_unit = f64::from(table.gain_fraction).exp2();
    let fine = table.fine_gains.as_ref().filter(|(rows, cols, _)| {
        usize::from(*rows) <= frame.height() && usize::from(*cols) <= frame.width()
    });
    let gains = match fine {
        Some((rows, cols, gains)) => {
            let (up_rows, up_cols) = up(usize::from(*rows), usize::from(*cols));
            resample(&own(gains, gain_unit), &up_rows, &up_cols)
        }
        None => resample(&own(&table.gains, gain_unit), &up_rows, &up_cols),
    };
    let black = f64::from(table.black) / UNIT;
    let raised = |light: &f64| ((black + (1.0 - black) * light) * UNIT).round() / UNIT;
    let mut light: Vec<f64> = light.iter().map(raised).collect();
    if let Some(ambient) = &table.ambient {
        let driven = own(&table.gains, gain_unit).into_iter();
        let driven = driven.zip(own(ambient, UNIT)).map(|(gain, a)| gain * a);
        let driven = resample(&driven.collect::<Vec<_>>(), &up_rows, &up_cols);
        for ((light, driven), gain) in light.iter_mut().zip(driven).zip(&gains) {
            *light = (*light - (driven / gain).min(1.0)).max(0.0);
        }
    }
    let down = (average(rows, frame.height()), average(cols, frame.width()));
    let cells = resample(&light, &down.0, &down.1);
    let corrections = resample(&operate(table, channel, &cells), &up_rows, &up_cols);
    let direct = light.iter().zip(&gains).map(|(light, gain)| light * gain);
    direct
        .zip(corrections)
        .map(|(direct, taken)| direct - taken)
        .collect()
}

/// Largest difference from the reference over all samples, in steps of 2^-15.
fn worst(table: &MadeUp, tier: u8, frame: FrameSize, picture: &Picture) -> f64 {
    let settings = CompensateOptions {
        tier: Some(tier),
        ..settings(Encoding::Linear)
    };
    let (result, summary) = compensated(table, settings, picture).unwrap();
    let (Samples::Sixteen(wanted), Samples::Sixteen(result)) =
        (picture.samples(), result.samples())
    else {
        panic!("a picture of 16 bits");
    };
    let mut worst = 0.0_f64;
    let mut clipped = 0;
    for channel in 0..table.channels {
        let own = |samples: &[u16]| -> Vec<u16> {
            samples
                .iter()
                .copied()
                .skip(channel)
                .step_by(table.channels)
                .collect()
        };
        let light: Vec<f64> = own(wanted)
            .into_iter()
            .map(|code| (f64::from(code) / 65_535.0 * UNIT).round() / UNIT)
            .collect();
        let drives = reference(table, channel, frame, &light);
        for (drive, code) in drives.into_iter().zip(own(result)) {
            let reached = f64::from(code) / 65_535.0;
            clipped += u64::from(!(0.0..=1.0).contains(&drive));
            worst = worst.max((drive.clamp(0.0, 1.0) - reached).abs() * UNIT);
        }
    }
    // Samples on the very edge may count either way.
    assert!(tier == 0 || summary.clipped.abs_diff(clipped) <= 1 + clipped / 20);
    worst
}

#[test]
fn frames_of_any_size_are_the_formula_within_three_steps() {
    for (index, (rows, cols, width, height)) in [
        (13, 21, 84, 52),
        (13, 21, 211, 97),
        (13, 21, 22, 13),
        (13, 21, 21, 13),
        (8, 8, 64, 64),
        (5, 3, 61, 7),
        (1, 1, 17, 9),
        (16, 24, 101, 75),
    ]
    .into_iter()
    .enumerate()
    {
        for channels in [1, 3] {
            let (grid, frame) = (grid(rows, cols), size(width, height));
            let mut table = MadeUp::of_all_kinds(grid, channels, 6, index as u64);
            // Gains as fine as drives, so that their own steps are not in the result.
            table.gain_fraction = 15;
            for gain in &mut table.gains {
                *gain *= 4;
            }
            for gain in &mut table.fine_gains.as_mut().unwrap().2 {
                *gain *= 4;
            }
            let random = random_picture(frame, channels, true, index as u64);
            let white = vec![u16::MAX; frame.pixels() * channels];
            let white = Picture::new(frame, Samples::Sixteen(white)).unwrap();
            for picture in [random, white] {
                let without = worst(&table, 0, frame, &picture);
                // A single cell lights no other and has no operator.
                let does = without >= 50.0 || grid.cells() == 1;
                assert!(does, "the operator does little: {without}");
                let worst = worst(&table, table.tiers.len() as u8, frame, &picture);
                println!("{grid} to {frame}, {channels} channels: {worst:.2} steps of 2^-15");
                assert!(
                    worst <= 3.0,
                    "{grid} to {frame}, {channels} channels: {worst}"
                );
            }
        }
    }
}
