//! A table image survives nothing but itself.

use iltm::picture::Response;
use iltm::video::OperatorMemory;
use iltm_runtime::image::{ImageError, Table};
use iltm_runtime::pipeline::{Encoding, GridPipeline};
use iltm_tests::{wedge_table, wedge_table_for};
use proptest::prelude::*;
use std::sync::OnceLock;

/// A table of few bytes with every kind of section but the long ones.
fn small(channels: usize) -> Vec<u8> {
    static SMALL: OnceLock<[Vec<u8>; 2]> = OnceLock::new();
    let tables = SMALL.get_or_init(|| {
        let projector = Response::Linear;
        [1, 3].map(|channels| wedge_table_for(projector, 3, 4, channels))
    });
    tables[channels / 2].clone()
}

#[test]
fn every_change_of_a_single_byte_is_refused() {
    for channels in [1, 3] {
        let image = small(channels);
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

/// The image with some bytes replaced and its checksums made right again, so that
/// the checks behind the checksums have to hold.
fn forged(image: &[u8], changes: &[(usize, u8)]) -> Vec<u8> {
    use iltm_runtime::image::crc32;
    use iltm_runtime::image::layout::{entry, header};
    let mut forged = image.to_vec();
    for (at, value) in changes {
        let at = at % forged.len();
        forged[at] = *value;
    }
    let word = |bytes: &[u8], at: usize| {
        let field = bytes.get(at..at + 4)?.try_into().ok()?;
        Some(u32::from_le_bytes(field) as usize)
    };
    let sections = usize::from(u16::from_le_bytes([forged[6], forged[7]]));
    for index in 0..sections {
        let row = header::SIZE + index * entry::SIZE;
        let section = word(&forged, row + entry::OFFSET.start)
            .zip(word(&forged, row + entry::LENGTH.start))
            .and_then(|(start, length)| forged.get(start..start.checked_add(length)?));
        let Some(crc) = section.map(|bytes| crc32(&[bytes])) else {
            continue;
        };
        if let Some(field) = forged.get_mut(row + entry::CRC.start..row + entry::CRC.end) {
            field.copy_from_slice(&crc.to_le_bytes());
        }
    }
    let table_end = (header::SIZE + sections * entry::SIZE).min(forged.len());
    let crc = crc32(&[
        &forged[..header::CRC.start],
        &forged[header::SIZE..table_end],
    ]);
    forged[header::CRC].copy_from_slice(&crc.to_le_bytes());
    forged
}

/// Runs a frame of any table that is taken; it must not panic or overflow.
fn run<const C: usize>(table: &Table<'_>) {
    let cells = table.grid().cells();
    let pipeline = GridPipeline::<C>::new(table).expect("chosen by the table's channels");
    let mut memory = OperatorMemory::new(table);
    let mut workspace = memory.workspace();
    for level in [0_u8, 255] {
        let mut input = vec![[0; C]; cells];
        let wanted = vec![[level; C]; cells];
        let tier = table.top_tier();
        pipeline
            .compensate(tier, Encoding::Display, &wanted, &mut input, &mut workspace)
            .expect("everything has the table's size");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4_000))]

    #[test]
    fn random_bytes_are_refused_without_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..2_000)) {
        prop_assert!(Table::check(&bytes).is_err());
    }

    #[test]
    fn a_forged_image_with_good_checksums_is_refused_or_harmless(
        changes in prop::collection::vec((any::<usize>(), any::<u8>()), 1..6), colour in any::<bool>()
    ) {
        let image = small(if colour { 3 } else { 1 });
        let forged = forged(&image, &changes);
        if let Ok(table) = Table::check(&forged) {
            match table.channels() {
                1 => run::<1>(&table),
                _ => run::<3>(&table),
            }
        }
    }
}
