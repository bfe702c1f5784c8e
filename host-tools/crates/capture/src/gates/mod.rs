//! What a capture must show before it is solved, each with a number, a limit, a
//! sentence and a next step.
//!
//! | gate | question | file |
//! |---|---|---|
//! | `complete` | is every photograph there, once? | `complete.rs` |
//! | `format` | have all one size, and values that mean light? | `format.rs` |
//! | `saturation` | is white below the camera's limit? | `saturation.rs` |
//! | `order` | does every photograph show its own pattern? | `order.rs` |
//! | `coverage` | which cells does the camera see? | `coverage.rs` |
//! | `movement` | did camera, projector and scene stand still? | `movement.rs` |
//! | `drift` | did lamp or lens change slowly? | `drift.rs` |
//! | `flicker` | does brightness jump from photograph to photograph, or row to row? | `flicker.rs`, `bands.rs` |
//! | `superposition` | does light add up? | `superposition.rs`, `cause.rs` |
//! | `response` | which curve makes it add up best? | `response.rs` |
//! | `noise` | how much of the result will be the camera's noise? | `noise.rs` |
//!
//! A gate that fails refuses the capture; one that warns does not. What a gate was
//! judged from goes along as [`Evidence`], for whoever draws it.

mod bands;
pub(super) mod cause;
pub(super) mod complete;
pub(super) mod coverage;
pub(super) mod drift;
pub(super) mod flicker;
pub(super) mod format;
pub(super) mod movement;
pub(super) mod noise;
pub(super) mod order;
pub(super) mod response;
pub(super) mod saturation;
pub(super) mod superposition;

use std::fmt;
use std::str::FromStr;

/// The gates, in the order in which they are told: what explains others first.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
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
    pub const ALL: [Self; 11] = [
        Self::Complete,
        Self::Format,
        Self::Saturation,
        Self::Order,
        Self::Coverage,
        Self::Movement,
        Self::Drift,
        Self::Flicker,
        Self::Superposition,
        Self::Response,
        Self::Noise,
    ];

    /// Its name, as `--ignore` takes it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Complete => "complete",
            Self::Format => "format",
            Self::Saturation => "saturation",
            Self::Order => "order",
            Self::Coverage => "coverage",
            Self::Movement => "movement",
            Self::Drift => "drift",
            Self::Flicker => "flicker",
            Self::Superposition => "superposition",
            Self::Response => "response",
            Self::Noise => "noise",
        }
    }
}

impl fmt::Display for GateName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for GateName {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|gate| gate.name() == name);
        found.ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|gate| gate.name()).collect();
            format!("no gate has this name; they are {}", names.join(", "))
        })
    }
}

/// What a gate says.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
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
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::NotJudged => "not-judged",
            Self::Warn => "warn",
            Self::Fail => "fail",
        }
    }

    /// Of a number with two limits.
    pub(super) fn of(number: f64, warn: f64, fail: f64) -> Self {
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

impl Gate {
    /// A gate that has nothing to look at.
    pub(super) fn not_judged(name: GateName, why: impl Into<String>) -> Self {
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

/// Puts gates in order and takes back what only follows from a gate that fails
/// before: numbers of photographs that show other patterns mean nothing.
pub(super) fn settle(gates: &mut [Gate], cause: Option<cause::Cause>) {
    gates.sort_by_key(|gate| gate.name);
    let fails = |name: GateName| gates.iter().any(|gate| gate.name == name && gate.fails());
    let (order, movement) = (fails(GateName::Order), fails(GateName::Movement));
    let known = cause.is_some_and(cause::Cause::is_known) && fails(GateName::Superposition);
    let flicker = fails(GateName::Flicker);
    for gate in gates {
        let because = match gate.name {
            GateName::Order | GateName::Complete | GateName::Format | GateName::Saturation => None,
            _ if order => Some(GateName::Order),
            GateName::Movement | GateName::Coverage => None,
            _ if movement => Some(GateName::Movement),
            GateName::Flicker | GateName::Drift | GateName::Noise if known => {
                Some(GateName::Superposition)
            }
            GateName::Superposition | GateName::Response | GateName::Noise if !known && flicker => {
                Some(GateName::Flicker)
            }
            _ => None,
        };
        if let Some(because) = because.filter(|_| gate.verdict != Verdict::Pass) {
            let why = format!("cannot be judged before `{because}` passes");
            *gate = Gate::not_judged(gate.name, why);
        }
    }
}

/// Some indices for people: `3, 7, 8 and 12 more`.
pub(super) fn listed(items: impl IntoIterator<Item = impl fmt::Display>, most: usize) -> String {
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
            assert_eq!(gate.to_string().parse(), Ok(gate));
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
