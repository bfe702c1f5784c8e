//! Admission of files that are wrong in one way each.

use super::*;
use crate::features::Stage;
use crate::image::layout::{SectionKind, header, meta};
use crate::image::made_up::{flat, image};
use crate::image::{ImageError, Seal, Table, seal::field};
use crate::yield_budget::cost;
use ed25519_dalek::{Signer, SigningKey};
use std::collections::BTreeSet;
use std::string::ToString;
use std::vec;
use std::vec::Vec;

const DEVICE: u64 = 0x1234_5678_9ABC_DEF0;

fn signer(number: u8) -> SigningKey {
    SigningKey::from_bytes(&[number; 32])
}

fn terms() -> Terms {
    Terms {
        trust: Trust {
            key: Some(signer(1).verifying_key().to_bytes()),
            device: DEVICE,
        },
        floor: 5,
    }
}

/// What a seal states.
#[derive(Clone, Copy)]
struct Stated {
    version: u32,
    oldest: u32,
    device: u64,
}

const GOOD: Stated = Stated {
    version: 5,
    oldest: 4,
    device: DEVICE,
};

fn signed_by(signer: &SigningKey, image: &[u8], stated: Stated) -> Vec<u8> {
    let key = signer.verifying_key().to_bytes();
    let head = Seal::head(stated.version, stated.oldest, stated.device, &key);
    let message = [image, &head].concat();
    let signature = signer.sign(&message).to_bytes();
    [&message[..], &signature].concat()
}

fn signed(image: &[u8], stated: Stated) -> Vec<u8> {
    signed_by(&signer(1), image, stated)
}

fn admitted(file: &[u8], terms: &Terms) -> Result<Accepted, Rejected> {
    admit(file, terms, &mut || {}).map(|(_, accepted)| accepted)
}

fn rejected(file: &[u8]) -> Rejected {
    admitted(file, &terms()).expect_err("a bad file")
}

#[test]
fn a_table_signed_for_the_device_is_admitted_with_what_its_seal_states() {
    let image = image(&flat(2, 3));
    let file = signed(&image, GOOD);
    let (table, accepted) = admit(&file, &terms(), &mut || {}).expect("a good file");
    let expected = Accepted {
        id: Table::check(&image).expect("a table").id(),
        version: 5,
        oldest: 4,
        length: file.len() as u32,
        grid: table.grid(),
        channels: 1,
        label: *table.label(),
    };
    assert_eq!((table.bytes(), accepted), (image.len(), expected));
}

#[test]
fn a_table_for_any_device_is_admitted() {
    let stated = Stated { device: 0, ..GOOD };
    assert!(admitted(&signed(&image(&flat(2, 3)), stated), &terms()).is_ok());
}

#[test]
fn each_kind_of_bad_file_has_an_error_of_its_own() {
    let good = image(&flat(2, 3));
    let mut other_format = signed(&good, GOOD);
    other_format[header::VERSION.start] ^= 2;
    let mut damaged = signed(&good, GOOD);
    damaged[header::SIZE + 60] ^= 1;
    let mut sections = flat(2, 3);
    sections[0].1[meta::CHANNELS] = 2;
    let strange = signed(&image(&sections), GOOD);
    let mut forged = signed(&good, GOOD);
    forged[good.len() + field::OLDEST.start] ^= 1;
    let old = Stated { version: 4, ..GOOD };
    let other = Stated { device: 9, ..GOOD };
    let files = [
        (vec![0; 200], Rejected::NotATable),
        (
            signed(&good, GOOD)[..good.len() - 1].to_vec(),
            Rejected::Truncated,
        ),
        (other_format, Rejected::Format),
        (damaged, Rejected::Damaged),
        (strange, Rejected::Contents),
        (good.clone(), Rejected::Unsigned),
        (signed_by(&signer(2), &good, GOOD), Rejected::WrongKey),
        (forged, Rejected::Signature),
        (
            signed(&good, old),
            Rejected::Older {
                version: 4,
                floor: 5,
            },
        ),
        (signed(&good, other), Rejected::OtherDevice { device: 9 }),
    ];
    let mut texts = BTreeSet::new();
    for (number, (file, expected)) in files.iter().enumerate() {
        assert_eq!(rejected(file), *expected);
        assert!(texts.insert(expected.to_string()));
        // The numbers that go over the wire.
        let mut bytes = [0; 16];
        let written = postcard::to_slice(expected, &mut bytes).expect("room");
        assert_eq!(usize::from(written[0]), number);
        assert_eq!(postcard::from_bytes(written), Ok(*expected));
    }
}

#[test]
fn any_altered_byte_of_a_signed_file_is_noticed() {
    let good = image(&flat(3, 5));
    let file = signed(&good, GOOD);
    for place in 0..file.len() {
        for flip in [0x01, 0x80, 0xFF] {
            let mut altered = file.clone();
            altered[place] ^= flip;
            let why = rejected(&altered);
            // What the seal states, or its signature, is not what was signed.
            if place >= good.len() + field::VERSION.start {
                assert!(matches!(why, Rejected::WrongKey | Rejected::Signature));
            } else if (header::SIZE..good.len()).contains(&place) {
                assert_eq!(why, Rejected::Damaged, "byte {place}");
            }
        }
    }
}

