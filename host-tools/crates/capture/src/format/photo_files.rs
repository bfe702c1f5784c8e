//! Photograph files: which one a manifest means, which are missing and which are copies.
//!
//! The manifest names `photos/007.png` before any photograph is taken; a camera
//! then writes `photos/007.jpg` or `photos/007.TIF`. A file under the very name
//! counts; else the one picture file of the same stem.

use super::bracket::Bracket;
use super::error::CaptureError;
use super::manifest::{Shot, ShotOf};
use super::picture_file::FileFormat;
use super::role::Role;
use std::collections::HashMap;
use std::ffi::OsStr;
use std::hash::{DefaultHasher, Hasher};
use std::path::{Path, PathBuf};

/// The file that stands for `named` (relative to `folder`), relative to
/// `folder`; `None` if it is missing.
///
/// # Errors
/// [`CaptureError::Ambiguous`] if the named file is missing and more than one
/// picture has its stem.
pub fn find_photo(folder: &Path, named: &Path) -> Result<Option<PathBuf>, CaptureError> {
    // A file that is there and may not be read is an error of its own, later.
    if !matches!(folder.join(named).try_exists(), Ok(false)) {
        return Ok(Some(named.to_owned()));
    }
    let found = pictures_of_stem(folder, named);
    match found.as_slice() {
        [first, second, ..] => Err(CaptureError::Ambiguous {
            path: folder.join(named),
            first: first.clone(),
            second: second.clone(),
        }),
        found => Ok(found.first().cloned()),
    }
}

/// All picture files of the stem of `named` in its place, relative to `folder`, in
/// the order of their names.
#[must_use]
pub fn pictures_of_stem(folder: &Path, named: &Path) -> Vec<PathBuf> {
    let parent = named.parent().unwrap_or(Path::new(""));
    let entries = std::fs::read_dir(folder.join(parent));
    let names = entries
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.file_name()));
    let mut found: Vec<PathBuf> = names
        .filter(|name| stands_for(Path::new(name), named.file_stem()))
        .map(|name| parent.join(name))
        .collect();
    found.sort();
    found
}

/// Whether a file name has this stem and a picture's extension.
fn stands_for(name: &Path, stem: Option<&OsStr>) -> bool {
    let extension = name.extension().and_then(OsStr::to_str);
    let picture = extension.is_some_and(|extension| {
        FileFormat::EXTENSIONS
            .iter()
            .any(|known| extension.eq_ignore_ascii_case(known))
    });
    picture && name.file_stem() == stem
}

/// Names in each shot the file that stands for its photograph; one that is missing
/// keeps the name it has.
///
/// # Errors
/// [`CaptureError::Ambiguous`].
pub(crate) fn resolve<R>(folder: &Path, shots: &mut [ShotOf<R>]) -> Result<(), CaptureError> {
    for shot in shots {
        if let Some(found) = find_photo(folder, &shot.photo)? {
            shot.photo = found;
        }
    }
    Ok(())
}

/// Which photographs of a capture are there.
pub(crate) struct PhotoFiles {
    /// Lines of the manifest.
    pub(crate) listed: usize,
    /// Photographs that are not there, in the order of their lines.
    pub(crate) missing: Vec<PathBuf>,
    /// Photographs that are exact copies of others, which come first, and should show
    /// another pattern; not looked for if some are missing.
    pub(crate) copies: Vec<(PathBuf, PathBuf)>,
}

/// Names in each shot of the brackets the file that stands for its photograph; shots
/// without one are taken out.
///
/// # Errors
/// [`CaptureError::Ambiguous`].
pub(super) fn find_all(
    folder: &Path,
    brackets: &mut Vec<Bracket>,
) -> Result<PhotoFiles, CaptureError> {
    let mut missing = Vec::new();
    let listed = brackets.iter().map(|bracket| bracket.shots.len()).sum();
    for bracket in &mut *brackets {
        for at in (0..bracket.shots.len()).rev() {
            if let Some(found) = find_photo(folder, &bracket.shots[at].photo)? {
                bracket.shots[at].photo = found;
            } else {
                missing.push(bracket.shots.remove(at));
                bracket.times.remove(at);
            }
        }
    }
    brackets.retain(|bracket| !bracket.shots.is_empty());
    missing.sort_by_key(|shot| shot.index);
    let shots: Vec<&Shot> = brackets.iter().flat_map(|bracket| &bracket.shots).collect();
    Ok(PhotoFiles {
        listed,
        copies: if missing.is_empty() {
            copies(folder, &shots)
        } else {
            Vec::new()
        },
        missing: missing.into_iter().map(|shot| shot.photo).collect(),
    })
}

/// Pairs of shots, by their photographs, that should show different patterns and have the same file.
/// Two photographs differ at least by their noise.
fn copies(folder: &Path, shots: &[&Shot]) -> Vec<(PathBuf, PathBuf)> {
    let mut by_size: HashMap<u64, Vec<&Shot>> = HashMap::new();
    for &shot in shots {
        if let Ok(data) = folder.join(&shot.photo).metadata() {
            by_size.entry(data.len()).or_default().push(shot);
        }
    }
    let mut copies = Vec::new();
    // Only files of one length can be the same, so that few are read.
    for same in by_size.values().filter(|shots| shots.len() > 1) {
        let mut by_bytes: HashMap<u64, &Shot> = HashMap::new();
        for shot in same {
            let Some(hash) = hash(&folder.join(&shot.photo)) else {
                continue;
            };
            match by_bytes.get(&hash) {
                Some(first) if !alike(folder, first, shot) => copies.push((*first, *shot)),
                Some(_) => {}
                None => {
                    by_bytes.insert(hash, shot);
                }
            }
        }
    }
    copies.sort_by_key(|(_, second)| second.index);
    let files = |(first, second): (&Shot, &Shot)| (first.photo.clone(), second.photo.clone());
    copies.into_iter().map(files).collect()
}

/// Whether two shots show the same pattern.
fn alike(folder: &Path, a: &Shot, b: &Shot) -> bool {
    let of = |shot: &Shot| hash(&folder.join(&shot.pattern));
    (a.role == b.role && a.role != Role::Bernoulli) || of(a) == of(b)
}

/// A hash of a file's bytes.
fn hash(path: &Path) -> Option<u64> {
    let mut hasher = DefaultHasher::new();
    hasher.write(&std::fs::read(path).ok()?);
    Some(hasher.finish())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn what_the_camera_wrote_stands_for_what_the_manifest_names() {
        let folder = tempfile::tempdir().unwrap();
        let photos = folder.path().join("photos");
        fs::create_dir(&photos).unwrap();
        let find = || find_photo(folder.path(), Path::new("photos/007.png"));
        assert_eq!(find().unwrap(), None);
        for beside in ["007.CR2", "007.xmp", "0071.jpg", "007.jpg.part"] {
            fs::write(photos.join(beside), "").unwrap();
        }
        assert_eq!(find().unwrap(), None, "raw files and sidecars");
        fs::write(photos.join("007.JPG"), "").unwrap();
        assert_eq!(find().unwrap(), Some("photos/007.JPG".into()));
        fs::write(photos.join("007.tiff"), "").unwrap();
        let error = find().unwrap_err().to_string();
        assert!(error.contains("007.JPG and photos/007.tiff"), "{error}");
        fs::write(photos.join("007.png"), "").unwrap();
        assert_eq!(find().unwrap(), Some("photos/007.png".into()));
    }
}
