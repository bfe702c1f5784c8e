//! Preflight: checks of a table against a device before anything is sent.

use super::super::failure::{Failure, Kind};
use super::super::tables::{TableSize, check_sealed};
use super::super::words::{CalledTable, key_id, uses};
use crate::compile::sign::is_signed_by;
use crate::device::rejection_next_step;
use ed25519_dalek::VerifyingKey;
use iltm_runtime::{
    image::{Seal, layout::FORMAT_VERSION},
    link::{FrameKind, Hello, Slots, TableAbout, TableName},
    trust::Rejected,
};
use std::path::{Path, PathBuf};

/// A table's file, checked.
#[derive(Debug)]
pub(super) struct CheckedTable {
    path: PathBuf,
    pub(super) called: CalledTable,
    pub(super) size: TableSize,
    seal: Option<Seal>,
}

/// What is to be done with it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Now {
    /// Bring it.
    Send,
    /// Nothing: the device uses it.
    InUse,
    /// A file of this name and length is on trial: the device knows whether it is this
    /// one.
    OnTrial,
}

impl CheckedTable {
    pub(super) fn read(path: &Path, bytes: &[u8]) -> Result<Self, Failure> {
        let (table, seal) = check_sealed(path, bytes)?;
        Ok(Self {
            path: path.to_owned(),
            called: CalledTable {
                name: TableName {
                    id: table.id(),
                    version: seal.map_or(0, |seal| seal.version),
                },
                about: Some(TableAbout {
                    label: *table.label(),
                    frames: FrameKind {
                        width: table.grid().cols() as u16,
                        height: table.grid().rows() as u16,
                        channels: table.channels(),
                    },
                }),
            },
            size: TableSize::new(&table, bytes.len()),
            seal,
        })
    }

    /// Who signed it.
    pub(super) fn signer(&self) -> String {
        self.seal.map_or_else(
            || "not signed".to_owned(),
            |seal| format!("signed with key {}", key_id(&seal.key)),
        )
    }

    /// Whether the device will take it, as far as its terms tell;
    /// [`check_signature`](Self::check_signature) looks at the signature.
    pub(super) fn check(&self, device: &Hello, slots: &Slots) -> Result<Now, Failure> {
        if uses(slots, self.called.name, self.size.bytes) {
            if slots.trial_ms > 0 {
                return Ok(Now::OnTrial);
            }
            if self.tells_all(slots) {
                return Ok(Now::InUse);
            }
        }
        let refused = |kind, why: String, next_step: &str| {
            let message = format!("{}: {why}", self.path.display());
            Err(Failure::new(kind, message, next_step))
        };
        if slots.trial_ms > 0 {
            return Err(self.other_on_trial());
        }
        let limits = &device.limits;
        let (bytes, cells) = (self.size.bytes, self.size.grid.cells());
        if bytes as u64 > u64::from(limits.table_bytes) {
            let why = format!(
                "the table has {bytes} bytes; the device has room for {}",
                limits.table_bytes
            );
            let advice = self.size.advice(limits.table_bytes as usize);
            return refused(Kind::TooLarge, why, &advice);
        }
        if cells as u64 > u64::from(limits.cells) {
            let why = format!(
                "the table has {cells} cells; the device can take {}",
                limits.cells
            );
            return refused(Kind::TooLarge, why, "Solve for a coarser grid.");
        }
        if device.table_format != FORMAT_VERSION {
            let why = format!(
                "the table is of format {FORMAT_VERSION}; the device reads format {}",
                device.table_format
            );
            return refused(Kind::Table, why, rejection_next_step(&Rejected::Format));
        }
        match self.rejected(slots) {
            Some(Rejected::Older { version, floor }) => {
                let why = format!(
                    "the table has version {version}; the device takes {floor} and later ones"
                );
                let rejected = Rejected::Older { version, floor };
                refused((&rejected).into(), why, rejection_next_step(&rejected))
            }
            Some(rejected) => refused(
                (&rejected).into(),
                rejected.to_string(),
                rejection_next_step(&rejected),
            ),
            None => Ok(Now::Send),
        }
    }

    /// Whether the signature is good, where the public key is known: the device would say
    /// so only when all has been sent.
    pub(super) fn check_signature(
        &self,
        file: &[u8],
        site: Option<&VerifyingKey>,
        slots: &Slots,
    ) -> Result<(), Failure> {
        let same = |key: &&VerifyingKey| slots.key == Some(Seal::key_id(key.as_bytes()));
        let good = match (site.filter(same), &self.seal) {
            (Some(site), Some(seal)) => is_signed_by(file, seal, site),
            _ => true,
        };
        if good {
            return Ok(());
        }
        let rejected = Rejected::Signature;
        let message = format!("{}: {rejected}", self.path.display());
        let next_step = rejection_next_step(&rejected);
        Err(Failure::new((&rejected).into(), message, next_step))
    }

    /// A device decides on one table at a time.
    pub(super) fn other_on_trial(&self) -> Failure {
        let message = format!(
            "{}: another table is on trial on the device",
            self.path.display()
        );
        let next_step = "Run `iltm confirm` to keep that one, or `iltm rollback`, first.";
        Failure::new(Kind::OnTrial, message, next_step)
    }

    /// Whether name and length, which the device tells of a table in use, leave no
    /// difference to this file that matters. Of a seal they leave out who signed it,
    /// which a device with a key has verified, and what it revokes: a file that revokes
    /// versions is brought again, or it might never.
    fn tells_all(&self, slots: &Slots) -> bool {
        self.seal
            .is_none_or(|seal| seal.oldest == 0 && slots.key == Some(seal.key))
    }

    /// Why the device's terms do not admit it.
    fn rejected(&self, slots: &Slots) -> Option<Rejected> {
        // A device without a key takes every whole table.
        let key = slots.key?;
        let Some(seal) = self.seal else {
            return Some(Rejected::Unsigned);
        };
        if seal.key != key {
            return Some(Rejected::WrongKey);
        }
        let device = seal.device;
        if device != 0 && device != slots.device {
            return Some(Rejected::OtherDevice { device });
        }
        let (version, floor) = (seal.version, slots.oldest);
        (version < floor).then_some(Rejected::Older { version, floor })
    }
}
