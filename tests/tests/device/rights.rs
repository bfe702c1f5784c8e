//! Rights: what a device with a key does for nobody but its owner and those whom he has
//! certified, and how long its flash bears whoever asks.

use ed25519_dalek::{Signer, SigningKey};
use iltm_runtime::link::{Digest, Refusal, Request, Response, SlotState, TableReason};
use iltm_runtime::trust::{Certificate, Deed, NoRight};
use iltm_tests::slots::{SimDevice, Step, TRIAL_S, digest, provision};
use iltm_tests::{signed, signing_key, wedge_table};

type Device = SimDevice<4, 512>;

/// Sectors of a slot.
const SLOT: usize = 64;

const NUMBER: u64 = 42;

fn site() -> SigningKey {
    signing_key(7)
}

fn table(cols: u16, version: u32, oldest: u32) -> Vec<u8> {
    signed(&wedge_table(3, cols, 1), &site(), version, oldest, 0)
}

/// A device with a key that runs version 2 and has version 1 in its other slot.
fn keyed() -> (Device, [Vec<u8>; 2]) {
    let files = [table(4, 1, 0), table(5, 2, 0)];
    let mut device = Device::new(SLOT, 1);
    assert_eq!(
        device.ask(provision(&site(), NUMBER)),
        Response::Provisioned
    );
    for file in &files {
        device.update(file, true).expect("a good file");
    }
    (device, files)
}

fn refused(response: Response) -> NoRight {
    match response {
        Response::Refused(Refusal::NoRight(cause)) => cause,
        other => panic!("{other:?}"),
    }
}

fn begin<'a>(file: &[u8], right: &'a [u8]) -> Request<'a> {
    Request::Begin {
        length: file.len() as u32,
        digest: digest(file),
        right,
    }
}

fn begin_deed(file: &[u8]) -> Deed {
    Deed::Begin {
        length: file.len() as u32,
        digest: digest(file),
    }
}

#[test]
fn without_a_right_nobody_begins_confirms_or_rolls_back_and_nothing_changes() {
    let (mut device, [old, new]) = keyed();
    let third = table(6, 3, 0);
    let right: &[u8] = &[];
    let used = device.updater.table().expect("in use").id;
    let before = device.flash().contents().to_vec();
    let rollback = Request::Rollback { table: used, right };
    assert_eq!(refused(device.ask(begin(&third, right))), NoRight::Missing);
    assert_eq!(refused(device.ask(rollback)), NoRight::Missing);
    assert_eq!(device.flash().contents(), before);
    device.update(&third, false).expect("with the right");
    let table = device.updater.table().expect("in use").id;
    let confirm = Request::Confirm { table, right };
    assert_eq!(refused(device.ask(confirm)), NoRight::Missing);
    let rollback = Request::Rollback { table, right };
    assert_eq!(refused(device.ask(rollback)), NoRight::Missing);
    assert!(device.runs(&third), "still on trial");
    let device = device.restarted();
    assert!(device.runs(&new) && !device.runs(&old), "not confirmed");
}

#[test]
fn a_right_is_for_one_deed_on_one_device_and_good_once() {
    let (mut device, [old, new]) = keyed();
    let used = device.updater.table().expect("in use").id;
    let back = Deed::Rollback { table: used };
    let slots = device.slots();
    let sign = |deed: &Deed, key: &SigningKey, device, sequence| {
        let message = deed.message(device, sequence);
        key.sign(&message).to_bytes().to_vec()
    };
    for (what, wrong) in [
        ("another device", sign(&back, &site(), 43, slots.sequence)),
        (
            "another time",
            sign(&back, &site(), NUMBER, slots.sequence + 1),
        ),
        (
            "another key",
            sign(&back, &signing_key(8), NUMBER, slots.sequence),
        ),
        (
            "another deed",
            sign(
                &Deed::Confirm { table: used },
                &site(),
                NUMBER,
                slots.sequence,
            ),
        ),
    ] {
        let right = &wrong[..];
        let answer = device.ask(Request::Rollback { table: used, right });
        assert_eq!(refused(answer), NoRight::Signature, "{what}");
    }
    let overheard = sign(&back, &site(), NUMBER, slots.sequence);
    let again = Request::Rollback {
        table: used,
        right: &overheard,
    };
    assert!(matches!(device.ask(again), Response::InUse(_)));
    assert!(device.runs(&old));
    // Its owner puts the newer one back; what was overheard does not undo that, not even
    // after a restart.
    device.update(&new, true).expect("a good file");
    assert_eq!(refused(device.ask(again)), NoRight::Signature);
    let mut device = device.restarted();
    assert_eq!(refused(device.ask(again)), NoRight::Signature);
    assert!(device.runs(&new));
}

