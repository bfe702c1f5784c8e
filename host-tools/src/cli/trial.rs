//! `iltm confirm` and `iltm rollback`

use super::active::Active;
use super::args::SerialLine;
use super::connect::{Connection, connect};
use super::failure::{Failure, Kind};
use super::output::Output;
use super::words::{in_use, other};
use iltm_runtime::link::{Slots, TableName};
use serde_json::json;

pub(super) fn confirm(line: &SerialLine, output: &Output) -> Result<(), Failure> {
    let mut connection = connect(line, output)?;
    let (slots, table) = slots(&mut connection)?;
    let done = if slots.trial_ms == 0 {
        format!("Table {table} is in use and needs no confirmation.\n")
    } else {
        let kept = connection.client.confirm(table.id);
        kept.map_err(|error| connection.failed_with_table(&error))?;
        format!("Table {table} is in use, confirmed.\n")
    };
    finish(connection, output, Some(table), &done);
    Ok(())
}

pub(super) fn rollback(line: &SerialLine, output: &Output) -> Result<(), Failure> {
    let mut connection = connect(line, output)?;
    let (slots, table) = slots(&mut connection)?;
    if slots.trial_ms == 0 && other(&slots).is_none() {
        let message = format!(
            "{}: there is no other table than {table} to go back to",
            connection.port
        );
        let next_step = "Flash the table that you want instead.";
        let failure = Failure::new(Kind::NoTable, message, next_step);
        return Err(failure.with(Active::ask(&mut connection.client)));
    }
    let now = connection.client.rollback(table.id);
    let now = now.map_err(|error| connection.failed_with_table(&error))?;
    let done = match now.table {
        Some(now) => format!("Table {now} is in use again, instead of {table}.\n"),
        None => format!("No table is in use now, instead of {table}: frames pass unchanged.\n"),
    };
    finish(connection, output, now.table, &done);
    Ok(())
}

/// The slots, and the table in use.
fn slots(connection: &mut Connection) -> Result<(Slots, TableName), Failure> {
    let slots = connection.client.slots();
    let slots = slots.map_err(|error| connection.failed_with_table(&error))?;
    let table = in_use(&slots).ok_or_else(|| {
        let message = format!("{}: there is no table", connection.port);
        let failure = Failure::new(Kind::NoTable, message, "Flash one: `iltm flash TABLE`.");
        failure.with(Active::Known {
            table: None,
            trial_ms: 0,
        })
    })?;
    Ok((slots, table))
}

fn finish(mut connection: Connection, output: &Output, table: Option<TableName>, done: &str) {
    connection.remember(output);
    let data = json!({
        "port": connection.port,
        "active": Active::Known { table, trial_ms: 0 }.data(),
    });
    output.result(&data, done);
}
