//! Capture folder format: what a capture's files are called, hold and must agree in.
//!
//! | file | holds | module |
//! |---|---|---|
//! | `capture.csv`, `calibration.csv` | which picture each photograph shows | `manifest`, `role`, `calibration_role` |
//! | `stripes.csv` | the same of stripes finer than the cells | `stripe_role` |
//! | `capture.toml` | what photographs cannot say about themselves | `settings` |
//! | `patterns/*.png` | which cells are lit | `pattern`, `pattern_set`, `code` |
//! | a folder of stills | pictures of any size, as images to show | `still` |
//! | `photos/*` | PNG, TIFF, JPEG, `OpenEXR` or netpbm | `photo_files`, `picture_file` |
//! | `reference_T.npy` | the transport itself, where it is known | `reference` |
//!
//! `bracket` puts photographs of one pattern with different exposures together, and
//! `sequence` checks all patterns against their roles and each other.

pub(crate) mod bracket;
pub(crate) mod calibration_role;
pub(crate) mod code;
pub(crate) mod error;
pub(crate) mod manifest;
pub(crate) mod pattern;
pub(crate) mod pattern_set;
pub(crate) mod photo_files;
pub(crate) mod picture_file;
#[cfg(test)]
pub(crate) mod picture_tests;
pub(crate) mod reference;
pub(crate) mod role;
pub(crate) mod sequence;
pub(crate) mod settings;
pub(crate) mod still;
pub(crate) mod stripe_role;