#[test]
fn an_overheard_begin_erases_nothing_a_second_time() {
    let (mut device, _) = keyed();
    let [one, other] = [table(6, 3, 0), table(7, 4, 0)];
    let overheard = device.right(&begin_deed(&one));
    assert!(matches!(
        device.ask(begin(&one, &overheard)),
        Response::Receiving(_)
    ));
    // The same file once more is the same transfer, and changes nothing.
    assert!(matches!(
        device.ask(begin(&one, &[])),
        Response::Receiving(_)
    ));
    let next = device.right(&begin_deed(&other));
    assert!(matches!(
        device.ask(begin(&other, &next)),
        Response::Receiving(_)
    ));
    for right in [&overheard, &next] {
        assert_eq!(refused(device.ask(begin(&one, right))), NoRight::Signature);
    }
}

#[test]
fn a_technician_does_what_the_site_certified_until_the_site_revokes_it() {
    let (mut device, _) = keyed();
    let anna = signing_key(9);
    let certificate = |by: &SigningKey, device, version| {
        let mut certificate = Certificate {
            key: anna.verifying_key().to_bytes(),
            device,
            version,
            signature: [0; 64],
        };
        certificate.signature = by.sign(&certificate.message()).to_bytes();
        certificate.emit()
    };
    let right = |device: &mut Device, deed: &Deed, certificate: [u8; Certificate::SIZE]| {
        let slots = device.slots();
        let signature = anna.sign(&deed.message(slots.device, slots.sequence));
        [&signature.to_bytes()[..], &certificate].concat()
    };
    let third = table(6, 3, 3);
    let deed = begin_deed(&third);
    for (certificate, cause) in [
        (certificate(&anna, 0, 2), NoRight::Certificate),
        (
            certificate(&site(), 43, 2),
            NoRight::OtherDevice { device: 43 },
        ),
    ] {
        let right = right(&mut device, &deed, certificate);
        assert_eq!(refused(device.ask(begin(&third, &right))), cause);
    }
    let good = certificate(&site(), NUMBER, 2);
    let shown = right(&mut device, &deed, good);
    assert!(matches!(
        device.ask(begin(&third, &shown)),
        Response::Receiving(_)
    ));
    for step in device.plan(&third, false) {
        if !matches!(step, Step::Begin) {
            device.carry_out(&third, &step).expect("it has begun");
        }
    }
    let table = device.updater.table().expect("in use").id;
    let shown = right(&mut device, &Deed::Confirm { table }, good);
    let confirm = Request::Confirm {
        table,
        right: &shown,
    };
    assert!(matches!(device.ask(confirm), Response::InUse(_)));
    // That table revokes what is below version 3, and the technician's key with it.
    let shown = right(&mut device, &Deed::Rollback { table }, good);
    let fourth = wedge_table(3, 7, 1);
    let answer = device.ask(begin(&fourth, &shown));
    let (version, floor) = (2, 3);
    assert_eq!(refused(answer), NoRight::Revoked { version, floor });
}

#[test]
fn a_rollback_does_not_lower_what_is_taken_from_the_line() {
    let (mut device, [old, new]) = keyed();
    assert_eq!(device.slots().oldest, 2);
    device.carry_out(&new, &Step::Rollback).expect("its owner");
    assert!(device.runs(&old));
    for mut device in [device.clone(), device.restarted()] {
        assert_eq!(device.slots().oldest, 2, "version 1 is in use");
        assert!(device.update(&table(6, 1, 0), true).is_err());
        device.update(&table(6, 2, 0), true).expect("as new");
    }
}

