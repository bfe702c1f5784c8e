//! Power cuts: the power fails at every byte of every write and at every stage of every erase.
//!
//! The device is the runtime's own updater and gate over a simulated NOR flash that
//! refuses what the strictest parts refuse. After each cut it starts again: it must
//! run the old table or the new one, whole, break no rule of the flash, and take the
//! update again.
//!
//! The short form of the two-cut test runs always; the full form with
//! `cargo test --release -p iltm-tests --test device power_cuts -- --include-ignored --nocapture`.

use ed25519_dalek::SigningKey;
use iltm::picture::Response as ProjectorResponse;
use iltm_runtime::image::crc32;
use iltm_runtime::link::{Refusal, Request, Response};
use iltm_tests::flash_simulator::{NorSimulator, Violations, Wear, Work};
use iltm_tests::slots::{SimDevice, SlotLayout, Step, provision};
use iltm_tests::{signed, signing_key, wedge_table_for};
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;

/// The device's number.
const DEVICE: u64 = 7;

fn key() -> SigningKey {
    signing_key(42)
}

fn table(rows: u16, cols: u16, channels: usize) -> Vec<u8> {
    wedge_table_for(ProjectorResponse::Linear, rows, cols, channels)
}

/// Two files that differ from the first sector on.
struct Files {
    old: Vec<u8>,
    new: Vec<u8>,
}

impl Files {
    /// Tables that are signed, the second with a higher version. Both revoke version 0.
    fn signed() -> Self {
        let file = |cols, version| signed(&table(6, cols, 1), &key(), version, 1, DEVICE);
        Self {
            old: file(8, 1),
            new: file(9, 2),
        }
    }

    fn both(&self) -> [&[u8]; 2] {
        [&self.old, &self.new]
    }
}

/// What happens to a device with one file: the transfer, and then this.
struct Story<'f> {
    file: &'f [u8],
    steps: Vec<Step>,
}

/// A whole life: first table, update, trial, confirmation; a trial that nobody
/// confirms; one that is rolled back; the way back to the table before.
fn life(files: &Files) -> Vec<Story<'_>> {
    let story = |file, steps: &[Step]| Story {
        file,
        steps: steps.to_vec(),
    };
    vec![
        story(&files.old, &[Step::Activate, Step::Confirm]),
        story(&files.new, &[Step::Activate, Step::TrialOver]),
        story(&files.new, &[Step::Activate, Step::Rollback]),
        story(
            &files.new,
            &[
                Step::Activate,
                Step::Confirm,
                Step::Rollback,
                Step::Rollback,
            ],
        ),
    ]
}

/// What was cut, in all threads.
#[derive(Default)]
struct Counts {
    writes: AtomicU64,
    erases: AtomicU64,
    again: AtomicU64,
}

/// Starts after each cut.
const STARTS: u32 = 3;

/// What the flash is like.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    /// What was cut reads the same for ever.
    Plain,
    /// Bits that a cut caught in motion read as either.
    Weak,
    /// A write unit is programmed at once, and cannot be read if that was cut.
    Ecc,
}

impl Part {
    fn make<const W: usize, const E: usize>(self, layout: SlotLayout) -> NorSimulator<W, E> {
        let flash = NorSimulator::new(layout.sectors(), 1);
        match self {
            Self::Plain => flash,
            Self::Weak => flash.with_weak_bits(),
            Self::Ecc => flash.with_whole_units().with_ecc(),
        }
    }
}

/// Cuts the power at every point at which a device with a table is given its key.
fn cut_provision<const W: usize, const E: usize>(files: &Files, slot: usize, part: Part) -> u64 {
    let layout = SlotLayout { slot, sector: E };
    let mut device = SimDevice::<W, E>::start(part.make(layout), layout);
    device.update(&files.old, true).expect("a good device");
    let mut whole = device.clone();
    let start = whole.flash().steps();
    whole.ask(provision(&key(), DEVICE));
    let work = whole.flash().steps() - start;
    for cut in 0..work {
        let mut device = device.clone();
        let flash = device.updater.flash_mut();
        flash.reseed(cut);
        flash.cut_after(cut);
        let answer = device.ask(provision(&key(), DEVICE));
        let mut device = device.restarted();
        let what = format!("unit {W}, cut {cut} of {work}");
        let trust = *device.updater.trust();
        // What was answered holds: the cut fell into the duplicate of the last record.
        assert!(
            answer != Response::Provisioned || trust.device == DEVICE,
            "{what}"
        );
        for _ in 0..STARTS {
            assert_eq!(*device.updater.trust(), trust, "{what}");
            assert!(device.runs(&files.old), "{what}");
            assert_eq!(device.updater.fault(), None, "{what}");
            assert_eq!(device.flash().violations(), Violations::default(), "{what}");
            device = device.restarted();
        }
        let given = device.ask(provision(&key(), DEVICE));
        assert_eq!(given, Response::Provisioned, "{what}");
        let device = device.restarted();
        assert_eq!(device.updater.trust().device, DEVICE, "{what}");
        assert!(device.runs(&files.old), "{what}");
    }
    work
}

