//! Pattern role: what a pattern was shown for, and its name in `capture.csv`.

use std::fmt;

/// One axis of the grid, in the order in which arrays of both have them.
#[derive(Clone, Copy, PartialEq, Eq, Debug, strum::Display)]
#[strum(serialize_all = "lowercase")]
pub enum CodeAxis {
    /// Columns, counted from the left.
    Column,
    /// Rows, counted from the top.
    Row,
}

impl CodeAxis {
    /// The role of a Gray code stripe along it.
    #[must_use]
    pub const fn stripe(self, bit: u8, inverse: bool) -> Role {
        match self {
            Self::Column => Role::Column { bit, inverse },
            Self::Row => Role::Row { bit, inverse },
        }
    }
}

/// What a pattern was shown for.
///
/// [`fmt::Display`] writes and [`Role::from_name`] reads the name that stands in
/// `capture.csv`: `white`, `black`, `column-B`, `column-B-inverse`, `row-B`,
/// `row-B-inverse`, `bernoulli`, `image`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum Role {
    /// Every cell lit: the flood photograph.
    White,
    /// No cell lit: ambient light and the projector's black.
    Black,
    /// Gray code of the column index.
    Column {
        /// Bit of the Gray code, 0 the most significant.
        bit: u8,
        /// Whether lit and dark are exchanged.
        inverse: bool,
    },
    /// Gray code of the row index.
    Row {
        /// Bit of the Gray code, 0 the most significant.
        bit: u8,
        /// Whether lit and dark are exchanged.
        inverse: bool,
    },
    /// Independent random cells, each lit with probability one half.
    Bernoulli,
    /// Any picture, grey or in colour, of the grid's size or the projector's.
    Image,
}

impl Role {
    /// Bits that a Gray code of at most 65,535 columns or rows can have.
    pub const MAX_BITS: u8 = 16;

    /// Reads a role's name; `None` if it is not one.
    ///
    /// ```
    /// use iltm_capture::Role;
    /// let role = Role::from_name("column-3-inverse");
    /// assert_eq!(role, Some(Role::Column { bit: 3, inverse: true }));
    /// assert_eq!(Role::from_name("diagonal-3"), None);
    /// ```
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "white" => return Some(Self::White),
            "black" => return Some(Self::Black),
            "bernoulli" => return Some(Self::Bernoulli),
            "image" => return Some(Self::Image),
            _ => {}
        }
        let (axis, rest) = name.split_once('-')?;
        let (digits, inverse) = match rest.strip_suffix("-inverse") {
            Some(digits) => (digits, true),
            None => (rest, false),
        };
        // `parse` alone would also take "+3" and "03", which no one writes.
        let bit: u8 = digits.parse().ok()?;
        if bit >= Self::MAX_BITS || digits != bit.to_string() {
            return None;
        }
        match axis {
            "column" => Some(Self::Column { bit, inverse }),
            "row" => Some(Self::Row { bit, inverse }),
            _ => None,
        }
    }

    /// Axis, bit and whether it is the inverse, of a Gray code stripe; `None` for others.
    #[must_use]
    pub const fn as_stripe(self) -> Option<(CodeAxis, u8, bool)> {
        match self {
            Self::Column { bit, inverse } => Some((CodeAxis::Column, bit, inverse)),
            Self::Row { bit, inverse } => Some((CodeAxis::Row, bit, inverse)),
            Self::White | Self::Black | Self::Bernoulli | Self::Image => None,
        }
    }

    /// Whether it tells each cell's light from that of the others: a random pattern or a picture.
    #[must_use]
    pub const fn is_content(self) -> bool {
        matches!(self, Self::Bernoulli | Self::Image)
    }

    /// The same stripes with lit and dark exchanged; `None` for a role that is
    /// not a Gray code stripe.
    #[must_use]
    pub fn complement(self) -> Option<Self> {
        let (axis, bit, inverse) = self.as_stripe()?;
        Some(axis.stripe(bit, !inverse))
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some((axis, bit, inverse)) = self.as_stripe() else {
            return f.write_str(match self {
                Self::White => "white",
                Self::Black => "black",
                Self::Image => "image",
                _ => "bernoulli",
            });
        };
        write!(f, "{axis}-{bit}{}", if inverse { "-inverse" } else { "" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_role_is_read_back_from_its_name() {
        let mut roles = vec![Role::White, Role::Black, Role::Bernoulli, Role::Image];
        for bit in 0..Role::MAX_BITS {
            for inverse in [false, true] {
                roles.push(Role::Column { bit, inverse });
                roles.push(Role::Row { bit, inverse });
            }
        }
        for role in roles {
            assert_eq!(Role::from_name(&role.to_string()), Some(role));
        }
    }

    #[test]
    fn names_that_only_look_like_roles_are_refused() {
        for name in [
            "",
            "White",
            "column",
            "column-",
            "column-+1",
            "column-01",
            "column-16",
            "row--1",
            "row-1-",
            "row-1-inverse-inverse",
            "bernoulli-1",
            "column-1 ",
        ] {
            assert_eq!(Role::from_name(name), None, "{name:?}");
        }
    }

    proptest! {
        #[test]
        fn a_name_that_is_read_is_written_the_same(name in "(column|row)?-?[0-9]{0,3}(-inverse)?") {
            if let Some(role) = Role::from_name(&name) {
                prop_assert_eq!(role.to_string(), name);
            }
        }
    }
}
