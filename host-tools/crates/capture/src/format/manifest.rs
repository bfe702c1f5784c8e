//! Manifest: `capture.csv` and `calibration.csv` say which picture each photograph shows.

use super::error::CaptureError;
use super::role::Role;
use super::stripe_role::STRIPES_FILE;
use iltm_picture::foreign_file;
use std::collections::HashMap;
use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

/// Name of the manifest in a capture folder.
pub const MANIFEST_FILE: &str = "capture.csv";

/// Name of the manifest of the calibration photographs in a capture folder. It may
/// be absent.
pub const CALIBRATION_FILE: &str = "calibration.csv";

/// A manifest's first line. The last column may be left out.
const HEADER: [&str; 5] = ["index", "role", "pattern", "photo", "exposure"];

/// Columns that every manifest has.
const NEEDED: usize = 4;

/// Bytes a manifest may have: about 100,000 photographs.
const MAX_BYTES: u64 = 8 << 20;

/// What the pictures of one manifest are shown for.
pub trait ListedRole: Clone + fmt::Display {
    /// Name of the manifest in a capture folder.
    const FILE: &'static str;

    /// Reads a role's name; `None` if it is not one.
    fn from_name(name: &str) -> Option<Self>;

    /// What to do about another name.
    const NEXT_STEP: &'static str = LINE;

    /// What is said about another name.
    fn unknown(role: &str) -> String;
}

/// What to do about a line that is not as it should be.
pub(super) const LINE: &str = "Write the header and every line as index,role,pattern,photo.";

impl ListedRole for Role {
    const FILE: &'static str = MANIFEST_FILE;
    const NEXT_STEP: &'static str = "Use white, black, column-B, column-B-inverse, row-B, \
         row-B-inverse, bernoulli or image, B being a bit from 0.";

    fn from_name(name: &str) -> Option<Self> {
        Self::from_name(name)
    }

    fn unknown(role: &str) -> String {
        format!("unknown role {role:?}")
    }
}

/// One line of a manifest: a pattern and the photograph taken of it.
#[derive(Clone, PartialEq, Debug)]
pub struct ShotOf<R> {
    /// Order of the pattern in the sequence.
    pub index: u32,
    /// What the pattern was shown for.
    pub role: R,
    /// Pattern file, relative to the capture folder.
    pub pattern: PathBuf,
    /// Photograph file, relative to the capture folder.
    pub photo: PathBuf,
    /// How long light was gathered, above 0, in seconds or any other unit that all
    /// lines share; `None` where nothing is said.
    pub exposure: Option<f64>,
    /// Line of the manifest, the first is 1.
    pub line: u64,
}

impl<R> ShotOf<R> {
    /// The same as a line of `capture.csv`: with another role.
    pub(crate) fn with_role(&self, role: Role) -> Shot {
        Shot {
            index: self.index,
            role,
            pattern: self.pattern.clone(),
            photo: self.photo.clone(),
            exposure: self.exposure,
            line: self.line,
        }
    }
}

/// One line of `capture.csv`.
pub type Shot = ShotOf<Role>;

/// All lines of a manifest, ordered by index.
#[derive(Clone, PartialEq, Debug)]
pub struct ManifestOf<R> {
    /// The photographs, ordered by [`ShotOf::index`].
    pub shots: Vec<ShotOf<R>>,
}

/// All lines of a `capture.csv`, ordered by index.
pub type Manifest = ManifestOf<Role>;

/// File with a number in a folder of a capture: `FOLDER/007.png`.
#[must_use]
pub fn numbered(folder: &str, index: u32) -> PathBuf {
    Path::new(folder).join(format!("{index:03}.png"))
}

impl<R> ManifestOf<R> {
    /// The manifest of pictures whose files have their indices as names, in the folder
    /// `patterns`; their photographs are in `photos`.
    pub fn numbered(patterns: &str, roles: impl IntoIterator<Item = (u32, R)>) -> Self {
        let shot = |((index, role), line)| ShotOf {
            index,
            role,
            pattern: numbered(patterns, index),
            photo: numbered("photos", index),
            exposure: None,
            line,
        };
        // The header is the first line.
        Self {
            shots: roles.into_iter().zip(2..).map(shot).collect(),
        }
    }
}

