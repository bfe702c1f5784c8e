//! Sample images for tests of this crate; the host tools write the real ones.

use super::layout::{ALIGNMENT, FORMAT_VERSION, MAGIC, SectionKind, entry, header, tier};
use super::{Label, Meta, crc32};
use crate::Grid;
use crate::operator::Bounds;
use fixed::types::{U0F32, U1F15, U8F24};
use std::vec;
use std::vec::Vec;

/// An image of these sections, whole whatever is in them.
pub(crate) fn image(sections: &[(SectionKind, Vec<u8>)]) -> Vec<u8> {
    let table_end = header::SIZE + sections.len() * entry::SIZE;
    let mut image = vec![0; table_end];
    for (index, (kind, bytes)) in sections.iter().enumerate() {
        let (offset, start) = (image.len(), header::SIZE + index * entry::SIZE);
        let row = &mut image[start..][..entry::SIZE];
        row[entry::KIND].copy_from_slice(&(*kind as u16).to_le_bytes());
        row[entry::OFFSET].copy_from_slice(&(offset as u32).to_le_bytes());
        row[entry::LENGTH].copy_from_slice(&(bytes.len() as u32).to_le_bytes());
        row[entry::CRC].copy_from_slice(&crc32(&[bytes]).to_le_bytes());
        image.extend_from_slice(bytes);
        image.resize(image.len().next_multiple_of(ALIGNMENT), 0);
    }
    let length = image.len() as u32;
    image[header::MAGIC].copy_from_slice(&MAGIC);
    image[header::VERSION].copy_from_slice(&FORMAT_VERSION.to_le_bytes());
    image[header::SECTIONS].copy_from_slice(&(sections.len() as u16).to_le_bytes());
    image[header::LENGTH].copy_from_slice(&length.to_le_bytes());
    let crc = crc32(&[&image[..header::CRC.start], &image[header::SIZE..table_end]]);
    image[header::CRC].copy_from_slice(&crc.to_le_bytes());
    image
}

/// The sections of a grey table of tier 0 alone for a dark, flat scene.
pub(crate) fn flat(rows: u16, cols: u16) -> Vec<(SectionKind, Vec<u8>)> {
    let meta = Meta {
        grid: Grid::new(rows, cols).expect("a small grid"),
        channels: 1,
        gain_fraction: 12,
        reference_white: U8F24::from_bits(1 << 23),
        inverse_error: U0F32::ZERO,
        bounds: Bounds::default(),
        channel_scales: [U1F15::ZERO; 3],
        label: Label::default(),
    };
    let cells = usize::from(rows) * usize::from(cols);
    vec![
        (SectionKind::Meta, meta.emit().to_vec()),
        (SectionKind::Tiers, vec![0; tier::SIZE]),
        (SectionKind::Gain, 4_096_u16.to_le_bytes().repeat(cells)),
    ]
}
