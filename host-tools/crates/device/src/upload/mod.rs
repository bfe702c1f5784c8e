//! Upload of a table's file into the slot that a device does not use, whatever breaks
//! meanwhile.
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

pub mod plan;
mod window;

pub use plan::{Parcel, UploadPlan};

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

/// Why a file could not be brought to a device. What arrived stays in the slot, which
/// is not in use: the next transfer goes on from there.
#[derive(Debug, thiserror::Error)]
pub enum UploadError {
    /// The device, or the line to it.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// Chunks are sent and nothing new gets into the flash.
    #[error(
        "nothing new has reached the device's flash for {} s, at {done} of {total} bytes",
        PATIENCE.as_secs()
    )]
    Stalled {
        /// Bytes that the slot holds.
        done: u32,
        /// Bytes of the file.
        total: u32,
    },
    /// A sector does not take what is written to it.
    #[error(
        "sector {sector} of the slot (from byte {offset} on) does not hold what is written to it, after {attempts} attempts"
    )]
    Worn {
        /// Its index.
        sector: u32,
        /// Where it starts.
        offset: u32,
        /// How often it was tried.
        attempts: u32,
    },
    /// Comparing finds differences again and again.
    #[error(
        "the slot does not come to hold the table, after {rounds} rounds; {sectors} sectors still differ"
    )]
    NeverWhole {
        /// Sectors that differ at best.
        sectors: usize,
        /// Comparisons that got no better.
        rounds: u32,
    },
    /// Whoever watched wanted an end.
    #[error("stopped before all of the table had arrived")]
    Stopped,
}

impl UploadError {
    /// What to do about it.
    #[must_use]
    pub fn next_step(&self) -> &'static str {
        match self {
            Self::Device(DeviceError::Gone { .. } | DeviceError::NoAnswer { .. }) => {
                "Check the cable and the device's power, then flash again: it goes on where it stopped."
            }
            Self::Device(error) => error.next_step(),
            Self::Stalled { .. } => {
                "Check cable and power, or give a lower --baud, and flash again: it goes on where it stopped."
            }
            Self::Worn { .. } => {
                "The device's flash is worn out there: a shorter table may still fit before it; else replace the board."
            }
            Self::NeverWhole { .. } => {
                "Check the device's power supply and its log (`iltm monitor`), then flash again."
            }
            Self::Stopped => "Flash again: it goes on where it stopped.",
        }
    }
}

/// What happens during a transfer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum UploadStep {
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
pub trait UploadObserver {
    /// Something happened.
    fn step(&mut self, step: UploadStep);

    /// Whether to stop, between two chunks.
    fn stopped(&self) -> bool {
        false
    }
}

/// Looks away.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoObserver;

impl UploadObserver for NoObserver {
    fn step(&mut self, _: UploadStep) {}
}

/// What a transfer took.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct UploadSummary {
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
    summary: UploadSummary,
    /// Bytes that were equal at the first comparison.
    skipped: Option<u32>,
    /// When something last got better.
    advanced: Instant,
}

impl<'a, L: Line> Upload<'a, L> {
    /// Of a file to a device.
    pub fn new(client: &'a mut Client<L>, parcel: &'a Parcel<'a>) -> Self {
        let now = client.transport.now();
        Self {
            client,
            parcel,
            summary: UploadSummary::default(),
            skipped: None,
            advanced: now,
        }
    }

    /// Has the slot hold the file.
    ///
    /// # Errors
    /// [`UploadError`]. The table in use is the same as before.
    pub fn run(
        &mut self,
        observer: &mut impl UploadObserver,
    ) -> Result<UploadSummary, UploadError> {
        self.transfer(observer)?;
        observer.step(UploadStep::Verified);
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
        observer: &mut impl UploadObserver,
    ) -> Result<InUse, UploadError> {
        for _ in 0..ACTIVATIONS {
            match self.client.activate(self.parcel.transfer(), trial) {
                Ok(in_use) => return Ok(in_use),
                Err(error) => {
                    self.recover(error, observer)?;
                    self.advanced = self.client.transport.now();
                    self.transfer(observer)?;
                }
            }
        }
        Err(UploadError::NeverWhole {
            sectors: 0,
            rounds: ACTIVATIONS,
        })
    }

    fn transfer(&mut self, observer: &mut impl UploadObserver) -> Result<(), UploadError> {
        let mut least = usize::MAX;
        let mut rounds = 0;
        loop {
            match self.round(observer) {
                Ok(0) => return Ok(()),
                Ok(differing) if differing < least => {
                    least = differing;
                    rounds = 0;
                }
                Ok(_) => rounds += 1,
                Err(UploadError::Device(error)) => {
                    rounds += u32::from(!matches!(error, DeviceError::NoAnswer { .. }));
                    self.recover(error, observer)?;
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
    fn round(&mut self, observer: &mut impl UploadObserver) -> Result<usize, UploadError> {
        if observer.stopped() {
            return Err(UploadError::Stopped);
        }
        let plan = UploadPlan::make(self.client, self.parcel, || observer.stopped())?;
        self.advanced = self.client.transport.now();
        let held = self.parcel.length() - plan.bytes();
        let skipped = *self.skipped.get_or_insert(held);
        self.summary.skipped = skipped;
        observer.step(UploadStep::Progress {
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
        let result = window.run(skipped, held, &mut sent, observer);
        self.summary.sent += sent;
        self.advanced = self.client.transport.now();
        result?;
        Ok(plan.differing.len())
    }

    /// Goes on after an error that does not end the transfer.
    fn recover(
        &mut self,
        error: DeviceError,
        observer: &mut impl UploadObserver,
    ) -> Result<(), UploadError> {
        match error {
            DeviceError::Refused {
                refusal: Refusal::HelloFirst,
                ..
            } => {
                self.summary.restarts += 1;
                observer.step(UploadStep::Restarted);
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
                observer.step(UploadStep::Restarted);
                Ok(())
            }
            DeviceError::NoAnswer { .. } => {
                let now = self.client.transport.now();
                let silence = now.saturating_duration_since(self.advanced);
                if silence >= PATIENCE {
                    return Err(error.into());
                }
                observer.step(UploadStep::Quiet { silence });
                Ok(())
            }
            error => Err(error.into()),
        }
    }
}