impl<R: ListedRole> ManifestOf<R> {
    /// Reads the manifest of a capture folder.
    ///
    /// # Errors
    /// [`CaptureError::NoManifest`] if there is none, [`CaptureError::Io`] if it
    /// cannot be read, otherwise as [`ManifestOf::parse`].
    pub fn read(folder: &Path) -> Result<Self, CaptureError> {
        let path = || folder.join(R::FILE);
        Self::read_if_there(folder)?.ok_or_else(|| CaptureError::NoManifest { path: path() })
    }

    /// Reads the manifest of a capture folder; `None` if there is none.
    ///
    /// # Errors
    /// [`CaptureError::Io`] if it cannot be read, otherwise as
    /// [`ManifestOf::parse`].
    pub fn read_if_there(folder: &Path) -> Result<Option<Self>, CaptureError> {
        Self::read_named(folder, R::FILE)
    }

    /// The same of a manifest with another name.
    ///
    /// # Errors
    /// As [`ManifestOf::read_if_there`].
    pub fn read_named(folder: &Path, name: &str) -> Result<Option<Self>, CaptureError> {
        let path = folder.join(name);
        match read_small(&path, MAX_BYTES) {
            Ok(bytes) => bytes.map(|bytes| Self::parse(&bytes, &path)).transpose(),
            Err(source) => Err(CaptureError::Io { path, source }),
        }
    }

    /// Reads the contents of a manifest; `path` is only for errors.
    ///
    /// # Errors
    /// [`CaptureError::ManifestLine`] with the first line that cannot be used.
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self, CaptureError> {
        let refuse_by = |line, (reason, next_step)| CaptureError::ManifestLine {
            path: path.to_owned(),
            line,
            reason,
            next_step,
        };
        let refuse = |line, reason| refuse_by(line, (reason, LINE));
        if bytes.len() as u64 > MAX_BYTES {
            return Err(refuse(
                1,
                format!("the file is longer than {MAX_BYTES} bytes"),
            ));
        }
        // Spreadsheets of countries that write decimals with a comma separate by semicolons.
        let header = bytes
            .split(|byte| *byte == b'\n')
            .find(|line| !line.trim_ascii().is_empty());
        let semicolons = header.is_some_and(|line| line.contains(&b';') && !line.contains(&b','));
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(if semicolons { b';' } else { b',' })
            .trim(csv::Trim::All)
            .flexible(true)
            .has_headers(false)
            .from_reader(bytes);
        let mut lines = LineCounter::new(bytes);
        let mut seen = HashMap::new();
        let mut shots = Vec::new();
        let mut columns = 0;
        for record in reader.records() {
            let record = record.map_err(|error| {
                let line = lines.at(error.position());
                refuse(line, "it is not readable text".to_owned())
            })?;
            let line = lines.at(record.position());
            if columns == 0 {
                columns = record.len();
                if columns < NEEDED || !record.iter().eq(HEADER.into_iter().take(columns)) {
                    let needed = HEADER[..NEEDED].join(",");
                    let reason = format!("the header must be {needed}; \"exposure\" may follow");
                    return Err(refuse(line, reason));
                }
                continue;
            }
            let shot = shot(&record, columns, line).map_err(|flaw| refuse_by(line, flaw))?;
            if let Some(first) = seen.insert(shot.index, line) {
                let reason = format!("index {} is already used in line {first}", shot.index);
                let flaw = (reason, "Give every line an index of its own.");
                return Err(refuse_by(line, flaw));
            }
            shots.push(shot);
        }
        if columns == 0 {
            return Err(refuse(1, "the file is empty".to_owned()));
        }
        shots.sort_by_key(|shot| shot.index);
        Ok(Self { shots })
    }

    /// Writes the manifest as [`ManifestOf::parse`] reads it; the column of exposures
    /// only if some line has one.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let exposed = self.shots.iter().any(|shot| shot.exposure.is_some());
        let columns = if exposed { HEADER.len() } else { NEEDED };
        let mut writer = csv::Writer::from_writer(Vec::new());
        let mut line = |fields: &[String]| {
            // Writing into memory cannot fail, and all lines have as many fields.
            let _ = writer.write_record(&fields[..columns]);
        };
        line(&HEADER.map(str::to_owned));
        for shot in &self.shots {
            let exposure = shot.exposure.map(|exposure| exposure.to_string());
            line(&[
                shot.index.to_string(),
                shot.role.to_string(),
                shot.pattern.to_string_lossy().into_owned(),
                shot.photo.to_string_lossy().into_owned(),
                exposure.unwrap_or_default(),
            ]);
        }
        let bytes = writer.into_inner().unwrap_or_default();
        String::from_utf8_lossy(&bytes).into_owned()
    }
}