#[test]
fn a_cut_while_the_key_is_given_leaves_none_or_the_whole_one_and_the_table() {
    let files = Files::signed();
    let mut cuts = 0;
    for part in [Part::Plain, Part::Weak, Part::Ecc] {
        cuts += cut_provision::<1, 256>(&files, 48, part);
        cuts += cut_provision::<8, 256>(&files, 48, part);
        cuts += cut_provision::<32, 256>(&files, 48, part);
    }
    println!("{cuts} cuts");
    assert!(cuts > 1_000);
}

#[test]
fn an_update_goes_on_where_a_write_unit_cannot_be_read() {
    let files = Files::signed();
    let layout = SlotLayout {
        slot: 4,
        sector: 4_096,
    };
    let mut device = SimDevice::<32, 4_096>::start(Part::Ecc.make(layout), layout);
    device.update(&files.old, true).expect("a good device");
    let steps = device.plan(&files.new, true);
    let [begin, first, second, ..] = steps.as_slice() else {
        panic!("a table of several chunks");
    };
    for step in [begin, first] {
        device.carry_out(&files.new, step).expect("a good device");
    }
    device.updater.flash_mut().cut_after(100);
    device
        .carry_out(&files.new, second)
        .expect_err("it was cut");
    let mut device = device.restarted();
    assert!(device.runs(&files.old), "the torn slot is not read");
    let length = files.new.len() as u32;
    let Response::Sectors(sectors) = device.ask(Request::Sectors { length, first: 0 }) else {
        panic!("the sectors cannot be compared");
    };
    let wanted = files.new.chunks(4_096).map(|sector| crc32(&[sector]));
    assert!(
        wanted
            .zip(&sectors.crcs)
            .all(|(wanted, held)| wanted != *held)
    );
    device.update(&files.new, true).expect("it goes on");
    assert!(device.restarted().runs(&files.new));
}

/// Cuts the power at every point of one step of a device that runs `before`, and of
/// what the device does when it starts again.
fn cut_everywhere<const W: usize, const E: usize>(
    device: &SimDevice<W, E>,
    files: &Files,
    (file, step, starts): (&[u8], &Step, u32),
    before: Option<&[u8]>,
    counts: &Counts,
) {
    let mut whole = device.clone();
    let start = whole.flash().steps();
    whole.carry_out(file, step).expect("a good device");
    let work = whole.flash().steps() - start;
    let after = files.both().into_iter().find(|file| whole.runs(file));
    for cut in 0..work {
        let mut device = device.clone();
        let flash = device.updater.flash_mut();
        flash.reseed(cut);
        flash.cut_after(cut);
        let _ = device.carry_out(file, step);
        let operation = *device.flash().last_cut().expect("it was cut");
        let count = match operation.work {
            Work::Program => &counts.writes,
            Work::Erase => &counts.erases,
        };
        count.fetch_add(1, Ordering::Relaxed);
        let mut device = device.restarted();
        let what = format!("unit {W}, {step:?}, cut {cut} of {work}: {operation}");
        let runs = |device: &SimDevice<W, E>, file: Option<&[u8]>| match file {
            Some(file) => device.runs(file),
            None => device.updater.in_use().is_none(),
        };
        // A trial is not confirmed by a loss of power.
        let kept = after.filter(|_| matches!(step, Step::Confirm | Step::Rollback));
        assert!(
            runs(&device, before) || kept.is_some() && runs(&device, kept),
            "{what}: neither the old table nor the new one runs"
        );
        assert_eq!(device.flash().violations(), Violations::default(), "{what}");
        // Where cells read as either, the first start has settled it.
        let settled = [Some(files.old.as_slice()), Some(&files.new), None]
            .into_iter()
            .find(|file| runs(&device, *file));
        for start in 2..=starts {
            device = device.restarted();
            let same = settled.is_some_and(|file| runs(&device, file));
            assert!(same, "{what}: another table at start {start}");
        }
        // Now and then, the update is made once more, to the end.
        if cut.is_multiple_of(61) {
            counts.again.fetch_add(1, Ordering::Relaxed);
            if !device.runs(file) {
                let done = device.update(file, true);
                done.unwrap_or_else(|refusal| panic!("{what}: {refusal}"));
            }
            let device = device.restarted();
            assert!(device.runs(file), "{what}: the update again");
            assert_eq!(device.flash().violations(), Violations::default(), "{what}");
        }
    }
}

