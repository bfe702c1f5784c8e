//! `capture.csv`: which pattern each photograph shows.

use super::{CaptureError, Role};
use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Component, Path, PathBuf};

/// Name of the manifest in a capture folder.
pub const MANIFEST_FILE: &str = "capture.csv";

/// The manifest's first line.
const HEADER: [&str; 4] = ["index", "role", "pattern", "photo"];

/// Bytes a manifest may have: about 100,000 photographs.
const MAX_BYTES: u64 = 8 << 20;

/// One line of the manifest: a pattern and the photograph taken of it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Shot {
    /// Order of the pattern in the sequence.
    pub index: u32,
    /// What the pattern was shown for.
    pub role: Role,
    /// Pattern file, relative to the capture folder.
    pub pattern: PathBuf,
    /// Photograph file, relative to the capture folder.
    pub photo: PathBuf,
    /// Line of `capture.csv`, the first is 1.
    pub line: u64,
}

/// All lines of a `capture.csv`, ordered by index.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Manifest {
    /// The photographs, ordered by [`Shot::index`].
    pub shots: Vec<Shot>,
}

impl Manifest {
    /// Reads the manifest of a capture folder.
    ///
    /// # Errors
    /// [`CaptureError::NoManifest`] if there is none, [`CaptureError::Io`] if it
    /// cannot be read, otherwise as [`Manifest::parse`].
    pub fn read(folder: &Path) -> Result<Self, CaptureError> {
        let path = folder.join(MANIFEST_FILE);
        let file = match File::open(&path) {
            Ok(file) => file,
            Err(error) if error.kind() == ErrorKind::NotFound => {
                return Err(CaptureError::NoManifest { path });
            }
            Err(source) => return Err(CaptureError::Io { path, source }),
        };
        let mut bytes = Vec::new();
        if let Err(source) = file.take(MAX_BYTES + 1).read_to_end(&mut bytes) {
            return Err(CaptureError::Io { path, source });
        }
        Self::parse(&bytes, &path)
    }

    /// Reads the contents of a manifest; `path` is only for errors.
    ///
    /// # Errors
    /// [`CaptureError::ManifestLine`], [`CaptureError::UnknownRole`],
    /// [`CaptureError::DuplicateIndex`] or [`CaptureError::OutsideFolder`], each
    /// with its line.
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, CaptureError> {
        let refuse = |line, reason| CaptureError::ManifestLine {
            path: path.to_owned(),
            line,
            reason,
        };
        if bytes.len() as u64 > MAX_BYTES {
            return Err(refuse(
                1,
                format!("the file is longer than {MAX_BYTES} bytes"),
            ));
        }
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .flexible(true)
            .has_headers(false)
            .from_reader(bytes);
        let mut lines = LineCounter::new(bytes);
        let mut seen = HashMap::new();
        let mut shots = Vec::new();
        let mut headed = false;
        for record in reader.records() {
            let record = record.map_err(|error| {
                let line = lines.at(error.position());
                refuse(line, "it is not readable text".to_owned())
            })?;
            let line = lines.at(record.position());
            if !headed {
                if !record.iter().eq(HEADER) {
                    return Err(refuse(
                        line,
                        format!("the header must be {}", HEADER.join(",")),
                    ));
                }
                headed = true;
                continue;
            }
            let shot = shot(&record, line, path)?;
            if let Some(first_line) = seen.insert(shot.index, line) {
                return Err(CaptureError::DuplicateIndex {
                    path: path.to_owned(),
                    line,
                    index: shot.index,
                    first_line,
                });
            }
            shots.push(shot);
        }
        if !headed {
            return Err(refuse(1, "the file is empty".to_owned()));
        }
        shots.sort_by_key(|shot| shot.index);
        Ok(Self { shots })
    }

    /// Writes the manifest as [`Manifest::parse`] reads it.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut text = HEADER.join(",") + "\n";
        for shot in &self.shots {
            let (pattern, photo) = (quoted(&shot.pattern), quoted(&shot.photo));
            // Writing into a string cannot fail.
            let _ = writeln!(text, "{},{},{pattern},{photo}", shot.index, shot.role);
        }
        text
    }
}

/// Counts lines up to where records begin. The reader's own count stops before
/// the line ends that precede a record.
struct LineCounter<'a> {
    bytes: &'a [u8],
    counted: usize,
    line: u64,
}

impl<'a> LineCounter<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self {
            bytes,
            counted: 0,
            line: 1,
        }
    }

    /// Line of the record that the reader found at or after `position`; positions
    /// must not go back.
    fn at(&mut self, position: Option<&csv::Position>) -> u64 {
        let from = position.map_or(self.counted, |p| p.byte() as usize);
        let is_end = |byte: &u8| matches!(byte, b'\r' | b'\n');
        let rest = self.bytes.get(from..).unwrap_or_default();
        let begin = from + rest.iter().take_while(|byte| is_end(byte)).count();
        let new = self.bytes.get(self.counted..begin).unwrap_or_default();
        self.line += new.split(|&byte| byte == b'\n').skip(1).count() as u64;
        self.counted = self.counted.max(begin);
        self.line
    }
}