/// The bytes of a file, `most` and one more of a longer one; `None` if there is no such
/// file.
///
/// # Errors
/// What the operating system says.
pub(super) fn read_small(path: &Path, most: u64) -> io::Result<Option<Vec<u8>>> {
    let mut bytes = Vec::new();
    let read = |file: File| file.take(most + 1).read_to_end(&mut bytes);
    match foreign_file::open(path).and_then(read) {
        Ok(_) => Ok(Some(bytes)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
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

/// What is wrong with a line, and what to do about it.
type Flaw = (String, &'static str);

/// Reads one line of as many `columns` as the header.
fn shot<R: ListedRole>(
    record: &csv::StringRecord,
    columns: usize,
    line: u64,
) -> Result<ShotOf<R>, Flaw> {
    let fields: Vec<&str> = record.iter().collect();
    let (&[index, role, pattern, photo, ref exposure @ ..], true) =
        (fields.as_slice(), fields.len() == columns)
    else {
        let (found, header) = (fields.len(), HEADER[..columns].join(","));
        let reason = format!("{found} fields instead of the {columns} of {header}");
        return Err((reason, LINE));
    };
    let index = index.parse().map_err(|_| {
        let reason = format!("the index \"{index}\" is not a whole number from 0");
        (reason, LINE)
    })?;
    let role = R::from_name(role).ok_or_else(|| (R::unknown(role), R::NEXT_STEP))?;
    let exposure = match exposure.first() {
        None | Some(&"") => None,
        Some(text) => Some(self::exposure(text).ok_or_else(|| {
            let reason = format!(
                "the exposure \"{text}\" is not a number above 0 (seconds, or any unit that all \
                 lines share)"
            );
            (reason, LINE)
        })?),
    };
    let inside = |file: &str| {
        inside_folder(file).ok_or_else(|| {
            if inside_folder(&file.replace('\\', "/")).is_some() {
                let reason = format!("{file:?} separates its folder by \\");
                return (
                    reason,
                    "Write / instead of \\ in capture.csv, on Windows too.",
                );
            }
            let reason = format!(
                "{file:?} is not a relative path inside the capture without \\ : \" % {{ }} or \
                 control characters"
            );
            let next_step =
                "Copy the file into the capture folder and name it relative to that folder.";
            (reason, next_step)
        })
    };
    Ok(ShotOf {
        index,
        role,
        pattern: inside(pattern)?,
        photo: inside(photo)?,
        exposure,
        line,
    })
}

/// A number of seconds, or of another unit, with a point or a comma.
fn exposure(text: &str) -> Option<f64> {
    let exposure: f64 = text.replace(',', ".").parse().ok()?;
    // Neither zero nor so far out that a ratio of two would be.
    (1e-9..=1e9).contains(&exposure).then_some(exposure)
}

/// The path if it stays inside the folder it is relative to, on any system: a capture
/// made on one is read on another. Names are also put into shell commands: quotes,
/// percent signs, braces and control characters, which no quoting makes safe on every
/// system, are refused.
fn inside_folder(file: &str) -> Option<PathBuf> {
    let foreign = file.contains(['\\', ':', '"', '%', '{', '}']) || file.contains(char::is_control);
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

/// Name of the list in a folder that was made to verify a table.
pub const VERIFY_FILE: &str = "verify.csv";

/// List of the patterns that tell the cells of one of several projectors in a folder made to verify
/// their table, counted from 1: as `capture.csv`, but that a pattern has the columns of all projectors.
#[must_use]
pub fn projector_file(projector: usize) -> String {
    format!("projector-{projector}.csv")
}

/// List of that projector's fine stripes: as `stripes.csv`, but of slides of all projectors.
#[must_use]
pub fn projector_stripes_file(projector: usize) -> String {
    format!("projector-{projector}-stripes.csv")
}

/// Lists that a folder may hold: a capture's, and those of a folder made to verify a
/// table. There may be those of [`projector_file`] too.
const LISTS: [&str; 4] = [MANIFEST_FILE, CALIBRATION_FILE, STRIPES_FILE, VERIFY_FILE];

/// A role by its name alone: whoever photographs need not know more.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct RoleName(pub String);

impl fmt::Display for RoleName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl ListedRole for RoleName {
    const FILE: &'static str = MANIFEST_FILE;

    fn from_name(name: &str) -> Option<Self> {
        (!name.is_empty()).then(|| Self(name.to_owned()))
    }

    fn unknown(role: &str) -> String {
        format!("the role {role:?} is no name")
    }
}

/// All lines of a folder's lists, each with the list that it stands on, list after list.
///
/// # Errors
/// [`CaptureError::NoManifest`] if there is no line, or what a list's line says.
pub fn listed(folder: &Path) -> Result<Vec<(String, ShotOf<RoleName>)>, CaptureError> {
    let mut all = Vec::new();
    let mut add = |list: String| {
        let Some(manifest) = ManifestOf::<RoleName>::read_named(folder, &list)? else {
            return Ok(false);
        };
        let shots = manifest.shots.into_iter();
        all.extend(shots.map(|shot| (list.clone(), shot)));
        Ok(true)
    };
    for list in LISTS {
        add(list.to_owned())?;
    }
    let mut projector = 1;
    while add(projector_file(projector))? {
        add(projector_stripes_file(projector))?;
        projector += 1;
    }
    if all.is_empty() {
        let path = folder.join(MANIFEST_FILE);
        return Err(CaptureError::NoManifest { path });
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CalibrationManifest, CalibrationRole};
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
    fn semicolons_separate_too_and_a_backslash_is_named() {
        let text = "index;role;pattern;photo;exposure\r\n0;white;p/0.png;f/0.png;0,5\r\n";
        let shots = parse(text).unwrap().shots;
        assert_eq!(shots[0].photo, Path::new("f/0.png"));
        assert_eq!(shots[0].exposure, Some(0.5));
        let said = refusal("0,white,p/0.png,f\\0.png\n");
        assert!(said.contains("separates its folder by"), "{said}");
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
    fn a_column_of_exposures_may_follow_and_have_gaps() {
        let text = "index,role,pattern,photo,exposure\n0,white,p,f,0.0125\n1,white,p,g,\n";
        let manifest = parse(text).unwrap();
        let exposures = manifest.shots.iter().map(|shot| shot.exposure);
        assert!(exposures.eq([Some(0.0125), None]));
        assert_eq!(manifest.to_csv(), text);
        for bad in ["0", "-1", "nan", "inf", "1/60", "1e300"] {
            let text = format!("index,role,pattern,photo,exposure\n0,white,p,f,{bad}\n");
            let error = parse(&text).unwrap_err().to_string();
            assert!(error.contains("line 2: the exposure"), "{error}");
        }
    }

    #[test]
    fn a_manifest_without_exposures_keeps_its_four_columns() {
        let text = "index,role,pattern,photo\n0,white,p,f\n";
        assert_eq!(parse(text).unwrap().to_csv(), text);
        assert!(refusal("0,white,p,f,0.5\n").contains("line 2: 5 fields instead of the 4"));
    }

    #[test]
    fn calibration_has_roles_of_its_own() {
        let path = Path::new("calibration.csv");
        let parse = |text: &str| CalibrationManifest::parse(text.as_bytes(), path);
        let text = "index,role,pattern,photo\n2,ramp-white-032,c,f\n5,probe,c,f\n";
        let manifest = parse(text).unwrap();
        assert_eq!(manifest.shots[1].role, CalibrationRole::Probe);
        assert_eq!(manifest.to_csv(), text);
        let error = parse("index,role,pattern,photo\n0,white,p,f\n").unwrap_err();
        let error = error.to_string();
        assert!(error.contains("line 2: unknown role \"white\""), "{error}");
        assert!(error.contains("ramp-white-LLL"), "{error}");
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
            "{stem};touch x;#.png",
            "%PATH%.png",
            "\"\"&calc&.png",
            "x\u{1b}[2J.png",
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
        fn a_written_manifest_is_read_back(
            names in proptest::collection::vec("[a-z ,'é]{0,5}[a-z]", 1..9),
            exposed: bool,
        ) {
            let shots = names.iter().enumerate().map(|(i, name)| Shot {
                index: i as u32,
                role: Role::Bernoulli,
                pattern: format!("p/{name}").into(),
                photo: format!("f/{name}").into(),
                exposure: (exposed && i % 3 != 1).then_some(0.1 + i as f64 / 7.0),
                line: i as u64 + 2,
            }).collect();
            let manifest = Manifest { shots };
            prop_assert_eq!(parse(&manifest.to_csv()).unwrap(), manifest);
        }
    }
}
