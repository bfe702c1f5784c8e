//! Memory of an emulated board, as a file.
//!
//! The emulator maps the file; what either side writes, the other sees. Here it is
//! read and written through the file rather than mapped, since the system calls
//! cost little beside a frame and need no unsafe code.

use iltm_runtime::{
    frame_buffers::{ControlWords, layout::CONTROL_WORDS, psram},
    store::identity_record,
};
use std::fs::{File, OpenOptions};
use std::io;
use std::ops::Range;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// The file behind an emulated board's PSRAM.
#[derive(Debug)]
pub struct BoardMemory {
    file: File,
    path: PathBuf,
    /// Removes the file when the board is gone, where nobody asked to keep it.
    _temporary: Option<NamedTempFile>,
}

impl BoardMemory {
    /// Fresh memory that is gone with the board.
    ///
    /// # Errors
    /// What the operating system says if the file cannot be made.
    pub fn temporary() -> io::Result<Self> {
        let temporary = tempfile::Builder::new().prefix("iltm-board-").tempfile()?;
        let memory = Self {
            file: temporary.as_file().try_clone()?,
            path: temporary.path().to_owned(),
            _temporary: Some(temporary),
        };
        memory.make()?;
        Ok(memory)
    }

    /// Memory that stays in `path`: what an earlier board left there, a new board
    /// finds.
    ///
    /// # Errors
    /// What the operating system says if the file cannot be opened or made, and
    /// [`io::ErrorKind::InvalidData`] if it is not as large as the memory.
    pub fn kept(path: &Path) -> io::Result<Self> {
        let mut options = OpenOptions::new();
        let options = options.read(true).write(true).create(true).truncate(false);
        let file = options.open(path)?;
        let memory = Self {
            file,
            path: path.to_owned(),
            _temporary: None,
        };
        match memory.file.metadata()?.len() {
            0 => memory.make()?,
            length if length == psram::SIZE as u64 => {}
            length => {
                let message = format!(
                    "it has {length} bytes; a board's memory has {}",
                    psram::SIZE
                );
                return Err(io::Error::new(io::ErrorKind::InvalidData, message));
            }
        }
        Ok(memory)
    }

    /// Memory as from the factory: the flash erased, everything else zero.
    fn make(&self) -> io::Result<()> {
        self.file.set_len(psram::SIZE as u64)?;
        self.erase(&psram::FLASH)
    }

    fn erase(&self, range: &Range<usize>) -> io::Result<()> {
        self.write(range, &vec![0xFF; range.len()])
    }

    /// Puts a table's file into slot A past the device, as a debug port would: it is
    /// the only table then, and nothing is known of earlier ones. The device's key and
    /// number stay.
    ///
    /// # Errors
    /// What the operating system says, and [`io::ErrorKind::FileTooLarge`] if it is
    /// larger than a slot.
    pub fn put_table(&self, file: &[u8]) -> io::Result<()> {
        if file.len() > psram::SLOT_A.len() {
            return Err(io::ErrorKind::FileTooLarge.into());
        }
        let [first, second] = psram::RECORDS;
        for part in [psram::SLOT_A, psram::SLOT_B, first, second] {
            self.erase(&part)?;
        }
        self.write(&psram::SLOT_A, file)
    }

    /// Gives the board a public key and a number, as its factory would.
    ///
    /// # Errors
    /// What the operating system says, and [`io::ErrorKind::AlreadyExists`] if it has
    /// others.
    pub fn provision(&self, key: [u8; 32], device: u64) -> io::Result<()> {
        let record = identity_record(key, device);
        let mut there = [0; psram::SECTOR];
        self.read(&psram::IDENTITY, &mut there)?;
        if there.starts_with(&record) {
            return Ok(());
        }
        if there.iter().any(|byte| *byte != 0xFF) {
            return Err(io::ErrorKind::AlreadyExists.into());
        }
        self.write(&psram::IDENTITY, &record)
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes bytes at the start of a range of [`psram`], which must hold them.
    ///
    /// # Errors
    /// What the operating system says, and [`io::ErrorKind::FileTooLarge`] if they
    /// are more than the range.
    pub fn write(&self, range: &Range<usize>, bytes: &[u8]) -> io::Result<()> {
        if bytes.len() > range.len() {
            return Err(io::ErrorKind::FileTooLarge.into());
        }
        self.file.write_all_at(bytes, range.start as u64)
    }

    /// Reads bytes from the start of a range of [`psram`].
    ///
    /// # Errors
    /// What the operating system says.
    pub fn read(&self, range: &Range<usize>, bytes: &mut [u8]) -> io::Result<()> {
        self.file.read_exact_at(bytes, range.start as u64)
    }

    /// The control words of the frame memory.
    ///
    /// # Errors
    /// What the operating system says.
    pub fn words(&self) -> io::Result<FileWords> {
        let file = self.file.try_clone()?;
        Ok(FileWords { file })
    }
}

/// Control words of the frame memory in the file.
///
/// A word that cannot be read is zero, and one that cannot be written stays: both
/// look to the caller like a board that does nothing, which is what is left when
/// its memory fails.
#[derive(Debug)]
pub struct FileWords {
    file: File,
}

impl FileWords {
    fn offset(index: usize) -> Option<u64> {
        (index < CONTROL_WORDS).then_some((psram::FRAMES.start + 4 * index) as u64)
    }
}

impl ControlWords for FileWords {
    fn load(&self, index: usize) -> u32 {
        let mut bytes = [0; 4];
        let read = Self::offset(index).map(|offset| self.file.read_exact_at(&mut bytes, offset));
        match read {
            Some(Ok(())) => u32::from_le_bytes(bytes),
            _ => 0,
        }
    }