/// One life with cuts everywhere.
fn live<const W: usize, const E: usize>(files: &Files, slot: usize, part: Part, counts: &Counts) {
    let layout = SlotLayout { slot, sector: E };
    let mut device = SimDevice::<W, E>::start(part.make(layout), layout);
    device.ask(provision(&key(), DEVICE));
    assert_eq!(device.updater.trust().device, DEVICE);
    // What a start would find: not what is on trial.
    let mut confirmed: Option<&[u8]> = None;
    for story in life(files) {
        let mut steps = device.plan(story.file, false);
        steps.pop();
        steps.extend(&story.steps);
        for step in &steps {
            let starts = if part == Part::Weak { STARTS } else { 1 };
            cut_everywhere(
                &device,
                files,
                (story.file, step, starts),
                confirmed,
                counts,
            );
            device.carry_out(story.file, step).expect("a good device");
            if matches!(step, Step::Confirm | Step::Rollback) {
                confirmed = files.both().into_iter().find(|file| device.runs(file));
                assert!(confirmed.is_some());
            }
        }
    }
    assert!(device.runs(&files.new), "back, and back again");
    assert_eq!(device.flash().violations(), Violations::default());
}

#[test]
fn a_cut_at_any_byte_or_erase_stage_leaves_the_old_table_or_the_new_whole() {
    let files = Files::signed();
    let counts = Counts::default();
    thread::scope(|scope| {
        // Sectors of four records, so that the records change sectors as well.
        scope.spawn(|| {
            live::<1, 256>(&files, 48, Part::Plain, &counts);
            live::<4, 256>(&files, 48, Part::Plain, &counts);
            live::<8, 256>(&files, 48, Part::Weak, &counts);
        });
        scope.spawn(|| {
            live::<16, 256>(&files, 48, Part::Plain, &counts);
            live::<8, 256>(&files, 48, Part::Ecc, &counts);
            live::<32, 256>(&files, 48, Part::Ecc, &counts);
            live::<4, 4_096>(&files, 4, Part::Weak, &counts);
        });
    });
    let count = |count: &AtomicU64| count.load(Ordering::Relaxed);
    let cuts = count(&counts.writes) + count(&counts.erases);
    println!(
        "{cuts} cuts: {} in writes, {} in erases; after {} of them the update was made again; tables of {} and {} bytes",
        count(&counts.writes),
        count(&counts.erases),
        count(&counts.again),
        files.old.len(),
        files.new.len(),
    );
    assert!(cuts >= 50_000, "{cuts} cuts");
}

/// A device that runs the old table, and the new one on its way to it.
fn in_use<const W: usize, const E: usize>(files: &Files, slot: usize) -> SimDevice<W, E> {
    let mut device = SimDevice::new(slot, 1);
    device.update(&files.old, true).expect("a good device");
    device
}

/// An update that is cut, and again after the device has started; then it must run one
/// of the two, and take the update. Returns how much work the second try did.
fn cut_twice<const W: usize, const E: usize>(
    device: &SimDevice<W, E>,
    files: &Files,
    (first, second): (u64, u64),
) -> u64 {
    let mut device = device.clone();
    let flash = device.updater.flash_mut();
    flash.reseed(first << 32 | second);
    flash.cut_after(first);
    let _ = device.update(&files.new, true);
    let layout = SlotLayout {
        slot: device.updater.map().slot_bytes() as usize / E,
        sector: E,
    };
    // The start may be cut as well.
    let mut flash = device.updater.into_flash();
    flash.power_on();
    let start = flash.steps();
    flash.cut_after(second);
    let mut device = SimDevice::<W, E>::start(flash, layout);
    if !device.runs(&files.new) {
        let _ = device.update(&files.new, true);
    }
    let work = device.flash().steps() - start;
    let device = device.restarted();
    let what = format!(
        "cuts after {first} and {second}: {:?}",
        device.flash().last_cut()
    );
    assert!(
        device.runs(&files.old) || device.runs(&files.new),
        "{what}: neither runs"
    );
    assert_eq!(device.flash().violations(), Violations::default(), "{what}");
    work
}

