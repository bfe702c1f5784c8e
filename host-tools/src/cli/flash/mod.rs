//! `iltm flash`
//!
//! | what | file |
//! |---|---|
//! | the order of things, and what to say when they fail | here |
//! | what the host can tell before anything is sent | [`preflight`] |
//! | progress: a bar, or an event a line | [`show`] |

mod preflight;
mod show;

use super::active::{Active, Asked, Lost};
use super::args::Flash;
use super::connect::{Connection, connect};
use super::failure::{Failure, Kind};
use super::fit::{Fit, ask_fit, not_compensating};
use super::interrupt;
use super::output::Output;
use super::tables::read_table;
use super::words::{self, letter, table_name};
use crate::device::DeviceError;
use crate::device::upload::{Parcel, Upload, UploadError, UploadPlan, UploadSummary};
use crate::user::{Folders, begin_transcript};
use iltm_runtime::link::{Fault, InUse, Refusal};
use iltm_runtime::trust::NoRight;
use preflight::{CheckedTable, Now};
use serde_json::json;
use show::Show;
use std::time::{Duration, Instant};

pub(super) fn run(arguments: &Flash, output: &Output) -> Result<(), Failure> {
    let untouched = |failure: Failure| failure.with(Active::Untouched);
    let bytes = read_table(&arguments.table).map_err(untouched)?;
    let table = CheckedTable::read(&arguments.table, &bytes).map_err(untouched)?;
    let connected = connect(&arguments.line, output);
    let mut connection = connected.map_err(|failure| match failure.kind {
        Kind::NoAnswer | Kind::NoDevice | Kind::Port => failure.with(Active::Unknown),
        _ => failure.with(Active::Untouched),
    })?;
    if let Some(Ok(file)) = Folders::of_user().map(|folders| begin_transcript(&folders)) {
        connection.transcribe(file);
    }
    let result = flash(arguments, &bytes, &table, &mut connection, output);
    let result = result.map_err(|failure| match failure.active {
        Some(_) => failure,
        None => failure.with(Active::ask(&mut connection.client)),
    });
    let words = match &result {
        Ok(()) => "done".to_owned(),
        Err(failure) => format!("failed: {failure}"),
    };
    connection.client.line().remark(&words);
    result?;
    connection.remember(output);
    Ok(())
}

fn flash(
    arguments: &Flash,
    bytes: &[u8],
    table: &CheckedTable,
    connection: &mut Connection,
    output: &Output,
) -> Result<(), Failure> {
    let slots = connection.client.slots();
    let slots = slots.map_err(|error| connection.failed(&error))?;
    let site = connection.authorise(arguments.key.as_deref())?;
    let parcel = Parcel::new(bytes);
    let now = table.check(connection.client.device(), &slots)?;
    // Also of a table that is there already: the file is not, and may be brought elsewhere.
    table.check_signature(bytes, site.as_ref(), &slots)?;
    let in_use = match now {
        Now::Send if slots.key.is_some() => {
            if site.is_none() && !arguments.dry_run {
                let error = DeviceError::Refused {
                    request: "begin",
                    refusal: Refusal::NoRight(NoRight::Missing),
                };
                return Err(connection.failed(&error));
            }
            None
        }
        Now::Send => None,
        Now::InUse => Some(InUse {
            table: Some(table.called.name),
            trial_ms: 0,
        }),
        Now::OnTrial => Some(on_trial(arguments, table, &parcel, connection)?),
    };
    let mut ending = Ending {
        arguments,
        table,
        output,
        summary: UploadSummary::default(),
        start: Instant::now(),
        dry_run: arguments.dry_run,
    };
    if let Some(in_use) = in_use {
        return ending.end(connection, in_use, "is in use already");
    }
    interrupt::catch();
    let plan = UploadPlan::make(&mut connection.client, &parcel, interrupt::stopped);
    let mut lost = Lost {
        before: words::in_use(&slots),
        asked: Asked::Transfer,
    };
    let plan = plan.map_err(|error| failed(connection, &error, lost))?;
    announce(table, &plan, connection, output);
    if arguments.dry_run {
        output.result(
            &json!({
                "event": "done",
                "dry_run": true,
                "active": active(&plan.slots).data(),
            }),
            "Nothing was changed: this was a dry run.\n",
        );
        return Ok(());
    }
    let in_use = bring(connection, &parcel, &plan, &mut ending, &mut lost)?;
    lost.asked = Asked::Confirmation;
    let ended = ending.end(connection, in_use, "is in use");
    ended.map_err(|failure| match failure.active.as_deref() {
        Some(Active::Unknown) => failure.with(Active::Lost(lost)),
        _ => failure,
    })
}

