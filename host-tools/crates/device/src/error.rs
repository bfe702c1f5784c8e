//! Errors of a conversation with a device, and what to do about each.

use iltm_runtime::{
    link::{PROTOCOL_VERSION, Refusal},
    trust::{NoRight, Rejected},
};
use std::io;

/// Why a device could not be spoken to. [`DeviceError::next_step`] says what to
/// do about it.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// The port could not be opened.
    #[error("the port cannot be opened: {source}{}", held_by(holder.as_ref()))]
    Open {
        /// What the operating system says.
        source: serialport::Error,
        /// The program that has it open, where that can be told.
        holder: Option<String>,
    },
    /// The port was there and is not any more.
    #[error("the port has gone: {source}")]
    Gone {
        /// What the operating system says.
        source: io::Error,
    },
    /// Nothing came back that is an answer.
    #[error("no answer after asking {tries} times in {seconds:.1} s; {heard}")]
    NoAnswer {
        /// How often it was asked.
        tries: u32,
        /// How long that took.
        seconds: f64,
        /// What did come back.
        heard: Heard,
    },
    /// The device speaks another version.
    #[error(
        "the device speaks version {device} of the protocol; these host tools speak version {}",
        PROTOCOL_VERSION
    )]
    Protocol {
        /// The device's version.
        device: u16,
    },
    /// The device did not do what it was asked.
    #[error("the device refuses the request \"{request}\": {refusal}")]
    Refused {
        /// What it was asked.
        request: &'static str,
        /// Why not.
        refusal: Refusal,
    },
    /// Another device answers now.
    #[error("another device answers than before")]
    Exchanged,
    /// The answer belongs to another request, or cannot be read.
    #[error("the device answers the request \"{request}\" with something else")]
    Answer {
        /// What it was asked.
        request: &'static str,
    },
}

fn held_by(holder: Option<&String>) -> String {
    holder.map_or_else(String::new, |holder| format!("; {holder} has it open"))
}

/// What came over a line while an answer was awaited.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Heard {
    /// Bytes.
    pub bytes: u64,
    /// Whole frames.
    pub frames: u64,
}

impl std::fmt::Display for Heard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (self.bytes, self.frames) {
            (0, _) => f.write_str("the line is silent"),
            (bytes, 0) => write!(f, "{bytes} bytes came, none of them an iltm frame"),
            (_, frames) => write!(f, "{frames} frames came, none of them the answer"),
        }
    }
}

impl DeviceError {
    /// What to do about it.
    #[must_use]
    pub fn next_step(&self) -> &'static str {
        match self {
            Self::Open {
                holder: Some(_), ..
            } => "End that program, or ask it to let go of the port, and try again.",
            Self::Open { source, .. } => match source.kind() {
                serialport::ErrorKind::NoDevice => {
                    "Check the name and the cable, and close other programs that use the port."
                }
                serialport::ErrorKind::Io(io::ErrorKind::PermissionDenied) => {
                    "Join the group that owns the port: `sudo usermod -aG dialout $USER`, then log in again."
                }
                _ => "Check the name: `ls /dev/tty*` before and after plugging the device in.",
            },
            Self::Gone { .. } => "Check the cable and the device's power, then try again.",
            Self::NoAnswer { heard, .. } if heard.bytes > 0 && heard.frames == 0 => {
                "Give the device's speed with --baud, or another --port: something else speaks there."
            }
            Self::NoAnswer { .. } => {
                "Check that the device has power, that the cable is the right one, and try another --port or --baud."
            }
            Self::Protocol { device } if *device > PROTOCOL_VERSION => {
                "Use the host tools of the firmware's version, or later ones."
            }
            Self::Protocol { .. } => "Bring the device's firmware up to date.",
            Self::Refused { refusal, .. } => refusal_next_step(refusal),
            Self::Exchanged => "Plug the device back in and start again.",
            Self::Answer { .. } => "Use host tools and firmware of the same version.",
        }
    }
}

/// What to do about a refusal.
const fn refusal_next_step(refusal: &Refusal) -> &'static str {
    match refusal {
        Refusal::HelloFirst => "The device has just restarted: try again.",
        Refusal::Unknown | Refusal::Malformed | Refusal::Chunk => {
            "Use host tools and firmware of the same version."
        }
        Refusal::NoTransfer | Refusal::Incomplete => {
            "Run `iltm flash` again: it goes on where it stopped."
        }
        Refusal::TooLong { .. } => "Solve for a coarser grid.",
        Refusal::OnTrial => "Run `iltm confirm` to keep that table, or `iltm rollback`, first.",
        Refusal::Flash { .. } => {
            "Try once more; if it happens again the device's flash is worn out."
        }
        Refusal::Table(rejected) => rejection_next_step(rejected),
        Refusal::NotInUse { .. } => "Run `iltm status` to see which table is in use.",
        Refusal::NoOther => "Flash the table that you want instead.",
        Refusal::HasKey => {
            "A device keeps its key for good: sign tables with that key (`iltm status` shows its id)."
        }
        Refusal::ReadOnly => {
            "The device has no flash for tables, or no room for records: ask who built its firmware."
        }
        Refusal::KeyLost => {
            "Restart the device. If it says so again, its key has rotted in its flash: it must be written anew through the debug port."
        }
        Refusal::NoRight(cause) => right_next_step(cause),
        Refusal::Wear { .. } => {
            "Find out who keeps writing to the device; restart it, or wait, and try again."
        }
    }
}

/// What to do about a right that a device does not accept.
const fn right_next_step(cause: &NoRight) -> &'static str {
    match cause {
        NoRight::Missing => {
            "Give --key with the site's key, or with a technician's key that `iltm key technician` made."
        }
        NoRight::Signature => {
            "The key of --key is not the device's key: compare `iltm key show FILE` with `iltm status`. If they are the same, the device's state has changed meanwhile: try again."
        }
        NoRight::Certificate => {
            "Give a technician's key that was made with this device's key (`iltm status` shows its id)."
        }
        NoRight::OtherDevice { .. } => {
            "Give a technician's key for this device or for any: `iltm key technician`."
        }
        NoRight::Revoked { .. } => "Ask for a new technician's key: `iltm key technician`.",
    }
}

/// What to do about a table that a device does not take.
#[must_use]
pub const fn rejection_next_step(rejected: &Rejected) -> &'static str {
    match rejected {
        Rejected::NotATable | Rejected::Truncated | Rejected::Damaged | Rejected::Contents => {
            "Copy the table again, or make it anew with `iltm solve`."
        }
        Rejected::Format => "Use host tools and firmware of the same version.",
        Rejected::Unsigned => "Sign it: `iltm sign TABLE --key FILE` with the device's key.",
        Rejected::WrongKey => {
            "Sign it with the device's own key: `iltm key show FILE` says a key's id, `iltm status` the device's."
        }
        Rejected::Signature => "Sign it again: `iltm sign TABLE --key FILE`.",
        Rejected::Older { .. } => {
            "Flash a newer table, or sign this one with a higher --table-version."
        }
        Rejected::OtherDevice { .. } => {
            "Take this device's table, or sign this one with --for-device."
        }
        Rejected::NotBuilt { .. } => {
            "Put firmware with all stages on the device, or make the table without that effect."
        }
    }
}
