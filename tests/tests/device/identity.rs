//! Device identity: its key and number, from a factory or a host, in a flash that is cut,
//! misread or rots: whoever was told that a device has a key need not fear that it takes
//! tables without.

use embedded_storage::nor_flash::NorFlash;
use iltm::picture::Response as Projector;
use iltm_runtime::link::{Fault, Refusal, Request, Response};
use iltm_runtime::store::{RECORD, identity_record};
use iltm_runtime::trust::{Rejected, Trust};
use iltm_tests::flash_simulator::{Misread, NorSimulator, Violations, Wear};
use iltm_tests::slots::{SimDevice, SlotLayout};
use iltm_tests::{signing_key, wedge_table_for};

type Device = SimDevice<4, 256>;

const NUMBER: u64 = 7;

fn public(seed: u8) -> [u8; 32] {
    signing_key(seed).verifying_key().to_bytes()
}

fn provision(seed: u8) -> Request<'static> {
    iltm_tests::slots::provision(&signing_key(seed), NUMBER)
}

fn trust() -> Trust {
    Trust {
        key: Some(public(5)),
        device: NUMBER,
    }
}

fn table(cols: u16) -> Vec<u8> {
    wedge_table_for(Projector::Linear, 1, cols, 1)
}

fn signed(cols: u16, version: u32) -> Vec<u8> {
    iltm_tests::signed(&table(cols), &signing_key(5), version, 0, NUMBER)
}

/// A device that has its key and runs a table that was signed with it.
fn device() -> Device {
    let mut device = Device::new(3, 1);
    assert_eq!(device.ask(provision(5)), Response::Provisioned);
    device.update(&signed(1, 1), true).expect("a good table");
    device
}

/// It takes nothing, says so, and goes on with its table.
fn takes_nothing(device: &mut Device, how: &str) {
    let lost = Response::Refused(Refusal::KeyLost);
    assert_eq!(device.updater.trust().key, None, "{how}");
    assert_eq!(device.updater.fault(), Some(Fault::KeyLost), "{how}");
    for file in [table(2), signed(2, 2)] {
        assert_eq!(device.update(&file, true), Err(Refusal::KeyLost), "{how}");
    }
    let used = device.updater.table().map_or(0, |table| table.id);
    assert_eq!(
        device.ask(Request::Rollback {
            table: used,
            right: &[]
        }),
        lost,
        "{how}"
    );
    assert_eq!(device.ask(provision(6)), lost, "{how}");
    assert_eq!(device.ask(provision(5)), lost, "{how}");
    let Response::Slots(slots) = device.ask(Request::Slots) else {
        panic!("slots");
    };
    assert_eq!((slots.key, slots.oldest), (None, u32::MAX), "{how}");
}

/// It takes what is signed with its key, and nothing else.
fn has_its_key(device: &mut Device, how: &str) {
    assert_eq!(*device.updater.trust(), trust(), "{how}");
    let unsigned = Err(Refusal::Table(Rejected::Unsigned));
    assert_eq!(device.update(&table(2), true), unsigned, "{how}");
    assert_eq!(device.update(&signed(2, 2), true), Ok(()), "{how}");
}

/// A device that finds this where its key belongs when it starts.
fn with_identity(record: &[u8]) -> Device {
    let new = Device::new(3, 1);
    let layout = new.layout();
    let mut flash = new.updater.into_flash();
    let place = layout.identity().start as u32;
    flash.write(place, record).expect("erased");
    Device::start(flash, layout)
}

#[test]
fn a_device_writes_the_record_that_a_factory_would() {
    let mut device = Device::new(3, 1);
    assert_eq!(device.ask(provision(5)), Response::Provisioned);
    let written = &device.flash().contents()[device.layout().identity()];
    assert_eq!(written[..RECORD], identity_record(public(5), NUMBER));
}

#[test]
fn a_device_with_the_record_of_a_factory_has_its_key_and_number_for_good() {
    let mut device = with_identity(&identity_record(public(5), NUMBER));
    assert_eq!(*device.updater.trust(), trust());
    let refused = Response::Refused(Refusal::HasKey);
    assert_eq!(device.ask(provision(1)), refused);
}

