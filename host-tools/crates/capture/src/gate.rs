//! Gate: a number, a limit, a verdict, a sentence and a next step on one question that a
//! capture must pass before it is solved. [`gates`](crate::gates) judges.

use iltm_runtime::Grid;
use std::fmt;
use std::str::FromStr;

/// The gates, in the order in which they are told: what explains others first.
#[derive(
    Clone,
    Copy,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Hash,
    Debug,
    strum::Display,
    strum::IntoStaticStr,
    strum::VariantArray,
)]
#[strum(serialize_all = "kebab-case")]
pub enum GateName {
    /// Every photograph is there, once.
    Complete,
    /// All photographs have one size, and values that mean light.
    Format,
    /// White is below the camera's full scale.
    Saturation,
    /// Every photograph shows the pattern of its line.
    Order,
    /// Cells were found.
    Coverage,
    /// Nothing moved.
    Movement,
    /// Brightness changed slowly, and by little.
    Drift,
    /// Brightness does not jump.
    Flicker,
    /// Light adds up.
    Superposition,
    /// The declared responses are those of the devices.
    Response,
    /// The camera's noise is small enough.
    Noise,
}

impl GateName {
    /// All of them, in order.
    pub const ALL: &'static [Self] = <Self as strum::VariantArray>::VARIANTS;

    /// Its name, as `--ignore` takes it.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.into()
    }
}

impl FromStr for GateName {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.iter().find(|gate| gate.name() == name);
        found.copied().ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|gate| gate.name()).collect();
            format!("no gate has this name; they are {}", names.join(", "))
        })
    }
}

/// What a gate says.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, strum::IntoStaticStr)]
#[strum(serialize_all = "kebab-case")]
pub enum Verdict {
    /// Nothing is wrong.
    Pass,
    /// The capture does not hold what the gate looks at.
    NotJudged,
    /// Something is not as it should be, and can be lived with.
    Warn,
    /// The capture cannot be used as it is.
    Fail,
}

impl Verdict {
    /// Its name for programs.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.into()
    }

    /// Of a number with two limits.
    pub(crate) fn of(number: f64, warn: f64, fail: f64) -> Self {
        // What is not a number is never good.
        if !number.is_finite() || number > fail {
            Self::Fail
        } else if number > warn {
            Self::Warn
        } else {
            Self::Pass
        }
    }
}

/// One gate's verdict on a capture.
#[derive(Clone, PartialEq, Debug)]
pub struct Gate {
    /// Which gate.
    pub name: GateName,
    /// What it says.
    pub verdict: Verdict,
    /// What it measured; 0 if it could not be measured.
    pub number: f64,
    /// Above this the capture is refused.
    pub limit: f64,
    /// Unit of both, `%` for parts of a hundred.
    pub unit: &'static str,
    /// What was found, one sentence, with the likely cause.
    pub what: String,
    /// What to do about it, one sentence; empty if nothing.
    pub next_step: &'static str,
    /// What the number was taken from.
    pub evidence: Evidence,
}

/// What a gate's number was taken from.
#[derive(Clone, PartialEq, Debug)]
pub enum Evidence {
    /// There is nothing to draw.
    None,
    /// A number for each photograph.
    Photographs {
        /// What the number is, with its unit.
        what: &'static str,
        /// `index` of the photograph and its number.
        values: Vec<(u32, f64)>,
        /// Where the gate's limit lies, if it is one of this number.
        limit: Option<f64>,
        /// `index` of the first photograph after which all is otherwise, if there is one.
        from: Option<u32>,
    },
    /// A number for each cell, `rows x cols`, row by row; NaN for none.
    Cells {
        /// What the number is, with its unit.
        what: &'static str,
        /// Rows of the grid.
        rows: usize,
        /// Columns of the grid.
        cols: usize,
        /// The numbers.
        values: Vec<f64>,
        /// A number that is worth a look: smaller ones are drawn as small, whatever the
        /// largest is. 0 where the size says nothing.
        notable: f64,
    },
    /// Points and a curve that should go through them.
    Curve {
        /// What is to the right.
        x: &'static str,
        /// What is upwards.
        y: &'static str,
        /// The points.
        points: Vec<(f64, f64)>,
    },
}

impl Evidence {
    /// A number for each cell of a grid.
    pub(crate) fn cells(what: &'static str, grid: Grid, values: Vec<f64>, notable: f64) -> Self {
        let (rows, cols) = (grid.rows(), grid.cols());
        Self::Cells {
            what,
            rows,
            cols,
            values,
            notable,
        }
    }
}

impl Gate {
    /// A gate that has nothing to look at.
    pub(crate) fn not_judged(name: GateName, why: impl Into<String>) -> Self {
        Self {
            name,
            verdict: Verdict::NotJudged,
            number: 0.0,
            limit: 0.0,
            unit: "",
            what: why.into(),
            next_step: "",
            evidence: Evidence::None,
        }
    }

    /// A gate on a share of something, in parts of a hundred, without words yet. The next
    /// step is one unless it passes.
    pub(crate) fn of_share(
        name: GateName,
        verdict: Verdict,
        (share, most): (f64, f64),
        next_step: &'static str,
    ) -> Self {
        Self {
            verdict,
            number: 100.0 * share,
            limit: 100.0 * most,
            unit: "%",
            next_step: if verdict == Verdict::Pass {
                ""
            } else {
                next_step
            },
            ..Self::not_judged(name, "")
        }
    }

    /// Its number against its limit, for people.
    #[must_use]
    pub fn number_and_limit(&self) -> String {
        let whole = self.number.fract() == 0.0 && self.limit.fract() == 0.0;
        let digits = if whole { 0 } else { 2 };
        let unit = match self.unit {
            // Nobody needs to be told what is counted where there must be none.
            "photographs" | "complaints" => String::new(),
            unit => format!(" {unit}"),
        };
        format!(
            "{:.digits$}{unit} (limit {:.digits$})",
            self.number, self.limit
        )
    }

    /// Whether the capture is refused for it.
    #[must_use]
    pub fn fails(&self) -> bool {
        self.verdict == Verdict::Fail
    }
}

impl fmt::Display for Gate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.name, self.what)
    }
}

/// Some indices for people: `3, 7, 8 and 12 more`.
pub(crate) fn listed(items: impl IntoIterator<Item = impl fmt::Display>, most: usize) -> String {
    let all: Vec<String> = items.into_iter().map(|item| item.to_string()).collect();
    let more = all.len().saturating_sub(most);
    let shown = all[..all.len() - more].join(", ");
    if more == 0 {
        shown
    } else {
        format!("{shown} and {more} more")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_gate_is_read_back_from_its_name() {
        for gate in GateName::ALL {
            assert_eq!(gate.to_string().parse(), Ok(*gate));
        }
        let error = "exposure".parse::<GateName>().unwrap_err();
        assert!(error.contains("saturation"), "{error}");
    }

    #[test]
    fn what_is_no_number_fails() {
        assert_eq!(Verdict::of(f64::NAN, 1.0, 2.0), Verdict::Fail);
        assert_eq!(Verdict::of(1.5, 1.0, 2.0), Verdict::Warn);
        assert_eq!(Verdict::of(1.0, 1.0, 2.0), Verdict::Pass);
    }

    #[test]
    fn long_lists_are_cut_and_counted() {
        assert_eq!(listed([1, 2, 3], 3), "1, 2, 3");
        assert_eq!(listed([1, 2, 3, 4, 5], 3), "1, 2, 3 and 2 more");
    }
}
