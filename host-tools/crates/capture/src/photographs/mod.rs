//! Photographs: all photographs of a capture in linear light, each decoded once, in a fixed
//! amount of memory.
//!
//! | what | module |
//! |---|---|
//! | one file, decoded and linearised | `photo` |
//! | a bracket's photographs as one | `merge` |
//! | those that memory has no room for, in a file | `spool` |
//! | mean of white and black | `linearise` |
//! | pixels that white clips | `clipping` |
//! | squares of pixels from every photograph | `sampled` |
//! | which pattern each photograph shows | `order` |
//! | brightness of a file, before anything is known of it | `photo_stats` |
//! | a file small and grey, before anything is known of it | `grey_view` |

pub(crate) mod clipping;
pub(crate) mod grey_view;
pub(crate) mod linearise;
mod merge;
pub(crate) mod order;
pub(crate) mod photo;
pub(crate) mod photo_stats;
pub(crate) mod sampled;
mod spool;

use crate::format::bracket::{self, Bracket};
use crate::format::error::CaptureError;
use crate::format::manifest::{MANIFEST_FILE, Shot};
use crate::format::picture_file::Source;
use crate::format::settings::Reading;
use iltm_picture::progress::Progress;
use photo::{Photo, PhotoFormat};
use rayon::prelude::*;
use spool::Spool;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Bytes of photographs that are kept decoded in memory: 14 of 12 megapixels in colour. Those
/// beyond are kept in a file.
const KEPT_BYTES: usize = 512 << 20;

/// Bytes of photographs that are decoded at the same time.
const BATCH_BYTES: usize = 512 << 20;

/// The photographs named in a manifest, those of a bracket as one.
pub(crate) struct Photographs<'a> {
    folder: &'a Path,
    brackets: Vec<Bracket>,
    pub(crate) format: PhotoFormat,
    /// What a sample reads as that is saturated in every photograph of its bracket:
    /// more than any other reads.
    pub(crate) saturated: f32,
    /// From camera channels to the projector's.
    unmixing: Option<[[f32; 3]; 3]>,
    /// One entry a bracket, decoded or not yet.
    kept: Vec<Option<Photo>>,
    /// How many more may be kept.
    room: usize,
    /// Those that there is no room for; written while others are decoded.
    spool: Mutex<Spool>,
    /// Photographs decoded at the same time.
    batch: usize,
}

impl<'a> Photographs<'a> {
    /// Takes the format of the first photograph; decodes nothing yet. Every shot is
    /// a photograph of its own.
    ///
    /// # Errors
    /// As [`Photographs::of_brackets`].
    pub(crate) fn new(
        folder: &'a Path,
        shots: &[Shot],
        reading: &Reading,
    ) -> Result<Self, CaptureError> {
        let longest = bracket::longest(shots, &folder.join(MANIFEST_FILE))?;
        Self::of_brackets(folder, Bracket::of_each(shots, longest), reading)
    }

    /// Takes the format of the first photograph; decodes nothing yet.
    ///
    /// # Errors
    /// As [`PhotoFormat::of_first`]. Without any bracket, [`CaptureError::NoWhite`].
    pub(crate) fn of_brackets(
        folder: &'a Path,
        brackets: Vec<Bracket>,
        reading: &Reading,
    ) -> Result<Self, CaptureError> {
        let Some(first) = brackets.first().and_then(|bracket| bracket.shots.first()) else {
            return Err(CaptureError::NoWhite {
                path: folder.join(MANIFEST_FILE),
            });
        };
        let path = folder.join(&first.photo);
        let format = PhotoFormat::of_first(source(&path, first), reading)?;
        let largest = brackets.iter().map(|b| b.shots.len()).max().unwrap_or(1);
        let batch = (BATCH_BYTES / largest / format.decoding_bytes()).clamp(1, 16);
        let times = brackets.iter().flat_map(|bracket| &bracket.times);
        Ok(Self {
            saturated: times.fold(Photo::SATURATED, |most, time| most.max((1.0 / time) as f32)),
            kept: vec![None; brackets.len()],
            room: KEPT_BYTES / format.bytes(),
            spool: Mutex::new(Spool::new(brackets.len(), format.channels, format.pixels())),
            folder,
            brackets,
            format,
            unmixing: None,
            batch,
        })
    }

