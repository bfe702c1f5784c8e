//! Gate `complete`: every photograph is there, once.

use super::super::frame::Frame;
use super::super::{CaptureError, Role, Shot, find_photo};
use super::{Evidence, Gate, GateName, Verdict, listed};
use std::collections::HashMap;
use std::fs::File;
use std::hash::{DefaultHasher, Hasher};
use std::io::Read;
use std::path::Path;

/// File names that a sentence lists.
const MOST_NAMED: usize = 12;

/// Looks for the photographs of all frames and names in each shot the file that stands
/// for it; shots without one are taken out.
///
/// # Errors
/// [`CaptureError::Ambiguous`] if several files could be meant.
pub(crate) fn judge(folder: &Path, frames: &mut Vec<Frame>) -> Result<Gate, CaptureError> {
    let mut missing = Vec::new();
    let all: usize = frames.iter().map(|frame| frame.shots.len()).sum();
    for frame in &mut *frames {
        for at in (0..frame.shots.len()).rev() {
            if let Some(found) = find_photo(folder, &frame.shots[at].photo)? {
                frame.shots[at].photo = found;
            } else {
                missing.push(frame.shots.remove(at));
                frame.times.remove(at);
            }
        }
    }
    frames.retain(|frame| !frame.shots.is_empty());
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
        missing.sort_by_key(|shot| shot.index);
        let names = listed(missing.iter().map(|shot| shot.photo.display()), MOST_NAMED);
        let what = format!("{} of {all} photographs missing: {names}", missing.len());
        let next_step = "Take the missing photographs: `iltm capture` goes on where it stopped.";
        return Ok(gate(Verdict::Fail, missing.len() as f64, what, next_step));
    }
    let shots: Vec<Shot> = frames
        .iter()
        .flat_map(|frame| frame.shots.clone())
        .collect();
    let twins = twins(folder, &shots);
    if let Some((first, second)) = twins.first() {
        let what = format!(
            "{} photographs are exact copies of others that show another pattern: {} is {}",
            twins.len(),
            second.photo.display(),
            first.photo.display()
        );
        let next_step =
            "Take those photographs again: the camera or the copying gave an old file twice.";
        return Ok(gate(Verdict::Fail, twins.len() as f64, what, next_step));
    }
    let what = format!("all {all} photographs are there");
    Ok(gate(Verdict::Pass, 0.0, what, ""))
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
