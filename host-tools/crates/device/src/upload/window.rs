//! Window of an upload: several chunks on their way at once, each until it is in the flash.

use super::plan::{Parcel, UploadPlan};
use super::{PATIENCE, UploadError, UploadObserver, UploadStep};
use crate::client::{Client, unexpected};
use crate::transport::Posted;
use crate::{DeviceError, Line};
use iltm_runtime::link::{Receiving, Refusal, Request, Response};
use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

/// How long an answer to a chunk may take: the chunks before it are on the line, and
/// the erase of a sector takes up to .4 s.
const FIRST_WAIT: Duration = Duration::from_millis(600);

/// Waits grow to this.
const LONGEST_WAIT: Duration = Duration::from_secs(2);

/// Longest look at the line before ctrl-C is looked at.
const TICK: Duration = Duration::from_millis(100);

/// Silence after which it is said, and then again each time that much later.
const QUIET: Duration = Duration::from_secs(3);

/// How often a sector is sent that the flash does not take.
const ATTEMPTS: u32 = 3;

/// Answers to later chunks after which a chunk, or its answer, counts as lost.
const OVERTAKEN: u32 = 2;

/// Most chunks on their way, whatever a device says.
const MOST: u8 = 16;

/// A chunk of the file.
#[derive(Clone, Copy, Debug)]
struct Chunk {
    offset: u32,
    length: u32,
    sector: u32,
}

/// A chunk on its way.
#[derive(Debug)]
struct Flight {
    chunk: Chunk,
    posted: Posted,
    sent: Instant,
    wait: Duration,
    /// Number of the sending, over all chunks.
    turn: u64,
    /// Chunks sent later that were answered meanwhile.
    overtaken: u32,
}

/// The chunks of the sectors that differ.
#[derive(Debug)]
pub(super) struct Window<'a, L> {
    client: &'a mut Client<L>,
    parcel: &'a Parcel<'a>,
    plan: &'a UploadPlan,
    chunk: u32,
    size: usize,
    waiting: VecDeque<Chunk>,
    flying: Vec<Flight>,
    turns: u64,
    attempts: BTreeMap<u32, u32>,
    /// Bytes of each sector that are in the flash.
    taken: BTreeMap<u32, u32>,
}

impl<'a, L: Line> Window<'a, L> {
    pub(super) fn new(
        client: &'a mut Client<L>,
        parcel: &'a Parcel<'a>,
        plan: &'a UploadPlan,
        receiving: Receiving,
    ) -> Result<Self, DeviceError> {
        if receiving.chunk == 0 {
            return Err(DeviceError::Answer { request: "begin" });
        }
        let mut window = Self {
            client,
            parcel,
            plan,
            chunk: receiving.chunk.into(),
            size: receiving.window.clamp(1, MOST).into(),
            waiting: VecDeque::new(),
            flying: Vec::new(),
            turns: 0,
            attempts: BTreeMap::new(),
            taken: BTreeMap::new(),
        };
        for sector in &plan.differing {
            let chunks = window.chunks(*sector);
            window.waiting.extend(chunks);
        }
        Ok(window)
    }

    fn chunks(&self, sector: u32) -> Vec<Chunk> {
        let start = sector.saturating_mul(self.plan.slots.sector);
        let end = start.saturating_add(self.plan.size(sector));
        let offsets = (start..end).step_by(self.chunk as usize);
        let chunk = |offset: u32| Chunk {
            offset,
            length: self.chunk.min(end - offset),
            sector,
        };
        offsets.map(chunk).collect()
    }

    /// Sends all. `held` bytes of the file were in the slot before, `sent` counts what
    /// was taken.
    pub(super) fn run(
        mut self,
        skipped: u32,
        held: u32,
        sent: &mut u64,
        observer: &mut impl UploadObserver,
    ) -> Result<(), UploadError> {
        let total = self.parcel.length();
        let mut advanced = self.client.transport.now();
        let mut told = advanced;
        while !self.waiting.is_empty() || !self.flying.is_empty() {
            if observer.stopped() {
                return Err(UploadError::Stopped);
            }
            self.fill()?;
            let wait = self.wait();
            for (sequence, response) in self.client.transport.responses(wait)? {
                let Some(flight) = self.landed(sequence) else {
                    continue;
                };
                if self.take(flight.chunk, response, observer)? {
                    advanced = self.client.transport.now();
                }
                *sent = u64::from(self.taken.values().sum::<u32>());
                observer.step(UploadStep::Progress {
                    done: held.saturating_add(*sent as u32),
                    skipped,
                    total,
                });
            }
            self.repeat()?;
            let now = self.client.transport.now();
            let silence = now.saturating_duration_since(advanced);
            if silence >= PATIENCE {
                let done = held.saturating_add(*sent as u32);
                return Err(UploadError::Stalled { done, total });
            }
            if silence >= QUIET && now.saturating_duration_since(told) >= QUIET {
                told = now;
                observer.step(UploadStep::Quiet { silence });
            }
        }
        Ok(())
    }

