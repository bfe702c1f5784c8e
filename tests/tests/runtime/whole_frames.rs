//! Frames larger than the grid: a device's way through a frame larger than the grid
//! against the host's.

use iltm_runtime::frame_buffers::Format;
use iltm_runtime::image::Table;
use iltm_runtime::pipeline::Encoding;
use iltm_runtime::placement::ProjectorPixels;
use iltm_runtime::{FrameSize, Grid};
use iltm_tests::firmware::{Effects, on_host, random_frame, random_table};
use iltm_tests::made_up::MadeUp;
use iltm_tests::neighbours::runtime_frame;

#[test]
fn a_device_makes_of_a_larger_frame_what_the_host_makes_of_it() {
    let sizes = [
        (5, 9, 40, 23),
        (13, 21, 68, 53),
        (6, 8, 48, 36),
        (7, 3, 3, 61),
    ];
    for (seed, (rows, cols, width, height)) in (0..).zip(sizes) {
        for channels in [1, 3] {
            let grid = Grid::new(rows, cols).expect("a small grid");
            let image = random_table(grid, channels, Effects::ALL, seed);
            let table = Table::check(&image).expect("compile checked it");
            let size = FrameSize::new(width, height).expect("not empty");
            for encoding in [Encoding::Display, Encoding::Linear] {
                let format = Format::new(size, channels as u8, encoding, 1_000).expect("a format");
                for tier in 0..=table.top_tier() {
                    let wanted = random_frame(format, seed + u64::from(tier));
                    let (expected, _) = on_host(&table, tier, format, &wanted);
                    let made = runtime_frame(&table, (tier, format), &wanted, None);
                    assert!(
                        made == expected,
                        "{grid} to {size}, {channels} channels, {encoding:?}, tier {tier}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_device_and_the_host_leave_the_same_border_black() {
    for (seed, channels) in [(1, 1), (2, 3)] {
        let mut table = MadeUp::of_all_kinds(Grid::new(5, 9).expect("small"), channels, 4, seed);
        table.projector = ProjectorPixels::new(FrameSize::new(160, 90).expect("not empty"), 11);
        let image = table.image();
        let table = Table::check(&image).expect("whole");
        for (width, height) in [(160, 90), (64, 36), (121, 68)] {
            let size = FrameSize::new(width, height).expect("not empty");
            let encoding = Encoding::Display;
            let format = Format::new(size, channels as u8, encoding, 1_000).expect("a format");
            let area = table.area(size).expect("of its aspect");
            for tier in 0..=table.top_tier() {
                let wanted = random_frame(format, seed + u64::from(tier));
                let (expected, clipped) = on_host(&table, tier, format, &wanted);
                let made = runtime_frame(&table, (tier, format), &wanted, None);
                assert!(made == expected, "{size}, {channels} channels, tier {tier}");
                assert!((clipped.total() as usize) < area.size.pixels() * channels);
                let row = size.width() * channels;
                assert!(made.iter().take(area.top * row).all(|code| *code == 0));
                let left = made
                    .chunks_exact(row)
                    .map(|row| &row[..area.left * channels]);
                assert!(left.flatten().all(|code| *code == 0));
            }
        }
        assert_eq!(table.area(FrameSize::new(64, 48).expect("not empty")), None);
    }
}

#[test]
fn ambient_light_that_falls_to_none_between_cells_leaves_no_pixel_dark() {
    let grids = [(13, 21), (36, 48), (4, 5), (32, 32)];
    let sizes = [
        (320, 240),
        (641, 97),
        (1280, 720),
        (1366, 768),
        (1920, 1080),
    ];
    for (seed, (rows, cols)) in (0..).zip(grids) {
        let grid = Grid::new(rows, cols).expect("a small grid");
        let mut random = fastrand::Rng::with_seed(seed);
        let mut made_up = MadeUp::new(grid, 1);
        made_up.ambient = Some((0..grid.cells()).map(|_| random.u16(..2)).collect());
        let image = made_up.image();
        let table = Table::check(&image).expect("a whole table");
        for (width, height) in sizes {
            let size = FrameSize::new(width, height).expect("not empty");
            let format = Format::new(size, 1, Encoding::Linear, 1_000).expect("a format");
            let wanted = vec![255; size.pixels()];
            let made = runtime_frame(&table, (0, format), &wanted, None);
            // Gain 1, and ambient light of at most one step of light.
            assert!(made.iter().all(|code| *code >= 254), "{grid} to {size}");
            let (expected, _) = on_host(&table, 0, format, &wanted);
            assert!(made == expected, "{grid} to {size}");
        }
    }
}
