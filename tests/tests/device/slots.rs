//! Table slots: what a device does with tables, request by request.

use ed25519_dalek::SigningKey;
use iltm::picture::Response as Projector;
use iltm_runtime::link::{Fault, PassThrough, Refusal, Request, Response, SlotState, TableReason};
use iltm_runtime::store::{Map, MapError, Slot};
use iltm_runtime::trust::Rejected;
use iltm_tests::firmware::{Effects, random_table};
use iltm_tests::flash_simulator::NorSimulator;
use iltm_tests::slots::{SimDevice, Step, TRIAL_S, digest, provision};
use iltm_tests::{signing_key, wedge_table_for};

type Device = SimDevice<4, 256>;

/// Sectors of a slot: 12 KiB.
const SLOT: usize = 48;

const NUMBER: u64 = 7;

fn key() -> SigningKey {
    signing_key(5)
}

fn table(cols: u16) -> Vec<u8> {
    wedge_table_for(Projector::Linear, 2, cols, 1)
}

fn signed(cols: u16, version: u32, oldest: u32) -> Vec<u8> {
    iltm_tests::signed(&table(cols), &key(), version, oldest, NUMBER)
}

/// A device with a key.
fn strict() -> Device {
    let mut device = Device::new(SLOT, 1);
    let answer = device.ask(provision(&key(), NUMBER));
    assert_eq!(answer, Response::Provisioned);
    device
}

/// A device that has confirmed the first of two tables, and them.
fn with_first() -> (Device, Vec<u8>, Vec<u8>) {
    let (first, second) = (table(3), table(4));
    let mut device = Device::new(SLOT, 1);
    device.update(&first, true).expect("a good table");
    (device, first, second)
}

