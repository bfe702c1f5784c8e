//! A table's file on its way to a device, whatever happens meanwhile: the host's
//! transfer against the runtime's own updater over a simulated flash.

use iltm::device::upload::{Parcel, Plan, Step, Unwatched, Upload, UploadError, Watch};
use iltm::device::{Client, Patience};
use iltm_runtime::fault::Wear;
use iltm_runtime::link::SlotState;
use iltm_tests::fake_device::{FakeDevice, FakeLine, Harm};
use iltm_tests::fake_tables::{FakeTables, Flash, SECTOR, slot};
use iltm_tests::wedge_table;
use std::sync::OnceLock;
use std::time::Duration;

const TRIAL: Duration = Duration::from_mins(5);

const SHORT: Patience = Patience {
    answer: Duration::from_millis(60),
    tries: 10,
};

/// A table of several sectors.
fn table() -> &'static [u8] {
    static TABLE: OnceLock<Vec<u8>> = OnceLock::new();
    TABLE.get_or_init(|| wedge_table(12, 16, 1))
}

fn client(tables: FakeTables, harm: Harm, seed: u64) -> Client<FakeLine> {
    let line = FakeLine::new(FakeDevice::with_tables(tables), harm, seed);
    Client::greet(line, SHORT).expect("a device")
}

/// Everything that happens, and an end after some bytes.
#[derive(Default)]
struct Seen {
    steps: Vec<Step>,
    stop_at: Option<u32>,
}

impl Watch for Seen {
    fn step(&mut self, step: Step) {
        self.steps.push(step);
    }

    fn stopped(&self) -> bool {
        let done = self.steps.iter().rev().find_map(|step| match step {
            Step::Progress { done, .. } => Some(*done),
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
    let mut client = client(FakeTables::default(), Harm::default(), 1);
    let mut seen = Seen::default();
    let mut upload = Upload::new(&mut client, &parcel);
    let summary = upload.run(&mut seen).expect("a good line");
    assert_eq!(summary.sent, file.len() as u64);
    assert_eq!((summary.skipped, summary.restarts), (0, 0));
    let in_use = upload.activate(TRIAL, &mut seen).expect("a good table");
    assert!(in_use.table.is_some() && in_use.trial_ms > 290_000);
    assert_eq!(seen.steps.last(), Some(&Step::Verified));
    let tables = client.line().device.tables();
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
    let mut client = client(FakeTables::default(), Harm::default(), 1);
    let half = table().len() as u32 / 2;
    let mut seen = Seen {
        stop_at: Some(half),
        ..Seen::default()
    };
    let stopped = Upload::new(&mut client, &parcel).run(&mut seen);
    assert!(matches!(stopped, Err(UploadError::Stopped)), "{stopped:?}");
    let before = client.line().device.tables().writes.len();
    let plan = Plan::make(&mut client, &parcel, || false).expect("a good line");
    assert!(plan.bytes() <= half + SECTOR as u32 && plan.bytes() > 0);

    let mut upload = Upload::new(&mut client, &parcel);
    let summary = upload.run(&mut Unwatched).expect("a good line");
    assert_eq!(
        summary.sent,
        u64::from(plan.bytes()),
        "only whole missing sectors"
    );
    assert_eq!(summary.skipped, table().len() as u32 - plan.bytes());
    let after = client.line().device.tables().writes.len();
    assert_eq!(after - before, plan.bytes().div_ceil(512) as usize);

    let again = Upload::new(&mut client, &parcel).run(&mut Unwatched);
    assert_eq!(again.expect("a good line").sent, 0);
    assert_eq!(client.line().device.tables().writes.len(), after);
}

#[test]
fn a_device_that_restarts_in_the_middle_gets_the_rest() {
    let parcel = Parcel::new(table());
    for after in [1, 9, 20, 41] {
        let mut tables = FakeTables::default();
        tables.restart_after = Some(after);
        let mut client = client(tables, Harm::default(), 1);
        let mut seen = Seen::default();
        let mut upload = Upload::new(&mut client, &parcel);
        let summary = upload.run(&mut seen).expect("it goes on");
        assert_eq!(summary.restarts, 1);
        assert!(seen.steps.contains(&Step::Restarted));
        upload.activate(TRIAL, &mut seen).expect("all of it");
        let writes = client.line().device.tables().writes.len();
        let (chunks, sector) = (table().len().div_ceil(512), SECTOR / 512);
        assert!(writes <= chunks + sector + 3, "{writes} of {chunks}");
    }
}

#[test]
fn a_device_that_restarts_before_the_activation_gets_it_again() {
    let parcel = Parcel::new(table());
    let mut client = client(FakeTables::default(), Harm::default(), 1);
    let mut upload = Upload::new(&mut client, &parcel);
    upload.run(&mut Unwatched).expect("a good line");
    let line = client.line();
    line.device.restart();
    line.session = iltm_runtime::link::Session::new();
    let mut upload = Upload::new(&mut client, &parcel);
    let in_use = upload.activate(TRIAL, &mut Unwatched).expect("again");
    assert!(in_use.trial_ms > 0);
    let chunks = table().len().div_ceil(512);
    assert_eq!(client.line().device.tables().writes.len(), chunks);
}

#[test]
fn a_bad_line_makes_it_slow_and_nothing_else() {
    let parcel = Parcel::new(&table()[..4 * SECTOR]);
    for seed in 0..2 {
        let harm = Harm {
            lost: 4,
            changed: 4,
            doubled: 10,
            cut: 4,
        };
        let mut client = client(FakeTables::default(), harm, seed);
        let mut upload = Upload::new(&mut client, &parcel);
        upload.run(&mut Unwatched).expect("in the end");
        let contents = client.line().device.tables().contents();
        assert_eq!(contents[..4 * SECTOR], table()[..4 * SECTOR], "seed {seed}");
    }
}

#[test]
fn a_sector_that_does_not_hold_anything_is_named_after_three_attempts() {
    let parcel = Parcel::new(table());
    let mut flash = Flash::new(67, 1);
    flash.wear_out(2, 0, Wear::StuckBits).expect("a sector");
    let mut client = client(FakeTables::new(flash), Harm::default(), 1);
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
        .filter(|step| **step == Step::Repeated { sector: 2 });
    assert_eq!(repeated.count(), 2);
    assert_eq!(client.line().device.tables().updater().table(), None);
}
