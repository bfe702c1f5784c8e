//! Gate `complete`: every photograph is there, once.

use super::super::{Role, Shot};
use super::{Evidence, Gate, GateName, Verdict, listed};
use std::collections::HashMap;
use std::fs::File;
use std::hash::{DefaultHasher, Hasher};
use std::io::Read;
use std::path::Path;

/// File names that a sentence lists.
const MOST_NAMED: usize = 12;

/// Looks for every photograph of `shots`; returns the gate and the shots that have
/// one.
pub(crate) fn judge(folder: &Path, shots: &[Shot]) -> (Gate, Vec<Shot>) {
    let is_missing = |shot: &&Shot| matches!(folder.join(&shot.photo).try_exists(), Ok(false));
    let missing: Vec<&Shot> = shots.iter().filter(is_missing).collect();
    let present: Vec<Shot> = shots
        .iter()
        .filter(|shot| !missing.contains(shot))
        .cloned()
        .collect();
    let gate = |verdict, number, what, next_step| Gate {
        name: GateName::Complete,
        verdict,
        number,
        limit: 0.0,
        unit: "photographs",
        what,
        next_step,
        evidence: Evidence::None,
    };
    if !missing.is_empty() {
        let names = listed(missing.iter().map(|shot| shot.photo.display()), MOST_NAMED);
        let lines = listed(missing.iter().map(|shot| shot.line), MOST_NAMED);
        let what = format!(
            "{} of {} photographs missing: {names}, named in line {lines} of capture.csv",
            missing.len(),
            shots.len()
        );
        let next_step = "Put the files there or take those photographs again; \
             if one was never taken, remove its line from capture.csv.";
        return (
            gate(Verdict::Fail, missing.len() as f64, what, next_step),
            present,
        );
    }
    let twins = twins(folder, &present);
    if let Some((first, second)) = twins.first() {
        let what = format!(
            "{} photographs are exact copies of others that should show another pattern: {} is {}",
            twins.len(),
            second.photo.display(),
            first.photo.display()
        );
        let next_step =
            "Take those photographs again: the camera or the copying gave an old file twice.";
        return (
            gate(Verdict::Fail, twins.len() as f64, what, next_step),
            present,
        );
    }
    let what = format!("all {} photographs are there", shots.len());
    (gate(Verdict::Pass, 0.0, what, ""), present)
}

/// Pairs of shots that should show different patterns and have the same file.
/// Two photographs differ at least by their noise.
fn twins<'a>(folder: &Path, shots: &'a [Shot]) -> Vec<(&'a Shot, &'a Shot)> {
    let mut by_size: HashMap<u64, Vec<&Shot>> = HashMap::new();
    for shot in shots {
        if let Ok(data) = folder.join(&shot.photo).metadata() {
            by_size.entry(data.len()).or_default().push(shot);
        }
    }
    let mut twins = Vec::new();
    // Only files of one length can be the same, so that few are read.
    for same in by_size.values().filter(|shots| shots.len() > 1) {
        let mut by_bytes: HashMap<u64, &Shot> = HashMap::new();
        for shot in same {
            let Some(hash) = hash(&folder.join(&shot.photo)) else {
                continue;
            };
            match by_bytes.get(&hash) {
                Some(first) if !alike(folder, first, shot) => twins.push((*first, *shot)),
                Some(_) => {}
                None => {
                    by_bytes.insert(hash, shot);
                }
            }
        }
    }
    twins.sort_by_key(|(_, second)| second.index);
    twins
}

/// Whether two shots show the same pattern.
fn alike(folder: &Path, a: &Shot, b: &Shot) -> bool {
    let of = |shot: &Shot| hash(&folder.join(&shot.pattern));
    (a.role == b.role && a.role != Role::Bernoulli) || of(a) == of(b)
}

/// A hash of a file's bytes.
fn hash(path: &Path) -> Option<u64> {
    let mut file = File::open(path).ok()?;
    let mut hasher = DefaultHasher::new();
    let mut part = vec![0; 1 << 16];
    loop {
        match file.read(&mut part).ok()? {
            0 => return Some(hasher.finish()),
            read => hasher.write(&part[..read]),
        }
    }
}
