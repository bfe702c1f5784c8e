//! Sample capture that the program carries with it.

use super::DemoError;
use iltm_picture::{FolderError, unfinished, whole_file};
use include_dir::{Dir, File, include_dir};
use std::path::Path;

/// 60 photographs of coloured M-shaped panels, 16 x 24 cells: 1 white, 1 black,
/// 18 Gray code, 40 Bernoulli, by a path tracer with a noisy camera.
static SAMPLE: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/samples/m-panels-colour");

/// Writes the capture into `folder`, which is made if it is not there; files of
/// the same names are replaced, each in one step.
///
/// # Errors
/// [`DemoError::Folder`] or [`DemoError::Write`].
pub fn write(folder: &Path) -> Result<(), DemoError> {
    write_dir(&SAMPLE, folder)
}

fn write_dir(dir: &Dir<'_>, folder: &Path) -> Result<(), DemoError> {
    make_folder(folder)?;
    for file in dir.files() {
        write_file(&folder.join(name(file.path())), file)?;
    }
    for dir in dir.dirs() {
        write_dir(dir, &folder.join(name(dir.path())))?;
    }
    Ok(())
}

/// The last part of a path, which every embedded file and folder has.
fn name(path: &Path) -> &Path {
    path.file_name().map_or(path, Path::new)
}

fn write_file(path: &Path, file: &File<'_>) -> Result<(), DemoError> {
    write_bytes(path, file.contents())
}

/// Writes a file whole or not at all.
pub(super) fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), DemoError> {
    Ok(whole_file::write(path, bytes)?)
}

/// Makes a folder and those that it lies in.
pub(super) fn make_folder(folder: &Path) -> Result<(), DemoError> {
    Ok(unfinished::make_folder(folder).map_err(FolderError::io(folder))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::Manifest;
    use std::fs;

    #[test]
    fn the_sample_carries_every_file_that_its_manifest_names() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path()).unwrap();
        let manifest = Manifest::read(folder.path()).unwrap();
        assert_eq!(manifest.shots.len(), 60);
        for shot in &manifest.shots {
            assert!(folder.path().join(&shot.photo).is_file());
            assert!(folder.path().join(&shot.pattern).is_file());
        }
    }

    #[test]
    fn writing_the_sample_again_replaces_it() {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path()).unwrap();
        let manifest = folder.path().join("capture.csv");
        let first = fs::read(&manifest).unwrap();
        fs::write(&manifest, "spoilt").unwrap();
        write(folder.path()).unwrap();
        assert_eq!(fs::read(&manifest).unwrap(), first);
    }
}