    /// Sends chunks for the first time.
    fn fill(&mut self) -> Result<(), DeviceError> {
        while self.flying.len() < self.size
            && let Some(chunk) = self.waiting.pop_front()
        {
            let posted = self.client.transport.post(self.request(chunk));
            self.client.transport.send(&posted)?;
            self.turns += 1;
            self.flying.push(Flight {
                chunk,
                posted,
                sent: self.client.transport.now(),
                wait: FIRST_WAIT,
                turn: self.turns,
                overtaken: 0,
            });
        }
        Ok(())
    }

    fn request(&self, chunk: Chunk) -> Request<'a> {
        Request::Write {
            transfer: self.parcel.transfer(),
            offset: chunk.offset,
            bytes: self.parcel.part(chunk.offset, chunk.length),
        }
    }

    /// Until the next chunk must be sent again.
    fn wait(&self) -> Duration {
        let now = self.client.transport.now();
        let left = |flight: &Flight| (flight.sent + flight.wait).saturating_duration_since(now);
        let least = self.flying.iter().map(left).min();
        least
            .unwrap_or_default()
            .clamp(Duration::from_millis(1), TICK)
    }

    /// The chunk that an answer is for; none for a second answer.
    fn landed(&mut self, sequence: u16) -> Option<Flight> {
        let mut flying = self.flying.iter();
        let index = flying.position(|flight| flight.posted.sequence == sequence)?;
        let landed = self.flying.remove(index);
        for flight in &mut self.flying {
            flight.overtaken += u32::from(flight.turn < landed.turn);
        }
        Some(landed)
    }

    /// Takes note of an answer; returns whether there is more in the flash now.
    fn take(
        &mut self,
        chunk: Chunk,
        response: Option<Response>,
        observer: &mut impl UploadObserver,
    ) -> Result<bool, UploadError> {
        match response {
            Some(Response::Written) => {
                *self.taken.entry(chunk.sector).or_default() += chunk.length;
                Ok(true)
            }
            Some(Response::Refused(Refusal::Flash { .. })) => {
                self.again(chunk.sector)?;
                let sector = chunk.sector;
                observer.step(UploadStep::Repeated { sector });
                Ok(false)
            }
            Some(other) => Err(unexpected(self.request(chunk), &other).into()),
            None => Err(DeviceError::Answer { request: "write" }.into()),
        }
    }

    /// The device erases a sector anew after a chunk of it that did not get into the
    /// flash: all of the sector must come once more.
    fn again(&mut self, sector: u32) -> Result<(), UploadError> {
        let attempts = self.attempts.entry(sector).or_insert(1);
        if *attempts >= ATTEMPTS {
            return Err(UploadError::Worn {
                sector,
                offset: sector.saturating_mul(self.plan.slots.sector),
                attempts: *attempts,
            });
        }
        *attempts += 1;
        self.taken.remove(&sector);
        self.flying.retain(|flight| flight.chunk.sector != sector);
        self.waiting.retain(|chunk| chunk.sector != sector);
        for chunk in self.chunks(sector).into_iter().rev() {
            self.waiting.push_front(chunk);
        }
        Ok(())
    }

    /// Sends chunks once more that, or whose answers, seem to be lost.
    fn repeat(&mut self) -> Result<(), DeviceError> {
        let now = self.client.transport.now();
        for flight in &mut self.flying {
            let late = now.saturating_duration_since(flight.sent) >= flight.wait;
            if !late && flight.overtaken < OVERTAKEN {
                continue;
            }
            self.client.transport.send(&flight.posted)?;
            if late {
                flight.wait = (flight.wait * 3 / 2).min(LONGEST_WAIT);
            }
            self.turns += 1;
            flight.turn = self.turns;
            flight.overtaken = 0;
            flight.sent = now;
        }
        Ok(())
    }
}
