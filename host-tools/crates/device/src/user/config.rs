//! Settings of the user: `config.toml`.
//!
//! ```toml
//! port = "/dev/ttyACM0"              # remembered: where a device answered last
//! include = ["/dev/ttyAMA0"]         # asked too, though soldered to this machine
//! exclude = ["/dev/ttyUSB*"]         # never opened unless named with --port
//! ```
//!
//! A port that both lists name is excluded.

use super::Folders;
use glob::Pattern;
use iltm_picture::{foreign_file, whole_file};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::{fs, io};
use toml_edit::DocumentMut;

/// What the file is called.
const NAME: &str = "config.toml";

/// Bytes of the file at most: a person writes it.
const MOST_BYTES: u64 = 1 << 20;

/// Settings of the user.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Config {
    /// The port that is asked first.
    pub port: Option<String>,
    include: Vec<Pattern>,
    exclude: Vec<Pattern>,
    path: PathBuf,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct ConfigFile {
    port: Option<String>,
    #[serde(default)]
    include: Vec<String>,
    #[serde(default)]
    exclude: Vec<String>,
}

/// Why settings cannot be read or kept.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        source: io::Error,
    },
    /// It is not TOML, or holds something unknown.
    #[error("{}: {reason}", path.display())]
    Toml {
        /// The file.
        path: PathBuf,
        /// What and where.
        reason: String,
    },
    /// A pattern is none.
    #[error("{}: the pattern \"{pattern}\" in `{list}`: {reason}", path.display())]
    Pattern {
        /// The file.
        path: PathBuf,
        /// The list that it is in.
        list: &'static str,
        /// The pattern.
        pattern: String,
        /// What is wrong with it.
        reason: String,
    },
}

impl Config {
    /// The settings; the usual ones if there is no file.
    ///
    /// # Errors
    /// [`ConfigError`]. Ports must not be opened then: one may be excluded.
    pub fn read(folders: &Folders) -> Result<Self, ConfigError> {
        let path = folders.config.join(NAME);
        let text = text(&path)?;
        let written: ConfigFile = toml::from_str(&text).map_err(|error| ConfigError::Toml {
            path: path.clone(),
            reason: error.to_string().trim_end().to_owned(),
        })?;
        let patterns = |list, texts: &[String]| {
            let pattern = |text: &String| {
                Pattern::new(text).map_err(|error| ConfigError::Pattern {
                    path: path.clone(),
                    list,
                    pattern: text.clone(),
                    reason: error.msg.to_owned(),
                })
            };
            texts.iter().map(pattern).collect::<Result<_, _>>()
        };
        Ok(Self {
            port: written.port,
            include: patterns("include", &written.include)?,
            exclude: patterns("exclude", &written.exclude)?,
            path,
        })
    }

    /// Whether a port is to be asked whatever kind it is, unless it is excluded.
    #[must_use]
    pub fn includes(&self, port: &str) -> bool {
        self.include.iter().any(|pattern| pattern.matches(port))
    }

    /// Ports that are included by their whole name, which need be in no list of the
    /// system.
    pub fn included(&self) -> impl Iterator<Item = &str> {
        let names = self.include.iter().map(Pattern::as_str);
        names.filter(|name| !name.contains(['*', '?', '[']))
    }

    /// Whether a port must not be opened.
    #[must_use]
    pub fn excludes(&self, port: &str) -> bool {
        self.exclude.iter().any(|pattern| pattern.matches(port))
    }

    /// The file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Keeps a port for the next time; everything else in the file stays, comments too.
    ///
    /// # Errors
    /// [`ConfigError`].
    pub fn remember(&mut self, port: &str) -> Result<(), ConfigError> {
        if self.port.as_deref() == Some(port) {
            return Ok(());
        }
        let path = self.path.clone();
        let mut document: DocumentMut = text(&path)?.parse().map_err(|error| {
            let reason = format!("{error}");
            ConfigError::Toml {
                path: path.clone(),
                reason,
            }
        })?;
        document["port"] = toml_edit::value(port);
        let write = || {
            let folder = path.parent().unwrap_or(Path::new("."));
            fs::create_dir_all(folder)?;
            whole_file::write(&path, document.to_string().as_bytes())?;
            Ok(())
        };
        write().map_err(|source| ConfigError::Io {
            path: path.clone(),
            source,
        })?;
        self.port = Some(port.to_owned());
        Ok(())
    }
}

fn text(path: &Path) -> Result<String, ConfigError> {
    match foreign_file::read_text(path, MOST_BYTES) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(String::new()),
        read => read.map_err(|source| ConfigError::Io {
            path: path.to_owned(),
            source,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folders(text: &str) -> (tempfile::TempDir, Folders) {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::write(folder.path().join(NAME), text).expect("writable");
        let folders = Folders {
            config: folder.path().to_owned(),
            state: folder.path().to_owned(),
        };
        (folder, folders)
    }

    #[test]
    fn a_remembered_port_leaves_comments_and_other_settings_alone() {
        let (_folder, folders) = folders("# mine\nexclude = [\"/dev/ttyS*\"] # modem\n");
        let mut config = Config::read(&folders).expect("good");
        config.remember("/dev/ttyACM3").expect("writable");
        let text = fs::read_to_string(config.path()).expect("there");
        assert_eq!(
            text,
            "# mine\nexclude = [\"/dev/ttyS*\"] # modem\nport = \"/dev/ttyACM3\"\n"
        );
        assert_eq!(Config::read(&folders).expect("good"), config);
    }

    #[test]
    fn patterns_match_whole_names() {
        let (_folder, folders) = folders("exclude = [\"/dev/ttyS*\", \"COM3\"]");
        let config = Config::read(&folders).expect("good");
        assert!(config.excludes("/dev/ttyS0") && config.excludes("COM3"));
        assert!(!config.excludes("/dev/ttyACM0") && !config.excludes("COM30"));
    }

    #[test]
    fn what_cannot_be_read_is_an_error_and_not_an_empty_list() {
        for text in [
            "exclude = 3",
            "exlude = []",
            "exclude = [\"[\"]",
            "include = [\"[\"]",
        ] {
            let (_folder, folders) = folders(text);
            let error = Config::read(&folders).expect_err("not good").to_string();
            assert!(error.contains("config.toml"), "{error}");
        }
    }

    #[test]
    fn no_file_is_no_settings() {
        let folders = Folders {
            config: "/no/such/folder".into(),
            state: "/no/such/folder".into(),
        };
        assert_eq!(Config::read(&folders).expect("none").port, None);
    }
}
