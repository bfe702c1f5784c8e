//! Markdown pages: their blocks of commands, and commands that stand elsewhere.

use iltm_tests::reference_pages::{files_below, root};
use std::fs;
use std::path::{Path, PathBuf};

/// Command with which the tests are run.
pub(crate) const ALL_TESTS: &str = "bash tests/run.sh";

/// Words with which a line begins that is meant to be typed.
const PROGRAMS: [&str; 12] = [
    "$", "apt-get", "bash", "cargo", "git", "iltm", "mdbook", "pip", "python3", "rustup", "sh",
    "sudo",
];

/// A fenced block.
pub(crate) struct Block {
    /// Page and line, for messages.
    pub(crate) place: String,
    /// Its language and marks.
    marks: Vec<String>,
    pub(crate) text: String,
}

impl Block {
    pub(crate) fn is(&self, mark: &str) -> bool {
        self.marks.iter().any(|own| own == mark)
    }

    /// Values of the marks of this name.
    pub(crate) fn values(&self, name: &str) -> impl Iterator<Item = &str> {
        self.marks.iter().filter_map(move |mark| {
            let (own, value) = mark.split_once('=')?;
            (own == name).then_some(value)
        })
    }

    /// The exit code that its last command ends with.
    pub(crate) fn code(&self) -> i32 {
        let code = self.values("exit").next();
        code.map_or(0, |code| code.parse().expect("an exit code"))
    }

    fn check_marks(&self) {
        for mark in &self.marks[1..] {
            let name = mark.split_once('=').map_or(mark.as_str(), |(name, _)| name);
            let known = ["exit", "given", "hardware"].contains(&name) && name != mark
                || ["device", "keeps-running", "long"].contains(&mark.as_str());
            assert!(known, "{}: there is no mark `{mark}`", self.place);
        }
    }
}

/// A page of Markdown.
pub(crate) struct Page {
    /// From the root of the repository.
    pub(crate) path: String,
    blocks: Vec<Block>,
    /// Everything outside the fences, with the number of its line.
    prose: Vec<(usize, String)>,
}

impl Page {
    pub(crate) fn read(path: &str) -> Self {
        let text = fs::read_to_string(root().join(path)).expect("a page");
        let mut page = Self {
            path: path.to_owned(),
            blocks: Vec::new(),
            prose: Vec::new(),
        };
        let mut inside: Option<(usize, Block)> = None;
        for (index, line) in text.lines().enumerate() {
            let indent = line.len() - line.trim_start().len();
            match (&mut inside, line.trim_start().strip_prefix("```")) {
                (None, Some(marks)) => {
                    let block = Block {
                        place: format!("{path}:{}", index + 1),
                        marks: marks.split_whitespace().map(str::to_owned).collect(),
                        text: String::new(),
                    };
                    inside = Some((indent, block));
                }
                (Some(_), Some(_)) => page.blocks.extend(inside.take().map(|(_, block)| block)),
                (Some((outer, block)), None) => {
                    block.text += line.get((*outer).min(indent)..).unwrap_or_default();
                    block.text.push('\n');
                }
                (None, None) => page.prose.push((index + 1, line.to_owned())),
            }
        }
        assert!(inside.is_none(), "{path}: a fence is not closed");
        page.commands().for_each(Block::check_marks);
        page
    }

    /// Blocks of commands, in order.
    pub(crate) fn commands(&self) -> impl Iterator<Item = &Block> {
        self.blocks.iter().filter(|block| block.is("sh"))
    }

    /// Lines that are typed, in blocks that are not marked as commands: place and line.
    pub(crate) fn loose_commands(&self) -> Vec<(String, &str)> {
        let others = self.blocks.iter().filter(|block| !block.is("sh"));
        let in_blocks = others.flat_map(|block| {
            let lines = block.text.lines();
            lines.map(|line| (block.place.clone(), line))
        });
        let indented = self.prose.iter();
        let indented = indented.filter(|(_, line)| line.starts_with("    "));
        let indented = indented.map(|(at, line)| (format!("{}:{at}", self.path), line.as_str()));
        let lines = in_blocks.chain(indented);
        lines.filter(|(_, line)| is_typed(line)).collect()
    }

    /// What stands between backticks in the prose.
    pub(crate) fn code_spans(&self) -> Vec<String> {
        let lines: Vec<&str> = self.prose.iter().map(|(_, line)| line.as_str()).collect();
        let mut spans = Vec::new();
        // A span ends with its paragraph.
        for paragraph in lines.split(|line| line.is_empty()) {
            let text = paragraph.join(" ");
            spans.extend(text.split('`').skip(1).step_by(2).map(str::to_owned));
        }
        spans
    }
}

/// Whether a path's last component ends with `.` and `extension`.
pub(crate) fn has_extension(path: &str, extension: &str) -> bool {
    Path::new(path)
        .extension()
        .is_some_and(|its| its == extension)
}

/// Whether a line is meant to be typed into a shell.
fn is_typed(line: &str) -> bool {
    let words = line.split_whitespace();
    let words: Vec<&str> = words.skip_while(|word| is_assignment(word)).collect();
    // A name alone is one in a drawing.
    words.first().is_some_and(|first| {
        PROGRAMS.contains(first) && words.len() > 1
            || has_extension(first, "sh")
            || first.starts_with("./")
    })
}

/// Whether a word sets a variable for the command behind it.
pub(crate) fn is_assignment(word: &str) -> bool {
    let Some((name, _)) = word.split_once('=') else {
        return false;
    };
    !name.is_empty() && name.chars().all(|c| c.is_ascii_uppercase() || c == '_')
}

/// The README and the pages of the site, from the root.
pub(crate) fn pages() -> Vec<String> {
    let pages = files_below("docs", "md").expect("pages").into_iter();
    let pages = pages.map(|path| path.strip_prefix(root()).expect("below").to_owned());
    let readme = PathBuf::from("README.md");
    let pages = std::iter::once(readme).chain(pages);
    pages
        .map(|path| path.to_string_lossy().into_owned())
        .collect()
}