/// Sends what differs and starts the trial, at lower speeds where the line falls silent.
fn bring(
    connection: &mut Connection,
    parcel: &Parcel<'_>,
    plan: &UploadPlan,
    ending: &mut Ending<'_>,
    lost: &mut Lost,
) -> Result<InUse, Failure> {
    let mut show = Show::new(ending.output);
    let trial = Duration::from_secs(ending.arguments.trial.into());
    loop {
        let mut upload = Upload::new(&mut connection.client, parcel);
        let result = upload.run(&mut show).and_then(|summary| {
            ending.summary = summary;
            let text = format!("slot {} holds the table", letter(plan.slots.target));
            show.say(
                &text,
                &json!({
                    "event": "verified",
                    "sent": summary.sent,
                    "skipped": summary.skipped,
                    "restarts": summary.restarts,
                }),
            );
            lost.asked = Asked::Trial;
            upload.activate(trial, &mut show)
        });
        match result {
            Ok(in_use) => {
                show.end();
                return Ok(in_use);
            }
            Err(error) if is_silence(&error) && connection.slow_down() => {
                let baud = connection.baud;
                let data = json!({ "event": "slower", "baud": baud });
                show.say(
                    &format!("no answer any more; going on at {baud} baud"),
                    &data,
                );
            }
            Err(error) => {
                show.stop();
                return Err(failed(connection, &error, *lost));
            }
        }
    }
}

/// Asks a device with a table on trial for the trial of this file, which changes
/// nothing: it is that one, by its digest, or the device refuses.
fn on_trial(
    arguments: &Flash,
    table: &CheckedTable,
    parcel: &Parcel<'_>,
    connection: &mut Connection,
) -> Result<InUse, Failure> {
    let trial = Duration::from_secs(arguments.trial.into());
    let asked = connection.client.activate(parcel.transfer(), trial);
    asked.map_err(|error| match error {
        DeviceError::Refused {
            refusal: Refusal::OnTrial,
            ..
        } => table.other_on_trial(),
        error => connection.failed(&error),
    })
}

/// Whether a lower speed may help.
const fn is_silence(error: &UploadError) -> bool {
    matches!(
        error,
        UploadError::Stalled { .. } | UploadError::Device(DeviceError::NoAnswer { .. })
    )
}

fn failed(connection: &mut Connection, error: &UploadError, lost: Lost) -> Failure {
    let message = format!("{}: {error}", connection.port);
    let active = match Active::ask(&mut connection.client) {
        Active::Unknown => Active::Lost(lost),
        known => known,
    };
    Failure::new(error.into(), message, error.next_step()).with(active)
}

fn active(slots: &iltm_runtime::link::Slots) -> Active {
    Active::Known {
        table: words::in_use(slots),
        trial_ms: slots.trial_ms,
    }
}

/// Says what is about to be done.
fn announce(table: &CheckedTable, plan: &UploadPlan, connection: &Connection, output: &Output) {
    let (differing, sectors) = (plan.differing.len(), plan.sectors);
    let seconds = seconds(plan.bytes(), connection.baud);
    let slot = letter(plan.slots.target);
    output.event(&json!({
        "event": "started",
        "port": connection.port,
        "baud": connection.baud,
        "board": connection.client.device().board.as_str(),
        "table": table_name(Some(table.called)),
        "bytes": table.size.bytes,
        "slot": slot.to_string(),
        "sectors": sectors,
        "differing": differing,
        "to_send": plan.bytes(),
        "seconds": seconds,
        "active": active(&plan.slots).data(),
    }));
    let what = if differing == 0 {
        "holds it already: nothing to send".to_owned()
    } else {
        format!(
            "{differing} of {sectors} sectors differ, {} bytes to send, about {} at {} baud",
            plan.bytes(),
            duration(seconds),
            connection.baud
        )
    };
    output.people(&format!(
        "table    {}, {} bytes, {}\ndevice   {} at {}\nin use   {}\nslot {slot}   {what}\n",
        table.called,
        table.size.bytes,
        table.signer(),
        connection.client.device().board,
        connection.port,
        match words::in_use(&plan.slots) {
            Some(used) => format!("table {used}"),
            None => "no table: frames pass unchanged".to_owned(),
        },
    ));
}

