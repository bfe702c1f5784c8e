//! Table image: its bytes. Knows the layout and nothing of what it means.

use super::ladder::Part;
use super::quantise::Quantised;
pub use super::quantise::StoredRow;
use iltm_runtime::{
    Grid,
    image::{
        Neighbours, crc32,
        layout::{ALIGNMENT, FORMAT_VERSION, MAGIC, SectionKind, entry, header, projector},
    },
    operator::layout as segment,
    placement::ProjectorPixels,
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

    /// The sections of a checked image.
    pub(crate) fn of_image(image: &[u8]) -> Self {
        let field = |row: &[u8], at: Range<usize>| -> usize {
            let bytes = row.get(at).unwrap_or_default().iter().rev();
            bytes.fold(0, |value, byte| value << 8 | usize::from(*byte))
        };
        let count = field(image, header::SECTIONS);
        let rows = image.get(header::SIZE..).unwrap_or_default();
        let section = |row: &[u8]| {
            let start = field(row, entry::OFFSET);
            let bytes = image.get(start..start + field(row, entry::LENGTH))?;
            let kind = SectionKind::from_number(field(row, entry::KIND) as u16)?;
            Some((kind, field(row, entry::SELECTOR) as u16, bytes.to_vec()))
        };
        let sections = rows.chunks_exact(entry::SIZE).take(count);
        Self {
            sections: sections.filter_map(section).collect(),
        }
    }

    /// Puts a section in the place of all of its kind; takes them out if there is none.
    pub(crate) fn replace(&mut self, kind: SectionKind, bytes: Option<Vec<u8>>) {
        self.sections.retain(|(own, _, _)| *own != kind);
        self.sections.extend(bytes.map(|bytes| (kind, 0, bytes)));
    }

    /// The bytes of the first section of a kind.
    pub(crate) fn bytes(&self, kind: SectionKind) -> Option<&[u8]> {
        let mut sections = self.sections.iter();
        let (_, _, bytes) = sections.find(|(own, _, _)| *own == kind)?;
        Some(bytes)
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

/// The bytes of a projector section.
#[must_use]
pub fn projector_section(pixels: ProjectorPixels) -> Vec<u8> {
    let mut bytes = vec![0; projector::SIZE];
    let size = pixels.size();
    // Sides of a frame are `u16`s.
    let (width, height) = (size.width() as u16, size.height() as u16);
    put(&mut bytes, projector::WIDTH, &width.to_le_bytes());
    put(&mut bytes, projector::HEIGHT, &height.to_le_bytes());
    put(
        &mut bytes,
        projector::BORDER,
        &pixels.border().to_le_bytes(),
    );
    bytes
}

/// The bytes of a neighbours section: cells of those on the left and on the right, and their ambient
/// light.
#[must_use]
pub fn neighbours_section(cells: Grid, around: [u8; 2], ambient: Vec<u16>) -> Vec<u8> {
    let mut bytes = Neighbours::head(cells, around).to_vec();
    bytes.extend(halfwords(ambient));
    bytes
}

/// `u16`s as bytes.
pub(super) fn halfwords(values: impl IntoIterator<Item = u16>) -> Vec<u8> {
    values.into_iter().flat_map(u16::to_le_bytes).collect()
}

/// The bytes of an operator section: rows, given in ascending order of their index,
/// grouped by their number of pairs. `inputs` are the input coefficients of a channel: a single one,
/// which lights no other, has no operator.
#[must_use]
pub fn segment_bytes(inputs: usize, rows: &[StoredRow]) -> Vec<u8> {
    let mut groups = vec![(0_u16, Vec::new()); segment::MAX_SHORT + 1];
    for row in rows {
        let pairs = row.pairs(inputs);
        let place = pairs.len().min(segment::MAX_SHORT + 1) - 1;
        let (count, words) = &mut groups[place];
        *count += 1;
        words.push(segment::word(row.index, row.shift));
        if pairs.len() > segment::MAX_SHORT {
            words.push(segment::word(pairs.len() as u16, 0));
        }
        for two in pairs.chunks(2) {
            let values = two.iter().map(|(_, [first, second])| {
                segment::word(first.cast_unsigned(), second.cast_unsigned())
            });
            words.extend(values);
            words.push(segment::word(two[0].0, two.get(1).map_or(0, |pair| pair.0)));
        }
    }
    let mut bytes = Vec::new();
    for (index, (count, words)) in groups.into_iter().enumerate() {
        let pairs = index + 1;
        if count == 0 {
            continue;
        }
        if pairs > segment::MAX_SHORT {
            bytes.push(segment::word(0, count));
            bytes.push((words.len() as u32).to_le_bytes());
        } else {
            bytes.push(segment::word(pairs as u16, count));
        }
        bytes.extend(words);
    }
    bytes.concat()
}

/// Operator sections of rows in the order of [`quantise`](super::quantise):
/// selector and bytes of each.
pub(super) fn operator_sections(inputs: usize, quantised: &[Quantised]) -> Vec<(u16, Vec<u8>)> {
    let section = |segment: &Quantised| {
        let channel = match segment.part {
            Part::Shared => 0,
            Part::Channel(channel) => u16::from(channel) + 1,
        };
        let selector = u16::from(segment.tier) + 256 * channel;
        (selector, segment_bytes(inputs, &segment.rows))
    };
    quantised.iter().map(section).collect()
}
