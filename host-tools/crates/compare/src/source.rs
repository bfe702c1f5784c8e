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

impl Source {
    /// The paper that this project follows.
    pub const THE_PAPER: Self = Self {
        authors: "Chu, Ng, Pahwa, Quek, Huang",
        title: "Compressive Inverse Light Transport",
        venue: "BMVC",
        year: 2011,
    };
    /// Bounces from the inverse of a transport that is measured one light at a time.
    pub const INVERSE_LIGHT_TRANSPORT: Self = Self {
        authors: "Seitz, Matsushita, Kutulakos",
        title: "A Theory of Inverse Light Transport",
        venue: "ICCV",
        year: 2005,
    };
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
