//! `iltm inspect`

use super::args::Inspect;
use super::failure::Failure;
use super::output::Output;
use super::table_words;
use super::tables::{check_sealed, read_table};
use super::words::{day, key_id, lines, named};
use crate::compile::Provenance;
use crate::compile::cost::{CLOCK, RATE};
use crate::compile::sign::{is_signed_by, read_public_key};
use crate::device::rejection_next_step;
use crate::report::tier_costs;
use ed25519_dalek::VerifyingKey;
use iltm_runtime::{
    image::{Seal, Table},
    operator::{Bounds, Operator},
    trust::Rejected,
    units::Light,
};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

pub(super) fn run(arguments: &Inspect, output: &Output) -> Result<(), Failure> {
    let file = read_table(&arguments.table)?;
    let (table, seal) = check_sealed(&arguments.table, &file)?;
    if let Some(path) = &arguments.key {
        verify(
            &arguments.table,
            &file,
            seal.as_ref(),
            &read_public_key(path)?,
        )?;
    }
    let mut data = data(&table);
    for (name, value) in table_words::data(&table).as_object().into_iter().flatten() {
        data[name] = value.clone();
    }
    let mut text = table_words::lines(&arguments.table, &table);
    text += &seal_text(seal.as_ref(), arguments.key.is_some());
    if arguments.detail.verbose {
        let _ = write!(text, "\n{}", self::text(&table));
    }
    data["neighbours"] = json!(table.neighbours().map(|neighbours| {
        let [before, after] = neighbours.around();
        json!({
            "rows": neighbours.grid().rows(),
            "cols": neighbours.grid().cols(),
            "before": before,
            "after": after,
            "bytes": neighbours.bytes(),
        })
    }));
    data["file_bytes"] = json!(file.len());
    data["seal"] = json!(
        seal.as_ref()
            .map(|seal| seal_data(seal, arguments.key.is_some()))
    );
    output.result(&data, &text);
    Ok(())
}

/// Checks the bytes of a table file, and whether they are signed with this key.
fn verify(
    path: &Path,
    file: &[u8],
    seal: Option<&Seal>,
    key: &VerifyingKey,
) -> Result<(), Failure> {
    let rejected = match seal {
        None => Rejected::Unsigned,
        Some(seal) if seal.key != Seal::key_id(key.as_bytes()) => Rejected::WrongKey,
        Some(seal) if !is_signed_by(file, seal, key) => Rejected::Signature,
        Some(_) => return Ok(()),
    };
    let why = match rejected {
        Rejected::Unsigned => "the table is not signed",
        Rejected::WrongKey => "the table is signed with another key",
        _ => "the table's signature is false",
    };
    let message = format!("{}: {why}", path.display());
    Err(Failure::new(
        (&rejected).into(),
        message,
        rejection_next_step(&rejected),
    ))
}

fn seal_data(seal: &Seal, verified: bool) -> Value {
    json!({
        "version": seal.version,
        "revokes_below": seal.oldest,
        "device": (seal.device != 0).then(|| seal.device.to_string()),
        "key": key_id(&seal.key),
        "verified": verified,
    })
}

fn seal_text(seal: Option<&Seal>, verified: bool) -> String {
    let Some(seal) = seal else {
        return "signed      no: only devices without a key take it\n".to_owned();
    };
    let verified = if verified {
        "verified"
    } else {
        "not verified: give --key"
    };
    let device = match seal.device {
        0 => "any device".to_owned(),
        device => format!("device {device} only"),
    };
    let revokes = match seal.oldest {
        0 => String::new(),
        oldest => format!(", revokes versions below {oldest}"),
    };
    format!(
        "version     {}, for {device}{revokes}\nsigned      with key {} ({verified})\n",
        seal.version,
        key_id(&seal.key)
    )
}

