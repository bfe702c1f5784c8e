//! Brings a file into the slot that a device does not use, whatever breaks meanwhile.
//!
//! ```text
//! compare the slot's sectors -> begin -> chunks of those that differ -> compare again
//!        ^                                                                  |
//!        +---- until all are equal; after a restart of the device ----------+
//! ```
//!
//! | step | file |
//! |---|---|
//! | what has to be sent | [`plan`] |
//! | several chunks on their way at once, each until it is in the flash | `window` |
//!
//! Nothing about a transfer is kept here or there: what the slot holds says what is
//! missing. So it goes on after a restart of either side.

mod error;
pub mod plan;
mod window;

pub use error::UploadError;
pub use plan::{Parcel, Plan};

use super::{Client, DeviceError, Line};
use iltm_runtime::link::{InUse, Refusal};
use std::time::{Duration, Instant};
use window::Window;

/// Without anything new in the flash for so long, a transfer is given up.
pub const PATIENCE: Duration = Duration::from_secs(30);

/// Comparisons in a row that may find no less to send than the best one before.
const ROUNDS: u32 = 8;

/// How often an activation may find that the device has lost the file.
const ACTIVATIONS: u32 = 4;

/// What happens during a transfer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Step {
    /// So far the slot holds `done` bytes of `total`; `skipped` of them were there
    /// before.
    Progress {
        /// Bytes that the slot holds.
        done: u32,
        /// Bytes that it held when the transfer began.
        skipped: u32,
        /// Bytes of the file.
        total: u32,
    },
    /// Nothing has come back for a while; it is tried again.
    Quiet {
        /// How long.
        silence: Duration,
    },
    /// The device has restarted, or forgotten the transfer; it begins anew.
    Restarted,
    /// The flash did not take a sector; it is sent once more.
    Repeated {
        /// Its index.
        sector: u32,
    },
    /// The slot holds the whole file.
    Verified,
}

/// Somebody who is told, and may stop it.
pub trait Watch {
    /// Something happened.
    fn step(&mut self, step: Step);

    /// Whether to stop, between two chunks.
    fn stopped(&self) -> bool {
        false
    }
}

/// Looks away.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unwatched;

impl Watch for Unwatched {
    fn step(&mut self, _: Step) {}
}

/// What a transfer took.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Summary {
    /// Bytes of chunks that were sent and taken.
    pub sent: u64,
    /// Bytes that were there before.
    pub skipped: u32,
    /// Restarts of the device meanwhile.
    pub restarts: u32,
}

/// A transfer that goes on until the slot holds the file.
#[derive(Debug)]
pub struct Upload<'a, L> {
    client: &'a mut Client<L>,
    parcel: &'a Parcel<'a>,
    summary: Summary,
    /// Bytes that were equal at the first comparison.
    skipped: Option<u32>,
    /// When something last got better.
    advanced: Instant,
}

impl<'a, L: Line> Upload<'a, L> {
    /// Of a file to a device.
    pub fn new(client: &'a mut Client<L>, parcel: &'a Parcel<'a>) -> Self {
        let now = client.talk.now();
        Self {
            client,
            parcel,
            summary: Summary::default(),
            skipped: None,
            advanced: now,
        }
    }

    /// Has the slot hold the file.
    ///
    /// # Errors
    /// [`UploadError`]. The table in use is the same as before.
    pub fn run(&mut self, watch: &mut impl Watch) -> Result<Summary, UploadError> {
        self.transfer(watch)?;
        watch.step(Step::Verified);
        Ok(self.summary)
    }

    /// Has the device use the file on trial, which must be in the slot; what the device
    /// lost meanwhile is brought once more.
    ///
    /// # Errors
    /// [`UploadError`]. Where the answer did not come, the device may use the table.
    pub fn activate(
        &mut self,
        trial: Duration,
        watch: &mut impl Watch,
    ) -> Result<InUse, UploadError> {
        for _ in 0..ACTIVATIONS {
            match self.client.activate(self.parcel.transfer(), trial) {
                Ok(in_use) => return Ok(in_use),
                Err(error) => {
                    self.recover(error, watch)?;
                    self.advanced = self.client.talk.now();
                    self.transfer(watch)?;
                }
            }
        }
        Err(UploadError::NeverWhole {
            sectors: 0,
            rounds: ACTIVATIONS,
        })
    }

    fn transfer(&mut self, watch: &mut impl Watch) -> Result<(), UploadError> {
        let mut least = usize::MAX;
        let mut rounds = 0;
        loop {
            match self.round(watch) {
                Ok(0) => return Ok(()),
                Ok(differing) if differing < least => {
                    least = differing;
                    rounds = 0;
                }
                Ok(_) => rounds += 1,
                Err(UploadError::Device(error)) => {
                    rounds += u32::from(!matches!(error, DeviceError::NoAnswer { .. }));
                    self.recover(error, watch)?;
                }
                Err(error) => return Err(error),
            }
            if rounds > ROUNDS {
                let sectors = least;
                return Err(UploadError::NeverWhole { sectors, rounds });
            }
        }
    }

    /// Compares and sends what differs. Returns how many sectors did.
    fn round(&mut self, watch: &mut impl Watch) -> Result<usize, UploadError> {
        if watch.stopped() {
            return Err(UploadError::Stopped);
        }
        let plan = Plan::make(self.client, self.parcel, || watch.stopped())?;
        self.advanced = self.client.talk.now();
        let held = self.parcel.length() - plan.bytes();
        let skipped = *self.skipped.get_or_insert(held);
        self.summary.skipped = skipped;
        watch.step(Step::Progress {
            done: held,
            skipped,
            total: self.parcel.length(),
        });
        // Also where nothing is missing: the device must know what to activate.
        let receiving = self
            .client
            .begin(self.parcel.length(), self.parcel.digest())?;
        if plan.differing.is_empty() {
            return Ok(0);
        }
        let window = Window::new(self.client, self.parcel, &plan, receiving)?;
        let mut sent = 0;
        let result = window.run(skipped, held, &mut sent, watch);
        self.summary.sent += sent;
        self.advanced = self.client.talk.now();
        result?;
        Ok(plan.differing.len())
    }

    /// Goes on after an error that does not end the transfer.
    fn recover(&mut self, error: DeviceError, watch: &mut impl Watch) -> Result<(), UploadError> {
        match error {
            DeviceError::Refused {
                refusal: Refusal::HelloFirst,
                ..
            } => {
                self.summary.restarts += 1;
                watch.step(Step::Restarted);
                match self.client.greet_again() {
                    // It is asked again.
                    Ok(()) | Err(DeviceError::NoAnswer { .. }) => Ok(()),
                    Err(error) => Err(error.into()),
                }
            }
            DeviceError::Refused {
                refusal: Refusal::NoTransfer | Refusal::Incomplete,
                ..
            } => {
                watch.step(Step::Restarted);
                Ok(())
            }
            DeviceError::NoAnswer { .. } => {
                let now = self.client.talk.now();
                let silence = now.saturating_duration_since(self.advanced);
                if silence >= PATIENCE {
                    return Err(error.into());
                }
                watch.step(Step::Quiet { silence });
                Ok(())
            }
            error => Err(error.into()),
        }
    }
}
