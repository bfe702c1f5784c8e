//! Lists of pictures to photograph, whatever they are shown for: every line of a folder.

use crate::{CALIBRATION_FILE, CaptureError, ListedRole, MANIFEST_FILE, ManifestOf, ShotOf};
use std::fmt;
use std::path::Path;

/// Name of the list in a folder that was made to verify a table.
pub const VERIFY_FILE: &str = "verify.csv";

/// Lists that a folder may hold: a capture's, and those of a folder made to verify a
/// table.
const LISTS: [&str; 3] = [MANIFEST_FILE, CALIBRATION_FILE, VERIFY_FILE];

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

    fn unknown(path: &Path, line: u64, role: &str) -> CaptureError {
        CaptureError::ManifestLine {
            path: path.to_owned(),
            line,
            reason: format!("the role \"{role}\" is no name"),
        }
    }
}

/// All lines of a folder's lists, each with the list that it stands on, list after list.
///
/// # Errors
/// [`CaptureError::NoManifest`] if there is no line, or what a list's line says.
pub fn listed(folder: &Path) -> Result<Vec<(&'static str, ShotOf<RoleName>)>, CaptureError> {
    let mut all = Vec::new();
    for list in LISTS {
        if let Some(manifest) = ManifestOf::<RoleName>::read_named(folder, list)? {
            all.extend(manifest.shots.into_iter().map(|shot| (list, shot)));
        }
    }
    if all.is_empty() {
        let path = folder.join(MANIFEST_FILE);
        return Err(CaptureError::NoManifest { path });
    }
    Ok(all)
}
