//! Words of the demo's report about the sample, which photographs cannot say.

use crate::report::{Command, Words};
use crate::solve_page::quoted;
use std::path::Path;

/// The words for a demo that was written to `out`.
pub(super) fn words(out: &Path, seconds: &[(&'static str, f64)]) -> Words {
    let path = |name: &str| quoted(&out.join(name));
    Words {
        title: "Light that bounces, learned and taken away".to_owned(),
        scene: "Four panels, red, white, blue and white, stand zigzag like the letter M. A projector \
                lights them, each panel lights the one opposite, and whatever is projected is washed \
                out and tinted. Sixty photographs were enough to cancel that. (Here a path tracer stands in \
                for projector and noisy camera; nothing else is prepared.)"
            .to_owned(),
        commands: vec![
            Command::new("This page and everything beside it:", format!("iltm demo --out {}", quoted(out))),
            Command::new(
                "The table alone, from the photographs; with --photos 20 from half of the random ones:",
                format!("iltm solve {} -o {}", path("capture"), path("table.iltm")),
            ),
            Command::new("What is in it:", format!("iltm inspect {}", path("table.iltm"))),
            Command::new(
                "A video or a picture of your own, or this one with tier 0 (gain only) for comparison:",
                format!(
                    "iltm compensate {} {} -o {}\niltm compensate {} {} -o {} --tier 0",
                    path("table.iltm"),
                    path("video.y4m"),
                    path("compensated.y4m"),
                    path("table.iltm"),
                    path("video.y4m"),
                    path("gain-only.y4m"),
                ),
            ),
        ],
        projectors: None,
        sections: Vec::new(),
        seconds: seconds.iter().map(|(what, seconds)| ((*what).to_owned(), *seconds)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_with_spaces_stays_one_word() {
        assert_eq!(quoted(Path::new("my demo/it's")), r#""my demo/it's""#);
        assert_eq!(
            quoted(Path::new("iltm-demo/table.iltm")),
            "iltm-demo/table.iltm"
        );
    }

    #[test]
    fn commands_name_the_folder_that_was_written() {
        let words = words(Path::new("/tmp/here"), &[]);
        assert!(
            words
                .commands
                .iter()
                .all(|command| command.line.contains("/tmp/here"))
        );
    }
}
