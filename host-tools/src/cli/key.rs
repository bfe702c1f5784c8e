//! `iltm key` and `iltm sign`

use super::args::{Install, Key, KeyCommand, Sign, Technician};
use super::connect::connect;
use super::failure::{Failure, Kind};
use super::output::{Output, write_file};
use super::tables::{check, read_table, seal, version_of_now};
use super::words::{in_use, key_id, number};
use crate::compile::sign::{new_key, new_technician, read_key, read_public_key};
use crate::device::{DeviceError, rejection_next_step};
use ed25519_dalek::VerifyingKey;
use iltm_runtime::image::{Seal, unseal};
use iltm_runtime::link::Refusal;
use serde_json::{Value, json};
use std::io::{self, IsTerminal, Write};
use std::path::Path;

pub(super) fn run(arguments: &Key, output: &Output) -> Result<(), Failure> {
    match &arguments.command {
        KeyCommand::New { output: path } => {
            let key = new_key(path)?;
            let text = format!(
                "{}Keep the file safe and secret: who has it can make tables for your devices,\n\
                 and without it nobody can.\n",
                words(path, &key.verifying_key())
            );
            output.result(&data(path, &key.verifying_key()), &text);
        }
        KeyCommand::Show { file } => {
            let key = read_public_key(file)?;
            output.result(&data(file, &key), &words(file, &key));
        }
        KeyCommand::Install(arguments) => return install(arguments, output),
        KeyCommand::Technician(arguments) => return technician(arguments, output),
    }
    Ok(())
}

fn id(key: &VerifyingKey) -> String {
    key_id(&Seal::key_id(key.as_bytes()))
}

fn data(path: &Path, key: &VerifyingKey) -> Value {
    json!({
        "file": path.display().to_string(),
        "id": id(key),
        "public_key": key_id(key.as_bytes()),
    })
}

fn words(path: &Path, key: &VerifyingKey) -> String {
    format!(
        "file        {}\nkey id      {}\npublic key  {}\n",
        path.display(),
        id(key),
        key_id(key.as_bytes())
    )
}

fn install(arguments: &Install, output: &Output) -> Result<(), Failure> {
    let key = read_public_key(&arguments.file)?;
    let mut connection = connect(&arguments.line, output)?;
    let slots = connection.client.slots();
    let slots = slots.map_err(|error| connection.failed(&error))?;
    // The device answers a repetition of what it has with yes: nothing to ask then.
    let same = slots.key == Some(Seal::key_id(key.as_bytes())) && slots.device == arguments.device;
    if slots.key.is_none() {
        agree(arguments, &connection.port, &key, output)?;
    }
    let installed =
        connection
            .client
            .provision(key.to_bytes(), arguments.device, arguments.lose_table);
    installed.map_err(|error| match (&error, in_use(&slots)) {
        (
            DeviceError::Refused {
                refusal: Refusal::Table(rejected),
                ..
            },
            Some(table),
        ) => {
            let message = format!(
                "{}: nothing was installed: from its next start on the device would refuse the \
                 table in use, {table}, and show frames as they are: {rejected}",
                connection.port
            );
            let next_step = format!(
                "{} Flash it, confirm it, and install the key then; or give --lose-table if you mean it.",
                rejection_next_step(rejected)
            );
            Failure::new(rejected.into(), message, next_step)
        }
        _ => connection.failed(&error),
    })?;
    connection.remember(output);
    let mut data = data(&arguments.file, &key);
    data["port"] = json!(connection.port);
    data["number"] = json!(arguments.device.to_string());
    let text = format!(
        "The device at {} {} key {} and {}.\n",
        connection.port,
        if same { "has" } else { "now has" },
        id(&key),
        number(arguments.device),
    );
    output.result(&data, &text);
    Ok(())
}

/// `iltm key technician`
fn technician(arguments: &Technician, output: &Output) -> Result<(), Failure> {
    let site = read_key(&arguments.site)?;
    let version = arguments.version.unwrap_or_else(version_of_now);
    let (path, device) = (&arguments.output, arguments.device);
    let key = new_technician(path, &site, device, version)?;
    let mut data = data(path, &key.verifying_key());
    data["site"] = json!(id(&site.verifying_key()));
    data["device"] = json!((device != 0).then(|| device.to_string()));
    data["version"] = json!(version);
    let devices = match device {
        0 => "all devices".to_owned(),
        device => format!("device {device}"),
    };
    let text = format!(
        "{}for         {devices} with key {}; void where a table confirmed revokes below {} or more\n\
         Who has the file can flash tables that the site key signed, confirm and roll back;\n\
         he can sign no tables.\n",
        words(path, &key.verifying_key()),
        id(&site.verifying_key()),
        u64::from(version) + 1,
    );
    output.result(&data, &text);
    Ok(())
}

/// Asks whether it is meant: it cannot be taken back.
fn agree(
    arguments: &Install,
    port: &str,
    key: &VerifyingKey,
    output: &Output,
) -> Result<(), Failure> {
    if arguments.yes {
        return Ok(());
    }
    let refused = |message: &str| {
        Err(Failure::new(
            Kind::Usage,
            message,
            "Give --yes if you mean it: a device keeps its key for good.",
        ))
    };
    if output.is_json() || !output.terminal || !io::stdin().is_terminal() {
        return refused("installing a key cannot be taken back, and nobody is here to be asked");
    }
    let _ = write!(
        io::stderr(),
        "The device at {port} will take only tables signed with key {} from now on,\n\
         and have {} for good.\nIs that meant? [y/N] ",
        id(key),
        number(arguments.device),
    );
    let mut answer = String::new();
    let _ = io::stdin().read_line(&mut answer);
    match answer.trim() {
        "y" | "Y" | "yes" => Ok(()),
        _ => refused("nothing was installed"),
    }
}

/// `iltm sign`
pub(super) fn sign(arguments: &Sign, output: &Output) -> Result<(), Failure> {
    let key = read_key(&arguments.key)?;
    let file = read_table(&arguments.table)?;
    check(&arguments.table, &file)?;
    let signed = seal(&file, &key, &arguments.seal)?;
    let path = arguments.output.as_ref().unwrap_or(&arguments.table);
    write_file(path, &signed)?;
    let mut data = data(&arguments.key, &key.verifying_key());
    data["table"] = json!(path.display().to_string());
    let version = unseal(&signed).ok().and_then(|(_, seal)| seal);
    let version = version.map_or(0, |seal| seal.version);
    data["version"] = json!(version);
    data["bytes"] = json!(signed.len());
    let text = format!(
        "{}: version {}, signed with key {}, {} bytes\n",
        path.display(),
        version,
        id(&key.verifying_key()),
        signed.len()
    );
    output.result(&data, &text);
    Ok(())
}
