//! Temporary file of decoded photographs: those that memory has no room for, so that they are
//! decoded once all the same.

use super::photo::Photo;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};

/// Decoded photographs of one size. Where the file cannot be made, is full or cannot be read, it
/// holds nothing, and photographs are decoded again.
#[derive(Debug)]
pub(super) struct Spool {
    /// Has no name, so that it is gone with the process.
    file: Option<File>,
    /// Whether it holds nothing from now on: it could not be made, is full, or is not wanted.
    given_up: bool,
    /// Which photographs are in it, each at its own place.
    held: Vec<bool>,
    channels: usize,
    pixels: usize,
}

impl Spool {
    /// For so many photographs; makes no file yet.
    pub(super) fn new(count: usize, channels: usize, pixels: usize) -> Self {
        Self {
            file: None,
            given_up: false,
            held: vec![false; count],
            channels,
            pixels,
        }
    }

    /// Writes a photograph at its place.
    pub(super) fn write(&mut self, at: usize, photo: &Photo) {
        if self.given_up {
            return;
        }
        self.held[at] = self.try_write(at, photo).is_ok();
        if !self.held[at] {
            self.give_up();
        }
    }

    /// A photograph, if it is held.
    pub(super) fn read(&mut self, at: usize) -> Option<Photo> {
        if !self.held[at] {
            return None;
        }
        let photo = self.try_read(at);
        self.held[at] = photo.is_ok();
        photo.ok()
    }

    /// Changes every photograph that is held.
    pub(super) fn change(&mut self, change: impl Fn(&mut Photo)) {
        for at in 0..self.held.len() {
            if let Some(mut photo) = self.read(at) {
                change(&mut photo);
                self.write(at, &photo);
            }
        }
    }

    /// Gives the file's space back and holds nothing from now on.
    pub(super) fn give_up(&mut self) {
        self.given_up = true;
        self.file = None;
        self.held.fill(false);
    }

    fn place(&self, at: usize) -> SeekFrom {
        SeekFrom::Start((at * self.channels * self.pixels * size_of::<f32>()) as u64)
    }

    fn try_write(&mut self, at: usize, photo: &Photo) -> io::Result<()> {
        let place = self.place(at);
        let file = match &mut self.file {
            Some(file) => file,
            none => none.insert(tempfile::tempfile()?),
        };
        file.seek(place)?;
        let mut planes = photo.planes.iter();
        planes.try_for_each(|plane| file.write_all(bytemuck::cast_slice(plane)))
    }

    fn try_read(&mut self, at: usize) -> io::Result<Photo> {
        let place = self.place(at);
        let mut planes = vec![vec![0.0_f32; self.pixels]; self.channels];
        let file = self.file.as_mut().ok_or(io::ErrorKind::NotFound)?;
        file.seek(place)?;
        for plane in &mut planes {
            file.read_exact(bytemuck::cast_slice_mut(plane))?;
        }
        Ok(Photo { planes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn photo(light: f32) -> Photo {
        Photo {
            planes: vec![vec![light, 0.5], vec![-light, f32::INFINITY]],
        }
    }

    #[test]
    fn photographs_come_back_as_they_were_written_or_changed_in_any_order() {
        let mut spool = Spool::new(4, 2, 2);
        spool.write(3, &photo(0.3));
        spool.write(1, &photo(0.1));
        assert_eq!(spool.read(1), Some(photo(0.1)));
        assert_eq!(spool.read(3), Some(photo(0.3)));
        assert_eq!(spool.read(0), None);
        spool.change(|photo| photo.planes[0][1] = 0.25);
        let changed = spool.read(1).unwrap();
        assert_eq!(changed.planes[0], [0.1, 0.25]);
        spool.give_up();
        spool.write(1, &photo(0.7));
        assert_eq!(spool.read(1), None);
    }

    #[test]
    fn what_cannot_be_read_or_written_is_not_held() {
        let mut spool = Spool::new(2, 2, 2);
        spool.write(0, &photo(0.1));
        spool.write(1, &photo(0.2));
        spool.file.as_mut().unwrap().set_len(20).unwrap();
        assert_eq!(spool.read(0), Some(photo(0.1)));
        assert_eq!(spool.read(1), None);
        // A file that is only open for reading stands for a full disk.
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f");
        std::fs::write(&path, [0; 64]).unwrap();
        spool.file = Some(File::open(&path).unwrap());
        spool.write(1, &photo(0.2));
        assert_eq!((spool.read(0), spool.read(1)), (None, None));
    }
}
