//! Which table a device uses, for whoever wants to know after something went wrong.

use super::status::table_name;
use crate::device::{Client, DeviceError, Line};
use iltm_runtime::link::{Refusal, TableName};
use serde_json::{Value, json};
use std::fmt;

/// Which table a device uses.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Active {
    /// The device says so.
    Known {
        table: Option<TableName>,
        trial_ms: u32,
    },
    /// It does not answer.
    Unknown,
    /// It was not asked, nor sent anything.
    Untouched,
}

impl Active {
    /// Asks the device again.
    pub(super) fn ask<L: Line>(client: &mut Client<L>) -> Self {
        let slots = match client.slots() {
            Err(DeviceError::Refused {
                refusal: Refusal::HelloFirst,
                ..
            }) => client.greet_again().and_then(|()| client.slots()),
            other => other,
        };
        match slots {
            Ok(slots) => Self::Known {
                table: super::slots::in_use(&slots),
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
