//! User of the command line: a folder in which `iltm` is run, and what a command says and
//! leaves behind.

use crate::schema;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use tempfile::TempDir;

/// The sample capture; in a command, `SAMPLE` stands for it.
pub(crate) const SAMPLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/samples/m-panels");

/// The scenes that come with the tools; in a command, `SCENES` stands for their folder.
const SCENES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes");

/// Somebody with a folder, and with settings of their own in it.
pub(crate) struct User {
    folder: TempDir,
}

impl User {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        Self { folder }
    }

    /// With a copy of the sample's photographs and lists as `capture`.
    pub(crate) fn with_capture() -> Self {
        let user = Self::new();
        for part in ["", "patterns", "photos"] {
            user.copy(&Path::new(SAMPLE).join(part), &format!("capture/{part}"));
        }
        fs::remove_file(user.path("capture/reference_T.npy")).expect("the sample has one");
        user
    }

    /// With the sample's table as `t.iltm`.
    pub(crate) fn with_table() -> Self {
        let user = Self::new();
        user.write("t.iltm", table());
        user
    }

    /// Copies the files of a folder, but no folders in it.
    pub(crate) fn copy(&self, from: &Path, to: &str) {
        fs::create_dir_all(self.path(to)).expect("a new folder");
        for file in fs::read_dir(from).expect("a folder") {
            let file = file.expect("a file").path();
            if file.is_file() {
                let name = file.file_name().expect("a file");
                fs::copy(&file, self.path(to).join(name)).expect("a copy");
            }
        }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        fs::write(self.path(name), bytes).expect("writable");
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub(crate) fn text(&self, name: &str) -> String {
        String::from_utf8(self.read(name)).expect("text")
    }

    pub(crate) fn picture(&self, name: &str) -> image::DynamicImage {
        image::open(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub(crate) fn remove(&self, name: &str) {
        fs::remove_file(self.path(name)).expect("there");
    }

    pub(crate) fn rename(&self, from: &str, to: &str) {
        fs::rename(self.path(from), self.path(to)).expect("there");
    }

    /// Names of what is in a folder of the user's, in order.
    pub(crate) fn names(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(folder)).expect("a folder");
        let names = entries.map(|entry| entry.expect("an entry").file_name());
        let mut names: Vec<_> = names.map(|name| name.to_string_lossy().into()).collect();
        names.sort();
        names
    }

    /// A command as it is typed behind `iltm`.
    pub(crate) fn iltm(&self, line: &str) -> Command {
        let words = shlex::split(line).expect("quotes that are closed");
        let words = words.into_iter().map(|word| {
            let word = word.replace("SAMPLE", SAMPLE);
            word.replace("SCENES", SCENES)
        });
        let mut command = Command::new(env!("CARGO_BIN_EXE_iltm"));
        command.current_dir(self.folder.path()).args(words);
        // Not the settings and the screen of whoever runs the tests.
        command.env("ILTM_CONFIG_DIR", self.path("config"));
        command.env("ILTM_STATE_DIR", self.path("state"));
        for screen in ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"] {
            command.env_remove(screen);
        }
        command.stdin(Stdio::null()).stdout(Stdio::piped());
        command.stderr(Stdio::piped());
        command
    }

    /// Runs ffmpeg here, which has nothing to complain of.
    #[track_caller]
    pub(crate) fn ffmpeg(&self, line: &str) {
        let ran = Command::new("ffmpeg")
            .current_dir(self.path(""))
            .args(["-loglevel", "error", "-y"])
            .args(shlex::split(line).expect("a shell's line"))
            .output()
            .expect("tests/run.sh installs ffmpeg");
        let said = String::from_utf8_lossy(&ran.stderr);
        assert!(ran.status.success() && said.is_empty(), "{said}");
    }

    pub(crate) fn spawn(&self, line: &str) -> Child {
        self.iltm(line).spawn().expect("the binary is there")
    }

    #[track_caller]
    pub(crate) fn run(&self, line: &str) -> Ended {
        let ended = Ended::of(self.spawn(line));
        if line.split(' ').any(|word| word == "--json") {
            schema::check(line, &ended.out);
        }
        ended
    }

    /// What a command that succeeds says.
    #[track_caller]
    pub(crate) fn says(&self, line: &str) -> String {
        self.fails(0, line)
    }

    /// What a command that ends with this code says.
    #[track_caller]
    pub(crate) fn fails(&self, code: i32, line: &str) -> String {
        let ended = self.run(line);
        assert_eq!(ended.code, code, "{line}: {}", ended.said);
        ended.said
    }

    /// The one object of a command that succeeds.
    #[track_caller]
    pub(crate) fn json(&self, line: &str) -> Value {
        let ended = self.run(&format!("--json {line}"));
        assert_eq!(ended.code, 0, "{line}: {}", ended.said);
        ended.json()
    }

    /// The objects that a command prints, one a line.
    pub(crate) fn events(&self, line: &str) -> Vec<Value> {
        self.run(&format!("--json {line}")).events()
    }
}

/// How a command ended.
pub(crate) struct Ended {
    /// Its exit code.
    pub(crate) code: i32,
    /// What came on standard output: the result.
    pub(crate) out: String,
    /// What people read, in the order in which it comes: remarks and the result, or what was
    /// found and the error.
    pub(crate) said: String,
}

impl Ended {
    /// Waits for the end.
    pub(crate) fn of(child: Child) -> Self {
        let output = child.wait_with_output().expect("a child");
        let code = output.status.code().expect("not killed");
        let for_programs = [b"{".as_slice(), b"YUV4MPEG2"];
        let is_for_people = !for_programs.iter().any(|it| output.stdout.starts_with(it));
        let words = if is_for_people { &*output.stdout } else { &[] };
        let mut parts = [&*output.stderr, words];
        if code != 0 {
            parts.reverse();
        }
        let said = String::from_utf8_lossy(&parts.concat()).into_owned();
        Self {
            code,
            out: String::from_utf8_lossy(&output.stdout).into_owned(),
            said,
        }
    }

    /// Exit code and what people read.
    pub(crate) fn with_code(&self) -> String {
        format!("exit {}\n{}", self.code, self.said)
    }

    pub(crate) fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap_or_else(|error| panic!("{error}: {}", self.out))
    }

    pub(crate) fn events(&self) -> Vec<Value> {
        let parse = |line| serde_json::from_str(line).expect("an object a line");
        self.out.lines().map(parse).collect()
    }
}

/// A scene with other values of these keys, wherever they stand.
pub(crate) fn with_values(scene: &str, values: &[(&str, u16)]) -> String {
    let line = |line: &str| {
        let key = line.split_once(" = ").map(|(key, _)| key);
        match values.iter().find(|(changed, _)| key == Some(changed)) {
            Some((key, value)) => format!("{key} = {value}\n"),
            None => format!("{line}\n"),
        }
    };
    scene.lines().map(line).collect()
}

/// What ctrl-C does.
pub(crate) fn interrupt(child: &Child) {
    let id = child.id().to_string();
    let sent = Command::new("kill").args(["-INT", &id]).status();
    assert!(sent.expect("every system has it").success());
}

/// The table of the sample, solved once.
pub(crate) fn table() -> &'static [u8] {
    static TABLE: OnceLock<Vec<u8>> = OnceLock::new();
    TABLE.get_or_init(|| {
        let user = User::new();
        user.says("solve SAMPLE -o t.iltm");
        user.read("t.iltm")
    })
}

/// All of these words are said.
#[track_caller]
pub(crate) fn contains(text: &str, words: &[&str]) {
    for word in words {
        assert!(text.contains(word), "{word}: {text}");
    }
}