#[test]
fn sectors_are_compared_as_many_as_fit_an_answer_and_one_at_a_time_in_a_hurry() {
    let mut device = Device::new(SLOT, 1);
    let mut sectors = |now_ms: u64, length: u32, first: u32| {
        device.now_ms = now_ms;
        match device.ask(Request::Sectors { length, first }) {
            Response::Sectors(sectors) => (sectors.first, sectors.crcs.len()),
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(sectors(1_000, 3 * 256, 0), (0, 3));
    assert_eq!(sectors(2_000, 2 * 256 + 1, 1), (1, 2));
    assert_eq!(sectors(3_000, 256, 1), (1, 0));
    assert_eq!(sectors(4_000, 256, 7), (7, 0));
    assert_eq!(sectors(5_000, 3 * 256, 0), (0, 3));
    assert_eq!(sectors(5_001, 3 * 256, 0), (0, 1));
}

fn roll_back(device: &mut Device) -> Result<(), Refusal> {
    device.carry_out(&[], &Step::Rollback)
}

#[test]
fn a_confirmed_table_counts_after_a_restart_and_one_on_trial_does_not() {
    let (first, second) = (table(3), table(4));
    let mut device = Device::new(SLOT, 1);
    device.update(&first, false).expect("a good table");
    assert!(device.runs(&first));
    let mut device = device.restarted();
    assert_eq!(device.tables.selected, Err(PassThrough::NoTable));
    device.update(&first, true).expect("a good table");
    device.update(&second, false).expect("a good table");
    assert!(device.runs(&second));
    let device = device.restarted();
    assert!(device.runs(&first));
    assert_eq!(
        device.updater.states(),
        [SlotState::Active, SlotState::Unconfirmed]
    );
}

/// A device that took it for broken would say of the table before that it needs no
/// confirmation, and nothing of the one that was lost.
#[test]
fn a_table_that_was_on_trial_at_a_restart_is_unconfirmed_whatever_length_its_slot_held_before() {
    for sizes in [[3, 4, 5], [5, 4, 3]] {
        let [first, second, third] = sizes.map(table);
        let mut device = Device::new(SLOT, 1);
        device.update(&first, true).expect("a good table");
        device.update(&second, true).expect("a good table");
        device.update(&third, false).expect("a good table");
        assert!(device.runs(&third));
        let device = device.restarted();
        assert!(device.runs(&second));
        let states = device.updater.states();
        assert_eq!(
            states,
            [SlotState::Unconfirmed, SlotState::Active],
            "{sizes:?}"
        );
    }
}

#[test]
fn a_trial_ends_by_itself_by_rollback_or_by_confirmation() {
    let (mut device, first, second) = with_first();
    device.update(&second, false).expect("a good table");
    assert_eq!(device.slots().trial_ms, u32::from(TRIAL_S) * 1_000);
    device.wait(u64::from(TRIAL_S) * 1_000 - 1);
    assert!(device.runs(&second));
    device.wait(1);
    assert!(device.runs(&first), "the time is over");
    device.update(&second, false).expect("it is there already");
    roll_back(&mut device).expect("on trial");
    assert!(device.runs(&first));
    device.update(&second, true).expect("it is there already");
    device.wait(u64::from(TRIAL_S) * 10_000);
    assert!(device.runs(&second), "confirmed");
}

#[test]
fn rolling_back_goes_to_the_other_table_and_counts_after_a_restart() {
    let (mut device, first, second) = with_first();
    assert_eq!(roll_back(&mut device), Err(Refusal::NoOther));
    device.update(&second, true).expect("a good table");
    roll_back(&mut device).expect("there is another");
    assert!(device.runs(&first));
    let mut device = device.restarted();
    assert!(device.runs(&first));
    roll_back(&mut device).expect("there is another");
    assert!(device.runs(&second), "and forth");
}

#[test]
fn nobody_goes_back_to_a_table_that_was_never_confirmed() {
    let (mut device, first, second) = with_first();
    device.update(&second, false).expect("a good table");
    roll_back(&mut device).expect("on trial");
    assert_eq!(roll_back(&mut device), Err(Refusal::NoOther));
    let mut device = device.restarted();
    assert_eq!(roll_back(&mut device), Err(Refusal::NoOther));
    assert!(device.runs(&first));
}

#[test]
fn a_transfer_that_has_begun_leaves_nothing_to_go_back_to() {
    let mut device = Device::new(SLOT, 1);
    device.update(&table(3), true).expect("a good table");
    device.update(&table(4), true).expect("a good table");
    let third = table(5);
    device.carry_out(&third, &Step::Begin).expect("room");
    device.carry_out(&third, &Step::Write(0)).expect("room");
    assert_eq!(roll_back(&mut device), Err(Refusal::NoOther));
    assert!(device.runs(&table(4)));
}

#[test]
fn requests_that_come_twice_do_no_more_than_once() {
    let (mut device, first, second) = with_first();
    let steps = device.plan(&second, true);
    for step in steps {
        device.carry_out(&second, &step).expect("good");
        let before = device.flash().contents().to_vec();
        let again = device.carry_out(&second, &step);
        again.unwrap_or_else(|refusal| panic!("{step:?} again: {refusal}"));
        assert_eq!(device.flash().contents(), before, "{step:?} again");
    }
    assert!(device.runs(&second));
    let id = device.updater.table().expect("in use").id;
    let back = Request::Rollback {
        table: id,
        right: &[],
    };
    assert!(matches!(device.ask(back), Response::InUse(_)));
    assert!(device.runs(&first));
    let again = device.ask(back);
    assert!(
        matches!(again, Response::Refused(Refusal::NotInUse { .. })),
        "{again:?}"
    );
    assert!(device.runs(&first), "not back again");
}

#[test]
fn chunks_may_come_in_any_order() {
    let file = table(6);
    let mut device = Device::new(SLOT, 1);
    let mut steps = device.plan(&file, false);
    let last = steps.len() - 1;
    let mut random = fastrand::Rng::with_seed(1);
    random.shuffle(&mut steps[1..last]);
    // And some of them again, at any later time.
    for _ in 0..last {
        let (from, to) = (random.usize(1..last), random.usize(1..last));
        let step = steps[from];
        if to > from {
            steps.insert(to, step);
        }
    }
    for step in steps {
        device.carry_out(&file, &step).expect("good");
    }
    assert!(device.runs(&file));
}

#[test]
fn what_is_no_chunk_of_the_file_is_refused_and_changes_nothing() {
    let file = table(6);
    let transfer = digest(&file).transfer();
    let mut device = Device::new(SLOT, 1);
    let write = |offset, bytes| Request::Write {
        transfer,
        offset,
        bytes,
    };
    let chunk = usize::from(device.updater.map().chunk());
    let none = Response::Refused(Refusal::NoTransfer);
    assert_eq!(device.ask(write(0, &file[..chunk])), none);
    device.carry_out(&file, &Step::Begin).expect("room");
    let before = device.flash().contents().to_vec();
    let end = (file.len() / chunk * chunk) as u32;
    for (offset, bytes) in [
        (1, &file[1..=chunk]),
        (0, &file[..chunk - 1]),
        (0, &file[..=chunk]),
        (0, &[]),
        (end, &file[..chunk]),
        (end + chunk as u32, &file[..1]),
        (u32::MAX, &file[..1]),
        (u32::MAX / chunk as u32 * chunk as u32, &file[..chunk]),
    ] {
        let answer = device.ask(write(offset, bytes));
        assert_eq!(answer, Response::Refused(Refusal::Chunk), "at {offset}");
    }
    assert_eq!(device.flash().contents(), before);
}

#[test]
fn a_file_that_has_not_come_whole_or_is_too_long_is_refused() {
    let file = table(6);
    let mut device = Device::new(SLOT, 1);
    let long = Request::Begin {
        length: device.updater.map().slot_bytes() + 1,
        digest: digest(&file),
        right: &[],
    };
    let limit = device.updater.map().slot_bytes();
    assert_eq!(
        device.ask(long),
        Response::Refused(Refusal::TooLong { limit })
    );
    let mut steps = device.plan(&file, false);
    steps.remove(2);
    let failed = steps
        .iter()
        .find_map(|step| device.carry_out(&file, step).err());
    assert_eq!(failed, Some(Refusal::Incomplete));
    assert_eq!(device.updater.in_use(), None);
}

#[test]
fn a_table_on_trial_keeps_others_out() {
    let mut device = Device::new(SLOT, 1);
    device.update(&table(3), true).expect("a good table");
    device.update(&table(4), false).expect("a good table");
    assert_eq!(device.update(&table(5), false), Err(Refusal::OnTrial));
    assert!(device.runs(&table(4)));
}

#[test]
fn an_older_table_is_refused_and_the_same_version_taken() {
    let mut device = strict();
    device.update(&signed(3, 5, 0), true).expect("good");
    let older = Rejected::Older {
        version: 4,
        floor: 5,
    };
    assert_eq!(
        device.update(&signed(4, 4, 0), true),
        Err(Refusal::Table(older))
    );
    assert!(device.runs(&signed(3, 5, 0)));
    device.update(&signed(4, 5, 0), true).expect("good");
}

#[test]
fn a_revoked_table_never_runs_again() {
    let (old, new) = (signed(3, 1, 0), signed(4, 2, 2));
    let mut device = strict();
    device.update(&old, true).expect("good");
    device.update(&new, false).expect("good");
    let mut kept = device.clone();
    roll_back(&mut kept).expect("only a confirmed table revokes others");
    assert!(kept.runs(&old));
    let confirm = Step::Confirm;
    device.carry_out(&new, &confirm).expect("on trial");
    let revoked = Rejected::Older {
        version: 1,
        floor: 2,
    };
    assert_eq!(roll_back(&mut device), Err(Refusal::Table(revoked)));
    let mut device = device.restarted();
    assert!(device.runs(&new));
    assert_eq!(roll_back(&mut device), Err(Refusal::NoOther));
    // Not even where it is the only whole one.
    let slot = (SLOT * 256) as u32;
    let flash = device.updater.flash_mut();
    flash.rot(slot..slot + new.len() as u32, 1).expect("there");
    let device = device.restarted();
    assert_eq!(device.tables.selected, Err(PassThrough::BrokenTable));
}

#[test]
fn a_stranger_s_table_is_refused_at_the_start_as_well() {
    let mut device = strict();
    device.update(&signed(3, 1, 0), true).expect("good");
    let stranger = table(3);
    let flash = device.updater.flash_mut();
    // Past the device, through the debug port.
    flash.put(0, &vec![0xFF; SLOT * 256]).expect("there");
    flash.put(0, &stranger).expect("there");
    let device = device.restarted();
    assert_eq!(device.tables.selected, Err(PassThrough::BrokenTable));
}

#[test]
fn a_device_without_a_key_takes_every_whole_table() {
    let mut device = Device::new(SLOT, 1);
    device.update(&signed(3, 9, 9), true).expect("whole");
    device.update(&table(4), true).expect("whole");
    device.update(&signed(5, 1, 0), true).expect("whole");
    roll_back(&mut device).expect("a stranger revokes nothing");
}

#[test]
fn a_key_is_installed_once_and_the_other_slot_must_meet_it() {
    let mut device = Device::new(SLOT, 1);
    device.update(&table(3), true).expect("whole");
    device.update(&table(4), true).expect("whole");
    assert_eq!(device.ask(provision(&key(), NUMBER)), Response::Provisioned);
    assert_eq!(
        device.ask(provision(&key(), NUMBER)),
        Response::Provisioned,
        "the same again"
    );
    let other = signing_key(6);
    for refused in [provision(&other, NUMBER), provision(&key(), NUMBER + 1)] {
        let answer = device.ask(refused);
        assert_eq!(answer, Response::Refused(Refusal::HasKey));
    }
    assert!(device.runs(&table(4)), "until the next start");
    assert_eq!(roll_back(&mut device), Err(Refusal::NoOther));
    let mut device = device.restarted();
    assert_eq!(device.updater.in_use(), None);
    device.update(&signed(3, 1, 0), true).expect("good");
}

#[test]
fn a_key_that_rots_in_one_place_still_counts() {
    let mut device = strict();
    device.update(&signed(3, 1, 0), true).expect("good");
    // The identity's sector is the last of all.
    let start = ((2 * SLOT + 2) * 256) as u32;
    let flash = device.updater.flash_mut();
    flash.rot(start..start + 64, 3).expect("there");
    let mut device = device.restarted();
    let refused = device.update(&table(4), true);
    assert_eq!(refused, Err(Refusal::Table(Rejected::Unsigned)));
    assert!(device.runs(&signed(3, 1, 0)));
}

#[test]
fn a_shorter_table_does_not_take_the_seal_of_the_longer_one_before_it() {
    // The unsigned file is the signed one without its seal, which stays behind it.
    let (long, short) = (signed(3, 1, 0), table(3));
    let mut device = Device::new(SLOT, 1);
    device.update(&table(5), true).expect("whole");
    device.update(&long, false).expect("whole");
    roll_back(&mut device).expect("on trial");
    device.update(&short, true).expect("whole");
    assert_eq!(device.updater.table().expect("in use").version, 0);
    let mut device = device.restarted();
    assert!(device.runs(&short));
    assert_eq!(device.updater.table().expect("in use").version, 0);
    roll_back(&mut device).expect("there is another");
    assert!(device.runs(&table(5)));
}

#[test]
fn erases_are_counted_and_the_counts_outlive_a_restart() {
    let file = table(6);
    let sectors = file.len().div_ceil(256) as u32;
    let mut device = Device::new(SLOT, 1);
    device.update(&file, true).expect("good");
    let before = device.slots();
    assert_eq!(before.slots[0].erases, sectors);
    assert_eq!(before.slots[1].erases, 0);
    assert!(before.record_erases > 0);
    let mut device = device.restarted();
    let after = device.slots();
    assert_eq!(after.slots.map(|slot| slot.erases), [sectors, 0]);
    assert_eq!(after.record_erases, before.record_erases);
    let counted: u32 = (0..SLOT)
        .map(|sector| device.flash().erases(sector).expect("there"))
        .sum();
    assert_eq!(counted, sectors);
}

#[test]
fn a_flash_is_parted_only_as_it_can_be() {
    let flash = NorSimulator::<4, 256>::new(16, 1);
    let map = |slots: [std::ops::Range<u32>; 2], records, identity| {
        Map::new(&flash, slots, records, identity)
    };
    let good = [0..1_024, 1_024..2_048];
    let records = [2_048..2_304, 2_304..2_560];
    let identity = 2_560..2_816;
    assert!(map(good.clone(), records.clone(), identity.clone()).is_ok());
    assert_eq!(
        map([0..1_000, 1_024..2_048], records.clone(), identity.clone()),
        Err(MapError::Sectors { start: 0 })
    );
    assert_eq!(
        map([0..1_280, 1_024..2_304], records.clone(), identity.clone()),
        Err(MapError::Place { start: 1_024 })
    );
    assert_eq!(
        map([0..512, 1_024..2_048], records.clone(), identity),
        Err(MapError::Slots)
    );
    assert_eq!(
        map(good, records, 4_096..4_352),
        Err(MapError::Place { start: 4_096 })
    );
    let small = NorSimulator::<4, 32>::new(64, 1);
    let parts = Map::new(&small, [0..64, 64..128], [128..192, 192..256], 256..320);
    assert_eq!(parts, Err(MapError::Unit));
}

#[test]
fn a_device_that_crashes_again_and_again_uses_no_table_until_another_one_comes() {
    let [a, b, c] = [2, 3, 4].map(table);
    for before in [&[&a][..], &[&a, &b]] {
        let mut device = Device::new(SLOT, 1);
        for file in before {
            device.update(file, true).expect("a good device");
        }
        let in_use = device.updater.in_use();
        let mut device = device.restarted_after_crashes();
        let crash_loop = Err(PassThrough::CrashLoop);
        assert_eq!(device.tables.selected, crash_loop);
        assert_eq!(
            (device.updater.in_use(), device.updater.table()),
            (None, None)
        );
        // A trial that nobody confirms leads back to no table.
        device.carry_out(&c, &Step::Begin).expect("the line works");
        let steps = whole(&c, &device);
        for step in &steps {
            device.carry_out(&c, step).expect("the line works");
        }
        assert!(device.runs(&c));
        assert_eq!(
            device.updater.in_use(),
            in_use,
            "it took the suspect's place"
        );
        device.wait(u64::from(TRIAL_S) * 1_000);
        assert_eq!(device.tables.selected, crash_loop);
        for step in &steps {
            device.carry_out(&c, step).expect("the line works");
        }
        device
            .carry_out(&c, &Step::Confirm)
            .expect("the line works");
        assert!(device.restarted().runs(&c));
    }
}

/// A transfer of all chunks of a file, and its trial.
fn whole(file: &[u8], device: &Device) -> Vec<Step> {
    let chunk = usize::from(device.updater.map().chunk());
    let writes = (0..file.len()).step_by(chunk);
    let writes = writes.map(|offset| Step::Write(offset as u32));
    let begin = std::iter::once(Step::Begin);
    begin.chain(writes).chain([Step::Activate]).collect()
}

#[test]
fn a_table_that_rots_in_use_gives_way_to_the_one_before_or_to_none() {
    let [a, b] = [2, 3].map(table);
    let mut device = Device::new(SLOT, 1);
    device.update(&a, true).expect("a good device");
    let mut alone = device.clone();
    alone.abandon();
    assert_eq!(alone.tables.selected, Err(PassThrough::BrokenTable));
    device.update(&b, true).expect("a good device");
    device.abandon();
    assert!(device.runs(&a));
    assert!(matches!(
        device.updater.fault(),
        Some(Fault::Table { slot: 1, .. })
    ));
    let change = device.updater.take_change().map(|change| change.reason);
    assert_eq!(change, Some(TableReason::Damaged));
    // One that was on trial beside a confirmed one.
    let mut device = Device::new(SLOT, 1);
    device.update(&a, true).expect("a good device");
    device.update(&b, false).expect("a good device");
    device.abandon();
    assert!(device.runs(&a));
    device.wait(u64::from(TRIAL_S) * 1_000);
    assert!(device.runs(&a), "its trial is over");
    // Nobody ever confirmed the other one.
    let mut device = Device::new(SLOT, 1);
    device.update(&a, true).expect("a good device");
    device.update(&b, false).expect("a good device");
    device.wait(u64::from(TRIAL_S) * 1_000);
    device.abandon();
    assert_eq!(device.tables.selected, Err(PassThrough::BrokenTable));
}

/// Puts a file into a slot through the debug port while the device is off.
fn put(device: Device, slot: Slot, file: &[u8]) -> Device {
    let place = device.layout().slot(slot);
    let mut bytes = file.to_vec();
    bytes.resize(place.len(), 0xFF);
    let mut device = device;
    let flash = device.updater.flash_mut();
    flash.put(place.start as u32, &bytes).expect("it fits");
    device.restarted()
}

#[test]
fn a_later_table_that_revokes_nothing_leaves_older_ones_revoked() {
    let mut device = Device::new(SLOT, 1);
    device.ask(provision(&key(), NUMBER));
    device.update(&signed(2, 2, 2), true).expect("signed");
    device.update(&signed(3, 3, 0), true).expect("signed");
    let device = put(device, Slot::A, &signed(4, 1, 0));
    assert_eq!(
        device.updater.states(),
        [SlotState::Broken, SlotState::Active],
        "version 1 was revoked by the first"
    );
}

#[test]
fn a_table_that_was_put_in_the_place_of_the_confirmed_one_is_not_used() {
    let mut device = Device::new(SLOT, 1);
    let table = |seed| random_table(iltm_tests::grid(2, 3), 1, Effects::NONE, seed);
    let [confirmed, other] = [1, 2].map(table);
    assert_eq!(confirmed.len(), other.len(), "its length does not tell");
    device.update(&confirmed, true).expect("a good device");
    let device = put(device, Slot::A, &other);
    assert_eq!(device.updater.states()[0], SlotState::Broken);
    assert_eq!(device.updater.in_use(), None);
}
