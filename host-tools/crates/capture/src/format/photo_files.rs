//! Photograph files: which one a manifest means, which are missing and which are copies.
//!
//! The manifest names `photos/007.png` before any photograph is taken; a camera
//! then writes `photos/007.jpg` or `photos/007.TIF`. A file under the very name
//! counts; else the one picture file of the same stem.

use super::bracket::Bracket;
use super::error::CaptureError;
use super::manifest::{Shot, ShotOf};
use super::picture_file::{FileFormat, MAX_PIXELS};
use std::collections::HashMap;
use std::ffi::OsStr;
use std::fs::File;
use std::hash::{DefaultHasher, Hasher};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Extensions of files that cameras write and this program does not read, lower case.
const RAW_EXTENSIONS: [&str; 14] = [
    "nef", "nrw", "cr2", "cr3", "crw", "dng", "arw", "raf", "orf", "rw2", "pef", "heic", "heif",
    "avif",
];

/// Bytes of files that are compared whole: no photograph is longer.
const MAX_BYTES: u64 = MAX_PIXELS * 16;

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
    of_stem(folder, named, &FileFormat::EXTENSIONS)
}

/// All files of the stem of `named` with one of some extensions.
fn of_stem(folder: &Path, named: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let parent = named.parent().unwrap_or(Path::new(""));
    let entries = std::fs::read_dir(folder.join(parent));
    let names = entries
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.file_name()));
    let mut found: Vec<PathBuf> = names
        .filter(|name| stands_for(Path::new(name), named.file_stem(), extensions))
        .map(|name| parent.join(name))
        .collect();
    found.sort();
    found
}

/// The raw file of the stem of `named` in its place, relative to `folder`.
fn raw(folder: &Path, named: &Path) -> Option<PathBuf> {
    of_stem(folder, named, &RAW_EXTENSIONS).into_iter().next()
}

/// Whether a file name has this stem and one of some extensions.
fn stands_for(name: &Path, stem: Option<&OsStr>, extensions: &[&str]) -> bool {
    let extension = name.extension().and_then(OsStr::to_str);
    let known = extension.is_some_and(|extension| {
        (extensions.iter()).any(|known| extension.eq_ignore_ascii_case(known))
    });
    known && name.file_stem() == stem
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
    /// Files beside those that are missing, of the same stem and of a kind that is not read:
    /// raw files, which somebody has to develop.
    pub(crate) raw: Vec<PathBuf>,
    /// Photographs that are exact copies of others, which come first, and should show
    /// another pattern; not looked for if some are missing.
    pub(crate) copies: Vec<(PathBuf, PathBuf)>,
}

/// Names in each shot of both lists' brackets the file that stands for its photograph; shots
/// without one are taken out.
///
/// # Errors
/// [`CaptureError::Ambiguous`].
pub(super) fn find_all(
    folder: &Path,
    mut lists: [&mut Vec<Bracket>; 2],
) -> Result<PhotoFiles, CaptureError> {
    let mut missing = Vec::new();
    let brackets = lists.iter().flat_map(|brackets| brackets.iter());
    let listed = brackets.map(|bracket| bracket.shots.len()).sum();
    for bracket in lists.iter_mut().flat_map(|brackets| brackets.iter_mut()) {
        for at in (0..bracket.shots.len()).rev() {
            if let Some(found) = find_photo(folder, &bracket.shots[at].photo)? {
                bracket.shots[at].photo = found;
            } else {
                missing.push(bracket.shots.remove(at));
                bracket.times.remove(at);
            }
        }
    }
    for brackets in &mut lists {
        brackets.retain(|bracket| !bracket.shots.is_empty());
    }
    missing.sort_by_key(|shot| shot.index);
    let brackets = lists.iter().flat_map(|brackets| brackets.iter());
    let mut shots: Vec<&Shot> = brackets.flat_map(|bracket| &bracket.shots).collect();
    shots.sort_by_key(|shot| shot.index);
    Ok(PhotoFiles {
        listed,
        copies: if missing.is_empty() {
            copies(folder, &shots)
        } else {
            Vec::new()
        },
        raw: missing
            .iter()
            .filter_map(|shot| raw(folder, &shot.photo))
            .collect(),
        missing: missing.into_iter().map(|shot| shot.photo).collect(),
    })
}

/// Pairs of shots, by their photographs, that should show different patterns and have the same file.
/// Two photographs differ at least by their noise.
fn copies(folder: &Path, shots: &[&Shot]) -> Vec<(PathBuf, PathBuf)> {
    let mut by_size: HashMap<u64, Vec<&Shot>> = HashMap::new();
    for &shot in shots {
        // What is no regular file has no end; reading it says so.
        let data = folder.join(&shot.photo).metadata();
        if let Some(data) = data
            .ok()
            .filter(|data| data.is_file() && data.len() <= MAX_BYTES)
        {
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
    (a.role == b.role && !a.role.is_content()) || of(a) == of(b)
}

/// A hash of a regular file's bytes.
fn hash(path: &Path) -> Option<u64> {
    if !path.metadata().ok()?.is_file() {
        return None;
    }
    let mut hasher = DefaultHasher::new();
    let mut file = File::open(path).ok()?.take(MAX_BYTES);
    let mut bytes = vec![0; 1 << 16];
    loop {
        match file.read(&mut bytes).ok()? {
            0 => return Some(hasher.finish()),
            count => hasher.write(&bytes[..count]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_without_an_end_is_not_read_to_compare_it() {
        let folder = tempfile::tempdir().unwrap();
        let zero = folder.path().join("zero");
        std::os::unix::fs::symlink("/dev/zero", &zero).unwrap();
        assert_eq!(hash(&zero), None);
    }

    #[test]
    fn a_raw_file_beside_a_missing_photograph_is_found() {
        let folder = tempfile::tempdir().unwrap();
        fs::create_dir(folder.path().join("photos")).unwrap();
        let named = Path::new("photos/070.png");
        assert_eq!(raw(folder.path(), named), None);
        fs::write(folder.path().join("photos/070.NEF"), "").unwrap();
        assert_eq!(raw(folder.path(), named), Some("photos/070.NEF".into()));
    }

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
