//! Regressions: what the session fuzzer found (`docs/fuzzing.md`), each as it happens to a
//! device.

use ed25519_dalek::SigningKey;
use iltm::picture::Response as Projector;
use iltm_runtime::link::{Refusal, Request, Response, SlotState};
use iltm_runtime::trust::{Deed, Rejected};
use iltm_tests::flash_simulator::{ERASE_STAGES, NorSimulator, Violations};
use iltm_tests::slots::{self, SimDevice, SlotLayout, Step, digest};
use iltm_tests::{signing_key, wedge_table_for};

type Device = SimDevice<8, 256>;

fn key() -> SigningKey {
    signing_key(42)
}

fn image(cols: u16) -> Vec<u8> {
    wedge_table_for(Projector::Linear, 1, cols, 1)
}

fn signed(cols: u16, version: u32, oldest: u32) -> Vec<u8> {
    iltm_tests::signed(&image(cols), &key(), version, oldest, 0)
}

fn provision() -> Request<'static> {
    slots::provision(&key(), 7)
}

/// A device with a key that runs the last of these files, with the one before it in
/// the other slot.
fn with_key(files: &[&[u8]]) -> Device {
    let mut device = Device::new(3, 1);
    assert_eq!(device.ask(provision()), Response::Provisioned);
    for file in files {
        device.update(file, true).expect("a good file");
    }
    device
}

fn refused(response: Response) -> Refusal {
    match response {
        Response::Refused(refusal) => refusal,
        other => panic!("not refused: {other:?}"),
    }
}

#[test]
fn a_table_that_revokes_its_own_version_still_runs_after_a_restart() {
    let file = signed(1, 4, 6);
    let device = with_key(&[&file]);
    assert!(device.restarted().runs(&file));
}

#[test]
fn a_device_without_a_key_names_no_oldest_version_as_it_takes_any() {
    let mut device = Device::new(3, 1);
    device.update(&signed(1, 9, 0), true).expect("a good file");
    let Response::Slots(slots) = device.ask(Request::Slots) else {
        panic!("slots");
    };
    assert_eq!(slots.oldest, 0);
    device.update(&signed(2, 3, 0), true).expect("an older one");
}

#[test]
fn other_bytes_for_a_place_that_was_written_are_refused_and_not_programmed() {
    let file = image(1);
    let mut device = Device::new(3, 1);
    device
        .carry_out(&file, &Step::Begin)
        .expect("there is room");
    let transfer = digest(&file).transfer();
    let mut wrong = file.clone();
    wrong[9] ^= 0x40;
    let write = |bytes| Request::Write {
        transfer,
        offset: 0,
        bytes,
    };
    assert_eq!(device.ask(write(&wrong)), Response::Written);
    let refusal = refused(device.ask(write(&file)));
    assert_eq!(refusal, Refusal::Flash { offset: 0 });
    assert_eq!(device.flash().violations(), Violations::default());
    // The sector is erased and written anew then.
    assert_eq!(device.ask(write(&file)), Response::Written);
    device.update(&file, true).expect("it is whole");
}

#[test]
fn a_chunk_that_is_refused_leaves_the_other_table_there_to_go_back_to() {
    let mut device = with_key(&[&signed(1, 1, 0), &signed(2, 2, 0)]);
    let new = signed(3, 3, 0);
    device.carry_out(&new, &Step::Begin).expect("there is room");
    let chunk = Request::Write {
        transfer: digest(&new).transfer(),
        offset: 1,
        bytes: &new[..256],
    };
    assert_eq!(refused(device.ask(chunk)), Refusal::Chunk);
    assert_eq!(device.updater.states()[0], SlotState::Valid);
    device
        .carry_out(&new, &Step::Rollback)
        .expect("nothing was written");
}

#[test]
fn an_older_table_that_is_refused_stays_there_to_go_back_to() {
    let (old, new) = (signed(1, 1, 0), signed(2, 2, 0));
    let mut device = with_key(&[&old, &new]);
    // All of it is in its slot already, so that no chunk is sent.
    let refusal = device.update(&old, true).expect_err("it is older");
    let (version, floor) = (1, 2);
    assert_eq!(refusal, Refusal::Table(Rejected::Older { version, floor }));
    device
        .carry_out(&old, &Step::Rollback)
        .expect("the way back");
    assert!(device.runs(&old));
}

