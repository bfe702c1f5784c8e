//! Files of the user rather than of a project: settings, and state that is kept between
//! two commands.
//!
//! | what | file |
//! |---|---|
//! | settings: the port, and ports never to open | [`config`] |
//! | ports of emulated boards that run now | [`emulated`] |
//! | folders, and transcripts of the last transfers for `iltm support-bundle` | here |

pub mod config;
pub mod emulated;

pub use config::{Config, ConfigError};

use etcetera::app_strategy::{AppStrategy, AppStrategyArgs, choose_app_strategy};
use std::fs::{self, File};
use std::path::PathBuf;
use std::{env, io};

/// Folders of the user. They need not be there yet.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Folders {
    /// Settings; `ILTM_CONFIG_DIR` takes precedence over the system's place.
    pub config: PathBuf,
    /// What is kept between two commands; likewise `ILTM_STATE_DIR`.
    pub state: PathBuf,
}

impl Folders {
    /// The folders of whoever runs this; none without a home folder.
    #[must_use]
    pub fn of_user() -> Option<Self> {
        let strategy = choose_app_strategy(AppStrategyArgs {
            top_level_domain: String::new(),
            author: String::new(),
            app_name: "iltm".to_owned(),
        });
        let given = |name| env::var_os(name).filter(|path| !path.is_empty());
        let given = |name| given(name).map(PathBuf::from);
        let usual = strategy.as_ref().ok();
        Some(Self {
            config: given("ILTM_CONFIG_DIR").or_else(|| usual.map(AppStrategy::config_dir))?,
            state: given("ILTM_STATE_DIR").or_else(|| {
                // Where the system has no place for state it goes with the caches' kin.
                usual.map(|usual| usual.state_dir().unwrap_or_else(|| usual.data_dir()))
            })?,
        })
    }
}

/// Folder of the transcripts.
const TRANSCRIPTS: &str = "transcripts";

/// How many transcripts are kept.
const KEPT: usize = 5;

/// Begins the transcript of a transfer and removes those that are too old.
///
/// # Errors
/// What the operating system says.
pub fn begin_transcript(folders: &Folders) -> io::Result<File> {
    let folder = folders.state.join(TRANSCRIPTS);
    fs::create_dir_all(&folder)?;
    for old in transcripts(folders).into_iter().skip(KEPT - 1) {
        let _ = fs::remove_file(old);
    }
    let now = chrono::Local::now().format("%Y%m%d-%H%M%S%.3f");
    File::create(folder.join(format!("flash-{now}-{}.txt", std::process::id())))
}

/// Transcripts of the last transfers, the newest first.
#[must_use]
pub fn transcripts(folders: &Folders) -> Vec<PathBuf> {
    let entries = fs::read_dir(folders.state.join(TRANSCRIPTS));
    let entries = entries.into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "txt"));
    // Names begin with the time.
    files.sort();
    files.reverse();
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_five_transcripts_are_kept() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let folders = Folders {
            config: folder.path().to_owned(),
            state: folder.path().to_owned(),
        };
        let mut newest = Vec::new();
        for _ in 0..KEPT + 2 {
            begin_transcript(&folders).expect("writable");
            newest.insert(0, transcripts(&folders)[0].clone());
            std::thread::sleep(std::time::Duration::from_millis(2));
        }
        newest.truncate(KEPT);
        assert_eq!(transcripts(&folders), newest);
    }
}
