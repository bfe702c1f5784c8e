//! Whole captures with something wrong, and what they are refused with.

use super::*;
use crate::test_capture::{TestCapture, save_pattern};
use crate::tests::{capture, read_default};
use iltm_picture::Response;
use proptest::prelude::*;
use std::fs;

/// What reading a changed default capture is refused with.
fn refusal(change: impl FnOnce(&Path, &mut Manifest)) -> CaptureError {
    let error = read_default(capture(change).path()).unwrap_err();
    assert!(error.next_step().ends_with('.'), "{error}");
    error
}

/// Whether a capture was refused by a gate.
fn fails(error: &CaptureError, name: GateName) -> bool {
    matches!(error, CaptureError::Refused { gates, .. } if gates.iter().any(|g| g.name == name))
}

#[test]
fn an_undeclared_camera_curve_is_refused_as_not_linear() {
    let scene = TestCapture {
        full_scale: 255,
        encode: |light| Response::Srgb.value(light),
        ..TestCapture::default()
    };
    let folder = scene.folder();
    let error = read_default(folder.path()).unwrap_err();
    assert!(fails(&error, GateName::Superposition), "{error}");
    assert!(error.next_step().contains("response = \"srgb\""));
}

#[test]
fn missing_roles_and_bits_are_named() {
    let without = |role: Role| refusal(|_, manifest| manifest.shots.retain(|s| s.role != role));
    assert!(matches!(without(Role::Black), CaptureError::NoBlack { .. }));
    assert!(matches!(without(Role::White), CaptureError::NoWhite { .. }));
    let drop_bit = |bit| {
        refusal(|_, manifest| {
            let is_bit = |role| matches!(role, Role::Column { bit: b, .. } if b == bit);
            manifest.shots.retain(|shot| !is_bit(shot.role));
        })
    };
    let error = drop_bit(2).to_string();
    assert!(
        error.contains("the Gray code has 2 column bits, but 6 columns need 3"),
        "{error}"
    );
    let error = drop_bit(1).to_string();
    assert!(
        error.contains("no photograph of column-1, though there is one of column-2"),
        "{error}"
    );
}

#[test]
fn missing_files_are_all_named() {
    let error = refusal(|folder, manifest| {
        fs::remove_file(folder.join("photos/003.png")).unwrap();
        fs::remove_file(folder.join("photos/011.png")).unwrap();
        assert_eq!(manifest.shots.len(), 44);
    });
    let text = error.to_string();
    assert!(
        text.contains("2 of 44 photographs missing: photos/003.png, photos/011.png"),
        "{text}"
    );
    let error = refusal(|folder, _| fs::remove_file(folder.join("patterns/003.png")).unwrap());
    let text = error.to_string();
    assert!(
        text.contains("003.png: missing pattern, named in line 5"),
        "{text}"
    );
    let empty = tempfile::tempdir().unwrap();
    let error = read_default(empty.path()).unwrap_err();
    assert!(matches!(error, CaptureError::NoManifest { .. }), "{error}");
}

#[test]
fn pictures_of_another_size_are_named_with_both_sizes() {
    let error = refusal(|folder, _| {
        image::GrayImage::new(7, 7)
            .save(folder.join("photos/030.png"))
            .unwrap();
    });
    let text = error.to_string();
    assert!(
        text.contains("030.png: 7 x 7 pixels, but") && text.contains("has 47 x 41"),
        "{text}"
    );
    let error = refusal(|folder, _| {
        image::GrayImage::new(7, 5)
            .save(folder.join("patterns/030.png"))
            .unwrap();
    });
    let text = error.to_string();
    assert!(
        text.contains("030.png: 5 x 7 cells") && text.contains("has 5 x 6"),
        "{text}"
    );
}

#[test]
fn a_pattern_that_contradicts_its_role_is_refused() {
    let error = refusal(|folder, _| {
        let patterns = TestCapture::default().patterns();
        save_pattern(&patterns[3].1, &folder.join("patterns/002.png"));
    });
    let text = error.to_string();
    assert!(
        text.contains("002.png: row 0, column 2 is not what \"column-0\" lights"),
        "{text}"
    );
}

#[test]
fn an_overexposed_flood_photograph_is_refused() {
    let scene = TestCapture {
        direct: 1.2,
        ..TestCapture::default()
    };
    let folder = scene.folder();
    let error = read_default(folder.path()).unwrap_err();
    assert!(fails(&error, GateName::Saturation), "{error}");
    assert!(error.to_string().contains("overexposed"), "{error}");
    assert!(error.next_step().contains("shorter exposure"));
}

#[test]
fn photographs_without_projector_light_are_refused() {
    let scene = TestCapture {
        direct: 0.0,
        bounced: 0.0,
        ..TestCapture::default()
    };
    let folder = scene.folder();
    let error = read_default(folder.path()).unwrap_err();
    let nothing = matches!(error, CaptureError::NoLight { .. });
    assert!(nothing || fails(&error, GateName::Coverage), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn a_damaged_capture_is_refused_or_read_but_never_panics(
        file in 0_usize..6,
        damage in proptest::collection::vec((0.0..1.0_f64, any::<u8>()), 1..5),
    ) {
        let folder = capture(|_, _| {});
        fs::write(folder.path().join(SETTINGS_FILE), "[camera]\nresponse = 1.0\n").unwrap();
        let names = [MANIFEST_FILE, SETTINGS_FILE, "patterns/000.png", "patterns/020.png", "photos/000.png", "photos/020.png"];
        let path = folder.path().join(names[file]);
        let mut bytes = fs::read(&path).unwrap();
        for (place, value) in damage {
            let at = (place * bytes.len() as f64) as usize;
            bytes[at] = value;
        }
        fs::write(&path, bytes).unwrap();
        if let Err(error) = read_default(folder.path()) {
            prop_assert!(!error.to_string().is_empty());
        }
    }
}