#[test]
fn a_signed_file_cut_short_anywhere_is_refused() {
    let good = image(&flat(3, 5));
    let file = signed(&good, GOOD);
    for length in 0..file.len() {
        let expected = if length == good.len() {
            Rejected::Unsigned
        } else {
            Rejected::Truncated
        };
        assert_eq!(rejected(&file[..length]), expected, "{length} bytes");
    }
}

#[test]
fn a_table_whose_checksums_were_made_to_fit_has_a_false_signature() {
    let file = signed(&image(&flat(2, 3)), GOOD);
    let seal = &file[file.len() - field::SIZE..];
    let mut sections = flat(2, 3);
    sections[2].1[0] ^= 1;
    let forged = [&image(&sections)[..], seal].concat();
    assert_eq!(rejected(&forged), Rejected::Signature);
}

#[test]
fn a_device_without_a_key_takes_every_whole_table_and_no_floor_from_it() {
    let good = image(&flat(2, 3));
    let open = Terms {
        trust: Trust {
            key: None,
            device: DEVICE,
        },
        floor: 5,
    };
    let stated = Stated {
        version: 1,
        oldest: 9,
        device: 9,
    };
    let file = signed_by(&signer(2), &good, stated);
    let accepted = admitted(&file, &open).expect("a whole table");
    assert_eq!((accepted.version, accepted.oldest), (1, 0));
    let accepted = admitted(&good, &open).expect("a whole table");
    assert_eq!((accepted.version, accepted.oldest), (0, 0));
    assert_eq!(
        admitted(&file[..file.len() - 1], &open),
        Err(Rejected::Truncated)
    );
}

/// Pauses during the admission of a table with one more section.
fn pauses(more: Option<(SectionKind, Vec<u8>)>) -> usize {
    let mut sections = flat(64, 64);
    sections.extend(more);
    let file = signed(&image(&sections), GOOD);
    let mut pauses = 0;
    admit(&file, &terms(), &mut || pauses += 1).expect("a good file");
    pauses
}

#[test]
fn pauses_come_as_often_as_the_work_asks_for() {
    let without = pauses(None);
    // A step of the signature is a pause or two; there are 256.
    assert!(without > 256, "{without}");
    let byte = cost::CRC_BYTE + cost::HASH_BYTE;
    let light = (SectionKind::Ambient, vec![0; 2 * 64 * 64]);
    let text = (SectionKind::Provenance, vec![b'a'; 60_000]);
    for (section, work) in [
        (light, 64 * 64 * (2 * byte + cost::VALUE)),
        (text, 60_000 * (byte + cost::VALUE)),
    ] {
        let more = pauses(Some(section)) - without;
        // No stride is half as long again, for no single piece of work is so long.
        assert!(
            more >= work / (crate::yield_budget::STRIDE * 3 / 2),
            "{more}"
        );
    }
}

#[test]
fn a_table_that_lists_a_stage_that_is_not_built_is_rejected_with_the_stages_number() {
    for (number, stage) in (0_u8..).zip(Stage::ALL) {
        let why = Rejected::from(ImageError::NotBuilt(stage));
        assert_eq!(why, Rejected::NotBuilt { stage });
        let mut bytes = [0; 16];
        let written = postcard::to_slice(&why, &mut bytes).expect("room");
        assert_eq!(written, [10, number]);
        assert!(why.to_string().contains(&stage.to_string()));
    }
}

/// Keys live longer than firmware: what they sign must never change.
#[test]
fn what_is_signed_is_laid_out_as_the_protocol_says() {
    let deed = Deed::Begin {
        length: 0x0102_0304,
        digest: crate::link::Digest([0xAB; 16]),
    };
    let expected = [
        &b"iltm right 1"[..],
        &[1, 0, 0, 0],
        &DEVICE.to_le_bytes(),
        &[9, 0, 0, 0],
        &[4, 3, 2, 1],
        &[0xAB; 16],
    ];
    assert_eq!(deed.message(DEVICE, 9)[..], expected.concat());
    let confirm = Deed::Confirm { table: 7 }.message(DEVICE, 9);
    let rollback = Deed::Rollback { table: 7 }.message(DEVICE, 9);
    assert_eq!((confirm[12], rollback[12]), (2, 3));
    let certificate = Certificate {
        key: [0xCD; 32],
        device: DEVICE,
        version: 6,
        signature: [0xEF; SIGNATURE],
    };
    let fields = [&[0xCD; 32][..], &DEVICE.to_le_bytes(), &[6, 0, 0, 0]].concat();
    let expected = [&b"iltm technician1"[..], &fields].concat();
    assert_eq!(certificate.message()[..], expected);
    assert_eq!(
        certificate.emit()[..],
        [&fields[..], &[0xEF; SIGNATURE]].concat()
    );
}
