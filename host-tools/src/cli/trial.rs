//! `iltm confirm` and `iltm rollback`

use super::active::{Active, slots_now};
use super::args::Decide;
use super::connect::{Connection, connect};
use super::failure::{Failure, Kind};
use super::fit::{Fit, ask_fit, not_compensating};
use super::output::Output;
use super::words::{CalledTable, how_ended, in_use, other, unconfirmed};
use crate::device::DeviceError;
use iltm_runtime::link::{Slots, Status};
use serde_json::json;

pub(super) fn confirm(arguments: &Decide, output: &Output) -> Result<(), Failure> {
    let mut connection = connect(&arguments.line, output)?;
    connection.authorise(arguments.key.as_deref())?;
    let slots = slots(&mut connection)?;
    if let Some(lost) = lost(&slots) {
        return Err(ended(&mut connection, &slots, lost));
    }
    let table = in_use(&slots).ok_or_else(|| no_table(&connection))?;
    let fit = ask_fit(&mut connection.client);
    let fit = fit.map_err(|error| not_confirmed(&mut connection, &error))?;
    if let Fit::PassThrough(status) = &fit {
        let mut failure = not_compensating(&connection.port, table, status, Some(&slots));
        failure.next_step = if slots.trial_ms > 0 {
            "Nothing was confirmed. `iltm rollback` brings the table before back at once."
                .to_owned()
        } else {
            "Give the device the frames that the table is for, or flash a table for its frames."
                .to_owned()
        };
        return Err(failure.with(Active::ask(&mut connection.client)));
    }
    let done = if slots.trial_ms == 0 {
        format!(
            "Table {table} is in use and needs no confirmation.{}\n",
            fit.remark()
        )
    } else {
        let kept = connection.client.confirm(table.name.id);
        kept.map_err(|error| not_confirmed(&mut connection, &error))?;
        format!("Table {table} is in use, confirmed.{}\n", fit.remark())
    };
    finish(connection, output, Some(table), fit.data(), &done);
    Ok(())
}

/// The table whose trial is over, though nobody confirmed it.
fn lost(slots: &Slots) -> Option<CalledTable> {
    unconfirmed(slots).filter(|_| slots.trial_ms == 0)
}

/// Of a confirmation that failed: the trial may have ended meanwhile, with its time or with a
/// restart of the device.
fn not_confirmed(connection: &mut Connection, error: &DeviceError) -> Failure {
    if let Ok(slots) = slots_now(&mut connection.client)
        && let Some(lost) = lost(&slots)
    {
        return ended(connection, &slots, lost);
    }
    connection.failed_with_table(error)
}

/// What nobody confirmed in time is gone: the table in use is another one.
fn ended(connection: &mut Connection, slots: &Slots, lost: CalledTable) -> Failure {
    let port = &connection.port;
    let now = match in_use(slots) {
        Some(now) => format!("the device went back to {now}"),
        None => "the device has no other table: frames pass unchanged".to_owned(),
    };
    let message = if let Some(how) = how_ended(slots, lost.name) {
        format!("{port}: the trial of {lost} {how}; {now}")
    } else {
        // What the device knew of it is lost with a restart.
        let status = connection.client.status().ok();
        let since = status.map_or_else(String::new, |status| since(&status));
        format!(
            "{port}: {lost} is not in use: the device has restarted{since}, and a trial ends with a restart; {now}"
        )
    };
    Failure::new(
        Kind::NoTable,
        message,
        "Nothing was confirmed. Flash the table again, then confirm it in time.",
    )
    .with(Active::ask(&mut connection.client))
}

/// When a device started, and whether its watchdog did it.
fn since(status: &Status) -> String {
    let seconds = status.uptime_ms / 1_000;
    match status.watchdog_resets {
        0 => format!(" {seconds} s ago"),
        1 => format!(" {seconds} s ago (its watchdog restarted it once)"),
        times => format!(" {seconds} s ago (its watchdog restarted it {times} times)"),
    }
}

pub(super) fn rollback(arguments: &Decide, output: &Output) -> Result<(), Failure> {
    let mut connection = connect(&arguments.line, output)?;
    connection.authorise(arguments.key.as_deref())?;
    let slots = slots(&mut connection)?;
    let table = in_use(&slots).ok_or_else(|| no_table(&connection))?;
    if slots.trial_ms == 0 && other(&slots).is_none() {
        let message = format!(
            "{}: there is no other table than {table} to go back to",
            connection.port
        );
        let next_step = "Flash the table that you want instead.";
        let failure = Failure::new(Kind::NoTable, message, next_step);
        return Err(failure.with(Active::ask(&mut connection.client)));
    }
    let now = connection.client.rollback(table.name.id);
    let now = now.map_err(|error| connection.failed_with_table(&error))?;
    let now = now.table.map(|now| super::words::called(now, Some(&slots)));
    let fit = ask_fit(&mut connection.client);
    let fit = fit.map_err(|error| connection.failed_with_table(&error))?;
    let mut done = match now {
        Some(now) => format!(
            "Table {now} is in use again, instead of {table}.{}\n",
            fit.remark()
        ),
        None => format!("No table is in use now, instead of {table}: frames pass unchanged.\n"),
    };
    if let (Fit::PassThrough(status), Some(_)) = (&fit, now) {
        let mode = super::words::mode(status, connection.client.slots().ok().as_ref());
        done = format!("{done}It is {mode}.\n");
    }
    finish(connection, output, now, fit.data(), &done);
    Ok(())
}

fn slots(connection: &mut Connection) -> Result<Slots, Failure> {
    let slots = slots_now(&mut connection.client);
    slots.map_err(|error| connection.failed_with_table(&error))
}

fn no_table(connection: &Connection) -> Failure {
    let message = format!("{}: there is no table", connection.port);
    let failure = Failure::new(Kind::NoTable, message, "Flash one: `iltm flash TABLE`.");
    failure.with(Active::Known {
        table: None,
        trial_ms: 0,
    })
}

fn finish(
    mut connection: Connection,
    output: &Output,
    table: Option<CalledTable>,
    compensating: Option<bool>,
    done: &str,
) {
    connection.remember(output);
    let data = json!({
        "port": connection.port,
        "active": Active::Known { table, trial_ms: 0 }.data(),
        "compensating": compensating,
    });
    output.result(&data, done);
}
