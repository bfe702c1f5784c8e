//! Upload: a table's file on its way to a device, whatever happens meanwhile. The host's
//! transfer against the runtime's own updater over a simulated flash; a device that restarts
//! in the middle is for `host-tools/tests/command/flash.rs`.

use iltm::device::upload::{
    NoObserver, Parcel, Upload, UploadError, UploadObserver, UploadPlan, UploadStep,
};
use iltm::device::{Client, DeviceError, Patience};
use iltm_runtime::link::SlotState;
use iltm_tests::fake_device::{FakeDevice, FakeLine, FakeTables, Flash, SECTOR, slot};
use iltm_tests::flash_simulator::Wear;
use iltm_tests::line_faults::{FaultRates, Faults, LossyLine};
use iltm_tests::wedge_table;
use std::ops::Range;
use std::sync::OnceLock;
use std::time::Duration;

const TRIAL: Duration = Duration::from_mins(5);

/// Bits a second of the line.
const BAUD: u32 = 921_600;

/// A table of several sectors.
fn table() -> &'static [u8] {
    static TABLE: OnceLock<Vec<u8>> = OnceLock::new();
    TABLE.get_or_init(|| wedge_table(12, 16, 1))
}

type Lossy = LossyLine<FakeLine>;

fn client(tables: FakeTables, rates: FaultRates, seed: u64) -> Client<Lossy> {
    let line = FakeDevice::with_tables(tables).line(BAUD);
    let line = LossyLine::new(line, Faults::both_ways(rates, seed));
    let patience = Patience {
        tries: 20,
        ..Patience::default()
    };
    Client::greet(line, patience).expect("a device")
}

/// The tables of the device at the other end.
fn of_device(client: &mut Client<Lossy>) -> &mut FakeTables {
    client.line().line_mut().far_end_mut().device.tables()
}

/// Everything that happens, and an end after some bytes.
#[derive(Default)]
struct Seen {
    steps: Vec<UploadStep>,
    stop_at: Option<u32>,
}

impl UploadObserver for Seen {
    fn step(&mut self, step: UploadStep) {
        self.steps.push(step);
    }

    fn stopped(&self) -> bool {
        let done = self.steps.iter().rev().find_map(|step| match step {
            UploadStep::Progress { done, .. } => Some(*done),
            _ => None,
        });
        self.stop_at
            .is_some_and(|stop| done.is_some_and(|done| done >= stop))
    }
}

#[test]
fn a_first_table_arrives_and_is_used_on_trial() {
    let file = table();
    assert!(file.len() > 6 * SECTOR, "{} bytes", file.len());
    let parcel = Parcel::new(file);
    let mut client = client(FakeTables::default(), FaultRates::default(), 1);
    let mut seen = Seen::default();
    let mut upload = Upload::new(&mut client, &parcel);
    let summary = upload.run(&mut seen).expect("a good line");
    assert_eq!(summary.sent, file.len() as u64);
    assert_eq!((summary.skipped, summary.restarts), (0, 0));
    let in_use = upload.activate(TRIAL, &mut seen).expect("a good table");
    assert!(in_use.table.is_some() && in_use.trial_ms > 290_000);
    assert_eq!(seen.steps.last(), Some(&UploadStep::Verified));
    let tables = of_device(&mut client);
    assert_eq!(tables.updater().states()[0], SlotState::Trial);
    assert_eq!(tables.contents()[slot(0)][..file.len()], *file);
    assert_eq!(
        tables.writes.len(),
        file.len().div_ceil(512),
        "each chunk once"
    );
}

#[test]
fn what_is_there_already_is_not_sent_again() {
    let parcel = Parcel::new(table());
    let mut client = client(FakeTables::default(), FaultRates::default(), 1);
    let half = table().len() as u32 / 2;
    let mut seen = Seen {
        stop_at: Some(half),
        ..Seen::default()
    };
    let stopped = Upload::new(&mut client, &parcel).run(&mut seen);
    assert!(matches!(stopped, Err(UploadError::Stopped)), "{stopped:?}");
    let plan = UploadPlan::make(&mut client, &parcel, || false).expect("a good line");
    // What was on its way has arrived by then.
    let before = of_device(&mut client).writes.len();
    assert!(plan.bytes() <= half + SECTOR as u32 && plan.bytes() > 0);

    let mut upload = Upload::new(&mut client, &parcel);
    let summary = upload.run(&mut NoObserver).expect("a good line");
    assert_eq!(
        summary.sent,
        u64::from(plan.bytes()),
        "only whole missing sectors"
    );
    assert_eq!(summary.skipped, table().len() as u32 - plan.bytes());
    let after = of_device(&mut client).writes.len();
    assert_eq!(after - before, plan.bytes().div_ceil(512) as usize);

    let again = Upload::new(&mut client, &parcel).run(&mut NoObserver);
    assert_eq!(again.expect("a good line").sent, 0);
    assert_eq!(of_device(&mut client).writes.len(), after);
}

