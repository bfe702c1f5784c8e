//! Fuzzed flash: a device that starts on any flash, records that look right among them.

use super::files::{DEVICES, Owner, files, keys};
use crate::flash_simulator::{NorSimulator, Violations};
use crate::slots::{SimDevice, SlotLayout};
use iltm_runtime::image::crc32;

/// Bytes of something that is put into the flash.
const GROUP: usize = 8;

/// What lies in the flash: the first byte says how large its sectors are, every eight
/// bytes after it are something that is put there.
///
/// # Panics
/// If the device breaks a rule of the flash, runs a table that was not signed for it,
/// or loses a table that it confirms afterwards.
pub fn flash(bytes: &[u8]) {
    let Some((kind, puts)) = bytes.split_first() else {
        return;
    };
    let (puts, _) = puts.as_chunks::<GROUP>();
    let puts = puts.get(..puts.len().min(64)).unwrap_or_default();
    match kind % 3 {
        0 => start::<1, 64>(12, puts),
        1 => start::<8, 256>(3, puts),
        _ => start::<32, 512>(2, puts),
    }
}

fn start<const W: usize, const E: usize>(slot: usize, puts: &[[u8; GROUP]]) {
    let layout = SlotLayout { slot, sector: E };
    let mut flash = NorSimulator::<W, E>::new(layout.sectors(), 1);
    let size = layout.sectors() * E;
    let slots = 2 * slot * E;
    let mut latest = 0;
    for [what, place, a, b, c, d, e, f] in puts.iter().copied() {
        let word = u32::from_le_bytes([a, b, c, d]);
        let number = |byte: u8| if byte < 0xF0 { u32::from(byte) } else { word };
        let (at, bytes) = match what % 8 {
            0 => (usize::from(place) * 8 + usize::from(a), vec![b, c, d, e, f]),
            1 | 2 => {
                let file = &files()[usize::from(a) % files().len()];
                (usize::from(place % 2) * slot * E, file.bytes.clone())
            }
            3 => (slots + usize::from(place) * 8, vec![b; usize::from(c)]),
            4 => {
                let identity = Owner {
                    key: keys()[usize::from(a % 3)],
                    device: DEVICES[usize::from(b % 2)],
                };
                let mut fields = identity.key.to_vec();
                fields.extend(identity.device.to_le_bytes());
                let record = record(*b"ILTI", &fields);
                (slots + 2 * E + usize::from(place) * 64 % E, record)
            }
            _ => {
                let id = &files()[usize::from(c) % files().len()].bytes;
                let id = id.get(12..16).unwrap_or(&[0; 4]).try_into();
                let slot = if b < 0xF0 { u32::from(b % 3) } else { word };
                let sequence = if what < 0xF8 { u32::from(a) } else { word };
                latest = latest.max(sequence);
                let fields = [
                    sequence,
                    slot,
                    u32::from_le_bytes(id.expect("four bytes")),
                    number(d % 8),
                    number(e),
                    number(f),
                    0,
                    if e < 0x40 { word } else { 0 },
                    0,
                ];
                let record = record(*b"ILTC", &fields.map(u32::to_le_bytes).concat());
                (slots + usize::from(place) * 64 % (2 * E), record)
            }
        };
        let at = at.min(size);
        let end = size.min(at + bytes.len());
        flash.put(at as u32, &bytes[..end - at]).expect("it fits");
    }
    let mut device = SimDevice::start(flash, layout);
    only_what_may(&device);
    // One that any device takes, but for its key and its floor.
    let file = &files()[5].bytes;
    if device.update(file, true).is_ok() {
        only_what_may(&device);
        assert_eq!(device.flash().violations(), Violations::default());
        let device = device.restarted();
        // No device ever writes four billion records.
        if latest < u32::MAX - 1_000 {
            assert!(device.runs(file), "a confirmed table is lost");
        }
        only_what_may(&device);
    }
}

fn record(magic: [u8; 4], fields: &[u8]) -> Vec<u8> {
    let mut record = magic.to_vec();
    record.extend(fields);
    record.resize(60, 0);
    let crc = crc32(&[&record]);
    record.extend(crc.to_le_bytes());
    record
}

/// A device with a key runs what was signed for it, or nothing.
fn only_what_may<const W: usize, const E: usize>(device: &SimDevice<W, E>) {
    let trust = device.updater.trust();
    let Some((slot, key)) = device.updater.in_use().zip(trust.key) else {
        return;
    };
    let owner = Owner {
        key,
        device: trust.device,
    };
    let bytes = &device.flash().contents()[device.layout().slot(slot)];
    let mut taken = files()
        .iter()
        .filter(|file| file.verdict(Some(owner), 0).is_ok());
    assert!(
        taken.any(|file| bytes.starts_with(&file.bytes)),
        "slot {slot:?} holds nothing that was signed for the device"
    );
}