/// Reads one line.
fn shot(record: &csv::StringRecord, line: u64, path: &Path) -> Result<Shot, CaptureError> {
    let refuse = |reason| CaptureError::ManifestLine {
        path: path.to_owned(),
        line,
        reason,
    };
    let fields: Vec<&str> = record.iter().collect();
    let &[index, role, pattern, photo] = fields.as_slice() else {
        return Err(refuse(format!(
            "{} fields instead of the {} of {}",
            fields.len(),
            HEADER.len(),
            HEADER.join(",")
        )));
    };
    let index = index.parse().map_err(|_| {
        refuse(format!(
            "the index \"{index}\" is not a whole number from 0"
        ))
    })?;
    let role = Role::from_name(role).ok_or_else(|| CaptureError::UnknownRole {
        path: path.to_owned(),
        line,
        role: role.to_owned(),
    })?;
    let inside = |file: &str| {
        inside_folder(file).ok_or_else(|| CaptureError::OutsideFolder {
            path: path.to_owned(),
            line,
            file: file.to_owned(),
        })
    };
    Ok(Shot {
        index,
        role,
        pattern: inside(pattern)?,
        photo: inside(photo)?,
        line,
    })
}

/// The path if it stays inside the folder it is relative to, on any system:
/// a capture made on one is read on another.
fn inside_folder(file: &str) -> Option<PathBuf> {
    let foreign = file.contains(['\\', '\0', ':']);
    let path = Path::new(file);
    let mut normal = 0;
    for component in path.components() {
        match component {
            Component::Normal(_) => normal += 1,
            Component::CurDir => {}
            Component::ParentDir | Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    (normal > 0 && !foreign).then(|| path.to_owned())
}

/// A path as a CSV field.
fn quoted(path: &Path) -> String {
    let text = path.to_string_lossy();
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.into_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn parse(text: &str) -> Result<Manifest, CaptureError> {
        Manifest::parse(text.as_bytes(), Path::new("capture.csv"))
    }

    fn refusal(lines: &str) -> String {
        parse(&format!("index,role,pattern,photo\n{lines}"))
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn lines_are_ordered_by_index_and_know_their_place() {
        let text = "index,role,pattern,photo\r\n7,white,p/7.png,f/7.png\r\n\r\n2, row-1-inverse ,./p/2.png,f/2.png\r\n";
        let shots = parse(text).unwrap().shots;
        assert_eq!((shots[0].index, shots[0].line), (2, 4));
        assert_eq!(
            shots[0].role,
            Role::Row {
                bit: 1,
                inverse: true
            }
        );
        assert_eq!((shots[1].index, shots[1].role), (7, Role::White));
    }

    #[test]
    fn a_byte_order_mark_is_no_reason_to_refuse() {
        assert!(parse("\u{feff}index,role,pattern,photo\n0,white,p.png,f.png\n").is_ok());
    }

    #[test]
    fn a_bad_line_is_named_with_its_number() {
        assert!(refusal("0,white,p,f\n1,black,p\n").contains("line 3: 3 fields"));
        assert!(refusal("x,white,p,f\n").contains("line 2: the index \"x\""));
        assert!(refusal("-1,white,p,f\n").contains("line 2: the index \"-1\""));
        assert!(refusal("0,grey,p,f\n").contains("line 2: unknown role \"grey\""));
        assert!(
            refusal("4,white,p,f\n4,black,p,f\n")
                .contains("line 3: index 4 is already used in line 2")
        );
        assert!(parse("").unwrap_err().to_string().contains("empty"));
        assert!(
            parse("a,b,c,d\n")
                .unwrap_err()
                .to_string()
                .contains("line 1: the header")
        );
        let not_text = Manifest::parse(b"index,role,pattern,photo\n0,\xff,p,f\n", Path::new("c"));
        assert!(
            not_text
                .unwrap_err()
                .to_string()
                .contains("line 2: it is not readable")
        );
    }

    #[test]
    fn a_path_out_of_the_folder_is_refused() {
        for file in [
            "/etc/x.png",
            "../x.png",
            "a/../../x.png",
            "c:\\x.png",
            "",
            ".",
            "a\\..\\x",
        ] {
            let text = refusal(&format!("0,white,p.png,\"{file}\"\n"));
            assert!(
                text.contains("line 2: ") && text.contains("inside the capture"),
                "{text}"
            );
        }
    }

    proptest! {
        #[test]
        fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            let _ = Manifest::parse(&bytes, Path::new("c"));
        }

        #[test]
        fn random_lines_never_panic(lines in "(([0-9]{0,3}|\"),?(white|row-[0-9]|bernoulli)?,[a-z./\"\\\\]{0,6},?\n?){0,8}") {
            let _ = parse(&format!("index,role,pattern,photo\n{lines}"));
        }

        #[test]
        fn a_written_manifest_is_read_back(names in proptest::collection::vec("[a-z ,\"é]{0,5}[a-z]", 1..9)) {
            let shots = names.iter().enumerate().map(|(i, name)| Shot {
                index: i as u32,
                role: Role::Bernoulli,
                pattern: format!("p/{name}").into(),
                photo: format!("f/{name}").into(),
                line: i as u64 + 2,
            }).collect();
            let manifest = Manifest { shots };
            prop_assert_eq!(parse(&manifest.to_csv()).unwrap(), manifest);
        }
    }
}