    fn spool_mut(&mut self) -> &mut Spool {
        self.spool.get_mut().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether photographs differ in exposure.
    pub(crate) fn bracketed(&self) -> bool {
        self.saturated > Photo::SATURATED
    }

    /// Turns every photograph's channels into the projector's from now on, by the inverse
    /// of the colour mixing.
    pub(crate) fn unmix(&mut self, inverse: [[f32; 3]; 3]) {
        for photo in self.kept.iter_mut().flatten() {
            photo.unmix(&inverse, self.saturated);
        }
        let saturated = self.saturated;
        self.spool_mut()
            .change(|photo| photo.unmix(&inverse, saturated));
        self.unmixing = Some(inverse);
    }

    /// Keeps no photograph after it was visited: for those that are read once.
    pub(crate) fn read_once(mut self) -> Self {
        self.room = 0;
        self.spool_mut().give_up();
        self
    }

    /// Keeps no photograph at all, to be dropped.
    pub(crate) fn forget(&mut self) {
        self.kept.clear();
        self.spool_mut().give_up();
    }

    /// Keeps no photograph in memory from now on, but all in a file.
    pub(crate) fn leave_memory(&mut self) {
        self.room = 0;
        for at in 0..self.kept.len() {
            if let Some(photo) = self.kept[at].take() {
                self.spool_mut().write(at, &photo);
            }
        }
    }

    /// Leaves room in memory for this list, which has the same format, beside `other`.
    fn beside(mut self, other: &Photographs<'_>) -> Self {
        let taken = other.kept.iter().flatten().count();
        self.room = self.room.saturating_sub(taken);
        self
    }

    /// The file of a bracket, the first if there are several.
    pub(crate) fn path(&self, bracket: usize) -> PathBuf {
        self.folder.join(&self.brackets[bracket].shots[0].photo)
    }

    /// The photographs of a bracket one by one, each in light of its own full scale.
    ///
    /// # Errors
    /// As [`PhotoFormat::read`].
    pub(crate) fn each_of(&self, bracket: usize) -> Result<Vec<Photo>, CaptureError> {
        let photo = |shot: &Shot| {
            let path = self.folder.join(&shot.photo);
            self.format.read(source(&path, shot))
        };
        self.brackets[bracket].shots.iter().map(photo).collect()
    }

    /// Reads the photographs of a bracket and makes one of them.
    fn read(&self, bracket: usize) -> Result<Photo, CaptureError> {
        let mut photos = self.each_of(bracket)?;
        let times = &self.brackets[bracket].times;
        let mut one = match photos.len() {
            1 if !self.bracketed() => photos.remove(0),
            _ => merge::merge(&photos, times, self.format.bits, self.saturated),
        };
        if let Some(inverse) = &self.unmixing {
            one.unmix(inverse, self.saturated);
        }
        Ok(one)
    }

    /// Hands the photographs of `shots` (indices of brackets) to `visit`
    /// in batches, in order, as pairs of index and photograph.
    ///
    /// # Errors
    /// The first photograph in order that cannot be read, as
    /// [`PhotoFormat::read`].
    pub(crate) fn for_batches(
        &mut self,
        shots: &[usize],
        progress: &dyn Progress,
        mut visit: impl FnMut(&[(usize, &Photo)]),
    ) -> Result<(), CaptureError> {
        for batch in shots.chunks(self.batch) {
            let spool = self.spool_mut();
            let mut passing: Vec<Option<Photo>> =
                batch.iter().map(|shot| spool.read(*shot)).collect();
            let unknown = |at: &usize| self.kept[batch[*at]].is_none() && passing[*at].is_none();
            let new: Vec<usize> = (0..batch.len()).filter(unknown).collect();
            let read = |(place, at): (usize, &usize)| {
                let photo = self.read(batch[*at])?;
                if place >= self.room {
                    let spool = self.spool.lock();
                    let mut spool = spool.unwrap_or_else(PoisonError::into_inner);
                    spool.write(batch[*at], &photo);
                }
                Ok(photo)
            };
            let read: Vec<Result<Photo, CaptureError>> =
                new.par_iter().enumerate().map(read).collect();
            for (at, photo) in new.into_iter().zip(read) {
                let photo = photo?;
                if self.room > 0 {
                    self.room -= 1;
                    self.kept[batch[at]] = Some(photo);
                } else {
                    passing[at] = Some(photo);
                }
            }
            let photos = batch.iter().zip(&passing).filter_map(|(shot, passing)| {
                let photo = self.kept[*shot].as_ref().or(passing.as_ref());
                photo.map(|photo| (*shot, photo))
            });
            visit(&photos.collect::<Vec<_>>());
            progress.advance(batch.len() as u64);
        }
        Ok(())
    }

    /// Decodes all photographs in parallel.
    ///
    /// # Errors
    /// As [`Photographs::for_batches`].
    pub(crate) fn prefetch(&mut self, progress: &dyn Progress) -> Result<(), CaptureError> {
        let all: Vec<usize> = (0..self.brackets.len()).collect();
        progress.begin("reading photographs", all.len() as u64);
        self.for_batches(&all, progress, |_| {})?;
        progress.end();
        Ok(())
    }

    /// Mean of the photographs of `shots`, one plane a channel, and for each
    /// pixel whether any of them is saturated there in any channel.
    ///
    /// # Errors
    /// As [`Photographs::for_batches`].
    pub(crate) fn mean(
        &mut self,
        shots: &[usize],
        progress: &dyn Progress,
    ) -> Result<(Vec<Vec<f32>>, Vec<bool>), CaptureError> {
        let pixels = self.format.pixels();
        let mut planes = vec![vec![0.0; pixels]; self.format.channels];
        let mut saturated = vec![false; pixels];
        let share = 1.0 / shots.len() as f32;
        let limit = self.saturated;
        self.for_batches(shots, progress, |photos| {
            for (_, photo) in photos {
                for (plane, photo) in planes.iter_mut().zip(&photo.planes) {
                    for ((sum, saturated), &value) in
                        plane.iter_mut().zip(&mut saturated).zip(photo)
                    {
                        *sum += share * value;
                        *saturated |= value >= limit;
                    }
                }
            }
        })?;
        Ok((planes, saturated))
    }
}

/// Sum over the channels of each pixel.
pub(crate) fn channel_sum(planes: &[Vec<f32>]) -> Vec<f32> {
    let mut sum = planes[0].clone();
    for plane in &planes[1..] {
        for (sum, value) in sum.iter_mut().zip(plane) {
            *sum += value;
        }
    }
    sum
}

/// A shot's photograph as a file to open.
fn source<'p>(path: &'p Path, shot: &Shot) -> Source<'p> {
    Source {
        path,
        what: "photograph",
        line: shot.line,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Manifest;
    use crate::test_capture::TestCapture;
    use iltm_picture::{Response, progress::Silent};

    #[test]
    fn photographs_too_large_to_be_kept_are_read_again_with_the_same_result() {
        let folder = tempfile::tempdir().unwrap();
        TestCapture::default().write(folder.path());
        let shots = Manifest::read(folder.path()).unwrap().shots;
        let order: Vec<usize> = (0..shots.len()).rev().collect();
        let mut photographs =
            Photographs::new(folder.path(), &shots, &Response::Linear.into()).unwrap();
        let collect = |photographs: &mut Photographs<'_>| {
            let mut seen = Vec::new();
            photographs
                .for_batches(&order, &Silent, |batch| {
                    seen.extend(batch.iter().map(|&(shot, photo)| (shot, photo.clone())));
                })
                .unwrap();
            seen
        };
        let (first, kept) = (collect(&mut photographs), collect(&mut photographs));
        photographs.batch = 3;
        assert_eq!(first, kept);
        // From the temporary file alone, and decoded once more without one.
        photographs.leave_memory();
        assert!(photographs.kept.iter().all(Option::is_none));
        let (taken, away) = (folder.path().join("photos"), folder.path().join("away"));
        std::fs::rename(&taken, &away).unwrap();
        assert_eq!(first, collect(&mut photographs));
        std::fs::rename(&away, &taken).unwrap();
        photographs.spool_mut().give_up();
        assert_eq!(first, collect(&mut photographs));
        assert!(
            first
                .iter()
                .map(|(shot, _)| *shot)
                .eq(order.iter().copied())
        );
    }

    #[test]
    fn the_first_unreadable_photograph_in_order_is_named() {
        let folder = tempfile::tempdir().unwrap();
        TestCapture::default().write(folder.path());
        let shots = Manifest::read(folder.path()).unwrap().shots;
        for broken in [7, 4] {
            std::fs::write(folder.path().join(&shots[broken].photo), b"not a PNG").unwrap();
        }
        let mut photographs =
            Photographs::new(folder.path(), &shots, &Response::Linear.into()).unwrap();
        let all: Vec<usize> = (0..shots.len()).collect();
        let error = photographs.for_batches(&all, &Silent, |_| {}).unwrap_err();
        assert!(
            error.to_string().contains("004.png: it is not a PNG, TIFF"),
            "{error}"
        );
    }
}
