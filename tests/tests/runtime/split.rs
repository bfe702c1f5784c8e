//! Split tables: what the devices of several projectors make of a wide frame, against the table of all.

use iltm::compile::{SplitTableError, split_table};
use iltm::video::FrameSplitter;
use iltm_runtime::FrameSize;
use iltm_runtime::frame_buffers::Format;
use iltm_runtime::image::Table;
use iltm_runtime::pipeline::Encoding;
use iltm_tests::firmware::{Effects, random_table};
use iltm_tests::grid;
use iltm_tests::made_up::MadeUp;
use iltm_tests::neighbours::runtime_frame;

/// A picture of waves, the same in blocks of so many pixels along each side.
fn picture(size: FrameSize, channels: usize, (steps, block): (f64, usize)) -> Vec<u8> {
    let sample = |at: usize| {
        let (pixel, channel) = (at / channels, (at % channels) as f64);
        let (x, y) = (pixel % size.width(), pixel / size.width());
        let (x, y) = (x / block * block, y / block * block);
        let across = steps * x as f64 / size.width() as f64;
        let down = steps * y as f64 / size.height() as f64;
        let wave = (across + channel).sin() * (1.3 * down + 0.5 * channel).cos();
        (110.0 + 60.0 * wave).round() as u8
    };
    (0..size.pixels() * channels).map(sample).collect()
}

/// Largest and mean difference of two frames, codes.
fn difference(a: &[u8], b: &[u8]) -> (u8, f64) {
    assert_eq!(a.len(), b.len());
    let differences = a.iter().zip(b).map(|(a, b)| a.abs_diff(*b));
    let sum: u64 = differences.clone().map(u64::from).sum();
    (differences.max().unwrap_or(0), sum as f64 / a.len() as f64)
}

/// What the devices make of a wide picture, side by side again, with the light of their neighbours
/// or without.
fn side_by_side(
    parts: &[iltm::compile::SplitTable],
    (wide, channels): (FrameSize, usize),
    frame: &[u8],
    silent: bool,
) -> Vec<u8> {
    let made: Vec<Vec<u8>> = parts
        .iter()
        .map(|part| {
            let table = Table::check(&part.image).expect("split checked it");
            let frames =
                FrameSplitter::new((&table, &[]), wide, Encoding::Linear).expect("wide frames");
            let own = frames.of_frame(frame);
            let light = (!silent).then_some(own.light.as_slice());
            let format = Format::new(frames.own(), channels as u8, Encoding::Linear, 1_000);
            let format = format.expect("a format");
            runtime_frame(&table, (table.top_tier(), format), &own.pixels, light)
        })
        .collect();
    let row = channels * wide.width() / parts.len();
    (0..wide.height())
        .flat_map(|y| {
            made.iter()
                .flat_map(move |own| own[y * row..][..row].to_vec())
        })
        .collect()
}

#[test]
fn devices_make_of_their_parts_what_the_table_of_all_makes_of_the_whole() {
    // Halves whose trees of nodes are those of the whole, and thirds whose are not; a picture of
    // blocks as large as the neighbours' cells, for which these lose nothing.
    let cases = [(8, 32, 2, 3, 1), (8, 24, 3, 1, 2), (6, 36, 3, 3, 3)];
    for (seed, (rows, cols, count, channels, block)) in (1..).zip(cases) {
        let effects = Effects {
            fine: false,
            ..Effects::ALL
        };
        let image = random_table(grid(rows, cols), channels, effects, seed);
        let whole = Table::check(&image).expect("compile checked it");
        let wide = FrameSize::of_grid(whole.grid());
        let format = Format::new(wide, channels as u8, Encoding::Linear, 1_000);
        let format = format.expect("a format");
        let frame = picture(wide, channels, (9.0, block));
        let expected = runtime_frame(&whole, (whole.top_tier(), format), &frame, None);
        let gains = runtime_frame(&whole, (0, format), &frame, None);
        let (_, operator) = difference(&expected, &gains);
        let mut off = Vec::new();
        for factor in [block, 2 * block] {
            let parts = split_table(&image, Some(count), factor as u16).expect("so many alike");
            assert_eq!(parts.len(), count);
            let made = side_by_side(&parts, (wide, channels), &frame, false);
            off.push(difference(&expected, &made));
            let alone = side_by_side(&parts, (wide, channels), &frame, true);
            let (_, silent) = difference(&expected, &alone);
            assert!(silent > 1.0, "the others' light counts: {silent}");
        }
        println!("{rows} x {cols}, {count}: {off:?} codes off, operator {operator:.1}");
        let [(most, mean), (_, coarse)] = off[..] else {
            unreachable!("two factors")
        };
        assert!(most <= 2 && mean < 0.25, "nothing is lost");
        assert!(coarse < 0.2 * operator, "little is lost");
    }
}