#[test]
fn a_device_that_restarts_before_the_activation_gets_it_again() {
    let parcel = Parcel::new(table());
    let mut client = client(FakeTables::default(), FaultRates::default(), 1);
    let mut upload = Upload::new(&mut client, &parcel);
    upload.run(&mut NoObserver).expect("a good line");
    client.line().line_mut().far_end_mut().restart();
    let mut upload = Upload::new(&mut client, &parcel);
    let in_use = upload.activate(TRIAL, &mut NoObserver).expect("again");
    assert!(in_use.trial_ms > 0);
    let chunks = table().len().div_ceil(512);
    assert_eq!(of_device(&mut client).writes.len(), chunks);
}

/// Where a table's way into use ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Stage {
    Hello,
    Transfer,
    Activate,
    Confirm,
}

/// The whole of `iltm flash --confirm`; with as much patience as that.
fn flash(line: &mut Lossy, file: &[u8]) -> Result<(), (Stage, UploadError)> {
    let client = Client::greet(line, Patience::default());
    let mut client = client.map_err(|error| (Stage::Hello, error.into()))?;
    let parcel = Parcel::new(file);
    let mut upload = Upload::new(&mut client, &parcel);
    let sent = upload.run(&mut NoObserver);
    sent.map_err(|error| (Stage::Transfer, error))?;
    let in_use = upload.activate(TRIAL, &mut NoObserver);
    let in_use = in_use.map_err(|error| (Stage::Activate, error))?;
    let table = in_use.table.expect("on trial");
    let confirmed = client.confirm(table.id);
    confirmed.map_err(|error| (Stage::Confirm, error.into()))?;
    Ok(())
}

/// Which of these files frames go through, and whether it is on trial.
fn in_use(tables: &FakeTables, files: &[&[u8]]) -> (usize, bool) {
    let used = tables.updater().in_use().expect("always a table");
    let contents = tables.contents();
    let held = &contents[slot(used.index())];
    let file = files.iter().position(|file| held.starts_with(file));
    let trial = *used.of(&tables.updater().states()) == SlotState::Trial;
    (file.expect("a whole table"), trial)
}

/// What became of updates.
#[derive(Debug, Default)]
struct Ends {
    whole: u64,
    /// Ended at each stage with an error.
    failed: [u64; 4],
    /// Of these, with the new table in use on trial, and confirmed.
    on_trial: [u64; 4],
    confirmed: [u64; 4],
    longest: Duration,
}

const OLD: usize = 0;
const NEW: usize = 1;

/// One update a seed from a confirmed old table to a new one. However it ends, frames
/// go through one of them, whole, and the error fits which.
fn updates(seeds: Range<u64>, rates: impl Fn(u64) -> FaultRates) -> Ends {
    let (old, new) = (wedge_table(8, 10, 1), wedge_table(8, 12, 1));
    assert!(new.len() > 3 * SECTOR, "{} bytes", new.len());
    let line = FakeDevice::with_tables(FakeTables::default()).line(BAUD);
    let mut line = LossyLine::new(line, Faults::default());
    flash(&mut line, &old).expect("a good line");
    let tables = line.line_mut().far_end_mut().device.tables();
    let with_old = tables.updater().flash().clone();
    let mut ends = Ends::default();
    for seed in seeds {
        let device = FakeDevice::with_tables(FakeTables::new(with_old.clone()));
        let mut line = LossyLine::new(device.line(BAUD), Faults::both_ways(rates(seed), seed));
        let result = flash(&mut line, &new);
        ends.longest = ends.longest.max(line.line().elapsed());
        let tables = line.line_mut().far_end_mut().device.tables();
        let now = in_use(tables, &[&old, &new]);
        tables.restart();
        let later = in_use(tables, &[&old, &new]);
        let [old_stays, on_trial, confirmed] = [
            ((OLD, false), (OLD, false)),
            // A restart ends the trial.
            ((NEW, true), (OLD, false)),
            ((NEW, false), (NEW, false)),
        ];
        let Err((stage, error)) = result else {
            assert_eq!((now, later), confirmed, "seed {seed}");
            ends.whole += 1;
            continue;
        };
        ends.failed[stage as usize] += 1;
        ends.on_trial[stage as usize] += u64::from(now == on_trial.0);
        ends.confirmed[stage as usize] += u64::from(now == confirmed.0);
        // Where the answer was lost, what was asked for may have been done.
        let possible = match stage {
            Stage::Hello | Stage::Transfer => [old_stays, old_stays],
            Stage::Activate => [old_stays, on_trial],
            Stage::Confirm => [on_trial, confirmed],
        };
        assert!(
            possible.contains(&(now, later)),
            "seed {seed}: {stage:?}: {error}; {now:?}, after a restart {later:?}"
        );
        let silence = matches!(
            error,
            UploadError::Stalled { .. } | UploadError::Device(DeviceError::NoAnswer { .. })
        );
        assert!(silence, "seed {seed}: {error}");
    }
    println!("{ends:?}");
    ends
}

