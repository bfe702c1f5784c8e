//! Label of a table: its name and date for people, as a device shows them.

use super::bytes::{put, u32_at};
use super::layout::label as field;
use core::fmt;
use serde::{Deserialize, Serialize};

/// Name and date of a table. Neither decides anything; both may be empty.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Label {
    /// UTF-8, filled up with zeros.
    name: [u8; field::NAME_BYTES],
    /// Day as a decimal number, 20261123 for 2026-11-23; 0: unknown.
    date: u32,
}

impl Label {
    /// A label with as much of a name as fits, and its day as a decimal number, 20261123
    /// for 2026-11-23.
    #[must_use]
    pub fn new(name: &str, date: u32) -> Self {
        let fits = |length: &usize| *length <= field::NAME_BYTES && name.is_char_boundary(*length);
        let length = (0..=name.len()).rev().find(fits).unwrap_or(0);
        let mut label = Self {
            date,
            ..Self::default()
        };
        let name = name.as_bytes().get(..length).unwrap_or_default();
        put(&mut label.name, 0..field::NAME_BYTES, name);
        label
    }

    /// The label in `bytes`; `None` if its name is not UTF-8 with zeros behind it.
    pub(super) fn parse(bytes: &[u8; field::SIZE]) -> Option<Self> {
        let label = Self {
            name: *bytes.first_chunk()?,
            date: u32_at(bytes, field::DATE)?,
        };
        let rest = label.name.iter().skip_while(|byte| **byte != 0);
        let padded = rest.copied().all(|byte| byte == 0);
        (padded && core::str::from_utf8(&label.name).is_ok()).then_some(label)
    }

    /// Its bytes.
    pub(super) fn emit(&self) -> [u8; field::SIZE] {
        let mut bytes = [0; field::SIZE];
        put(&mut bytes, field::NAME, &self.name);
        put(&mut bytes, field::DATE, &self.date.to_le_bytes());
        bytes
    }

    /// The name; empty if it has none.
    #[must_use]
    pub fn name(&self) -> &str {
        let length = self.name.iter().position(|byte| *byte == 0);
        let name = self.name.get(..length.unwrap_or(field::NAME_BYTES));
        core::str::from_utf8(name.unwrap_or_default()).unwrap_or_default()
    }

    /// The day as a decimal number; 0 if it is unknown.
    #[must_use]
    pub const fn date(&self) -> u32 {
        self.date
    }
}

/// For people, with nothing in it that a terminal would obey.
impl fmt::Display for Label {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name() {
            "" => f.write_str("no name")?,
            name => write!(f, "{}", name.escape_debug())?,
        }
        match self.date {
            0 => Ok(()),
            date => {
                let (year, month, day) = (date / 10_000, date / 100 % 100, date % 100);
                write!(f, ", {year:04}-{month:02}-{day:02}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn a_label_comes_back_from_its_bytes() {
        for name in ["", "foyer", "Großer Saal", &"x".repeat(32)] {
            let label = Label::new(name, 20_261_123);
            assert_eq!((label.name(), label.date()), (name, 20_261_123));
            assert_eq!(Label::parse(&label.emit()), Some(label));
        }
        assert_eq!(Label::default().emit(), [0; field::SIZE]);
    }

    #[test]
    fn a_name_that_is_too_long_is_cut_between_two_letters() {
        assert_eq!(Label::new(&"x".repeat(40), 0).name(), "x".repeat(32));
        // 31 bytes and a letter of two.
        let long = "x".repeat(31) + "ß";
        assert_eq!(Label::new(&long, 0).name(), "x".repeat(31));
    }

    #[test]
    fn a_name_that_is_no_text_or_goes_on_behind_its_end_is_refused() {
        let with = |at: usize, byte: u8| {
            let mut bytes = Label::new("foyer", 0).emit();
            bytes[at] = byte;
            Label::parse(&bytes)
        };
        assert_eq!(with(2, 0xFF), None, "no UTF-8");
        assert_eq!(with(9, b'x'), None, "behind the end");
        assert_eq!(with(2, 0), None, "behind a zero");
        assert!(with(4, b'x').is_some());
    }

    #[test]
    fn people_read_name_and_day_and_a_terminal_nothing_to_obey() {
        let said = |name: &str, date| Label::new(name, date).to_string();
        assert_eq!(said("foyer", 20_261_123), "foyer, 2026-11-23");
        assert_eq!(said("", 0), "no name");
        assert_eq!(said("a\x1b]0;b\x07", 0), "a\\u{1b}]0;b\\u{7}");
    }
}
