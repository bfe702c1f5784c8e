//! Parallel solve across processes: which part of the work is whose, and how the parts come
//! together.
//!
//! The first process reads, decides and writes. The others [`help`]: they get what a solve by links
//! needs, do their part of it, and wait for the next one.

use super::links;
use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt::{self, Debug, Formatter};
use std::ops::Range;

/// Processes that solve together, as those of MPI. All call the same functions in the same order.
pub trait Group: Sync {
    /// Which process this is, from 0.
    fn rank(&self) -> usize;
    /// How many there are.
    fn size(&self) -> usize;
    /// Gives bytes of the first process to all; what the others bring is dropped.
    fn broadcast(&self, bytes: Vec<u8>) -> Vec<u8>;
    /// Gives the bytes of each process to all, by rank.
    fn gather(&self, own: &[u8]) -> Vec<Vec<u8>>;
}

/// A process that has no others.
struct Alone;

impl Group for Alone {
    fn rank(&self) -> usize {
        0
    }

    fn size(&self) -> usize {
        1
    }

    fn broadcast(&self, bytes: Vec<u8>) -> Vec<u8> {
        bytes
    }

    fn gather(&self, own: &[u8]) -> Vec<Vec<u8>> {
        vec![own.to_vec()]
    }
}

/// The group that a solve is shared with.
#[derive(Clone, Copy)]
pub struct Processes(&'static dyn Group);

impl Processes {
    /// This process and those of `group`.
    #[must_use]
    pub fn new(group: &'static dyn Group) -> Self {
        Self(group)
    }

    /// How many there are.
    #[must_use]
    pub fn count(self) -> usize {
        self.0.size()
    }

    /// Whether this is the one that reads and writes.
    #[must_use]
    pub fn is_first(self) -> bool {
        self.0.rank() == 0
    }

    /// Helps the first process until it ends; to be called by all the others.
    pub fn help(self) {
        loop {
            let job = self.0.broadcast(Vec::new());
            if job.is_empty() {
                return;
            }
            let data = unpacked(&job);
            drop(job);
            links::help(&data, self);
        }
    }

    /// Lets the others end; to be called by the first one.
    pub fn dismiss(self) {
        if self.count() > 1 {
            self.0.broadcast(Vec::new());
        }
    }

    /// Gives the others what they [`help`](Self::help) with.
    pub(super) fn ask(self, job: &impl Serialize) {
        if self.count() > 1 {
            self.0.broadcast(packed(job));
        }
    }

    /// What is made of each of `items`, in their order. Each process makes a part, and all get
    /// the whole.
    pub(super) fn map<T: Serialize + DeserializeOwned + Send>(
        self,
        items: Range<usize>,
        of: impl Fn(usize) -> T + Send + Sync,
    ) -> Vec<T> {
        let count = self.count();
        let border = |rank: usize| items.start + items.len() * rank / count;
        let rank = self.0.rank();
        let own = border(rank)..border(rank + 1);
        let own: Vec<T> = own.into_par_iter().map(of).collect();
        if count == 1 {
            return own;
        }
        let parts = self.0.gather(&packed(&own));
        drop(own);
        let parts = parts.iter().map(|part| unpacked::<Vec<T>>(part));
        parts.flatten().collect()
    }
}

impl Default for Processes {
    fn default() -> Self {
        Self(&Alone)
    }
}

impl PartialEq for Processes {
    fn eq(&self, other: &Self) -> bool {
        (self.0.rank(), self.0.size()) == (other.0.rank(), other.0.size())
    }
}

impl Debug for Processes {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "rank {} of {}", self.0.rank(), self.0.size())
    }
}

fn packed(what: &impl Serialize) -> Vec<u8> {
    postcard::to_stdvec(what).expect("numbers and lists have bytes")
}

fn unpacked<T: DeserializeOwned>(bytes: &[u8]) -> T {
    postcard::from_bytes(bytes).expect("all processes are the same program")
}
