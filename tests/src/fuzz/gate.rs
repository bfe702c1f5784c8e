//! Admission of a table before it may run, and the parsers in front of it.

use super::files::{DEVICES, Owner, files, keys};
use iltm_runtime::image::layout::{entry, header};
use iltm_runtime::image::{Seal, Table, content, crc32, seal, unseal};
use iltm_runtime::trust::{Terms, Trust, admit};

/// A file at the gate; the first byte says what the device demands.
///
/// # Panics
/// If a device with a key takes a file that was not signed for it, a file is judged
/// otherwise than its making says, or the parsers disagree.
pub fn gate(bytes: &[u8]) {
    let Some((demands, file)) = bytes.split_first() else {
        return;
    };
    let owner = (demands % 4 > 0).then(|| Owner {
        key: keys()[usize::from(demands % 4 / 3)],
        device: DEVICES[usize::from(demands % 4 / 2)],
    });
    let floor = u32::from(demands / 4 % 8);
    let trust = owner.map_or_else(Trust::default, |owner| Trust {
        key: Some(owner.key),
        device: owner.device,
    });
    let apart = unseal(file);
    let admitted = admit(file, &Terms { trust, floor }, &mut || {});
    let known = files().iter().find(|known| known.bytes == file);
    let accepted = admitted.as_ref().map(|(_, accepted)| *accepted);
    match known {
        Some(known) => {
            let facts = accepted.map(|accepted| super::files::Facts {
                id: accepted.id,
                version: accepted.version,
                oldest: accepted.oldest,
                length: accepted.length,
            });
            let verdict = known.verdict(owner, floor);
            assert_eq!(facts.map_err(|rejected| *rejected), verdict);
        }
        None => assert!(
            owner.is_none() || accepted.is_err(),
            "a table was taken that nobody has signed"
        ),
    }
    if let Ok((image, sealed)) = apart {
        let length = image.len() + sealed.map_or(0, |_| seal::field::SIZE);
        assert_eq!(length, file.len(), "image and seal are the file");
        if let Some(sealed) = sealed {
            assert_eq!(sealed.emit(), file[image.len()..], "written again");
        }
        let slot = [file, &[0xFF; 40]].concat();
        assert_eq!(content(&slot), file, "the file in a longer slot");
    }
    assert!(content(file).len() <= file.len());
    if let Ok((table, accepted)) = admitted {
        let (image, sealed) = unseal(file).expect("it was admitted");
        assert_eq!(Table::check(image).map(|table| table.id()), Ok(table.id()));
        assert_eq!(accepted.id, table.id());
        assert_eq!(
            accepted.version,
            sealed.map_or(0, |sealed: Seal| sealed.version)
        );
    }
}

/// A table image whose checksums are made right, so that what is behind them is
/// reached.
pub fn contents(bytes: &[u8]) {
    let mut image = bytes.to_vec();
    repair(&mut image);
    super::image(&image);
}

/// Makes all checksums right that are where an image has them.
fn repair(image: &mut [u8]) {
    let word = |bytes: &[u8], at: usize| {
        let field = bytes.get(at..at + 4)?.try_into().ok()?;
        Some(u32::from_le_bytes(field) as usize)
    };
    let length = image.len() as u32;
    if let Some(field) = image.get_mut(header::LENGTH) {
        field.copy_from_slice(&length.to_le_bytes());
    }
    let Some(&[low, high]) = image.get(header::SECTIONS) else {
        return;
    };
    let sections = usize::from(u16::from_le_bytes([low, high]));
    for index in 0..sections {
        let row = header::SIZE + index * entry::SIZE;
        let section = word(image, row + entry::OFFSET.start)
            .zip(word(image, row + entry::LENGTH.start))
            .and_then(|(start, length)| image.get(start..start.checked_add(length)?));
        let Some(crc) = section.map(|bytes| crc32(&[bytes])) else {
            continue;
        };
        if let Some(field) = image.get_mut(row + entry::CRC.start..row + entry::CRC.end) {
            field.copy_from_slice(&crc.to_le_bytes());
        }
    }
    let end = (header::SIZE + sections * entry::SIZE).min(image.len());
    let Some(table) = image.get(header::SIZE..end) else {
        return;
    };
    let crc = crc32(&[&image[..header::CRC.start], table]);
    image[header::CRC].copy_from_slice(&crc.to_le_bytes());
}
