//! Worn records and identity: what is refused because the flash takes no more changes nothing,
//! at once and after the next start.

use iltm::picture::Response as ProjectorResponse;
use iltm_runtime::link::{Refusal, Response};
use iltm_tests::flash_simulator::{Violations, Wear};
use iltm_tests::slots::{SimDevice, Step, TRIAL_S, provision};
use iltm_tests::{signing_key, wedge_table_for};

type Device = SimDevice<4, 256>;

/// Sectors of a slot. The records follow the slots, and the identity them.
const SLOT: usize = 48;

/// Ways of wear that spoil every record. A stuck bit may lie where none is written.
const WEARS: [Wear; 2] = [Wear::LostBits, Wear::Refuses];

fn files() -> [Vec<u8>; 3] {
    [2, 3, 4].map(|cols| wedge_table_for(ProjectorResponse::Linear, 2, cols, 1))
}

/// From now on these sectors, counted from the first of the records, stand no erase.
fn wear_out(device: &mut Device, sectors: &[usize], how: Wear) {
    let flash = device.updater.flash_mut();
    for sector in sectors {
        let sector = 2 * SLOT + sector;
        let erases = flash.erases(sector).expect("there");
        flash.wear_out(sector, erases, how).expect("there");
    }
}

/// A device that runs `old`, after a start: its next record needs an erase.
fn running(files: &[&Vec<u8>]) -> Device {
    let mut device = Device::new(SLOT, 1);
    for file in files {
        device.update(file, true).expect("a good device");
    }
    device.restarted()
}

#[test]
fn a_rollback_that_cannot_be_recorded_changes_nothing() {
    let [old, new, _] = files();
    for how in WEARS {
        let mut device = running(&[&old, &new]);
        wear_out(&mut device, &[0, 1], how);
        let refused = device.carry_out(&[], &Step::Rollback);
        assert!(refused.is_err(), "{how:?}");
        assert!(device.runs(&new), "{how:?}: refused, and yet another table");
        assert!(device.restarted().runs(&new), "{how:?}");
    }
}

#[test]
fn a_confirmation_that_cannot_be_recorded_leaves_the_trial() {
    let [old, new, _] = files();
    for how in WEARS {
        let mut device = running(&[&old]);
        wear_out(&mut device, &[0, 1], how);
        device.update(&new, false).expect("a trial needs no record");
        let refused = device.carry_out(&new, &Step::Confirm);
        assert!(refused.is_err(), "{how:?}");
        device.wait(u64::from(TRIAL_S) * 1_000);
        assert!(
            device.runs(&old),
            "{how:?}: nobody confirmed, and yet it stays"
        );
        assert!(device.restarted().runs(&old), "{how:?}");
    }
}

#[test]
fn a_key_that_cannot_be_stored_is_not_trusted() {
    let [old, ..] = files();
    let key = signing_key(5);
    // The identity, or the record that says that there is one.
    for sectors in [&[2][..], &[0, 1]] {
        for how in WEARS {
            let mut device = running(&[&old]);
            wear_out(&mut device, sectors, how);
            let answer = device.ask(provision(&key, 7));
            if answer == Response::Provisioned {
                // One of its two copies is whole.
                assert_eq!(sectors, [2]);
                assert_eq!(device.restarted().updater.trust().device, 7);
                continue;
            }
            assert!(
                matches!(answer, Response::Refused(_)),
                "{how:?}: {answer:?}"
            );
            assert_eq!(device.updater.trust().key, None, "{how:?} {sectors:?}");
            let device = device.restarted();
            assert_eq!(device.updater.trust().key, None, "{how:?} {sectors:?}");
            assert!(device.runs(&old), "{how:?} {sectors:?}");
        }
    }
}

/// The record that counts stays in its part when the other one takes none, at whatever
/// number of records before, and if the power fails in a later try as well.
#[test]
fn the_record_that_counts_outlives_a_part_that_wears_out() {
    let [old, new, third] = files();
    for how in [Wear::StuckBits, Wear::LostBits, Wear::Refuses] {
        for (worn, before) in (0..2).flat_map(|worn| (0..6).map(move |before| (worn, before))) {
            let others = [&new, &third];
            let mut all = vec![&old];
            all.extend((0..before).map(|index| others[index % 2]));
            let mut device = running(&all);
            wear_out(&mut device, &[worn], how);
            let mut runs = all[before];
            for index in 0..8 {
                let next = if runs == &new { &third } else { &new };
                let what = format!("{how:?}, part {worn}, {before} before, update {index}");
                match device.update(next, true) {
                    Ok(()) => runs = next,
                    Err(refusal) => {
                        let expected = matches!(refusal, Refusal::ReadOnly | Refusal::Flash { .. });
                        assert!(expected, "{what}: {refusal:?}");
                        device.wait(u64::from(TRIAL_S) * 1_000);
                        // And the power fails in the next try, before a record is whole.
                        for cut in [0, 3, 7, 8, 40] {
                            let mut device = device.clone();
                            device.update(next, false).expect("a trial needs no record");
                            device.updater.flash_mut().cut_after(cut);
                            let _ = device.carry_out(next, &Step::Confirm);
                            let device = device.restarted();
                            assert!(device.runs(runs), "{what}, cut {cut}");
                        }
                    }
                }
                // Stuck bits are found before they are written over.
                let violations = device.flash().violations();
                assert_eq!(violations, Violations::default(), "{what}");
                let again = device.clone().restarted();
                assert!(
                    again.runs(runs),
                    "{what}: {:?} runs",
                    again.updater.in_use()
                );
            }
        }
    }
}