#[test]
fn frames_larger_than_the_grid_are_split_as_well() {
    let image = random_table(grid(8, 32), 3, Effects::ALL, 4);
    let whole = Table::check(&image).expect("compile checked it");
    let wide = FrameSize::new(160, 50).expect("not empty");
    let format = Format::new(wide, 3, Encoding::Linear, 1_000).expect("a format");
    let frame = picture(wide, 3, (7.0, 1));
    let expected = runtime_frame(&whole, (whole.top_tier(), format), &frame, None);
    let parts = split_table(&image, Some(2), 1).expect("halves");
    let made = side_by_side(&parts, (wide, 3), &frame, false);
    // Corrections are not interpolated across the border of two frames, so pixels that are
    // nearer to it than the centre of a cell differ.
    let near = |at: usize| (at / 3 % wide.width()).abs_diff(79) <= 4;
    let far = |frame: &[u8]| -> Vec<u8> {
        let samples = frame.iter().enumerate();
        let far = samples.filter(|(at, _)| !near(*at));
        far.map(|(_, sample)| *sample).collect()
    };
    let (most, mean) = difference(&far(&expected), &far(&made));
    assert!(most <= 2 && mean < 0.25, "{most}, {mean}");
}

#[test]
fn an_even_light_of_a_neighbour_is_its_light_in_every_cell() {
    let image = random_table(grid(7, 15), 3, Effects::ALL, 5);
    let parts = split_table(&image, Some(3), 4).expect("thirds");
    let table = Table::check(&parts[1].image).expect("split checked it");
    // Neither rows nor columns of pixels are a multiple of the cells'.
    let wide = FrameSize::new(3 * 23, 31).expect("not empty");
    let frames = FrameSplitter::new((&table, &[]), wide, Encoding::Linear).expect("wide frames");
    assert_eq!((frames.own().width(), frames.cells()), (23, grid(2, 4)));
    let colours = [[10, 20, 30], [0, 0, 0], [255, 128, 1]];
    let frame: Vec<u8> = (0..wide.pixels())
        .flat_map(|pixel| colours[pixel % wide.width() / 23])
        .collect();
    let own = frames.of_frame(&frame);
    assert!(own.pixels.iter().all(|code| *code == 0));
    for (at, light) in own.light.iter().enumerate() {
        let (col, channel) = (at / 3 % 4, at % 3);
        let code = f64::from(colours[2 * (col / 2)][channel]);
        let light = f64::from(u16::from_le_bytes(*light));
        assert!((light - code * 32_768.0 / 255.0).abs() <= 0.5, "{at}");
    }
}

#[test]
fn tables_of_other_frames_are_refused() {
    let image = random_table(grid(6, 20), 1, Effects::ALL, 6);
    let columns = |count| {
        let error = split_table(&image, Some(count), 4).expect_err("not so many alike");
        assert!(matches!(error, SplitTableError::Columns { .. }), "{error}");
    };
    for count in [0, 1, 3, 9, 20] {
        columns(count);
    }
    let unsaid = split_table(&image, None, 4).expect_err("nothing says how many");
    assert!(matches!(unsaid, SplitTableError::Unsaid), "{unsaid}");
    let parts = split_table(&image, Some(2), 4).expect("halves");
    let again = split_table(&parts[0].image, Some(2), 4).expect_err("it is one of two");
    assert!(matches!(again, SplitTableError::Split), "{again}");
    let four = split_table(&image, Some(4), 1).expect_err("three times as many as its own");
    assert!(
        matches!(four, SplitTableError::NeighboursCells { cells: 90 }),
        "{four}"
    );
    let mut made = MadeUp::new(grid(4, 8), 1);
    let size = FrameSize::new(81, 40).expect("not empty");
    made.projector = Some(iltm_runtime::placement::ProjectorPixels::whole(size));
    made.fine_gains = Some((8, 17, vec![1 << 13; 8 * 17]));
    let odd = split_table(&made.image(), Some(2), 4).expect_err("17 columns of gains");
    assert!(
        matches!(odd, SplitTableError::Columns { cols: 17, .. }),
        "{odd}"
    );
    made.fine_gains = None;
    let odd = split_table(&made.image(), Some(2), 4).expect_err("81 pixels");
    assert!(
        matches!(odd, SplitTableError::Frames { width: 81, .. }),
        "{odd}"
    );
}

#[test]
fn gains_alone_are_cut_and_take_no_light_of_others() {
    let effects = Effects {
        operator: false,
        deviation: false,
        ..Effects::ALL
    };
    let image = random_table(grid(6, 20), 3, effects, 7);
    let whole = Table::check(&image).expect("compile checked it");
    for (own, part) in split_table(&image, Some(2), 4)
        .expect("halves")
        .iter()
        .enumerate()
    {
        let table = Table::check(&part.image).expect("split checked it");
        assert!(table.neighbours().is_none() && part.tiers.is_empty());
        for row in 0..6 {
            let of_whole = whole.gain_row(row, 1).skip(10 * own).take(10);
            assert!(table.gain_row(row, 1).eq(of_whole), "{row}");
        }
    }
}

#[test]
fn a_part_is_called_after_its_place() {
    let image = random_table(grid(6, 20), 1, Effects::ALL, 6);
    let whole = Table::check(&image).expect("compile checked it");
    for (number, part) in (1..).zip(split_table(&image, Some(2), 4).expect("halves")) {
        let table = Table::check(&part.image).expect("split checked it");
        let name = format!("{} {number}/2", whole.label().name());
        assert_eq!(table.label().name(), name);
        let others = table.neighbours().expect("one");
        assert_eq!(others.around(), [number - 1, 2 - number]);
        assert_eq!(table.reference_white(), whole.reference_white());
        assert_eq!(table.top_tier(), whole.top_tier());
    }
}
