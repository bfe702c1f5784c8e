//! Tests of the NOR flash simulator.

use super::*;
use embedded_storage::nor_flash::{NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

type Flash = NorSimulator<4, 64>;

/// Neither all ones nor all zeros, and different from byte to byte.
fn pattern(length: usize) -> Vec<u8> {
    (0..length).map(|at| (at * 37 + 11) as u8).collect()
}

fn read<const W: usize, const E: usize, const R: usize>(
    flash: &mut NorSimulator<W, E, R>,
    from: u32,
    length: usize,
) -> Vec<u8> {
    let mut bytes = vec![0; length];
    flash.read(from, &mut bytes).expect("the power is on");
    bytes
}

fn ones(bytes: &[u8]) -> u32 {
    bytes.iter().map(|byte| byte.count_ones()).sum()
}

#[test]
fn what_is_programmed_is_read_and_an_erase_makes_ones() {
    let mut flash = Flash::new(3, 1);
    assert_eq!(flash.capacity(), 192);
    let bytes = pattern(72);
    flash.write(60, &bytes).expect("erased");
    assert_eq!(read(&mut flash, 60, 72), bytes);
    flash.erase(64, 128).expect("a sector");
    assert_eq!(read(&mut flash, 60, 4), bytes[..4]);
    assert_eq!(read(&mut flash, 64, 64), [0xFF; 64]);
    assert_eq!(read(&mut flash, 128, 4), bytes[68..]);
    assert_eq!(
        [0, 1, 2, 3].map(|sector| flash.erases(sector)),
        [Some(0), Some(1), Some(0), None]
    );
}

fn write_once<const W: usize>() {
    let mut flash = NorSimulator::<W, 64>::new(2, 1);
    let unit = W as u32;
    // All ones: nothing to see afterwards, and programmed all the same.
    flash.write(unit, &[0xFF; W]).expect("erased");
    let spent = Err(NorError::NotErased { unit });
    assert_eq!(flash.write(unit, &[0xFF; W]), spent);
    let before = flash.steps();
    assert_eq!(
        flash.write(0, &vec![0; 3 * W]),
        spent,
        "the first unit that is spent"
    );
    assert_eq!(flash.contents(), [0xFF; 128], "nothing has changed");
    assert_eq!(flash.steps(), before);
    assert_eq!(flash.violations().not_erased, 2);
    flash.write(0, &[0; W]).expect("its neighbours are erased");
    flash
        .write(2 * unit, &[0; W])
        .expect("its neighbours are erased");
    flash.erase(0, 64).expect("a sector");
    flash.write(0, &[0x5A; 64]).expect("all are erased again");
}

#[test]
fn a_write_unit_is_programmed_once_between_two_erases() {
    write_once::<1>();
    write_once::<4>();
    write_once::<8>();
    write_once::<16>();
    write_once::<32>();
}

#[test]
fn a_unit_with_a_rotten_bit_is_not_erased() {
    let mut flash = Flash::new(1, 1);
    flash.rot(8..12, 1).expect("within");
    assert_eq!(
        flash.write(0, &[0; 12]),
        Err(NorError::NotErased { unit: 8 })
    );
}

#[test]
fn a_rewritable_part_clears_more_bits_and_sets_none() {
    let mut flash = Flash::new(1, 1).rewritable();
    flash.write(0, &[0xF0; 4]).expect("erased");
    flash.write(0, &[0x3C; 4]).expect("rewritable");
    assert_eq!(read(&mut flash, 0, 4), [0x30; 4]);
}

#[test]
fn what_is_not_aligned_or_outside_is_refused_and_counted() {
    let mut flash = NorSimulator::<4, 64, 2>::new(2, 1).with_log();
    let not_aligned = Err(NorError::NotAligned);
    assert_eq!(flash.read(1, &mut [0; 2]), not_aligned);
    assert_eq!(flash.read(0, &mut [0; 3]), not_aligned);
    assert_eq!(flash.write(2, &[0; 4]), not_aligned);
    assert_eq!(flash.write(0, &[0; 6]), not_aligned);
    assert_eq!(flash.erase(0, 65), not_aligned);
    assert_eq!(flash.erase(32, 64), not_aligned);
    let outside = Err(NorError::OutOfBounds);
    assert_eq!(flash.read(126, &mut [0; 4]), outside);
    assert_eq!(flash.write(u32::MAX - 3, &[0; 4]), outside);
    assert_eq!(flash.erase(64, 192), outside);
    assert_eq!(flash.erase(64, 0), outside);
    assert_eq!(flash.put(127, &[0; 2]), outside);
    assert_eq!(flash.rot(64..129, 1), outside);
    assert_eq!(flash.wear_out(2, 0, Wear::StuckBits), outside);
    let counted = Violations {
        not_erased: 0,
        not_aligned: 6,
        out_of_bounds: 4,
    };
    assert_eq!(flash.violations(), counted);
    assert_eq!((flash.contents(), flash.steps()), (&[0xFF; 128][..], 0));
    assert_eq!(
        flash.log().len(),
        7,
        "reads change nothing and are not noted"
    );
    assert_eq!(NorError::NotAligned.kind(), NorFlashErrorKind::NotAligned);
    assert_eq!(NorError::OutOfBounds.kind(), NorFlashErrorKind::OutOfBounds);
    assert_eq!(NorError::PowerCut.kind(), NorFlashErrorKind::Other);
}

/// An erase and two programs, cut at every step.
fn every_cut<const W: usize>() {
    const OLD: u8 = 0xA5;
    let bytes = pattern(96);
    let mut new = NorSimulator::<W, 64>::new(3, 1);
    new.put(64, &[OLD; 64]).expect("within");
    let run = |flash: &mut NorSimulator<W, 64>| {
        flash.erase(64, 128)?;
        flash.write(32, &bytes[..64])?;
        flash.write(96, &bytes[64..])
    };
    let mut whole = new.clone();
    run(&mut whole).expect("power");
    assert_eq!(
        whole.steps(),
        ERASE_STAGES + 96,
        "a step a byte and a stage"
    );
    for cut in 0..ERASE_STAGES + 96 {
        let mut flash = new.clone();
        flash.reseed(cut);
        flash.cut_after(cut);
        assert_eq!(run(&mut flash), Err(NorError::PowerCut), "{cut}");
        assert_eq!((flash.is_on(), flash.steps()), (false, cut));
        assert_eq!(flash.read(0, &mut [0]), Err(NorError::PowerCut));
        assert_eq!(flash.erase(0, 64), Err(NorError::PowerCut));
        assert_eq!(flash.write(0, &[0; W]), Err(NorError::PowerCut));
        flash.power_on();
        let old_sector = flash.contents()[64..128].to_vec();
        let Some(done) = cut.checked_sub(ERASE_STAGES) else {
            assert_eq!(old_sector == [OLD; 64], cut == 0, "stage {cut}");
            assert!(
                old_sector.iter().all(|cell| cell & OLD == OLD),
                "zeros become ones"
            );
            let unit = flash.write(64, &[0; W]);
            assert_eq!(unit, Err(NorError::NotErased { unit: 64 }), "stage {cut}");
            continue;
        };
        let done = done as usize;
        let programmed = &flash.contents()[32..128];
        assert_eq!(programmed[..done], bytes[..done], "bytes before the cut");
        assert_eq!(
            programmed[done] & bytes[done],
            bytes[done],
            "no bit too many"
        );
        assert!(programmed[done + 1..].iter().all(|cell| *cell == 0xFF));
        // The unit of the torn byte is spent; the next one is not.
        let torn = (32 + done) / W * W;
        let again = flash.write(torn as u32, &[0xFF; W]);
        assert_eq!(again, Err(NorError::NotErased { unit: torn as u32 }));
        if torn + W < 192 {
            flash.write((torn + W) as u32, &[0; W]).expect("not begun");
        }
        flash.erase(0, 192).expect("power");
        assert_eq!(flash.contents(), [0xFF; 192]);
    }
    let mut flash = new.clone();
    flash.cut_after(ERASE_STAGES + 96);
    run(&mut flash).expect("the cut comes after it");
    assert_eq!(flash.write(0, &[0; W]), Err(NorError::PowerCut));
}

#[test]
fn a_cut_at_any_step_leaves_what_was_done_and_tears_what_was_not() {
    every_cut::<1>();
    every_cut::<4>();
    every_cut::<8>();
    every_cut::<16>();
    every_cut::<32>();
}

#[test]
fn an_erase_that_is_cut_before_it_begins_changes_nothing() {
    for stage in 0..ERASE_STAGES {
        let mut flash = Flash::new(1, 1);
        flash.cut_after(stage);
        assert_eq!(flash.erase(0, 64), Err(NorError::PowerCut));
        flash.power_on();
        assert_eq!(flash.contents(), [0xFF; 64]);
        let has_begun = stage > 0;
        assert_eq!(
            flash.write(0, &[0; 64]).is_err(),
            has_begun,
            "stage {stage}"
        );
        assert_eq!(flash.erases(0), Some(u32::from(has_begun)));
    }
}

#[test]
fn an_erase_makes_no_unit_of_its_neighbours_free() {
    let mut flash = Flash::new(3, 1);
    flash.write(0, &[0xFF; 192]).expect("erased");
    flash.erase(64, 128).expect("a sector");
    for unit in [0, 60, 128, 188] {
        let result = flash.write(unit, &[0; 4]);
        assert_eq!(result, Err(NorError::NotErased { unit }));
    }
    flash.write(64, &[0; 64]).expect("erased");
}

#[test]
fn a_torn_byte_is_any_mixture_of_old_and_new() {
    let mut seen = [false; 256];
    for seed in 0..4_000 {
        let mut flash = NorSimulator::<1, 16>::new(1, seed);
        flash.cut_after(0);
        let _ = flash.write(0, &[0x0F]);
        seen[usize::from(flash.contents()[0])] = true;
    }
    for (byte, seen) in seen.iter().enumerate() {
        assert_eq!(*seen, byte & 0x0F == 0x0F, "{byte:#x}");
    }
}

fn stage_shares(flash: &NorSimulator<4, 4096>) -> Vec<f64> {
    let stages = 1..ERASE_STAGES;
    stages
        .map(|stage| {
            let mut flash = flash.clone();
            flash.cut_after(stage);
            assert_eq!(flash.erase(0, 4096), Err(NorError::PowerCut));
            f64::from(ones(flash.contents())) / 32_768.0
        })
        .collect()
}

#[test]
fn an_erase_moves_few_bits_at_first_and_leaves_few_at_last() {
    let mut flash = NorSimulator::new(1, 5);
    flash.put(0, &[0; 4096]).expect("within");
    let documented = [
        1.0 / 64.0,
        0.125,
        0.5,
        0.75,
        15.0 / 16.0,
        127.0 / 128.0,
        1_023.0 / 1_024.0,
    ];
    for (share, expected) in stage_shares(&flash).iter().zip(documented) {
        // Five standard deviations of 32,768 draws.
        let allowed = 5.0 * (expected * (1.0 - expected) / 32_768.0_f64).sqrt();
        assert!((share - expected).abs() < allowed, "{share} for {expected}");
        assert!(*share < 1.0);
    }
}

#[test]
fn a_part_that_preprograms_loses_ones_before_it_gains_them() {
    let mut flash = NorSimulator::new(1, 5).with_preprogramming();
    flash.put(0, &[0xF0; 4096]).expect("within");
    let shares = stage_shares(&flash);
    assert!(shares[0] < 0.4 && shares[1] < 0.05, "{shares:?}");
    assert!(shares[6] > 0.99 && shares[6] < 1.0, "{shares:?}");
}

#[test]
fn weak_bits_read_as_either_until_they_are_erased() {
    let mut flash = NorSimulator::<1, 64>::new(1, 3).with_weak_bits();
    flash.write(0, &[0xAA]).expect("erased");
    flash.cut_after(0);
    assert_eq!(flash.write(1, &[0x0F; 2]), Err(NorError::PowerCut));
    flash.power_on();
    let mut seen = [0_u8; 3];
    let mut unseen = [0xFF_u8; 3];
    for _ in 0..100 {
        for (at, byte) in read(&mut flash, 0, 3).iter().enumerate() {
            seen[at] |= byte;
            unseen[at] &= byte;
        }
    }
    assert_eq!(seen, [0xAA, 0xFF, 0xFF]);
    assert_eq!(
        unseen,
        [0xAA, 0x0F, 0xFF],
        "only bits to be cleared are weak"
    );
    flash.erase(0, 64).expect("power");
    assert!((0..100).all(|_| read(&mut flash, 0, 64) == [0xFF; 64]));

    flash.write(0, &[0; 64]).expect("erased");
    flash.cut_after(7);
    let _ = flash.erase(0, 64);
    flash.power_on();
    assert_ne!(read(&mut flash, 0, 64), read(&mut flash, 0, 64));
}

#[test]
fn rot_flips_as_many_different_bits_as_it_is_told() {
    let mut flash = Flash::new(2, 9);
    let bytes = pattern(128);
    flash.put(0, &bytes).expect("within");
    for (count, expected) in [(0, 0), (1, 1), (100, 100), (256, 256), (usize::MAX, 256)] {
        let mut rotten = flash.clone();
        rotten.rot(32..64, count).expect("within");
        let flipped: Vec<u8> = bytes
            .iter()
            .zip(rotten.contents())
            .map(|(a, b)| a ^ b)
            .collect();
        assert_eq!(ones(&flipped), expected);
        assert_eq!(ones(&flipped[32..64]), expected, "nowhere else");
    }
}

#[test]
fn a_worn_sector_keeps_zeros_after_an_erase_and_says_nothing() {
    let mut flash = Flash::new(2, 4);
    flash.wear_out(1, 3, Wear::StuckBits).expect("a sector");
    for erases in 1..=6 {
        flash.erase(0, 128).expect("it says nothing");
        let zeros = 1_024 - ones(flash.contents());
        assert_eq!(zeros, u32::from(erases > 3), "erase {erases}");
        assert_eq!(flash.contents()[..64], [0xFF; 64], "the other one");
    }
    assert_eq!(flash.erases(1), Some(6));
}

#[test]
fn a_worn_sector_loses_bits_of_programs_and_says_nothing() {
    let mut flash = NorSimulator::<4, 4096>::new(2, 4);
    flash.wear_out(1, 0, Wear::LostBits).expect("a sector");
    flash.write(0, &[0; 8192]).expect("not worn yet");
    assert_eq!(flash.contents(), [0; 8192]);
    flash.erase(0, 8192).expect("it says nothing");
    assert_eq!(flash.contents(), [0xFF; 8192]);
    flash.write(0, &[0x0F; 8192]).expect("it says nothing");
    assert_eq!(flash.contents()[..4096], [0x0F; 4096], "the other one");
    // One of 64 of 16,384 bits is 256; five standard deviations are 80.
    let lost = ones(&flash.contents()[4096..]) - 4096 * 4;
    assert!((176..=336).contains(&lost), "{lost}");
}

#[test]
fn what_a_debug_port_puts_there_is_there_and_may_be_programmed_if_erased() {
    let mut flash = Flash::new(1, 1);
    flash.write(0, &[0; 8]).expect("erased");
    flash.put(2, &[0xFF; 6]).expect("within");
    assert_eq!(
        flash.contents()[..8],
        [0, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF]
    );
    assert_eq!(
        flash.write(0, &[0; 4]),
        Err(NorError::NotErased { unit: 0 })
    );
    flash.write(4, &[1; 4]).expect("as good as erased");
    assert_eq!((flash.steps(), flash.erases(0)), (12, Some(0)));
}

#[test]
fn the_same_seed_fails_alike_and_another_does_not() {
    let fail = |flash: &mut NorSimulator<8, 256>| {
        let _ = flash.write(0, &pattern(256));
        flash.cut_after(3);
        let _ = flash.erase(0, 256);
        flash.power_on();
        let _ = flash.rot(0..256, 10);
        flash.contents().to_vec()
    };
    let new = NorSimulator::new(1, 7);
    let first = fail(&mut new.clone());
    assert_eq!(fail(&mut new.clone()), first);
    assert_eq!(fail(&mut NorSimulator::new(1, 7)), first);
    let mut other = new.clone();
    other.reseed(8);
    assert_ne!(fail(&mut other), first);
}

#[test]
fn the_log_says_which_operation_a_cut_fell_into() {
    let mut flash = Flash::new(4, 1).with_log();
    flash.cut_after(64 + 8 + 3);
    flash.write(0, &[0; 64]).expect("power");
    assert_eq!(flash.erase(64, 192), Err(NorError::PowerCut));
    assert_eq!(flash.write(0, &[0; 4]), Err(NorError::PowerCut));
    let texts: Vec<_> = flash
        .log()
        .iter()
        .map(|operation| format!("{operation}"))
        .collect();
    let expected = [
        "program of 64 bytes at 0x0: done in 64 steps",
        "erase of 128 bytes at 0x40: power cut at stage 3 of 8 of its sector 1",
    ];
    assert_eq!(texts, expected);
    assert_eq!(flash.last_cut(), flash.log().last());
    assert_eq!(flash.last_cut().map(|cut| cut.before), Some(64));
    flash.power_on();
    flash.cut_after(5);
    assert_eq!(flash.write(64 * 3, &[0; 8]), Err(NorError::PowerCut));
    let cut = flash.last_cut().map(|cut| format!("{cut}"));
    assert_eq!(
        cut.as_deref(),
        Some("program of 8 bytes at 0xc0: power cut in byte 5 of 8")
    );
}

#[test]
fn an_order_to_cut_does_not_outlive_the_next_start() {
    let mut flash = Flash::new(1, 1);
    flash.cut_after(4);
    flash.write(0, &[0; 4]).expect("power");
    flash.power_on();
    flash.write(4, &[0; 4]).expect("forgotten");
    flash.power_off();
    assert_eq!(flash.read(0, &mut [0]), Err(NorError::PowerCut));
    assert_eq!(flash.last_cut(), None, "it fell into no operation");
}

#[test]
fn a_cut_tears_the_whole_write_unit_where_a_part_programs_it_at_once() {
    let mut later = 0;
    for seed in 0..50 {
        let mut flash = NorSimulator::<8, 64>::new(1, seed).with_whole_units();
        flash.cut_after(11);
        let cut = flash.write(0, &[0; 32]);
        assert_eq!(cut, Err(NorError::PowerCut));
        let cells = flash.contents();
        assert_eq!(cells[..8], [0; 8], "the unit before is done");
        assert_eq!(cells[16..], [0xFF; 48], "the units behind are untouched");
        later += u32::from(cells[12..16] != [0xFF; 4]);
    }
    assert!(
        later > 40,
        "bytes behind the cut are in motion too: {later}"
    );
}

#[test]
fn a_torn_unit_cannot_be_read_on_a_part_with_ecc_until_it_is_erased() {
    let mut flash = NorSimulator::<8, 64>::new(2, 1).with_ecc();
    flash.cut_after(11);
    let _ = flash.write(0, &[0; 32]);
    flash.power_on();
    let mut bytes = [0; 8];
    for (unit, expected) in [(0, Ok(())), (8, Err(NorError::Unreadable)), (16, Ok(()))] {
        assert_eq!(flash.read(unit, &mut bytes), expected, "unit {unit}");
    }
    assert!(!flash.is_readable(0..9) && flash.is_readable(16..128));
    // An erase that is cut leaves nothing that can be read.
    flash.cut_after(4);
    let _ = flash.erase(0, 64);
    flash.power_on();
    assert_eq!(flash.read(0, &mut bytes), Err(NorError::Unreadable));
    flash.erase(0, 64).expect("a good sector");
    flash.read(8, &mut bytes).expect("erased");
    assert_eq!(flash.violations(), Violations::default());
}

#[test]
fn a_sector_that_refuses_work_says_so_and_stays_as_it_is() {
    let mut flash = NorSimulator::<4, 64>::new(2, 1);
    flash.erase(0, 64).expect("the last that it stands");
    flash.wear_out(0, 1, Wear::Refuses).expect("there");
    assert_eq!(flash.write(0, &[0; 4]), Err(NorError::Worn));
    assert_eq!(flash.erase(0, 64), Err(NorError::Worn));
    flash.write(64, &[0; 4]).expect("the other one");
    assert_eq!(flash.contents()[..64], [0xFF; 64]);
    assert_eq!(flash.violations(), Violations::default());
}