#[test]
fn a_start_without_a_key_wears_nothing() {
    let mut device = Device::new(3, 1);
    device.update(&table(2), true).expect("a good table");
    let erased = |device: &Device| {
        let sectors = 0..device.layout().sectors();
        sectors
            .map(|at| device.flash().erases(at))
            .collect::<Vec<_>>()
    };
    let before = erased(&device);
    for _ in 0..3 {
        device = device.restarted();
    }
    assert_eq!(erased(&device), before);
}

#[test]
fn a_record_with_any_bit_changed_is_no_identity() {
    for bit in 0..8 * RECORD {
        let mut record = identity_record(public(5), NUMBER);
        record[bit / 8] ^= 1 << (bit % 8);
        let device = with_identity(&record);
        assert_eq!(device.updater.trust().key, None, "bit {bit}");
    }
}

#[test]
fn a_key_that_is_misread_at_one_start_is_there_at_the_next() {
    for misread in [
        Misread::Error,
        Misread::Zeros,
        Misread::Ones,
        Misread::OneBit,
    ] {
        for reads in [1, 2, 3, 64] {
            let how = format!("{misread:?}, {reads} reads");
            let mut device = device();
            let part = device.layout().identity();
            device.updater.flash_mut().misread(part, reads, misread);
            let mut device = device.restarted();
            assert!(device.runs(&signed(1, 1)), "{how}");
            if reads < 2 {
                assert_eq!(*device.updater.trust(), trust(), "{how}");
            } else {
                takes_nothing(&mut device, &how);
            }
            device.updater.flash_mut().misread(0..0, 0, misread);
            has_its_key(&mut device.restarted(), &how);
        }
    }
}

#[test]
fn a_start_at_which_nothing_can_be_read_opens_nothing_and_changes_nothing() {
    for misread in [Misread::Error, Misread::Zeros] {
        let mut device = device();
        let all = 0..device.flash().contents().len();
        let before = device.flash().contents().to_vec();
        device.updater.flash_mut().misread(all, u32::MAX, misread);
        let mut device = device.restarted();
        takes_nothing(&mut device, &format!("{misread:?}"));
        assert!(device.flash().contents() == before, "{misread:?}");
        device.updater.flash_mut().misread(0..0, 0, misread);
        has_its_key(&mut device.restarted(), &format!("{misread:?}"));
    }
}

#[test]
fn a_key_that_has_rotted_in_both_places_opens_nothing_until_it_is_written_anew() {
    for bit in 0..64 * 8 {
        let mut device = device();
        let part = device.layout().identity();
        let mut bytes = device.flash().contents()[part.clone()].to_vec();
        bytes[bit / 8] ^= 1 << (bit % 8);
        bytes[64 + (bit * 7 % 64)] ^= 0x10;
        let flash = device.updater.flash_mut();
        flash.put(part.start as u32, &bytes).expect("it fits");
        for start in 0..3 {
            device = device.restarted();
            takes_nothing(&mut device, &format!("bit {bit}, start {start}"));
            assert!(device.runs(&signed(1, 1)), "bit {bit}");
        }
        let record = identity_record(public(5), NUMBER);
        let flash = device.updater.flash_mut();
        flash.put(part.start as u32, &record).expect("it fits");
        has_its_key(&mut device.restarted(), &format!("bit {bit}"));
    }
}

#[test]
fn a_key_that_was_erased_opens_nothing() {
    let mut device = device();
    let part = device.layout().identity();
    let flash = device.updater.flash_mut();
    let blank = vec![0xFF; part.len()];
    flash.put(part.start as u32, &blank).expect("it fits");
    takes_nothing(&mut device.restarted(), "erased");
}

#[test]
fn the_key_of_older_firmware_is_guarded_from_its_first_start_on() {
    // Of a time at which records did not say whether there is a key.
    let mut device = Device::new(3, 1);
    device.update(&signed(1, 1), true).expect("a good table");
    let part = device.layout().identity();
    let record = identity_record(public(5), NUMBER);
    let flash = device.updater.flash_mut();
    for copy in [0, 64] {
        flash.put(part.start as u32 + copy, &record).expect("fits");
    }
    let mut device = device.restarted();
    assert_eq!(*device.updater.trust(), trust());
    let flash = device.updater.flash_mut();
    flash.put(part.start as u32, &[0; 128]).expect("it fits");
    takes_nothing(&mut device.restarted(), "rotted");
}