#[test]
fn an_unsigned_table_in_use_when_the_key_comes_is_none_to_go_back_to() {
    let good = signed(2, 2, 0);
    let mut device = Device::new(3, 1);
    device.update(&good, true).expect("a good file");
    device.update(&image(1), true).expect("a good file");
    assert_eq!(device.ask(provision()), Response::Provisioned);
    device
        .carry_out(&[], &Step::Rollback)
        .expect("it is signed");
    let refusal = device.carry_out(&[], &Step::Rollback);
    assert_eq!(refusal, Err(Refusal::Table(Rejected::Unsigned)));
    assert!(device.runs(&good));
}

#[test]
fn a_device_gets_no_key_while_a_table_is_on_trial_that_nobody_asked_who_signed() {
    let mut device = Device::new(3, 1);
    device.update(&image(1), false).expect("a good file");
    assert_eq!(refused(device.ask(provision())), Refusal::OnTrial);
    device
        .carry_out(&[], &Step::Rollback)
        .expect("it is on trial");
    assert_eq!(device.ask(provision()), Response::Provisioned);
}

#[test]
fn a_rollback_that_is_repeated_confirms_nothing() {
    // The same image twice: what a rollback names does not tell them apart.
    let (old, new) = (signed(1, 1, 0), signed(1, 2, 2));
    let mut device = with_key(&[&old]);
    device.update(&new, false).expect("a good file");
    let table = device.updater.table().expect("it is on trial").id;
    let right = device.right(&Deed::Rollback { table });
    let right = &right;
    device.ask(Request::Rollback { table, right });
    assert!(device.runs(&old));
    let again = refused(device.ask(Request::Rollback { table, right }));
    assert_eq!(again, Refusal::NoOther);
    assert!(device.runs(&old) && device.restarted().runs(&old));
}

/// A device whose records read differently from one time to the next where a cut caught
/// a bit in motion; it runs the second of these files, the first is in the other slot.
fn weak(files: [&[u8]; 2], seed: u64) -> Device {
    let layout = SlotLayout {
        slot: 3,
        sector: 256,
    };
    let flash = NorSimulator::new(layout.sectors(), seed).with_weak_bits();
    let mut device = Device::start(flash, layout);
    for file in files {
        device.update(file, true).expect("a good file");
    }
    device
}

fn reads_the_same_at_every_start<const W: usize, const E: usize>(
    mut device: SimDevice<W, E>,
    seed: u64,
) {
    let first = device.updater.in_use();
    for start in 0..20 {
        device = device.restarted();
        assert_eq!(device.updater.in_use(), first, "seed {seed}, start {start}");
    }
}

#[test]
fn a_record_cut_in_its_last_byte_reads_the_same_at_every_start() {
    let (old, new) = (image(1), image(2));
    let mut kept = [0, 0];
    for seed in 0..400 {
        let mut device = weak([&new, &old], seed);
        device.update(&new, false).expect("a good file");
        let flash = device.updater.flash_mut();
        flash.reseed(seed);
        // The last byte of the record, in which its checksum ends.
        flash.cut_after(63);
        let confirmed = device.carry_out(&new, &Step::Confirm);
        assert!(confirmed.is_err() || !device.flash().is_on());
        let device = device.restarted();
        kept[usize::from(device.runs(&new))] += 1;
        reads_the_same_at_every_start(device, seed);
    }
    assert!(kept.iter().all(|count| *count > 0), "both happen: {kept:?}");
}

#[test]
fn the_first_record_of_a_part_cut_in_its_last_byte_reads_the_same_at_every_start() {
    let file = image(1);
    // A part has room for one record and its twin only: each record goes to the other.
    let layout = SlotLayout {
        slot: 4,
        sector: 128,
    };
    for seed in 0..400 {
        let flash = NorSimulator::<16, 128>::new(layout.sectors(), seed).with_weak_bits();
        let mut device = SimDevice::start(flash, layout);
        device.update(&file, false).expect("a good file");
        let flash = device.updater.flash_mut();
        flash.reseed(seed);
        flash.cut_after(ERASE_STAGES + 63);
        let _ = device.carry_out(&file, &Step::Confirm);
        assert!(!device.flash().is_on());
        reads_the_same_at_every_start(device.restarted(), seed);
    }
}

/// The power fails in the last bytes of the device's key: at the first start the record
/// reads as none, and a later start must not find a key after all.
#[test]
fn a_key_that_was_cut_does_not_appear_at_a_later_start() {
    iltm_tests::fuzz::session(&[198, 0, 0, 0, 0, 235, 36, 177, 163, 26, 0, 0, 0]);
}
