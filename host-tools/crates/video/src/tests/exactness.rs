//! Exactness: tables and frames that must not change a single bit.

use super::*;
use iltm_compile::image::StoredRow;
use proptest::prelude::*;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn gain_one_and_nothing_else_returns_the_picture(
        (rows, cols) in (1_u16..9, 1_u16..9),
        (width, height) in (0_u16..40, 0_u16..40),
        (table_channels, channels) in prop::sample::select(vec![(1, 1), (1, 3), (3, 3)]),
        wide: bool,
        seed: u64,
    ) {
        // Light has 15 bits: of 16-bit codes every second comes back.
        let grid = grid(rows, cols);
        let mut picture = random_picture(size(width + cols, height + rows), channels, wide, seed);
        if let Samples::Sixteen(samples) = picture.samples_mut() {
            for sample in samples {
                let light = (u32::from(*sample) * 32_768 + 32_767) / 65_535;
                *sample = ((light * 65_535 + 16_384) >> 15) as u16;
            }
        }
        let table = MadeUp::new(grid, table_channels);
        let (result, summary) = compensated(&table, settings(Encoding::Linear), &picture).unwrap();
        prop_assert_eq!(result, picture);
        prop_assert_eq!(summary.clipped, 0);
    }

    #[test]
    fn the_number_of_threads_changes_nothing(
        (width, height) in (21_u16..90, 13_u16..90),
        (table_channels, channels) in prop::sample::select(vec![(1, 1), (1, 3), (3, 3)]),
        wide: bool,
        seed: u64,
    ) {
        let table = MadeUp::of_all_kinds(grid(13, 21), table_channels, 5, seed);
        let picture = random_picture(size(width, height), channels, wide, seed);
        let by = |threads| {
            let settings = CompensateOptions { threads, ..CompensateOptions::default() };
            compensated(&table, settings, &picture).unwrap()
        };
        let one = by(1);
        prop_assert!(one.0 != picture);
        for threads in [2, 3, 8] {
            prop_assert_eq!(&by(threads), &one);
        }
    }
}

#[test]
fn display_codes_come_back_through_a_projector_that_undoes_them() {
    let mut table = MadeUp::new(grid(4, 4), 3);
    table.response = true;
    let ramp = (0..=255)
        .flat_map(|code: u8| [code, 255 - code, code / 2])
        .collect();
    let picture = Picture::new(size(16, 16), Samples::Eight(ramp)).unwrap();
    let (result, _) = compensated(&table, CompensateOptions::default(), &picture).unwrap();
    assert_eq!(result, picture);
}

#[test]
fn a_frame_of_one_pixel_a_cell_is_what_the_full_resolution_way_makes_of_it() {
    // The same cells, once as they are and once each as four pixels: averages are
    // those of the cells, and with gains and ambient light alike everywhere, and
    // no operator but the constant, nothing depends on the place within a cell.
    let grid = grid(6, 10);
    let mut table = MadeUp::new(grid, 3);
    table.gains.fill(5000);
    table.ambient = Some(vec![321; table.gains.len()]);
    table.response = true;
    let constant = grid.cells() as u16 - 1;
    table.tiers = vec![vec![StoredRow {
        index: constant,
        shift: 4,
        entries: vec![(constant, 1500)],
    }]];
    let small = random_picture(size(10, 6), 3, false, 7);
    let Samples::Eight(samples) = small.samples() else {
        panic!("a picture of bytes");
    };
    let doubled = |samples: &[u8]| -> Vec<u8> {
        let rows = samples.chunks(30).flat_map(|row| [row, row]);
        rows.flat_map(|row| row.chunks(3).flat_map(|pixel| [pixel, pixel]))
            .flatten()
            .copied()
            .collect()
    };
    let large = Picture::new(size(20, 12), Samples::Eight(doubled(samples))).unwrap();
    let (small, _) = compensated(&table, CompensateOptions::default(), &small).unwrap();
    let (large, _) = compensated(&table, CompensateOptions::default(), &large).unwrap();
    let Samples::Eight(samples) = small.samples() else {
        panic!("a picture of bytes");
    };
    assert_eq!(large.samples(), &Samples::Eight(doubled(samples)));
}

#[test]
fn ambient_light_follows_the_paint_within_cells_and_goes_up_to_what_the_projector_misses() {
    // Ambient light and the projector's fall on a wall of dark and bright paint, pixel by
    // pixel; the projector misses a column and a corner of the cells, where
    // the table has drives.
    let grid = grid(4, 6);
    let missed = |row: usize, col: usize| col == 2 || (row == 0 && col == 5);
    let mut table = MadeUp::new(grid, 1);
    let frame = size(24, 16);
    let gain = |x: usize| if x.is_multiple_of(2) { 1 } else { 3 } << table.gain_fraction;
    let light = |x: usize| if x.is_multiple_of(2) { 3_000 } else { 1_000 };
    let (mut gains, mut ambient) = (Vec::new(), Vec::new());
    for cell in 0..grid.cells() {
        let reached = !missed(cell / 6, cell % 6);
        gains.push(if reached { 2 << table.gain_fraction } else { 0 });
        ambient.push(if reached { 1_500 } else { 3_000 });
    }
    let fine = (0..frame.pixels()).map(|at| gain(at % 24)).collect();
    table.fine_gains = Some((16, 24, fine));
    (table.gains, table.ambient) = (gains, Some(ambient));
    let codes = |more: u32| {
        let code = |at| ((light(at % 24) + more) * 65_535 + 16_384) >> 15;
        let codes = (0..frame.pixels()).map(|at| code(at) as u16);
        Picture::new(frame, Samples::Sixteen(codes.collect())).unwrap()
    };
    for more in [0, 100] {
        let (result, _) = compensated(&table, settings(Encoding::Linear), &codes(more)).unwrap();
        let Samples::Sixteen(result) = result.samples() else {
            panic!("a picture of 16 bits");
        };
        for (at, code) in result.iter().enumerate() {
            let wanted = more * u32::from(gain(at % 24) >> table.gain_fraction);
            let reached = (u32::from(*code) << 15) / 65_535;
            assert!(reached.abs_diff(wanted) <= 2, "{at}: {reached} of {wanted}");
        }
    }
}
