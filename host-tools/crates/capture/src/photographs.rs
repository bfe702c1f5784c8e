//! All photographs of a capture, within a fixed amount of memory.

use super::calibration::Unmix;
use super::frame::{self, Frame};
use super::photo::{Photo, PhotoFormat, Reading};
use super::picture::Source;
use super::{CaptureError, Shot};
use iltm_picture::progress::Progress;
use rayon::prelude::*;
use std::path::Path;

/// Bytes of photographs that are kept decoded. A capture that needs more is
/// decoded again in every pass.
const KEPT_BYTES: usize = 512 << 20;

/// Bytes of photographs that are decoded at the same time.
const BATCH_BYTES: usize = 1 << 30;

/// The photographs named in a manifest, those of a bracket as one.
pub(super) struct Photographs<'a> {
    folder: &'a Path,
    frames: Vec<Frame>,
    pub(super) format: PhotoFormat,
    /// What a sample reads as that is saturated in every photograph of its frame:
    /// more than any other reads.
    pub(super) saturated: f32,
    /// From camera channels to the projector's.
    unmix: Option<Unmix>,
    /// One entry a frame, if all of them fit [`KEPT_BYTES`].
    kept: Option<Vec<Option<Photo>>>,
    /// Photographs decoded at the same time.
    batch: usize,
}

impl<'a> Photographs<'a> {
    /// Takes the format of the first photograph; decodes nothing yet. Every shot is
    /// a photograph of its own.
    ///
    /// # Errors
    /// As [`Photographs::of_frames`].
    pub(super) fn new(
        folder: &'a Path,
        shots: &[Shot],
        reading: &Reading,
    ) -> Result<Self, CaptureError> {
        let longest = frame::longest(shots, &folder.join(super::MANIFEST_FILE))?;
        Self::of_frames(folder, Frame::of_each(shots, longest), reading)
    }

    /// Takes the format of the first photograph; decodes nothing yet.
    ///
    /// # Errors
    /// As [`PhotoFormat::of_first`]. Without any frame, [`CaptureError::NoWhite`].
    pub(super) fn of_frames(
        folder: &'a Path,
        frames: Vec<Frame>,
        reading: &Reading,
    ) -> Result<Self, CaptureError> {
        let Some(first) = frames.first().and_then(|frame| frame.shots.first()) else {
            return Err(CaptureError::NoWhite {
                path: folder.join(super::MANIFEST_FILE),
            });
        };
        let path = folder.join(&first.photo);
        let format = PhotoFormat::of_first(source(&path, first), reading)?;
        let fits = format.bytes().saturating_mul(frames.len()) <= KEPT_BYTES;
        let largest = frames.iter().map(|f| f.shots.len()).max().unwrap_or(1);
        let batch = (BATCH_BYTES / largest / format.decoding_bytes()).clamp(1, 16);
        let times = frames.iter().flat_map(|frame| &frame.times);
        Ok(Self {
            saturated: times.fold(Photo::SATURATED, |most, time| most.max((1.0 / time) as f32)),
            kept: fits.then(|| vec![None; frames.len()]),
            folder,
            frames,
            format,
            unmix: None,
            batch,
        })
    }

    /// Whether photographs differ in exposure.
    pub(super) fn bracketed(&self) -> bool {
        self.saturated > Photo::SATURATED
    }

    /// Turns every photograph's channels into the projector's from now on.
    pub(super) fn unmix(&mut self, unmix: Unmix) {
        for photo in self.kept.iter_mut().flatten().flatten() {
            unmix.apply(photo, self.saturated);
        }
        self.unmix = Some(unmix);
    }

    /// As if the photographs were too large to be kept.
    #[cfg(test)]
    pub(super) fn forget(&mut self) {
        (self.kept, self.batch) = (None, 3);
    }

    /// The file of a frame, the first if there are several.
    pub(super) fn path(&self, frame: usize) -> std::path::PathBuf {
        self.folder.join(&self.frames[frame].shots[0].photo)
    }

    /// The photographs of a frame one by one, each in light of its own full scale.
    ///
    /// # Errors
    /// As [`PhotoFormat::read`].
    pub(super) fn each_of(&self, frame: usize) -> Result<Vec<Photo>, CaptureError> {
        let photo = |shot: &Shot| {
            let path = self.folder.join(&shot.photo);
            self.format.read(source(&path, shot))
        };
        self.frames[frame].shots.iter().map(photo).collect()
    }

    /// Reads the photographs of a frame and makes one of them.
    fn read(&self, frame: usize) -> Result<Photo, CaptureError> {
        let mut photos = self.each_of(frame)?;
        let times = &self.frames[frame].times;
        let mut one = match photos.len() {
            1 if !self.bracketed() => photos.remove(0),
            _ => frame::merge(&photos, times, self.format.bits, self.saturated),
        };
        if let Some(unmix) = &self.unmix {
            unmix.apply(&mut one, self.saturated);
        }
        Ok(one)
    }

    /// Hands the photographs of `shots` (indices of frames) to `visit`
    /// in batches, in order, as pairs of index and photograph.
    ///
    /// # Errors
    /// The first photograph in order that cannot be read, as
    /// [`PhotoFormat::read`].
    pub(super) fn for_batches(
        &mut self,
        shots: &[usize],
        progress: &dyn Progress,
        mut visit: impl FnMut(&[(usize, &Photo)]),
    ) -> Result<(), CaptureError> {
        for batch in shots.chunks(self.batch) {
            let known = |shot: usize| matches!(&self.kept, Some(kept) if kept[shot].is_some());
            let new: Vec<usize> = batch.iter().copied().filter(|&s| !known(s)).collect();
            let read: Vec<Result<Photo, CaptureError>> =
                new.par_iter().map(|&frame| self.read(frame)).collect();
            let read = read.into_iter().collect::<Result<Vec<_>, _>>()?;
            match &mut self.kept {
                Some(kept) => {
                    for (&shot, photo) in new.iter().zip(read) {
                        kept[shot] = Some(photo);
                    }
                    let pairs: Vec<(usize, &Photo)> = batch
                        .iter()
                        .filter_map(|&shot| Some((shot, kept[shot].as_ref()?)))
                        .collect();
                    visit(&pairs);
                }
                None => visit(&new.into_iter().zip(&read).collect::<Vec<_>>()),
            }
            progress.advance(batch.len() as u64);
        }
        Ok(())
    }

    /// Decodes all photographs in parallel, if they are going to be kept.
    ///
    /// # Errors
    /// As [`Photographs::for_batches`].
    pub(super) fn prefetch(&mut self, progress: &dyn Progress) -> Result<(), CaptureError> {
        if self.kept.is_none() {
            return Ok(());
        }
        let all: Vec<usize> = (0..self.frames.len()).collect();
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
    pub(super) fn mean(
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
    use super::super::Manifest;
    use super::super::test_capture::TestCapture;
    use super::*;
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
        photographs.forget();
        assert_eq!(first, kept);
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
