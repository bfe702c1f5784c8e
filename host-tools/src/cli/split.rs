//! `iltm split`

use super::args::Split;
use super::failure::{Failure, cannot_write};
use super::output::{Output, write_file};
use super::tables::{check, read_table};
use crate::compile::{SplitTable, split_table};
use iltm_picture::numbers::{grouped, percent};
use iltm_runtime::image::{Table, unseal};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

pub(super) fn run(arguments: &Split, output: &Output) -> Result<(), Failure> {
    let path = &arguments.table;
    let file = read_table(path)?;
    let _ = check(path, &file)?;
    let image = unseal(&file).map_or(&file[..], |(image, _)| image);
    let parts = split_table(image, arguments.projectors, arguments.neighbours)?;
    let folder = &arguments.output;
    std::fs::create_dir_all(folder).map_err(|error| cannot_write(folder, &error))?;
    let mut text = String::new();
    let mut data = Vec::new();
    for (number, part) in (1..).zip(&parts) {
        let file = place(path, folder, number);
        write_file(&file, &part.image)?;
        let (found, words) = said(part, number, &file)?;
        data.push(found);
        text += &words;
    }
    text += "next        flash each to the device of its projector; to a device with a key, sign it before\n";
    let data = json!({
        "table": path.display().to_string(),
        "projectors": data,
    });
    output.result(&data, &text);
    Ok(())
}

/// Where the table of a projector goes.
fn place(table: &Path, folder: &Path, number: usize) -> PathBuf {
    let stem = table.file_stem().unwrap_or_default().to_string_lossy();
    folder.join(format!("{stem}-{number}.iltm"))
}

/// What is said of one projector's table, for programs and for people.
fn said(part: &SplitTable, number: usize, file: &Path) -> Result<(Value, String), Failure> {
    let table = check(file, &part.image)?;
    let bytes = part.image.len() as u64;
    let others = table.neighbours();
    let light = others.map_or_else(
        || "none of its neighbours: gains alone take no light of theirs".to_owned(),
        |others| {
            let bytes = grouped(others.bytes() as u64);
            format!(
                "{} of its neighbours: {bytes} bytes of their light a frame",
                others.grid()
            )
        },
    );
    let mut text = format!(
        "projector {number} {} cells of its own, {light}\n",
        table.grid()
    );
    if let Some(top) = part.tiers.last() {
        let _ = writeln!(
            text,
            "error       {} for being split, {} while the neighbours are silent",
            percent(top.together),
            percent(top.alone)
        );
    }
    let _ = writeln!(
        text,
        "written     {}, {} bytes",
        file.display(),
        grouped(bytes)
    );
    let tiers = part.tiers.iter().map(
        |errors| json!({ "wide": errors.wide, "together": errors.together, "alone": errors.alone }),
    );
    let size =
        |table: &Table<'_>| json!({ "rows": table.grid().rows(), "cols": table.grid().cols() });
    let data = json!({
        "table": file.display().to_string(),
        "bytes": bytes,
        "cells": size(&table),
        "neighbours": others.map(|others| json!({
            "rows": others.grid().rows(),
            "cols": others.grid().cols(),
            "bytes": others.bytes(),
        })),
        "tiers": tiers.collect::<Vec<_>>(),
    });
    Ok((data, text))
}