/// Work of a whole update.
fn work<const W: usize, const E: usize>(device: &SimDevice<W, E>, files: &Files) -> u64 {
    let mut device = device.clone();
    let start = device.flash().steps();
    device.update(&files.new, true).expect("a good device");
    device.flash().steps() - start
}

#[test]
fn two_cuts_in_a_row_lose_no_table_at_any_pair_of_points() {
    let files = Files {
        old: table(1, 1, 1),
        new: table(1, 2, 1),
    };
    let device = in_use::<8, 256>(&files, 2);
    let all = work(&device, &files);
    let pairs = AtomicU64::new(0);
    thread::scope(|scope| {
        for half in 0..2 {
            let (device, files, pairs) = (&device, &files, &pairs);
            scope.spawn(move || {
                for first in (half..=all).step_by(2) {
                    let mut second = 0;
                    loop {
                        let work = cut_twice(device, files, (first, second));
                        pairs.fetch_add(1, Ordering::Relaxed);
                        if second > work {
                            break;
                        }
                        second += 1;
                    }
                }
            });
        }
    });
    println!(
        "{} pairs of cuts, an update takes {all} steps",
        pairs.into_inner()
    );
}

/// Random pairs on flash with the reference board's sectors of 4 KiB.
fn random_pairs(count: u64) {
    let files = Files {
        old: table(6, 8, 1),
        new: table(6, 9, 1),
    };
    let device = in_use::<4, 4_096>(&files, 4);
    let all = work(&device, &files);
    thread::scope(|scope| {
        for half in 0..2 {
            let (device, files) = (&device, &files);
            scope.spawn(move || {
                let mut random = fastrand::Rng::with_seed(half);
                for _ in 0..count / 2 {
                    let pair = (random.u64(0..=all), random.u64(0..=all));
                    cut_twice(device, files, pair);
                }
            });
        }
    });
    println!(
        "{count} random pairs of cuts, an update of {} bytes takes {all} steps",
        files.new.len()
    );
}

#[test]
fn two_random_cuts_in_a_row_lose_no_table() {
    random_pairs(4_000);
}

#[test]
#[ignore = "takes minutes; the documented full form"]
fn a_hundred_thousand_random_pairs_of_cuts_lose_no_table() {
    random_pairs(100_000);
}

#[test]
fn a_worn_sector_is_found_when_it_is_written_and_the_old_table_stays() {
    let files = Files {
        old: table(8, 12, 3),
        new: table(8, 13, 3),
    };
    for wear in [Wear::StuckBits, Wear::LostBits] {
        let mut device = in_use::<4, 4_096>(&files, 16);
        // The second sector of slot B, which the new table goes to.
        let flash = device.updater.flash_mut();
        flash.wear_out(17, 0, wear).expect("there");
        let refusal = device.update(&files.new, true).expect_err("it is worn");
        assert!(
            matches!(refusal, Refusal::Flash { offset } if offset / 4_096 == 1),
            "{wear:?}: {refusal:?}"
        );
        assert!(device.runs(&files.old));
        assert!(device.restarted().runs(&files.old));
    }
}

#[test]
fn bits_that_rot_in_the_table_in_use_bring_the_other_one_back() {
    let files = Files::signed();
    for seed in 0..200 {
        let mut device = SimDevice::<4, 256>::new(48, seed);
        device.ask(provision(&key(), DEVICE));
        device.update(&files.old, true).expect("a good device");
        device.update(&files.new, true).expect("a good device");
        let slot = (48 * 256)..(48 * 256 + files.new.len() as u32);
        let flash = device.updater.flash_mut();
        flash.rot(slot, 1 + (seed % 3) as usize).expect("there");
        let device = device.restarted();
        assert!(device.runs(&files.old), "seed {seed}");
        assert!(device.updater.fault().is_some(), "seed {seed}");
    }
}