/// The stages that the runtime builds for the table, with what each is there for.
fn effects(table: &Table<'_>) -> Vec<&'static str> {
    let listed = [
        (true, "per-cell gain"),
        (table.fine_gain().is_some(), "fine gain"),
        (table.ambient_row(0, 0).is_some(), "ambient light"),
        (table.black() > Light::ZERO, "raised black"),
        (table.operator().is_some(), "interreflection"),
        (table.has_response(), "projector response"),
        (table.neighbours().is_some(), "light of other projectors"),
    ];
    let listed = listed.into_iter().filter(|(there, _)| *there);
    listed.map(|(_, name)| name).collect()
}

/// Predicted error of the inverse; zero in the image stands for none predicted.
fn inverse_error(table: &Table<'_>) -> Option<f64> {
    let error = table.inverse_error().to_num::<f64>();
    (error > 0.0).then_some(error)
}

fn data(table: &Table<'_>) -> Value {
    let tiers = tier_costs(table).into_iter().map(|step| {
        json!({
            "error": step.left_out,
            "total_error": step.total,
            "entries": step.entries,
            "multiplications": step.multiplications,
            "instructions": step.instructions,
            "share": step.share(),
            "bytes": step.table_bytes,
        })
    });
    let bounds = table.operator().map(Operator::bounds);
    json!({
        "id": format!("{:08x}", table.id()),
        "name": named(table.label()),
        "date": day(table.label()),
        "rows": table.grid().rows(),
        "cols": table.grid().cols(),
        "channels": table.channels(),
        "bytes": table.bytes(),
        "effects": effects(table),
        "fine_gain": table.fine_gain().map(|fine| json!({
            "rows": fine.size().height(),
            "cols": fine.size().width(),
        })),
        "reference_white": table.reference_white().to_num::<f64>(),
        "inverse_error": inverse_error(table),
        "tiers": tiers.collect::<Vec<_>>(),
        "bounds": bounds.map(|bounds| json!({
            "accumulator": bounds.accumulator,
            "correction": bounds.correction,
        })),
        "provenance": toml::from_str::<Value>(table.provenance()).ok(),
    })
}

fn text(table: &Table<'_>) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "effects          {}", effects(table).join(", "));
    if let Some(fine) = table.fine_gain() {
        let _ = writeln!(text, "fine gain        {}", fine.size());
    }
    let _ = writeln!(
        text,
        "reference white  {:.4} of the camera's full scale",
        table.reference_white().to_num::<f64>()
    );
    let provenance = Provenance::read(table.provenance());
    if let Some(white) = provenance.white {
        let _ = writeln!(text, "                 {}", white.reason());
    }
    let _ = match inverse_error(table) {
        Some(error) => writeln!(
            text,
            "error            {error:.4} of the inverse itself, predicted from held-out photographs"
        ),
        None => writeln!(
            text,
            "error            not predicted: too few photographs to hold any out"
        ),
    };
    if let Some(recovery) = provenance.recovery {
        text += &lines("recovery         ", &recovery.lines());
    }
    if let Some(operator) = table.operator() {
        let Bounds {
            accumulator,
            correction,
        } = operator.bounds();
        let _ = writeln!(
            text,
            "overflow proof   sums reach {:.0} % of 32 bits, corrections {:.0} % of theirs",
            100.0 * f64::from(accumulator) / Bounds::MAX_ACCUMULATOR as f64,
            100.0 * f64::from(correction) / Bounds::MAX_CORRECTION as f64
        );
    }
    tiers(table, &mut text);
    if !table.provenance().is_empty() {
        let stored = table.provenance().trim_end();
        let _ = writeln!(
            text,
            "\nWhere the table comes from, as it is stored in it for programs (TOML):\n\n{stored}"
        );
    }
    text
}

/// What each tier takes and leaves out.
fn tiers(table: &Table<'_>, text: &mut String) {
    let _ = writeln!(
        text,
        "\ntier   left out   error in all   entries   multiplications   instructions   of a frame     bytes"
    );
    for step in tier_costs(table) {
        let _ = writeln!(
            text,
            "{:>4}   {:>8.5}   {:>12.5}   {:>7}   {:>15}   {:>12}   {:>8.2} %   {:>7}",
            step.tier,
            step.left_out,
            step.total,
            step.entries,
            step.multiplications,
            step.instructions,
            100.0 * step.share(),
            step.table_bytes
        );
    }
    let _ = writeln!(
        text,
        "\nInstructions are those of a frame of one pixel a cell on the reference board, by a model\n\
         within 2 % of those counted, not timed, and 7 more for each sample that is cut off; of a frame: of {RATE} a second on a part of {} MHz, if it did one instruction a cycle.\n\
         Bytes: of a table with that tier and gain only.",
        CLOCK / 1_000_000
    );
}
