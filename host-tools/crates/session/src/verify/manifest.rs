//! `verify.csv`: its lines, and the names of what each picture was shown for.

use iltm_capture::{ListedRole, ManifestOf, Role, ShotOf, VERIFY_FILE};
use std::fmt;

/// All lines of a `verify.csv`, ordered by index.
pub type VerifyManifest = ManifestOf<VerifyRole>;

/// One line of `verify.csv`.
pub type VerifyShot = ShotOf<VerifyRole>;

/// What a picture of `verify.csv` was shown for.
///
/// [`fmt::Display`] writes and [`VerifyRole::from_name`] reads the name that stands
/// there: `white`, `black`, `column-B`, `column-B-inverse`, `row-B`, `row-B-inverse`,
/// `bernoulli`, `plain-K`, `compensated-K`, `wanted-K`, `fine-plain-K`, `fine-compensated-K`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Hash)]
pub enum VerifyRole {
    /// To find the cells: any role of `capture.csv`.
    Code(Role),
    /// Test image K as it is.
    Plain(u8),
    /// Test image K, compensated.
    Compensated(u8),
    /// Test image K as it should look, for a chain that compensates.
    Wanted(u8),
    /// Test image K of the projector's own pixels, as it is.
    FinePlain(u8),
    /// The same, compensated.
    FineCompensated(u8),
}

impl VerifyRole {
    /// Reads a role's name; `None` if it is not one.
    ///
    /// ```
    /// use iltm_session::verify::VerifyRole;
    /// assert_eq!(VerifyRole::from_name("plain-3"), Some(VerifyRole::Plain(3)));
    /// assert_eq!(VerifyRole::from_name("plain-03"), None);
    /// ```
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let number = |digits: &str| {
            // `parse` alone would also take "+3" and "03", which no one writes.
            let image: u8 = digits.parse().ok()?;
            (digits == image.to_string()).then_some(image)
        };
        let image = |prefix: &str| name.strip_prefix(prefix);
        if let Some(digits) = image("plain-") {
            number(digits).map(Self::Plain)
        } else if let Some(digits) = image("compensated-") {
            number(digits).map(Self::Compensated)
        } else if let Some(digits) = image("wanted-") {
            number(digits).map(Self::Wanted)
        } else if let Some(digits) = image("fine-plain-") {
            number(digits).map(Self::FinePlain)
        } else if let Some(digits) = image("fine-compensated-") {
            number(digits).map(Self::FineCompensated)
        } else {
            Role::from_name(name).map(Self::Code)
        }
    }
}

impl fmt::Display for VerifyRole {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Code(role) => role.fmt(f),
            Self::Plain(image) => write!(f, "plain-{image}"),
            Self::Compensated(image) => write!(f, "compensated-{image}"),
            Self::Wanted(image) => write!(f, "wanted-{image}"),
            Self::FinePlain(image) => write!(f, "fine-plain-{image}"),
            Self::FineCompensated(image) => write!(f, "fine-compensated-{image}"),
        }
    }
}

impl ListedRole for VerifyRole {
    const FILE: &'static str = VERIFY_FILE;

    fn from_name(name: &str) -> Option<Self> {
        Self::from_name(name)
    }

    fn unknown(role: &str) -> String {
        format!(
            "unknown role \"{role}\"; it must be white, black, column-B, row-B (the latter \
             two also with -inverse), bernoulli, plain-K, compensated-K or wanted-K (the first \
             two also with fine-)"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_role_is_read_back_from_its_name() {
        let stripes = Role::Column {
            bit: 2,
            inverse: true,
        };
        let codes = [Role::White, Role::Black, stripes].map(VerifyRole::Code);
        let images = [0, 1, 10, 255].map(VerifyRole::Plain);
        let compensated = [0, 1, 10, 255].map(VerifyRole::Compensated);
        let wanted = [0, 1, 10, 255].map(VerifyRole::Wanted);
        let fine = [0, 1, 10, 255]
            .map(|image| {
                [
                    VerifyRole::FinePlain(image),
                    VerifyRole::FineCompensated(image),
                ]
            })
            .concat();
        for role in [&codes[..], &images, &compensated, &wanted, &fine].concat() {
            assert_eq!(VerifyRole::from_name(&role.to_string()), Some(role));
        }
    }

    #[test]
    fn an_unknown_role_is_told_which_ones_there_are() {
        let text = VerifyRole::unknown("flat");
        for word in ["\"flat\"", "plain-K", "wanted-K", "fine-", "bernoulli"] {
            assert!(text.contains(word), "{text}");
        }
    }
}