#[test]
fn a_trial_that_ended_is_remembered_until_the_next_and_its_table_is_never_confirmed() {
    let (mut device, _) = keyed();
    let third = table(6, 3, 0);
    device.update(&third, false).expect("a good file");
    let on_trial = device.updater.table().expect("in use").id;
    assert_eq!(device.slots().ended, None);
    device.wait(u64::from(TRIAL_S) * 1_000);
    device.wait(2_000);
    let slots = device.slots();
    let ended = slots.ended.expect("just now");
    assert_eq!((ended.table, ended.ago_ms), (on_trial, 2_000));
    assert_eq!(ended.reason, TableReason::TrialOver);
    let states = |device: &Device| {
        let mut states = device.updater.states();
        states.sort_by_key(|state| *state as u8);
        states
    };
    assert_eq!(states(&device), [SlotState::Active, SlotState::Unconfirmed]);
    // It is known in RAM only.
    assert_eq!(device.clone().restarted().slots().ended, None);
    device.update(&third, true).expect("a good file");
    assert_eq!(device.slots().ended, None);
    assert_eq!(states(&device), [SlotState::Valid, SlotState::Active]);
}

/// Begins a transfer and writes its first chunk, as somebody does who wants to wear a
/// sector out.
fn hammer(device: &mut Device, number: u32) -> Response {
    let mut digest = [0; 16];
    digest[..4].copy_from_slice(&number.to_le_bytes());
    let digest = Digest(digest);
    let chunk = usize::from(device.updater.map().chunk());
    let begun = device.ask(Request::Begin {
        length: chunk as u32,
        digest,
        right: &[],
    });
    match begun {
        Response::Receiving(_) => device.ask(Request::Write {
            transfer: digest.transfer(),
            offset: 0,
            bytes: &vec![number as u8; chunk],
        }),
        other => other,
    }
}

#[test]
fn a_device_without_a_key_erases_for_anybody_but_not_as_often_as_he_likes() {
    let mut device = Device::new(SLOT, 1);
    let mut number = 0;
    while hammer(&mut device, number) == Response::Written {
        number += 1;
    }
    assert_eq!(number as usize, 16 * SLOT);
    let wait_s = match hammer(&mut device, number) {
        Response::Refused(Refusal::Wear { wait_s }) => wait_s,
        other => panic!("{other:?}"),
    };
    device.wait(u64::from(wait_s) * 1_000);
    assert_eq!(hammer(&mut device, number + 1), Response::Written);
    let again = hammer(&mut device, number + 2);
    assert!(matches!(again, Response::Refused(Refusal::Wear { .. })));
    // Whoever can switch it off and on may go on.
    let mut device = device.restarted();
    assert_eq!(hammer(&mut device, number), Response::Written);
}

#[test]
fn a_key_is_not_installed_over_a_table_that_it_would_lose() {
    let mut device = Device::new(SLOT, 1);
    let unsigned = wedge_table(3, 4, 1);
    device.update(&unsigned, true).expect("a good file");
    let key = site().verifying_key().to_bytes();
    let install = |even_so| Request::Provision {
        key,
        device: NUMBER,
        even_so,
    };
    let before = device.flash().contents().to_vec();
    let answer = device.ask(install(false));
    assert!(
        matches!(answer, Response::Refused(Refusal::Table(_))),
        "{answer:?}"
    );
    assert_eq!(device.flash().contents(), before);
    assert!(device.runs(&unsigned) && device.updater.trust().key.is_none());
    let mut other = device.clone();
    device.update(&table(4, 1, 0), true).expect("a good file");
    assert_eq!(device.ask(install(false)), Response::Provisioned);
    assert!(device.restarted().updater.table().is_some());
    // Whoever says that he means it loses the table.
    assert_eq!(other.ask(install(true)), Response::Provisioned);
    assert!(other.restarted().updater.table().is_none());
}
