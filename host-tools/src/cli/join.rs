//! `iltm join`

use super::args::Join;
use super::check::{dressed, text};
use super::failure::{Failure, Kind, cannot_write};
use super::output::Output;
use super::progress::progress;
use super::summary::gates;
use crate::capture::{JoinedPoses, MANIFEST_FILE, PosePhotographs, join_poses};
use serde_json::json;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

const NEXT: &str = "Give the folder that was photographed from each place: a capture, or a folder \
                    with the captures of all projectors.";

pub(super) fn run(arguments: &Join, output: &Output) -> Result<(), Failure> {
    let names = names(&arguments.poses[0])?;
    for pose in &arguments.poses[1..] {
        if self::names(pose)? != names {
            let first = arguments.poses[0].display();
            return Err(Failure::new(
                Kind::Capture,
                format!(
                    "{}: its captures have other names than those of {first}",
                    pose.display()
                ),
                "Copy the folder of slides for each pose before it is photographed.",
            ));
        }
    }
    let places = |folder: &Path| match &names[..] {
        [] => vec![folder.to_owned()],
        names => names.iter().map(|name| folder.join(name)).collect(),
    };
    let poses = arguments.poses.iter().map(|pose| PosePhotographs {
        name: pose.display().to_string(),
        captures: places(pose),
    });
    let poses: Vec<_> = poses.collect();
    let out = places(&arguments.output);
    // What is in the way is known before the work, not after it.
    for out in &out {
        iltm_picture::check_free(out)?;
    }
    if !names.is_empty() {
        let folder = &arguments.output;
        fs::create_dir_all(folder).map_err(|error| cannot_write(folder, &error))?;
    }
    let bars = progress(output);
    let joined = join_poses(&poses, &arguments.ignore, &out, bars.as_ref());
    bars.end();
    let joined = joined?;
    let written: Vec<String> = out.iter().map(|out| out.display().to_string()).collect();
    let words = words(&poses, &names, &joined, &written);
    let of_projector = |(at, capture): (usize, &String)| {
        json!({
            "capture": capture,
            "cells": joined.cells[at],
            "seen": joined.together[at],
        })
    };
    let of_pose =
        |(pose, seen): (&PosePhotographs, &Vec<usize>)| json!({ "pose": pose.name, "seen": seen });
    let data = json!({
        "poses": poses.iter().zip(&joined.seen).map(of_pose).collect::<Vec<_>>(),
        "captures": written.iter().enumerate().map(of_projector).collect::<Vec<_>>(),
        "gates": gates(&joined.gates),
    });
    output.dressed_result(&data, &dressed(&words));
    Ok(())
}

/// What was joined, for people.
fn words(
    poses: &[PosePhotographs],
    names: &[String],
    joined: &JoinedPoses,
    written: &[String],
) -> String {
    let counted = |seen: &[usize]| {
        let of = |(at, seen): (usize, &usize)| {
            let name = names
                .get(at)
                .map_or_else(String::new, |name| format!(" of {name}"));
            format!("{seen}{name}")
        };
        let all: Vec<String> = seen.iter().enumerate().map(of).collect();
        all.join(", ")
    };
    let mut words = text(&joined.gates);
    for (pose, seen) in poses.iter().zip(&joined.seen) {
        let _ = writeln!(
            words,
            "pose        {} sees cells: {}",
            pose.name,
            counted(seen)
        );
    }
    let cells: usize = joined.cells.iter().sum();
    let _ = writeln!(
        words,
        "together    cells: {}, of {cells} in all",
        counted(&joined.together)
    );
    let _ = writeln!(words, "written     {}", written.join(", "));
    let _ = writeln!(words, "next        iltm check {}", written.join(" "));
    words
}

/// Names of the captures in the folder of a pose, one a projector; none where it is one itself.
fn names(pose: &Path) -> Result<Vec<String>, Failure> {
    if pose.join(MANIFEST_FILE).exists() {
        return Ok(Vec::new());
    }
    let refuse = |what: &str| {
        let message = format!("{}: {what}", pose.display());
        Failure::new(Kind::Read, message, NEXT)
    };
    let entries = fs::read_dir(pose).map_err(|error| refuse(&error.to_string()))?;
    let captures: Vec<PathBuf> = entries
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.join(MANIFEST_FILE).exists())
        .collect();
    let name = |path: &PathBuf| path.file_name()?.to_str().map(str::to_owned);
    let names: Option<Vec<String>> = captures.iter().map(name).collect();
    let mut names = names.ok_or_else(|| refuse("a capture in it has a name that is no text"))?;
    names.sort();
    if names.is_empty() {
        return Err(refuse("neither a capture nor a folder of captures"));
    }
    Ok(names)
}
