//! The bytes of an image. Knows the layout and nothing of what it means.

use super::ladder::Part;
use super::quantise::Stored;
use iltm_runtime::image::crc32;
use iltm_runtime::image::layout::{
    ALIGNMENT, FORMAT_VERSION, MAGIC, SectionKind, entry, header, segment,
};
use std::ops::Range;

/// Sections in the order of their kinds and selectors.
#[derive(Clone, Debug, Default)]
pub struct ImageWriter {
    sections: Vec<(SectionKind, u16, Vec<u8>)>,
}

impl ImageWriter {
    /// Adds a section; the order in which sections are added does not matter.
    pub fn section(&mut self, kind: SectionKind, selector: u16, bytes: Vec<u8>) {
        self.sections.push((kind, selector, bytes));
    }

    /// The image.
    #[must_use]
    pub fn finish(mut self) -> Vec<u8> {
        self.sections
            .sort_by_key(|(kind, selector, _)| (*kind, *selector));
        let table_end = header::SIZE + self.sections.len() * entry::SIZE;
        let mut image = vec![0; table_end];
        for (index, (kind, selector, bytes)) in self.sections.iter().enumerate() {
            let offset = image.len();
            let row = &mut image[header::SIZE + index * entry::SIZE..][..entry::SIZE];
            put(row, entry::KIND, &(*kind as u16).to_le_bytes());
            put(row, entry::SELECTOR, &selector.to_le_bytes());
            put(row, entry::OFFSET, &(offset as u32).to_le_bytes());
            put(row, entry::LENGTH, &(bytes.len() as u32).to_le_bytes());
            put(row, entry::CRC, &crc32(&[bytes]).to_le_bytes());
            image.extend_from_slice(bytes);
            image.resize(image.len().next_multiple_of(ALIGNMENT), 0);
        }
        let length = image.len() as u32;
        put(&mut image, header::MAGIC, &MAGIC);
        put(&mut image, header::VERSION, &FORMAT_VERSION.to_le_bytes());
        let sections = self.sections.len() as u16;
        put(&mut image, header::SECTIONS, &sections.to_le_bytes());
        put(&mut image, header::LENGTH, &length.to_le_bytes());
        let crc = crc32(&[&image[..header::CRC.start], &image[header::SIZE..table_end]]);
        put(&mut image, header::CRC, &crc.to_le_bytes());
        image
    }
}

/// Stores a field.
pub(super) fn put(bytes: &mut [u8], field: Range<usize>, value: &[u8]) {
    bytes[field].copy_from_slice(value);
}

/// `u16`s as bytes.
pub(super) fn halfwords(values: impl IntoIterator<Item = u16>) -> Vec<u8> {
    values.into_iter().flat_map(u16::to_le_bytes).collect()
}

/// Operator sections of entries in the order of [`quantise`](super::quantise):
/// selector and bytes of each.
pub(super) fn operator_sections(entries: &[Stored]) -> Vec<(u16, Vec<u8>)> {
    let segment_of = |stored: &Stored| (stored.part, stored.tier);
    let of_one_segment = entries.chunk_by(|a, b| segment_of(a) == segment_of(b));
    let section = |entries: &[Stored]| {
        let (part, tier) = segment_of(&entries[0]);
        let channel = match part {
            Part::Shared => 0,
            Part::Channel(channel) => channel as u16 + 1,
        };
        let mut bytes = Vec::with_capacity(segment::WORD * entries.len() * 3 / 2);
        for row in entries.chunk_by(|a, b| a.row == b.row) {
            bytes.extend(segment::word(row[0].row, row.len() as u16));
            let words = row
                .iter()
                .map(|e| segment::word(e.col, e.value.cast_unsigned()));
            bytes.extend(words.flatten());
        }
        (u16::from(tier) + 256 * channel, bytes)
    };
    of_one_segment.map(section).collect()
}
