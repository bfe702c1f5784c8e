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

/// The group that a solve is shared with; by default this process is alone.
#[derive(Clone, Copy, Default)]
pub struct Processes(Option<&'static dyn Group>);

impl Processes {
    /// This process and those of `group`.
    #[must_use]
    pub fn new(group: &'static dyn Group) -> Self {
        Self(Some(group))
    }

    /// How many there are.
    #[must_use]
    pub fn count(self) -> usize {
        self.0.map_or(1, Group::size)
    }

    fn rank(self) -> usize {
        self.0.map_or(0, Group::rank)
    }

    /// Whether this is the one that reads and writes.
    #[must_use]
    pub fn is_first(self) -> bool {
        self.rank() == 0
    }

    /// Helps the first process until it ends; to be called by all the others.
    pub fn help(self) {
        while let Some(group) = self.0 {
            let job = group.broadcast(Vec::new());
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
        if let Some(group) = self.0 {
            group.broadcast(Vec::new());
        }
    }

    /// Gives the others what they [`help`](Self::help) with.
    pub(super) fn ask(self, job: &impl Serialize) {
        if let Some(group) = self.0 {
            group.broadcast(packed(job));
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
        let own = border(self.rank())..border(self.rank() + 1);
        let own: Vec<T> = own.into_par_iter().map(of).collect();
        let Some(group) = self.0 else {
            return own;
        };
        let parts = group.gather(&packed(&own));
        drop(own);
        let parts = parts.iter().map(|part| unpacked::<Vec<T>>(part));
        parts.flatten().collect()
    }
}

impl PartialEq for Processes {
    fn eq(&self, other: &Self) -> bool {
        (self.rank(), self.count()) == (other.rank(), other.count())
    }
}

impl Debug for Processes {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "rank {} of {}", self.rank(), self.count())
    }
}

fn packed(what: &impl Serialize) -> Vec<u8> {
    postcard::to_stdvec(what).expect("numbers and lists have bytes")
}

fn unpacked<T: DeserializeOwned>(bytes: &[u8]) -> T {
    postcard::from_bytes(bytes).expect("all processes are the same program")
}
