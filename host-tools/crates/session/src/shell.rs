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

/// A user's command with what it is about.
#[derive(Debug)]
pub(super) struct Line {
    /// What the shell reads.
    script: String,
    /// Variables that the shell gets: the values of the words that the script holds.
    values: Vec<(&'static str, String)>,
}

/// Puts what a command is about in the place of `{photo}`, `{stem}`, `{slide}`,
/// `{index}`, `{role}` and `{exposure}`, each as one word of the shell, within double
/// quotes too. Other words in braces are the shell's, and so is a brace after a
/// backslash.
///
/// A value that is not plain stands in a variable, not in the text of the command:
/// whatever a file is called and however the user's command quotes it, this shell never
/// reads a name as a command. A second shell does that (`sh -c`, `eval`, `ssh`) if the
/// first one puts the value into its text, as it does within double quotes.
pub(super) fn filled(command: &str, planned: &Planned, photo: &Path) -> Line {
    let stem = photo.with_extension("");
    let exposure = planned.exposure.map(|exposure| exposure.to_string());
    let words = [
        ("{photo}", "ILTM_PHOTO", photo.to_string_lossy().into()),
        ("{stem}", "ILTM_STEM", stem.to_string_lossy().into()),
        (
            "{slide}",
            "ILTM_SLIDE",
            planned.slide.to_string_lossy().into(),
        ),
        ("{index}", "ILTM_INDEX", planned.index.to_string()),
        ("{role}", "ILTM_ROLE", planned.role.clone()),
        ("{exposure}", "ILTM_EXPOSURE", exposure.unwrap_or_default()),
    ];
    let mut script = String::new();
    let mut rest = command;
    let mut quote = None;
    while let Some(next) = rest.chars().next() {
        if let Some((word, name, value)) = words.iter().find(|(word, ..)| rest.starts_with(word)) {
            script += &placed(name, value, quote == Some('"'));
            rest = &rest[word.len()..];
            continue;
        }
        let escapes = cfg!(unix) && next == '\\' && quote != Some('\'');
        let taken = rest.chars().take(if escapes { 2 } else { 1 });
        let (own, after) = rest.split_at(taken.map(char::len_utf8).sum());
        script += own;
        rest = after;
        if quote == Some(next) {
            quote = None;
        } else if quote.is_none() && (next == '"' || cfg!(unix) && next == '\'') {
            quote = Some(next);
        }
    }
    let values = words.map(|(_, name, value)| (name, value)).into();
    Line { script, values }
}

/// A value's place in the text of a command. A plain value means itself to every shell,
/// whatever the quotes. Another one stays in its variable; but not on Windows, whose
/// shell reads a variable's value as text of the command, and where captures' names have
/// no quotes and no percent signs.
fn placed(name: &str, value: &str, in_quotes: bool) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/._-+:=@".contains(c);
    let text = if !value.is_empty() && value.chars().all(plain) {
        return value.to_owned();
    } else if cfg!(windows) {
        value.to_owned()
    } else {
        format!("${{{name}}}")
    };
    if in_quotes {
        text
    } else {
        format!("\"{text}\"")
    }
}

/// What a command said, to be added to a sentence; nothing of one that said nothing.
pub(super) fn says(words: &str) -> String {
    match words.trim() {
        "" => String::new(),
        words => format!("; it says: {words}"),
    }
}

