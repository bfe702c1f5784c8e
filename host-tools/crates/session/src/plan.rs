//! Plan of a session: what is to be photographed, and what is still missing.

use super::{SLIDES_FOLDER, SessionError};
use iltm_capture::{CaptureError, PhotoStats, find_photo, listed, pictures_of_stem};
use iltm_picture::progress::Progress;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A picture to show and the photograph to take of it.
#[derive(Clone, PartialEq, Debug)]
pub struct Planned {
    /// Place in the order of showing.
    pub index: u32,
    /// What it is shown for, as its list says.
    pub role: String,
    /// Picture in the projector's own pixels.
    pub slide: PathBuf,
    /// Photograph, named beforehand.
    pub photo: PathBuf,
    /// What its list says about the exposure.
    pub exposure: Option<f64>,
}

/// How a planned photograph is.
#[derive(Clone, PartialEq, Debug)]
pub enum State {
    /// It is there, and whole.
    Whole(PhotoStats),
    /// It is not there.
    Missing,
    /// It is there and of no use; why.
    Bad(String),
}

/// Everything that `folder` asks to photograph, in the order of showing, with paths
/// that can be used from anywhere.
///
/// # Errors
/// [`SessionError::Capture`] if there is no list or one that cannot be read,
/// [`SessionError::IndexTwice`] if two lists claim a place in the order.
pub fn planned(folder: &Path) -> Result<Vec<Planned>, SessionError> {
    let root = folder.canonicalize().map_err(|source| CaptureError::Io {
        path: folder.to_owned(),
        source,
    })?;
    let mut all: BTreeMap<u32, (String, Planned)> = BTreeMap::new();
    for (list, shot) in listed(&root)? {
        // A pattern that is listed twice, for a bracket, has one slide.
        let name = shot.pattern.file_name().unwrap_or_default();
        let planned = Planned {
            index: shot.index,
            role: shot.role.0,
            slide: root.join(SLIDES_FOLDER).join(name),
            photo: root.join(&shot.photo),
            exposure: shot.exposure,
        };
        let index = planned.index;
        if let Some((first, _)) = all.insert(index, (list.clone(), planned)) {
            return Err(SessionError::IndexTwice {
                folder: folder.to_owned(),
                index,
                lists: [first, list],
            });
        }
    }
    Ok(all.into_values().map(|(_, planned)| planned).collect())
}

/// Looks at every photograph that is there. One of another size or other channels
/// than the first whole one is [`State::Bad`].
pub fn states(list: &[Planned], progress: &dyn Progress) -> Vec<State> {
    progress.begin("looking at photographs", list.len() as u64);
    let mut states: Vec<State> = list
        .par_iter()
        .map(|planned| {
            let state = state(&planned.photo);
            progress.advance(1);
            state
        })
        .collect();
    progress.end();
    let first = states.iter().find_map(|state| match state {
        State::Whole(exposed) => Some(*exposed),
        _ => None,
    });
    for state in &mut states {
        let (State::Whole(exposed), Some(first)) = (&state, &first) else {
            continue;
        };
        if let Some(why) = unlike(exposed, first) {
            *state = State::Bad(why);
        }
    }
    states
}

fn state(photo: &Path) -> State {
    let whole = find_photo(Path::new(""), photo).and_then(|found| {
        let Some(file) = found else {
            return Ok(State::Missing);
        };
        PhotoStats::read(&file).map(State::Whole)
    });
    whole.unwrap_or_else(|error| State::Bad(error.to_string()))
}

/// All photographs of a name, whatever its ending.
pub(super) fn endings(photo: &Path) -> Vec<PathBuf> {
    pictures_of_stem(Path::new(""), photo)
}

/// In what a photograph differs from the others.
pub(super) fn unlike(exposed: &PhotoStats, others: &PhotoStats) -> Option<String> {
    if exposed.size != others.size {
        let ((width, height), (w, h)) = (exposed.size, others.size);
        return Some(format!(
            "it has {width} x {height} pixels, the others have {w} x {h}"
        ));
    }
    (exposed.channels != others.channels).then(|| {
        let colour = |exposed: &PhotoStats| match exposed.channels {
            1 => "grey",
            _ => "in colour",
        };
        format!(
            "it is {}, the others are {}",
            colour(exposed),
            colour(others)
        )
    })
}

/// Numbers as people write them: `3, 5 to 9`.
///
/// ```
/// # use iltm_session::ranges;
/// assert_eq!(ranges(&[3, 5, 6, 7, 9, 10]), "3, 5 to 7, 9, 10");
/// ```
#[must_use]
pub fn ranges(indices: &[u32]) -> String {
    let runs = indices.chunk_by(|a, b| a.checked_add(1) == Some(*b));
    let words = runs.map(|run| match run {
        [] => String::new(),
        [one] => one.to_string(),
        [a, b] => format!("{a}, {b}"),
        [first, .., last] => format!("{first} to {last}"),
    });
    words.collect::<Vec<_>>().join(", ")
}
