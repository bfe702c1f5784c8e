//! Requests about tables. Each may be repeated without harm, and is
//! until it is answered.

use super::client::{Client, unexpected};
use super::{DeviceError, Line, Patience};
use iltm_runtime::link::{Digest, InUse, Receiving, Refusal, Request, Response, Sectors, Slots};
use iltm_runtime::trust::Deed;
use std::time::Duration;

/// A device checks the whole table, signature included, while frames go on; until then
/// it may not answer at all.
const CHECK: Patience = Patience {
    answer: Duration::from_secs(4),
    tries: 8,
};

impl<L: Line> Client<L> {
    /// What is in the slots, and who may change it.
    ///
    /// # Errors
    /// [`DeviceError`] if the device does not answer, or not this.
    pub fn slots(&mut self) -> Result<Slots, DeviceError> {
        match self.transport.ask(Request::Slots)? {
            Response::Slots(slots) => Ok(slots),
            other => Err(unexpected(Request::Slots, &other)),
        }
    }

    /// CRC-32 of some sectors of the slot that the next table goes to, from `first` on,
    /// for a table of `length` bytes.
    ///
    /// # Errors
    /// [`DeviceError`]; [`Refusal::TooLong`] if no such table fits.
    pub fn sectors(&mut self, length: u32, first: u32) -> Result<Sectors, DeviceError> {
        let request = Request::Sectors { length, first };
        match self.transport.ask(request)? {
            Response::Sectors(sectors) => Ok(sectors),
            other => Err(unexpected(request, &other)),
        }
    }

    /// The right to do something on a device with a key, signed for its next commit
    /// record; empty where nobody signs or the device has no key.
    fn right(&mut self, deed: &Deed) -> Result<Vec<u8>, DeviceError> {
        if self.authority.is_none() {
            return Ok(Vec::new());
        }
        let slots = self.slots()?;
        let authority = self.authority.as_ref().filter(|_| slots.key.is_some());
        let right = authority.map(|it| it.right(deed, slots.device, slots.sequence));
        Ok(right.unwrap_or_default())
    }

    /// For a request with this right: to verify a signature takes a device a while.
    fn patience(&self, right: &[u8]) -> Patience {
        if right.is_empty() {
            self.transport.patience()
        } else {
            CHECK
        }
    }

    /// Announces a file.
    ///
    /// # Errors
    /// [`DeviceError`]; [`Refusal::OnTrial`] while another table is on trial.
    pub fn begin(&mut self, length: u32, digest: Digest) -> Result<Receiving, DeviceError> {
        let right = self.right(&Deed::Begin { length, digest })?;
        let request = Request::Begin {
            length,
            digest,
            right: &right,
        };
        let patience = self.patience(&right);
        match self.transport.ask_patiently(request, patience)? {
            Response::Receiving(receiving) => Ok(receiving),
            other => Err(unexpected(request, &other)),
        }
    }

    /// Sends one chunk and waits until the flash holds it. [`upload`](super::upload)
    /// keeps several on their way.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn write(&mut self, transfer: u32, offset: u32, bytes: &[u8]) -> Result<(), DeviceError> {
        let request = Request::Write {
            transfer,
            offset,
            bytes,
        };
        match self.transport.ask(request)? {
            Response::Written => Ok(()),
            other => Err(unexpected(request, &other)),
        }
    }

    /// Has the device check the file that it received and use it on trial, for whole
    /// seconds.
    ///
    /// # Errors
    /// [`DeviceError`]; [`Refusal::Table`] if it must not be used.
    pub fn activate(&mut self, transfer: u32, trial: Duration) -> Result<InUse, DeviceError> {
        let request = Request::Activate {
            transfer,
            trial_s: u16::try_from(trial.as_secs()).unwrap_or(u16::MAX),
        };
        match self.transport.ask_patiently(request, CHECK)? {
            Response::InUse(in_use) => Ok(in_use),
            other => Err(unexpected(request, &other)),
        }
    }

    /// Keeps the table with this id, which is on trial.
    ///
    /// # Errors
    /// [`DeviceError`]; [`Refusal::NotInUse`] if another one is in use by now.
    pub fn confirm(&mut self, table: u32) -> Result<InUse, DeviceError> {
        let right = self.right(&Deed::Confirm { table })?;
        let right = &right;
        let request = Request::Confirm { table, right };
        let patience = self.patience(right);
        match self.transport.ask_patiently(request, patience)? {
            Response::InUse(in_use) => Ok(in_use),
            other => Err(unexpected(request, &other)),
        }
    }

    /// Goes back from the table with this id, which is in use, to the one before.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn rollback(&mut self, table: u32) -> Result<InUse, DeviceError> {
        let right = self.right(&Deed::Rollback { table })?;
        let right = &right;
        let request = Request::Rollback { table, right };
        match self.transport.ask_patiently(request, CHECK)? {
            Response::InUse(in_use) => Ok(in_use),
            // The answer to an earlier copy of the request was lost: the table has gone.
            Response::Refused(Refusal::NotInUse { table }) => Ok(InUse { table, trial_ms: 0 }),
            other => Err(unexpected(request, &other)),
        }
    }

    /// Gives a device that has none its public key and its number, for good; `even_so` if
    /// the table in use is not signed for it.
    ///
    /// # Errors
    /// [`DeviceError`]; [`Refusal::HasKey`] if it has others; [`Refusal::Table`] if the
    /// table in use would be refused from the next start on.
    pub fn provision(
        &mut self,
        key: [u8; 32],
        device: u64,
        even_so: bool,
    ) -> Result<(), DeviceError> {
        let request = Request::Provision {
            key,
            device,
            even_so,
        };
        match self.transport.ask_patiently(request, CHECK)? {
            Response::Provisioned => Ok(()),
            other => Err(unexpected(request, &other)),
        }
    }
}
