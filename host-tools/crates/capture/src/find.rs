//! The photograph files that a manifest means.
//!
//! The manifest names `photos/007.png` before any photograph is taken; a camera
//! then writes `photos/007.jpg` or `photos/007.TIF`. A file under the very name
//! counts; else the one picture file of the same stem.

use super::{CaptureError, FileFormat, ShotOf};
use std::ffi::OsStr;
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
pub(super) fn resolve<R>(folder: &Path, shots: &mut [ShotOf<R>]) -> Result<(), CaptureError> {
    for shot in shots {
        if let Some(found) = find_photo(folder, &shot.photo)? {
            shot.photo = found;
        }
    }
    Ok(())
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
