//! Shell commands that a user gives, and words quoted for them.

use super::plan::Planned;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// Between two looks at whether something has happened.
const TICK: Duration = Duration::from_millis(20);

/// Given to a command that is to end before it is killed.
const GRACE: Duration = Duration::from_secs(2);

/// Last words of a command that are kept.
const LAST_WORDS: u64 = 600;

/// How a command went.
#[derive(Debug)]
pub(super) enum Ran {
    /// It ended by itself.
    Ended(ExitStatus, String),
    /// It was ended because it took too long.
    TooLong(String),
    /// It was ended because the user wants an end.
    Stopped,
}

/// Puts what a command is about in the place of `{photo}`, `{stem}`, `{slide}`,
/// `{index}`, `{role}` and `{exposure}`, quoted for the shell where that is needed.
/// Other words in braces are the shell's. What was put in is not looked at again: a
/// file name that holds one of these words stays a file name.
pub(super) fn filled(command: &str, planned: &Planned, photo: &Path) -> String {
    let stem = photo.with_extension("");
    let exposure = planned.exposure.map(|exposure| exposure.to_string());
    let words = [
        ("{photo}", photo.to_string_lossy().into_owned()),
        ("{stem}", stem.to_string_lossy().into_owned()),
        ("{slide}", planned.slide.to_string_lossy().into_owned()),
        ("{index}", planned.index.to_string()),
        ("{role}", planned.role.clone()),
        ("{exposure}", exposure.unwrap_or_default()),
    ];
    let mut text = String::new();
    let mut rest = command;
    while let Some(brace) = rest.find('{') {
        let (before, from_brace) = rest.split_at(brace);
        text.push_str(before);
        let word = words.iter().find(|(word, _)| from_brace.starts_with(word));
        let length = word.map_or(1, |(word, _)| word.len());
        let own = &from_brace[..length];
        text.push_str(&word.map_or(own.to_owned(), |(_, value)| quoted(value)));
        rest = &from_brace[length..];
    }
    text + rest
}

/// A word for the shell.
#[cfg(unix)]
fn quoted(word: &str) -> String {
    iltm_report::solve_page::quoted(Path::new(word))
}

/// A word for the shell. Captures' names have no quotes and no percent signs.
#[cfg(windows)]
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/._-+:=@\\".contains(c);
    if word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("\"{word}\"")
    }
}

/// Runs a command until it ends, takes longer than `patience`, or `stop` says so.
/// Nothing that it started in the meantime is left running in the last two cases.
///
/// # Errors
/// What the system says where there is no shell.
pub(super) fn run(command: &str, patience: Duration, stop: &dyn Fn() -> bool) -> io::Result<Ran> {
    // A file cannot fill up as a pipe does that nobody reads, and does not stay open
    // with what the command may leave behind.
    let mut words = tempfile::tempfile()?;
    let mut child = shell(command)
        .stdin(Stdio::null())
        .stdout(words.try_clone()?)
        .stderr(words.try_clone()?)
        .spawn()?;
    let begun = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Ran::Ended(status, last_words(&mut words)));
        }
        if stop() {
            end(&mut child);
            return Ok(Ran::Stopped);
        }
        if begun.elapsed() > patience {
            end(&mut child);
            return Ok(Ran::TooLong(last_words(&mut words)));
        }
        thread::sleep(TICK);
    }
}

/// Waits; `false` if `stop` ended it early.
pub(super) fn wait(time: Duration, stop: &dyn Fn() -> bool) -> bool {
    let begun = Instant::now();
    loop {
        if stop() {
            return false;
        }
        let left = time.saturating_sub(begun.elapsed());
        if left.is_zero() {
            return true;
        }
        thread::sleep(left.min(TICK));
    }
}

#[cfg(unix)]
fn shell(command: &str) -> Command {
    use std::os::unix::process::CommandExt;
    let mut shell = Command::new("sh");
    // A group of its own: ctrl-C is for us, who then end the group as a whole.
    shell.arg("-c").arg(command).process_group(0);
    shell
}

