//! Linker script: the memory layout of the chosen board, put where the linker finds it.

use std::env;
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

/// The reference board's layout; other boards differ from it in a line.
const MEMORY: &str = "../../memory.x";

fn main() -> Result<(), Box<dyn Error>> {
    let manifest = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?);
    let out = PathBuf::from(env::var("OUT_DIR")?);
    let path = manifest.join(MEMORY);
    let mut memory = fs::read_to_string(&path)?;
    if env::var_os("CARGO_FEATURE_MPS2_AN386").is_some() {
        // Application note 386: the same board with a Cortex-M4 and the PSRAM at
        // another address.
        memory = replaced(
            &memory,
            "PSRAM : ORIGIN = 0x60000000",
            "PSRAM : ORIGIN = 0x21000000",
        )?;
    }
    fs::write(out.join("memory.x"), memory)?;
    // Names of the interrupts, for crates that find their handlers by name; the
    // boards here have theirs in a table.
    fs::write(out.join("device.x"), "")?;
    println!("cargo:rustc-link-search={}", out.display());
    for script in ["link.x", "defmt.x"] {
        println!("cargo:rustc-link-arg-bins=-T{script}");
    }
    println!("cargo:rerun-if-changed={}", Path::new(MEMORY).display());
    Ok(())
}

fn replaced(text: &str, from: &str, to: &str) -> Result<String, String> {
    if text.matches(from).count() != 1 {
        return Err(format!("{MEMORY} has no line `{from}`"));
    }
    Ok(text.replace(from, to))
}