/// Up to a fifth of the frames are faulty, in both directions. `ILTM_TRANSFERS` says in how
/// many updates.
#[test]
fn on_a_bad_line_updates_get_through_to_the_confirmation() {
    let count = std::env::var("ILTM_TRANSFERS").map_or(Ok(1_000), |count| count.parse());
    let count: u64 = count.expect("a number");
    let ends = updates(0..count, |seed| FaultRates::evenly((seed % 5 * 50) as u16));
    assert!(ends.whole * 100 >= count * 99, "{ends:?}");
    assert!(ends.longest < Duration::from_mins(2), "{ends:?}");
}

/// More than half of all frames are faulty.
#[test]
fn on_a_line_that_is_nearly_dead_every_error_says_what_may_be_in_use() {
    let ends = updates(0..400, |seed| {
        FaultRates::evenly((500 + seed % 4 * 100) as u16)
    });
    let [hello, transfer, activate, confirm] = ends.failed;
    let some = [ends.whole, hello, transfer, activate, confirm];
    assert!(some.iter().all(|count| *count > 0), "{ends:?}");
    // A lost answer leaves open whether the device did it.
    assert!(ends.on_trial[Stage::Activate as usize] > 0, "{ends:?}");
    assert!(ends.on_trial[Stage::Confirm as usize] > 0, "{ends:?}");
    assert!(ends.confirmed[Stage::Confirm as usize] > 0, "{ends:?}");
    assert!(ends.longest < Duration::from_mins(10), "{ends:?}");
}

#[test]
fn a_device_that_falls_silent_ends_the_transfer_after_half_a_minute() {
    let parcel = Parcel::new(table());
    let mut tables = FakeTables::default();
    tables.mute_after = Some(7);
    let mut client = client(tables, FaultRates::default(), 1);
    let mut seen = Seen::default();
    let error = Upload::new(&mut client, &parcel).run(&mut seen);
    let error = error.expect_err("nothing comes any more");
    assert!(matches!(error, UploadError::Stalled { .. }), "{error}");
    let quiet = seen
        .steps
        .iter()
        .filter(|step| matches!(step, UploadStep::Quiet { .. }));
    assert!(quiet.count() > 3, "it is said meanwhile");
    let took = client.line().line().elapsed();
    assert!(
        took > Duration::from_secs(30) && took < Duration::from_secs(35),
        "{took:?}"
    );
}

#[test]
fn a_line_that_is_cut_ends_the_transfer_at_once() {
    let parcel = Parcel::new(table());
    let mut client = client(FakeTables::default(), FaultRates::default(), 1);
    client.line().unplug_after(20);
    let error = Upload::new(&mut client, &parcel).run(&mut NoObserver);
    let error = error.expect_err("there is no line any more");
    let gone = matches!(error, UploadError::Device(DeviceError::Gone { .. }));
    assert!(gone, "{error}");
}

#[test]
fn a_clean_line_is_used_to_85_percent() {
    let parcel = Parcel::new(table());
    let mut client = client(FakeTables::default(), FaultRates::default(), 1);
    let before = client.line().line().elapsed();
    let plan = UploadPlan::make(&mut client, &parcel, || false).expect("a good line");
    assert_eq!(plan.bytes() as usize, table().len());
    Upload::new(&mut client, &parcel)
        .run(&mut NoObserver)
        .expect("a good line");
    let took = client.line().line().elapsed().saturating_sub(before);
    let share = 10.0 * table().len() as f64 / f64::from(BAUD) / took.as_secs_f64();
    println!(
        "{} bytes in {took:.3?}: {:.1} % of the line",
        table().len(),
        100.0 * share
    );
    assert!(share >= 0.85, "{share}");
}

#[test]
fn a_sector_that_does_not_hold_anything_is_named_after_three_attempts() {
    let parcel = Parcel::new(table());
    let mut flash = Flash::new(67, 1);
    flash.wear_out(2, 0, Wear::StuckBits).expect("a sector");
    let mut client = client(FakeTables::new(flash), FaultRates::default(), 1);
    let mut seen = Seen::default();
    let error = Upload::new(&mut client, &parcel).run(&mut seen);
    match error {
        Err(UploadError::Worn {
            sector: 2,
            offset: 8_192,
            attempts: 3,
        }) => {}
        other => panic!("{other:?}"),
    }
    let repeated = seen
        .steps
        .iter()
        .filter(|step| **step == UploadStep::Repeated { sector: 2 });
    assert_eq!(repeated.count(), 2);
    assert_eq!(of_device(&mut client).updater().table(), None);
}