    fn store(&self, index: usize, value: u32) {
        if let Some(offset) = Self::offset(index) {
            let _ = self.file.write_all_at(&value.to_le_bytes(), offset);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kept_memory_is_found_again_and_another_file_is_refused() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("memory");
        let memory = BoardMemory::kept(&path).expect("a new file");
        memory.write(&psram::SLOT_A, b"table").expect("room");
        let memory = BoardMemory::kept(&path).expect("the same file");
        let mut bytes = [0; 5];
        memory.read(&psram::SLOT_A, &mut bytes).expect("there");
        assert_eq!(&bytes, b"table");
        std::fs::write(&path, b"something else").expect("writable");
        let error = BoardMemory::kept(&path).expect_err("too short");
        assert_eq!(error.kind(), io::ErrorKind::InvalidData);
    }

    #[test]
    fn a_board_has_one_key_and_one_number() {
        let memory = BoardMemory::temporary().expect("a temporary file");
        memory.provision([7; 32], 9).expect("it has none");
        memory.put_table(b"table").expect("room");
        memory.provision([7; 32], 9).expect("the same");
        for (key, device) in [([8; 32], 9), ([7; 32], 10)] {
            let error = memory.provision(key, device).expect_err("others");
            assert_eq!(error.kind(), io::ErrorKind::AlreadyExists);
        }
        let mut record = [0; 44];
        memory.read(&psram::IDENTITY, &mut record).expect("there");
        assert_eq!(&record[..4], b"ILTI");
        assert_eq!(record[4..36], [7; 32]);
        assert_eq!(record[36..], 9_u64.to_le_bytes());
    }

    #[test]
    fn a_table_is_put_alone_into_the_first_slot() {
        let memory = BoardMemory::temporary().expect("a temporary file");
        memory.write(&psram::SLOT_B, b"another").expect("room");
        memory.write(&psram::RECORDS[0], b"record").expect("room");
        memory.put_table(b"table").expect("room");
        let read = |range: &Range<usize>| {
            let mut bytes = [0; 8];
            memory.read(range, &mut bytes).expect("there");
            bytes
        };
        assert_eq!(read(&psram::SLOT_A), *b"table\xFF\xFF\xFF");
        assert_eq!(read(&psram::SLOT_B), [0xFF; 8]);
        assert_eq!(read(&psram::RECORDS[0]), [0xFF; 8]);
        let long = vec![0; psram::SLOT_A.len() + 1];
        let error = memory.put_table(&long).expect_err("too long");
        assert_eq!(error.kind(), io::ErrorKind::FileTooLarge);
        assert_eq!(read(&psram::SLOT_A)[..5], *b"table");
    }

    #[test]
    fn what_does_not_fit_its_range_is_not_written() {
        let memory = BoardMemory::temporary().expect("a temporary file");
        let error = memory.write(&(4..6), b"abc").expect_err("too long");
        assert_eq!(error.kind(), io::ErrorKind::FileTooLarge);
    }

    #[test]
    fn words_lie_in_the_frame_memory_and_nowhere_else() {
        let memory = BoardMemory::temporary().expect("a temporary file");
        let words = memory.words().expect("the same file");
        words.store(3, 0x0403_0201);
        words.store(CONTROL_WORDS, u32::MAX);
        assert_eq!((words.load(3), words.load(CONTROL_WORDS)), (0x0403_0201, 0));
        let mut bytes = [0xAA; 20];
        memory.read(&psram::FRAMES, &mut bytes).expect("there");
        assert_eq!(bytes[12..16], [1, 2, 3, 4]);
        assert_eq!(bytes[16..], [0; 4]);
    }
}
