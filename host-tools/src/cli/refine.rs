//! `iltm refine`

use super::args::Refine;
use super::failure::Failure;
use super::output::{Output, write_file};
use super::progress::progress;
use super::solve::check_place;
use super::tables::{check_date, check_sealed, check_whole, read_table, seal};
use crate::compile::sign::read_key;
use crate::verify::{Readings, refine};
use iltm_picture::numbers::percent;
use iltm_runtime::image::unseal;
use serde_json::json;

pub(super) fn run(arguments: &Refine, output: &Output) -> Result<(), Failure> {
    check_date()?;
    let key = arguments.key.as_deref().map(read_key).transpose()?;
    check_place(&arguments.output)?;
    let file = read_table(&arguments.table)?;
    let _ = check_whole(&arguments.table, &file)?;
    let (table, sealed) = check_sealed(&arguments.table, &file)?;
    let bars = progress(output);
    let readings = Readings::read(&arguments.capture, &table, bars.as_ref())?;
    bars.begin("refining the gains", 0);
    let image = unseal(&file).map_or(&file[..], |(image, _)| image);
    let refined = refine(&arguments.capture, image, &table, &readings);
    bars.end();
    let refined = refined?;
    let written = match &key {
        Some(key) => seal(&refined.image, key, &arguments.seal)?,
        // What is not changed keeps its seal.
        None if !refined.confirmed => file.clone(),
        None => refined.image.clone(),
    };
    write_file(&arguments.output, &written)?;
    let data = json!({
        "table": arguments.output.display().to_string(),
        "capture": arguments.capture.display().to_string(),
        "refined": refined.confirmed,
        "error": { "before": refined.before, "after": refined.after },
        "photographs": refined.photographs,
        "gains": {
            "width": refined.gains.width(),
            "height": refined.gains.height(),
            "change": refined.change,
        },
        "bytes": written.len(),
        "signed": key.is_some() || (sealed.is_some() && !refined.confirmed),
    });
    let out = arguments.output.display();
    let step = if refined.confirmed {
        format!(
            "error       {} of what a viewer sees, {} before: by photographs left out of the step\n\
             gains       {}, changed by {} (root mean square)\n",
            percent(refined.after),
            percent(refined.before),
            format_args!("{} x {}", refined.gains.width(), refined.gains.height()),
            percent(refined.change),
        )
    } else {
        format!(
            "error       {} of what a viewer sees: no step would have made it smaller\n",
            percent(refined.before)
        )
    };
    let next = if !refined.confirmed {
        "next        nothing to flash: the table is as it was".to_owned()
    } else if sealed.is_some() && key.is_none() {
        format!("next        sign it again: iltm sign {out} --key KEY")
    } else {
        format!("next        iltm verify {out} -o FOLDER, or flash it")
    };
    let text = format!(
        "{step}written     {out}, {} bytes{}\n{next}\n",
        written.len(),
        if key.is_some() { ", signed" } else { "" },
    );
    output.result(&data, &text);
    Ok(())
}
