//! Stills: a folder's pictures as images to show and to learn from.

use super::PatternsError;
use iltm_capture::{FileFormat, read_still};
use iltm_picture::Picture;
use iltm_runtime::FrameSize;
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// The pictures of a folder in the order of their names, each of `size` with 8 bits: its middle, as
/// large as the aspect allows.
///
/// # Errors
/// [`PatternsError::Images`] if the folder cannot be read, [`PatternsError::NoImages`] if there is
/// no picture in it, [`PatternsError::Image`] with the first that cannot be shown.
pub fn stills(folder: &Path, size: FrameSize) -> Result<Vec<Picture>, PatternsError> {
    let entries = std::fs::read_dir(folder).and_then(|entries| {
        let paths = entries.map(|entry| Ok(entry?.path()));
        paths.collect::<std::io::Result<Vec<PathBuf>>>()
    });
    let mut paths = entries.map_err(|source| PatternsError::Images {
        folder: folder.to_owned(),
        source,
    })?;
    paths.retain(|path| {
        let extension = path.extension().and_then(|ending| ending.to_str());
        extension.is_some_and(|ending| {
            (FileFormat::EXTENSIONS.iter()).any(|known| ending.eq_ignore_ascii_case(known))
        })
    });
    if paths.is_empty() {
        return Err(PatternsError::NoImages {
            folder: folder.to_owned(),
        });
    }
    alphanumeric_sort::sort_path_slice(&mut paths);
    let pictures: Vec<_> = paths
        .par_iter()
        .map(|path| read_still(path, size))
        .collect();
    pictures.into_iter().map(|picture| Ok(picture?)).collect()
}