/// Seconds that so many bytes take: 10 bits each, and the frames around chunks.
fn seconds(bytes: u32, baud: u32) -> f64 {
    1.05 * 10.0 * f64::from(bytes) / f64::from(baud.max(1))
}

fn duration(seconds: f64) -> String {
    let seconds = seconds.ceil() as u64;
    match seconds / 60 {
        0 => format!("{seconds} s"),
        minutes => format!("{minutes} min {} s", seconds % 60),
    }
}

/// An error once the table was in use. A device that has restarted since then has ended the
/// trial.
fn after_activation(connection: &mut Connection, error: &DeviceError) -> Failure {
    let mut failure = connection.failed_with_table(error);
    if let DeviceError::Refused {
        refusal: Refusal::HelloFirst,
        ..
    } = error
    {
        let status = connection.client.status().ok();
        let watchdog = match status.map(|status| status.last_fault) {
            Some(Some(Fault::Watchdog)) => " (its watchdog restarted it)",
            _ => "",
        };
        failure.message = format!(
            "{}: the device has restarted{watchdog}, and a trial ends with a restart",
            connection.port
        );
        "Flash again.".clone_into(&mut failure.next_step);
    }
    failure
}

/// What is left to do once the device uses the table.
struct Ending<'a> {
    arguments: &'a Flash,
    table: &'a CheckedTable,
    output: &'a Output,
    summary: UploadSummary,
    start: Instant,
    dry_run: bool,
}

impl Ending<'_> {
    fn end(
        &mut self,
        connection: &mut Connection,
        in_use: InUse,
        how: &str,
    ) -> Result<(), Failure> {
        let table = self.table.called;
        let mut trial_ms = in_use.trial_ms;
        if in_use.table.is_none_or(|used| used.id != table.name.id) {
            let message = format!("{}: the device uses another table by now", connection.port);
            return Err(Failure::new(Kind::Device, message, "Run `iltm status`."));
        }
        if trial_ms > 0 {
            self.output
                .event(&json!({ "event": "trial", "seconds": trial_ms.div_ceil(1_000) }));
        }
        let fit = ask_fit(&mut connection.client);
        let fit = fit.map_err(|error| after_activation(connection, &error))?;
        if let Fit::PassThrough(status) = &fit {
            let slots = connection.client.slots().ok();
            let failure = not_compensating(&connection.port, table, status, slots.as_ref());
            if trial_ms > 0 && !self.dry_run {
                let back = connection.client.rollback(table.name.id);
                back.map_err(|error| connection.failed_with_table(&error))?;
            }
            return Err(failure);
        }
        if self.arguments.confirm && trial_ms > 0 && !self.dry_run {
            let kept = connection.client.confirm(table.name.id);
            kept.map_err(|error| after_activation(connection, &error))?;
            trial_ms = 0;
        }
        let mut text = match (trial_ms, self.arguments.confirm && in_use.trial_ms > 0) {
            (0, true) => format!("Table {table} {how}, confirmed.{}\n", fit.remark()),
            (0, false) => format!("Table {table} {how}.{}\n", fit.remark()),
            (trial_ms, _) => format!(
                "Table {table} {how}, on trial for {} s. Look at the wall, then run `iltm confirm`;\n\
                 without it the device goes back to what it showed before. `iltm rollback` does so now.{}\n",
                trial_ms.div_ceil(1_000),
                fit.remark()
            ),
        };
        if self.dry_run {
            text.push_str("Nothing was changed: this was a dry run.\n");
        }
        let data = json!({
            "event": "done",
            "dry_run": self.dry_run,
            "active": Active::Known { table: Some(table), trial_ms }.data(),
            "confirmed": trial_ms == 0,
            "compensating": fit.data(),
            "sent": self.summary.sent,
            "skipped": self.summary.skipped,
            "restarts": self.summary.restarts,
            "seconds": self.start.elapsed().as_secs_f64(),
        });
        self.output.result(&data, &text);
        Ok(())
    }
}