/// Runs a command until it ends, takes longer than `patience`, or `stop` says so.
/// Nothing that it started in the meantime is left running in the last two cases.
///
/// # Errors
/// What the system says where there is no shell.
pub(super) fn run(line: &Line, patience: Duration, stop: &dyn Fn() -> bool) -> io::Result<Ran> {
    // A file cannot fill up as a pipe does that nobody reads, and does not stay open
    // with what the command may leave behind.
    let mut words = tempfile::tempfile()?;
    let mut child = shell(&line.script)
        .envs(line.values.iter().cloned())
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

    fn in_shell(command: &str) -> Line {
        filled(command, &planned(), Path::new("7.png"))
    }

    fn says(command: &str, photo: &str) -> String {
        let line = filled(command, &planned(), Path::new(photo));
        match run(&line, Duration::from_secs(20), &|| false).unwrap() {
            Ran::Ended(_, words) => words,
            ran => panic!("{ran:?}"),
        }
    }

    #[test]
    fn words_are_filled_in_for_the_shell_and_its_own_braces_left() {
        let command = "printf '<%s>' -o {photo} \"{photo}\" {stem}.raw {index} {exposure} {role} ${HOME:+home} {x,y} '{a}' \\{role}";
        assert_eq!(
            says(command, "/it's a/007.png"),
            "<-o></it's a/007.png></it's a/007.png></it's a/007.raw><7><0.25><row-1-inverse><home><{x,y}><{a}><{role}>"
        );
    }

    #[test]
    fn a_plain_name_goes_through_every_quote_and_a_second_shell() {
        for command in [
            "printf '<%s>' {photo}",
            "printf '<%s>' '{photo}'",
            "printf '<%s>' \"{photo}\"",
            "sh -c 'printf \"<%s>\" {photo}'",
            "sh -c \"printf '<%s>' '{photo}'\"",
            "env -i sh -c 'printf \"<%s>\" \"{photo}\"'",
        ] {
            assert_eq!(says(command, "/a/7.png"), "</a/7.png>", "{command}");
        }
        let command = "sh -c 'printf \"<%s>\" {photo}'";
        assert_eq!(says(command, "/it's a/7.png"), "</it's a/7.png>");
    }

    #[test]
    fn no_name_is_a_command_however_the_user_quotes_it() {
        let folder = tempfile::tempdir().unwrap();
        let written = folder.path().join("written");
        let touch = format!("touch {}", written.display());
        for name in [
            format!("$({touch})"),
            format!("`{touch}`"),
            format!("a;{touch};#"),
            format!("a';{touch};'"),
            format!("a\";{touch};\""),
            format!("a\n{touch}\n"),
            format!("{{stem}};{touch};#{{index}}"),
        ] {
            for command in [
                "echo {photo}",
                "echo \"{photo}\"",
                "echo '{photo}'",
                "echo '--out={photo}' '{index}{photo}'",
                "sh -c 'echo {photo} \"{photo}\"'",
                "echo \"$(echo {photo})\" `echo {photo}`",
                "true # it's {photo}",
                "cat <<END\n{photo}\nEND",
                "echo \\{photo} \\\"{photo} \\'{photo}",
            ] {
                says(command, &name);
                assert!(!written.exists(), "{command} with {name}");
            }
        }
        let name = "$(true);{stem} {index} 'x'";
        assert_eq!(says("echo {photo} {index}", name), format!("{name} 7"));
        assert_eq!(says("echo \"{photo} {index}\"", name), format!("{name} 7"));
    }

    #[test]
    fn a_command_that_hangs_is_ended_with_all_that_it_started() {
        let folder = tempfile::tempdir().unwrap();
        let late = folder.path().join("late");
        let command = format!("(sleep 3; touch {}) & sleep 30", late.display());
        let ran = run(&in_shell(&command), Duration::from_millis(200), &|| false).unwrap();
        assert!(matches!(ran, Ran::TooLong(_)), "{ran:?}");
        thread::sleep(Duration::from_secs(4));
        assert!(!late.exists());
    }

    #[test]
    fn the_end_of_what_a_command_says_is_kept() {
        let command = "seq 1 5000; echo broken lens >&2; exit 3";
        let ran = run(&in_shell(command), Duration::from_secs(20), &|| false).unwrap();
        let Ran::Ended(status, words) = ran else {
            panic!("{ran:?}")
        };
        assert_eq!(status.code(), Some(3));
        assert!(words.ends_with("broken lens") && words.len() <= LAST_WORDS as usize);
    }
}
