//! Frames on a graphics processor (here Mesa's software) against those of the processor.

use super::*;
use crate::engine::Gpu;
use crate::{Fit, Input, live::Live};
use iltm_picture::progress::Silent;
use iltm_runtime::placement::ProjectorPixels;
use proptest::prelude::*;
use std::sync::{Arc, LazyLock};

/// One for all tests: finding it takes a while.
static GPU: LazyLock<Arc<Gpu>> = LazyLock::new(|| {
    Arc::new(Gpu::find().expect("Mesa's software Vulkan is installed (mesa-vulkan-drivers)"))
});

/// What both make of a frame, and how many samples were clipped.
fn by_both(
    table: &MadeUp,
    settings: CompensateOptions,
    picture: &Picture,
) -> [(Picture, FrameTotals); 2] {
    let image = table.image();
    let table = Table::check(&image).expect("a sample table is whole");
    let on_processor = Compensator::new(&table, settings).unwrap();
    let on_gpu = on_processor.with_gpu(&GPU).unwrap();
    [on_processor, on_gpu].map(|compensator| compensator.frame(picture.clone()).unwrap())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn every_frame_is_the_processors_bit_for_bit(
        (rows, cols) in (1_u16..14, 1_u16..22),
        (more_width, more_height) in (0_u16..90, 0_u16..90),
        (table_channels, channels) in prop::sample::select(vec![(1, 1), (1, 3), (3, 3)]),
        linear: bool,
        wide: bool,
        dark: bool,
        of_channels: bool,
        seed: u64,
    ) {
        // A side may have as many pixels as cells, both may not: that is another way.
        let size = size(cols + more_width, rows + more_height + 1);
        let mut table = MadeUp::of_all_kinds(grid(rows, cols), table_channels, 5, seed);
        table.of_channels = of_channels;
        if dark {
            table.ambient = None;
            table.fine_gains = None;
        }
        let encoding = if linear { Encoding::Linear } else { Encoding::Display };
        let picture = random_picture(size, channels, wide, seed);
        for tier in 0..=table.tiers.len() as u8 {
            let settings = CompensateOptions { tier: Some(tier), ..settings(encoding) };
            let [on_processor, on_gpu] = by_both(&table, settings, &picture);
            prop_assert!(on_gpu == on_processor, "tier {}", tier);
        }
    }
}

#[test]
fn a_frame_of_4k_is_the_processors() {
    // Sums of its cells need more than 32 bits, and its words more groups than one side takes.
    let table = MadeUp::of_all_kinds(grid(3, 5), 3, 3, 7);
    let picture = random_picture(size(3840, 2160), 3, false, 3);
    let [on_processor, on_gpu] = by_both(&table, settings(Encoding::Display), &picture);
    assert!(on_gpu == on_processor);
}

#[test]
fn borders_and_bars_are_the_processors() {
    for (channels, wide) in [(1, false), (3, false), (3, true)] {
        let mut table = MadeUp::of_all_kinds(grid(3, 5), channels, 3, 7);
        table.projector = ProjectorPixels::new(size(40, 25), 4);
        for (fit, frame) in [
            (None, size(80, 50)),
            (Some(Fit::Letterbox), size(64, 64)),
            (Some(Fit::Letterbox), size(101, 40)),
            (Some(Fit::Crop), size(101, 40)),
        ] {
            let picture = random_picture(frame, channels, wide, 3);
            let settings = CompensateOptions {
                fit,
                ..settings(Encoding::Display)
            };
            let [on_processor, on_gpu] = by_both(&table, settings, &picture);
            assert!(on_processor.1.clipped > 0);
            assert!(on_gpu == on_processor, "{fit:?} {frame}");
        }
    }
}

#[test]
fn films_of_all_kinds_are_the_processors_and_a_newer_table_takes_over() {
    let images: Vec<_> = [1, 2]
        .map(|seed| MadeUp::of_all_kinds(grid(13, 21), 3, 5, seed).image())
        .into();
    for kind in ["C420jpeg", "C422", "C444", "C420p10", "C444p12"] {
        let line = format!("YUV4MPEG2 W63 H41 {kind}");
        let film = super::live::stream(&line, 4);
        let table = Table::check(&images[0]).unwrap();
        let on_processor = Compensator::new(&table, settings(Encoding::Display)).unwrap();
        let on_gpu = on_processor.with_gpu(&GPU).unwrap();
        let [on_processor, on_gpu] = [on_processor, on_gpu].map(|compensator| {
            let mut asked = 0;
            let live = Live {
                budget: None,
                newer: &mut || {
                    asked += 1;
                    (asked == 3).then(|| images[1].clone())
                },
                said: &mut |_| (),
            };
            let mut output = Vec::new();
            let input = Input::of(film.as_slice()).unwrap();
            let done = compensator.live(live, input, &mut output, &Silent).unwrap();
            assert_eq!(done.tables, 1);
            (output, done.frames)
        });
        assert!(on_gpu == on_processor, "{kind}");
    }
}
