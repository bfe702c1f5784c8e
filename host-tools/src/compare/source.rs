//! Where a method comes from.

use std::fmt;

/// A publication.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Source {
    /// Family names.
    pub authors: &'static str,
    /// Title.
    pub title: &'static str,
    /// Where it appeared.
    pub venue: &'static str,
    /// When.
    pub year: u16,
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            authors,
            title,
            venue,
            year,
        } = self;
        write!(f, "{authors}: {title}. {venue}, {year}")
    }
}