#[cfg(windows)]
fn shell(command: &str) -> Command {
    use std::os::windows::process::CommandExt;
    let mut shell = Command::new("cmd");
    shell.arg("/C").raw_arg(command);
    shell
}

/// Ends a command and all that it started: politely, then not.
#[cfg(unix)]
fn end(child: &mut Child) {
    use rustix::process::{Pid, Signal, kill_process_group};
    let Some(group) = Pid::from_raw(child.id() as i32) else {
        return;
    };
    let _ = kill_process_group(group, Signal::TERM);
    let begun = Instant::now();
    while begun.elapsed() < GRACE {
        if matches!(child.try_wait(), Ok(Some(_))) {
            break;
        }
        thread::sleep(TICK);
    }
    let _ = kill_process_group(group, Signal::KILL);
    let _ = child.wait();
}

#[cfg(not(unix))]
fn end(child: &mut Child) {
    let _ = child.kill();
    let _ = child.wait();
}

fn last_words(file: &mut File) -> String {
    let mut bytes = Vec::new();
    let length = file.seek(SeekFrom::End(0)).unwrap_or(0);
    let _ = file.seek(SeekFrom::Start(length.saturating_sub(LAST_WORDS)));
    let _ = file.take(LAST_WORDS).read_to_end(&mut bytes);
    String::from_utf8_lossy(&bytes).trim().to_owned()
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn planned() -> Planned {
        Planned {
            index: 7,
            role: "row-1-inverse".into(),
            slide: "/a b/slides/007.png".into(),
            photo: "/a b/photos/007.png".into(),
            exposure: Some(0.25),
        }
    }

    #[test]
    fn words_are_filled_in_for_the_shell_and_its_own_braces_left() {
        let command =
            "snap -o {photo} --raw {stem}.raw -n {index} -t {exposure} {role} ${HOME} {x,y}";
        let text = filled(command, &planned(), Path::new("/it's/007.png"));
        assert_eq!(
            text,
            r#"snap -o "/it's/007.png" --raw "/it's/007".raw -n 7 -t 0.25 row-1-inverse ${HOME} {x,y}"#
        );
    }

    #[test]
    fn a_name_that_holds_words_in_braces_runs_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let written = folder.path().join("written");
        let name = format!("{{stem}};touch {};#{{index}}.png", written.display());
        let hostile = Planned {
            photo: name.clone().into(),
            ..planned()
        };
        let command = filled("echo {photo} {index}", &hostile, &hostile.photo);
        let ran = run(&command, Duration::from_secs(20), &|| false).unwrap();
        let Ran::Ended(status, words) = ran else {
            panic!("{ran:?}")
        };
        assert!(status.success() && !written.exists(), "{command}");
        assert_eq!(words, format!("{name} 7"));
    }

    #[test]
    fn a_command_that_hangs_is_ended_with_all_that_it_started() {
        let folder = tempfile::tempdir().unwrap();
        let late = folder.path().join("late");
        let command = format!("(sleep 3; touch {}) & sleep 30", late.display());
        let ran = run(&command, Duration::from_millis(200), &|| false).unwrap();
        assert!(matches!(ran, Ran::TooLong(_)), "{ran:?}");
        thread::sleep(Duration::from_secs(4));
        assert!(!late.exists());
    }

    #[test]
    fn the_end_of_what_a_command_says_is_kept() {
        let command = "seq 1 5000; echo broken lens >&2; exit 3";
        let ran = run(command, Duration::from_secs(20), &|| false).unwrap();
        let Ran::Ended(status, words) = ran else {
            panic!("{ran:?}")
        };
        assert_eq!(status.code(), Some(3));
        assert!(words.ends_with("broken lens") && words.len() <= LAST_WORDS as usize);
    }
}