#[test]
fn a_key_that_cannot_be_stored_is_refused_and_does_not_count() {
    // The key's own sector, or those of the records.
    for worn in [&[2][..], &[0, 1]] {
        for confirmed in [false, true] {
            let mut device = SimDevice::<4, 256>::new(3, 1);
            if confirmed {
                device.update(&signed(1, 1), true).expect("a good table");
            }
            for sector in worn {
                let flash = device.updater.flash_mut();
                flash
                    .wear_out(6 + sector, 0, Wear::LostBits)
                    .expect("there");
            }
            let answer = device.ask(provision(5));
            assert!(matches!(answer, Response::Refused(_)), "{answer:?}");
            assert_eq!(device.updater.trust().key, None);
            let device = device.restarted();
            assert_eq!(device.updater.trust().key, None, "{worn:?}, {confirmed}");
            assert_eq!(device.updater.fault(), None, "{worn:?}, {confirmed}");
        }
    }
}

/// Cuts the power at every step of the way of a key into a device.
fn cut_everywhere<const W: usize, const E: usize>(
    slot: usize,
    how: &str,
    flash: &NorSimulator<W, E>,
) {
    let (first_table, unsigned) = (signed(1, 1), table(2));
    for confirmed in [false, true] {
        let layout = SlotLayout { slot, sector: E };
        let mut new = SimDevice::start(flash.clone(), layout);
        if confirmed {
            new.update(&first_table, true).expect("a good table");
        }
        let mut whole = new.clone();
        assert_eq!(whole.ask(provision(5)), Response::Provisioned);
        let steps = whole.flash().steps() - new.flash().steps();
        for cut in 0..steps {
            let what = format!("W {W}, E {E}, {how}, table {confirmed}, cut {cut} of {steps}");
            let mut device = new.clone();
            let flash = device.updater.flash_mut();
            flash.reseed(cut);
            flash.cut_after(cut);
            let _ = device.ask(provision(5));
            let place = device.layout().identity();
            let first_place = &device.flash().contents()[place][..RECORD];
            let is_begun = first_place.iter().any(|byte| *byte != 0xFF);
            let mut device = device.restarted();
            let first = *device.updater.trust();
            if confirmed && how == "plain" && E > 64 {
                // The first place is written last: the other one is whole by then.
                assert_eq!(first.key.is_some(), is_begun, "{what}");
            }
            if confirmed && first.key.is_none() {
                // What is left of a key that was cut is gone before it can be misread.
                let place = device.layout().identity();
                let left = &device.flash().contents()[place];
                assert!(left.iter().all(|byte| *byte == 0xFF), "{what}");
            }
            for start in 0..3 {
                assert_eq!(device.updater.fault(), None, "{what}, start {start}");
                assert_eq!(*device.updater.trust(), first, "{what}, start {start}");
                assert_eq!(device.runs(&first_table), confirmed, "{what}");
                device = device.restarted();
            }
            assert_eq!(device.ask(provision(5)), Response::Provisioned, "{what}");
            let mut device = device.restarted();
            assert_eq!(*device.updater.trust(), trust(), "{what}");
            let refusal = device.update(&unsigned, true);
            assert_eq!(refusal, Err(Refusal::Table(Rejected::Unsigned)), "{what}");
            assert_eq!(device.flash().violations(), Violations::default(), "{what}");
        }
    }
}

fn kinds_of_flash<const W: usize, const E: usize>(slot: usize) {
    let new = || NorSimulator::<W, E>::new(SlotLayout { slot, sector: E }.sectors(), 1);
    cut_everywhere(slot, "plain", &new());
    cut_everywhere(slot, "weak", &new().with_weak_bits());
    cut_everywhere(slot, "preprogrammed", &new().with_preprogramming());
    let both = new().with_preprogramming().with_weak_bits();
    cut_everywhere(slot, "preprogrammed, weak", &both);
}

#[test]
fn a_device_whose_power_fails_while_it_gets_its_key_has_it_or_can_get_it() {
    // The first has room for one copy of the key only.
    kinds_of_flash::<1, 64>(12);
    kinds_of_flash::<1, 128>(6);
    kinds_of_flash::<8, 256>(3);
    kinds_of_flash::<16, 192>(4);
    kinds_of_flash::<32, 256>(3);
    kinds_of_flash::<4, 4_096>(1);
}
