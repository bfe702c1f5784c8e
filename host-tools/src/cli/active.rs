//! Active table of a device, for whoever wants to know after something went wrong.

use super::words::{CalledTable, in_use, table_name};
use crate::device::{Client, DeviceError, Line};
use iltm_runtime::link::{Refusal, Slots};
use serde_json::{Value, json};
use std::fmt;

/// Which table a device uses.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Active {
    /// The device says so.
    Known {
        table: Option<CalledTable>,
        trial_ms: u32,
    },
    /// It does not answer.
    Unknown,
    /// It does not answer any more.
    Lost(Lost),
    /// It was not asked, nor sent anything.
    Untouched,
}

/// A device that was lost during an update.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Lost {
    /// The table in use when it was last asked.
    pub(super) before: Option<CalledTable>,
    /// What it was asked for since.
    pub(super) asked: Asked,
}

/// How far an update had come, as seen from the host: the device may have done what it
/// was asked for last.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Asked {
    /// To receive.
    Transfer,
    /// To use the table on trial.
    Trial,
    /// To keep it.
    Confirmation,
}

impl fmt::Display for Lost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("The device cannot be asked now. ")?;
        let before = match self.before {
            Some(table) => format!("table {table}"),
            None => "no table, frames passing unchanged,".to_owned(),
        };
        match self.asked {
            Asked::Transfer => write!(
                f,
                "It goes on with {before} as before: the new one was not activated."
            ),
            Asked::Trial => write!(
                f,
                "The new table may be on trial; when that is over, or at the next start, the \
                 device goes back to {before} by itself."
            ),
            Asked::Confirmation => write!(
                f,
                "If the confirmation has reached it the new table stays in use; if not, the \
                 device goes back to {before} by itself."
            ),
        }
    }
}

/// The slots of a device that may have restarted.
pub(super) fn slots_now<L: Line>(client: &mut Client<L>) -> Result<Slots, DeviceError> {
    match client.slots() {
        Err(DeviceError::Refused {
            refusal: Refusal::HelloFirst,
            ..
        }) => client.greet_again().and_then(|()| client.slots()),
        other => other,
    }
}

impl Active {
    /// Asks the device again.
    pub(super) fn ask<L: Line>(client: &mut Client<L>) -> Self {
        match slots_now(client) {
            Ok(slots) => Self::Known {
                table: in_use(&slots),
                trial_ms: slots.trial_ms,
            },
            Err(_) => Self::Unknown,
        }
    }

    /// For programs.
    pub(super) fn data(&self) -> Value {
        match self {
            Self::Known { table, trial_ms } => json!({
                "known": true,
                "table": table_name(*table),
                "trial_ms": trial_ms,
            }),
            Self::Unknown | Self::Untouched => json!({ "known": false }),
            Self::Lost(Lost { before, asked }) => json!({
                "known": false,
                "before": table_name(*before),
                "asked": match asked {
                    Asked::Transfer => "transfer",
                    Asked::Trial => "trial",
                    Asked::Confirmation => "confirmation",
                },
            }),
        }
    }
}

impl fmt::Display for Active {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Known {
                table: Some(table),
                trial_ms: 0,
            } => write!(f, "Table {table} is in use."),
            Self::Known {
                table: Some(table),
                trial_ms,
            } => write!(
                f,
                "Table {table} is in use, on trial for {} s more; then the device goes back by itself.",
                trial_ms.div_ceil(1_000)
            ),
            Self::Known { table: None, .. } => {
                f.write_str("No table is in use: frames pass unchanged.")
            }
            Self::Lost(lost) => lost.fmt(f),
            Self::Untouched => {
                f.write_str("Nothing was sent: the device goes on with the table that it has.")
            }
            Self::Unknown => f.write_str(
                "Which table is in use cannot be asked now: the device keeps the one that was \
                 confirmed last, and goes back to it by itself if another is on trial.",
            ),
        }
    }
}
