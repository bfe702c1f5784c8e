//! Rights: what a device takes to look at one, counted by the firmware's `bench` in the emulator.

use crate::firmware::{counted, elf, memory_with, order};
use iltm::compile::sign::{RightSigner, new_key, new_technician};
use iltm::device::emulator::Board;
use iltm_runtime::trust::Deed;
use std::process::Stdio;

/// Keys of each kind: how long a signature takes depends on it.
const KEYS: usize = 8;

/// Prints the least and the most instructions of rights of either kind of key.
pub fn print() {
    for (kind, is_technician) in [("the site's key", false), ("a technician's key", true)] {
        let mut counts: Vec<u64> = (0..KEYS).map(|_| count(is_technician)).collect();
        counts.sort_unstable();
        println!("{kind}: {} to {} instructions", counts[0], counts[KEYS - 1]);
    }
}

/// Instructions of the right to confirm a table, with a new key.
#[must_use]
pub fn count(is_technician: bool) -> u64 {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [site, technician] = ["site.key", "technician.key"].map(|name| folder.path().join(name));
    let key = new_key(&site).expect("a new file");
    new_technician(&technician, &key, 1, 0).expect("a new file");
    let signer = RightSigner::read(if is_technician { &technician } else { &site });
    let right = signer
        .expect("a key")
        .right(&Deed::Confirm { table: 1 }, 1, 0);
    let memory = memory_with(&[key.verifying_key().as_bytes(), &*right].concat());
    order(&memory, 1, right.len() as u32);
    let mut qemu = counted(Board::An500, &elf(Board::An500, "bench"), &memory, "null");
    let output = qemu.stdout(Stdio::piped()).stderr(Stdio::piped()).output();
    let output = output.expect("qemu-system-arm is installed: tests/run.sh does it");
    // What semihosting prints goes to the emulator's standard error.
    let said = [output.stdout, output.stderr].concat();
    let said = String::from_utf8_lossy(&said);
    said.trim().parse().unwrap_or_else(|_| panic!("{said}"))
}
