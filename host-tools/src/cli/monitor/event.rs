//! Events of a monitored device, in words for people and as data for programs.

use super::super::words;
use crate::device::logs::LogMessage;
use iltm_runtime::link::{Event, Hello, Slots, TierReason};
use serde_json::{Value, json};

/// Something that happened to or at a device.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum MonitorEvent {
    Connected(Hello),
    /// What is in the slots, and how long the table in use is on trial yet.
    Slots(Box<Slots>),
    /// The device says so.
    Device(Event),
    Log(LogMessage),
    /// Log messages whose words nobody gave.
    UnreadLog {
        bytes: usize,
    },
    /// The device said more than came.
    Missed {
        what: &'static str,
        count: u16,
    },
    /// The device does not answer any more; it is tried again.
    Lost(String),
    /// The device answers and knows nothing of the conversation.
    Restarted,
}

impl MonitorEvent {
    /// In words; a status has too many.
    pub(super) fn words(&self) -> Option<String> {
        Some(match self {
            Self::Connected(device) => {
                format!(
                    "connected to {}, firmware {}",
                    device.board, device.firmware
                )
            }
            Self::Slots(slots) => match words::in_use(slots) {
                Some(table) if slots.trial_ms > 0 => format!(
                    "table {table} is on trial for {} s more",
                    slots.trial_ms.div_ceil(1_000)
                ),
                Some(table) => format!("table {table} is in use"),
                None => "no table is in use".to_owned(),
            },
            Self::Device(event) => match event {
                Event::Status(_) => return None,
                Event::TierChanged {
                    from,
                    to,
                    reason,
                    frame,
                } => format!("tier {from} to {to} at frame {frame}: {reason}"),
                Event::Fault(fault) => fault.to_string(),
                Event::TableChanged {
                    table: Some(table),
                    reason,
                    frame,
                } => format!("table {table} from frame {frame} on: {reason}"),
                Event::TableChanged {
                    table: None,
                    reason,
                    frame,
                } => format!("no table from frame {frame} on: {reason}"),
            },
            Self::Log(message) => {
                let words = [&message.time, &message.level, &message.text];
                let words: Vec<&str> = words.into_iter().map(|word| word.trim()).collect();
                words.join(" ").trim_start().to_owned()
            }
            Self::UnreadLog { bytes } => {
                format!("{bytes} bytes of log; --firmware ELF shows the words")
            }
            Self::Missed { what, count } => format!("{count} {what} frames were lost on the line"),
            Self::Lost(why) => format!("lost: {why}; trying again"),
            Self::Restarted => "the device has restarted".to_owned(),
        })
    }

    /// For programs.
    pub(super) fn data(&self) -> Value {
        match self {
            Self::Connected(device) => {
                let mut data = words::identity(device);
                data["event"] = json!("connected");
                data
            }
            Self::Slots(slots) => {
                let mut data = words::slots_data(slots);
                data["event"] = json!("slots");
                data
            }
            Self::Device(event) => from_device(event),
            Self::Log(message) => json!({
                "event": "log",
                "time": message.time,
                "level": message.level,
                "message": message.text,
            }),
            Self::UnreadLog { bytes } => json!({ "event": "log", "bytes": bytes }),
            Self::Missed { what, count } => {
                json!({ "event": "missed", "what": what, "count": count })
            }
            Self::Lost(why) => json!({ "event": "lost", "message": why }),
            Self::Restarted => json!({ "event": "restarted" }),
        }
    }
}

fn from_device(event: &Event) -> Value {
    match event {
        Event::Status(status) => {
            let mut data = words::status_data(status);
            data["event"] = json!("status");
            data
        }
        Event::TierChanged {
            from,
            to,
            reason,
            frame,
        } => json!({
            "event": "tier",
            "from": from,
            "to": to,
            "reason": match reason {
                TierReason::OverBudget => "over-budget",
                TierReason::TimeToSpare => "time-to-spare",
                TierReason::NewStart => "new-start",
            },
            "frame": frame,
        }),
        Event::Fault(fault) => json!({ "event": "fault", "message": fault.to_string() }),
        Event::TableChanged {
            table,
            reason,
            frame,
        } => json!({
            "event": "table",
            "table": words::table_name(*table),
            "reason": words::table_reason(*reason),
            "frame": frame,
        }),
    }
}
