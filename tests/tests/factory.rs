//! A device that got its key in the factory, and one that was asked to take it.

use embedded_storage::nor_flash::NorFlash;
use iltm_runtime::link::{Refusal, Request, Response};
use iltm_runtime::store::{RECORD, identity_record};
use iltm_runtime::trust::Trust;
use iltm_tests::fake_tables::{FakeTables, SECTOR, slot};

const KEY: [u8; 32] = [0x5A; 32];

const DEVICE: u64 = 0x0102_0304_0506_0708;

/// Behind both slots and both sectors of records.
const IDENTITY: usize = slot(1).end + 2 * SECTOR;

#[test]
fn a_device_writes_the_record_that_a_factory_would() {
    let contents = FakeTables::provisioned(KEY, DEVICE).contents();
    let written = &contents[IDENTITY..IDENTITY + RECORD];
    assert_eq!(written, identity_record(KEY, DEVICE));
}

#[test]
fn a_device_with_the_record_of_a_factory_has_its_key_and_number_for_good() {
    let mut flash = FakeTables::default().updater().flash().clone();
    let record = identity_record(KEY, DEVICE);
    flash.write(IDENTITY as u32, &record).expect("erased");
    let mut tables = FakeTables::new(flash);
    let trust = Trust {
        key: Some(KEY),
        device: DEVICE,
    };
    assert_eq!(*tables.updater().trust(), trust);
    let other = Request::Provision {
        key: [1; 32],
        device: DEVICE,
    };
    let refused = Response::Refused(Refusal::HasKey);
    assert_eq!(tables.carry_out(other, 0), refused);
}

#[test]
fn a_record_with_any_bit_changed_is_no_identity() {
    let record = identity_record(KEY, DEVICE);
    for bit in 0..8 * RECORD {
        let mut changed = record;
        changed[bit / 8] ^= 1 << (bit % 8);
        let mut flash = FakeTables::default().updater().flash().clone();
        flash.write(IDENTITY as u32, &changed).expect("erased");
        assert_eq!(
            FakeTables::new(flash).updater().trust().key,
            None,
            "bit {bit}"
        );
    }
}
