//! Sections of an image: header, section table and checksums.

use super::bytes::{u16_at, u32_at};
use super::layout::{ALIGNMENT, FORMAT_VERSION, MAGIC, MAX_SECTIONS, SectionKind, entry, header};
use super::{ImageError, SectionProblem, checksum};
use crate::yield_budget::YieldBudget;

/// An image whose checksums hold: every byte is as it was written. What they mean
/// is not looked at yet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Whole<'a> {
    pub(super) image: &'a [u8],
    entries: &'a [[u8; entry::SIZE]],
}

/// One section of it.
#[derive(Clone, Copy)]
pub(super) struct Section<'a> {
    pub(super) kind: SectionKind,
    pub(super) selector: u16,
    pub(super) bytes: &'a [u8],
}

impl<'a> Whole<'a> {
    /// Checks the header, the section table, and the checksum of every section.
    pub(crate) fn new(
        image: &'a [u8],
        budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>,
    ) -> Result<Self, ImageError> {
        let given = image.len();
        let truncated = |needed: usize| ImageError::Truncated { needed, given };
        let (head, rest) = image
            .split_at_checked(header::SIZE)
            .ok_or(truncated(header::SIZE))?;
        if head.get(header::MAGIC) != Some(&MAGIC) {
            return Err(ImageError::NotATable);
        }
        let found = u16_at(head, header::VERSION).unwrap_or(0);
        if found != FORMAT_VERSION {
            return Err(ImageError::Version { found });
        }
        let stated = u32_at(head, header::LENGTH).unwrap_or(0) as usize;
        if given < stated {
            return Err(truncated(stated));
        }
        if given > stated {
            return Err(ImageError::Length { stated, given });
        }
        let count = usize::from(u16_at(head, header::SECTIONS).unwrap_or(0));
        let table = rest
            .get(..count * entry::SIZE)
            .ok_or(truncated(header::SIZE + count * entry::SIZE))?;
        let covered = head.get(..header::CRC.start).unwrap_or_default();
        if u32_at(head, header::CRC) != Some(checksum(&[covered, table], budget)) {
            return Err(ImageError::HeaderChecksum);
        }
        let whole = Self {
            image,
            entries: table.as_chunks().0,
        };
        whole.check(budget)?;
        Ok(whole)
    }

    /// Sections stand in order, one behind the other, each with its checksum.
    fn check(&self, budget: &mut YieldBudget<'_, impl FnMut() + ?Sized>) -> Result<(), ImageError> {
        let given = self.image.len();
        let mut place = header::SIZE + self.entries.len() * entry::SIZE;
        let mut last = None;
        for (index, entry) in self.entries.iter().enumerate() {
            let section = self.place(index, entry, &mut place)?;
            let problem = |problem| ImageError::Section {
                section: section.kind,
                problem,
            };
            if Some(checksum(&[section.bytes], budget)) != u32_at(entry, entry::CRC) {
                return Err(ImageError::SectionChecksum {
                    section: section.kind,
                });
            }
            let this = (section.kind, section.selector);
            if last.is_some_and(|last| last >= this) || index >= MAX_SECTIONS {
                return Err(problem(SectionProblem::Order));
            }
            last = Some(this);
            if section.kind != SectionKind::Operator && section.selector != 0 {
                return Err(problem(SectionProblem::Selector));
            }
        }
        if place != given {
            return Err(ImageError::Length {
                stated: place,
                given,
            });
        }
        Ok(())
    }

    /// The section of an entry; `place` is where it must start and becomes where the
    /// next one must.
    fn place(
        &self,
        index: usize,
        bytes: &[u8; entry::SIZE],
        place: &mut usize,
    ) -> Result<Section<'a>, ImageError> {
        let number = u16_at(bytes, entry::KIND).unwrap_or(0);
        let kind = SectionKind::from_number(number).ok_or(ImageError::UnknownSection {
            index,
            kind: number,
        })?;
        let problem = |problem| ImageError::Section {
            section: kind,
            problem,
        };
        let (section, end) = self
            .read(bytes)
            .filter(|_| u32_at(bytes, entry::OFFSET) == u32::try_from(*place).ok())
            .ok_or(problem(SectionProblem::Place))?;
        let padded = end.checked_next_multiple_of(ALIGNMENT);
        let padding = padded.and_then(|padded| self.image.get(end..padded));
        let padding = padding.ok_or(problem(SectionProblem::Place))?;
        if padding.iter().any(|byte| *byte != 0) {
            return Err(problem(SectionProblem::Padding));
        }
        *place = end + padding.len();
        Ok(section)
    }

    /// The section of an entry and where it ends.
    fn read(&self, bytes: &[u8; entry::SIZE]) -> Option<(Section<'a>, usize)> {
        let start = u32_at(bytes, entry::OFFSET)? as usize;
        let end = start.checked_add(u32_at(bytes, entry::LENGTH)? as usize)?;
        let section = Section {
            kind: SectionKind::from_number(u16_at(bytes, entry::KIND)?)?,
            selector: u16_at(bytes, entry::SELECTOR)?,
            bytes: self.image.get(start..end)?,
        };
        Some((section, end))
    }

    /// All sections of a kind, in their order.
    pub(super) fn of_kind(self, kind: SectionKind) -> impl Iterator<Item = Section<'a>> {
        let read = move |entry| self.read(entry).map(|(section, _)| section);
        let sections = self.entries.iter().filter_map(read);
        sections.filter(move |section| section.kind == kind)
    }

    /// The section of a kind that occurs once at most.
    pub(super) fn optional(self, kind: SectionKind) -> Option<Section<'a>> {
        self.of_kind(kind).next()
    }

    /// The section of a kind that every table has.
    pub(super) fn required(self, kind: SectionKind) -> Result<Section<'a>, ImageError> {
        self.optional(kind).ok_or(ImageError::Section {
            section: kind,
            problem: SectionProblem::Missing,
        })
    }
}

impl Section<'_> {
    pub(super) fn length_error(self) -> ImageError {
        ImageError::Section {
            section: self.kind,
            problem: SectionProblem::Length,
        }
    }

    pub(super) fn field_error(self, field: &'static str, offset: usize) -> ImageError {
        ImageError::Field {
            section: self.kind,
            field,
            offset,
        }
    }
}
