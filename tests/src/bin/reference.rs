//! Reference pages: writes those of the site that are made from the source:
//! `docs/commands.md` and `docs/errors.md`.
//!
//! ```sh
//! cargo run -p iltm-tests --bin reference
//! ```

use iltm_tests::reference_pages;
use std::io;

fn main() -> io::Result<()> {
    for (path, text) in reference_pages::pages()? {
        std::fs::write(&path, text)?;
        println!("{}", path.display());
    }
    Ok(())
}
