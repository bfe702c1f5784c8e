//! Areas: code that must not have a defect, and the tests that ought to notice one.

/// Part of the code.
#[derive(Debug)]
pub struct Area {
    /// As it is named on the command line.
    pub name: &'static str,
    /// Its files.
    pub files: &'static [&'static str],
    /// Defects to choose; some of them turn out to lie in constants.
    pub defects: usize,
    /// Tests, the quick ones first.
    pub tests: &'static [Tests],
}

/// Some tests of a package.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Tests {
    /// The package.
    pub package: &'static str,
    /// Its test binary; its name for the unit tests of the library.
    pub target: &'static str,
    /// What they are given.
    pub arguments: &'static [&'static str],
}

const fn tests(
    package: &'static str,
    target: &'static str,
    arguments: &'static [&'static str],
) -> Tests {
    Tests {
        package,
        target,
        arguments,
    }
}

const RUNTIME: Tests = tests("iltm-runtime", "iltm_runtime", &[]);

/// Devices without a firmware, which is compiled from the code as it is.
const DEVICES: Tests = tests(
    "iltm-tests",
    "device",
    &[
        "--skip",
        "firmware",
        "--skip",
        "power_cuts",
        "--skip",
        "upload",
    ],
);

/// Any bytes on the line, in flash and in tables, against a model.
const FOREIGN_BYTES: Tests = tests("iltm-tests", "runtime", &["foreign_bytes"]);

const POWER_CUTS: Tests = tests("iltm-tests", "device", &["power_cuts"]);

const UPLOADS: Tests = tests("iltm-tests", "device", &["upload"]);

/// All of them.
pub const AREAS: &[Area] = &[
    Area {
        name: "store",
        files: &["runtime/src/store/**/*.rs"],
        defects: 36,
        tests: &[RUNTIME, DEVICES, FOREIGN_BYTES, POWER_CUTS],
    },
    Area {
        name: "trust",
        files: &["runtime/src/trust/**/*.rs"],
        defects: 36,
        tests: &[RUNTIME, DEVICES, FOREIGN_BYTES],
    },
    Area {
        name: "link",
        files: &["runtime/src/link/**/*.rs"],
        defects: 36,
        tests: &[RUNTIME, DEVICES, FOREIGN_BYTES, UPLOADS],
    },
    Area {
        name: "exchange",
        files: &["runtime/src/frame_buffers/**/*.rs"],
        defects: 36,
        tests: &[RUNTIME, DEVICES, FOREIGN_BYTES],
    },
    Area {
        name: "gates",
        files: &[
            "host-tools/crates/capture/src/gates/**/*.rs",
            "host-tools/crates/capture/src/photographs/*.rs",
        ],
        defects: 44,
        tests: &[
            tests("iltm-capture", "iltm_capture", &[]),
            tests("iltm-capture", "calibration", &[]),
        ],
    },
    Area {
        name: "verify",
        files: &["host-tools/crates/session/src/verify/*.rs"],
        defects: 44,
        tests: &[
            tests("iltm-session", "iltm_session", &["verify"]),
            tests("iltm", "command", &["verify"]),
        ],
    },
    Area {
        name: "client",
        files: &[
            "host-tools/crates/device/src/*.rs",
            "host-tools/crates/device/src/upload/*.rs",
        ],
        defects: 36,
        tests: &[
            tests("iltm-device", "iltm_device", &[]),
            DEVICES,
            UPLOADS,
            tests("iltm", "command", &["flash::", "device::"]),
            tests("iltm", "command", &["emulate::"]),
        ],
    },
];
