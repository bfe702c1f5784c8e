//! NaN: not a number, infinity and denormals wherever a number may come in.

use super::super::case::{Case, CaseOutcome, Trials};
use super::super::grid;
use super::super::observations::Capture;
use iltm::capture::Settings;
use iltm::compile::{CompileOptions, compile};
use iltm::progress::Silent;
use iltm::scene::coaxial::{CoaxialScene, Panels};
use iltm::solve::{Interreflection, InverseTransport, SolveOptions, solve_observed};
use std::path::Path;

const NOT_FINITE: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];

pub(super) const CASES: [Case; 6] = [
    Case {
        name: "light, patterns, ambient, noise or blur that are no numbers",
        reason: "one bad pixel makes a whole sum NaN",
        theory: "every number is looked at before it is used",
        run: observations,
    },
    Case {
        name: "options that are no numbers",
        reason: "a slip of the pen in a script",
        theory: "every option has a range",
        run: options,
    },
    Case {
        name: "an inverse with values that are no numbers",
        reason: "the compiler takes inverses from anywhere",
        theory: "every number is looked at before it is used",
        run: inverses,
    },
    Case {
        name: "settings that are no numbers",
        reason: "capture.toml is written by people",
        theory: "every setting has a range",
        run: settings,
    },
    Case {
        name: "light of 1e-300",
        reason: "squares underflow to zero",
        theory: "light is scaled to 1 before anything else",
        run: |trials| scaled(trials, 1e-300),
    },
    Case {
        name: "denormal light",
        reason: "values of 1e-310 have lost digits, and their reciprocals are infinite",
        theory: "a gain above the largest number is refused",
        run: |trials| scaled(trials, 1e-310),
    },
];

fn capture() -> Capture {
    let grid = grid((5, 8));
    let scene = CoaxialScene::new(grid, &Panels::corner(grid, 75.0), 0.7).textured(0.4, 0.9, 1);
    Capture::new(&scene, 30, 1)
}

/// All must be refused; measured is the first message.
fn all_refused(results: Vec<Result<(), String>>) -> CaseOutcome {
    let count = results.len();
    let messages: Vec<String> = results.into_iter().filter_map(Result::err).collect();
    let measured = format!(
        "{} refused, as: {}",
        messages.len(),
        messages.first().cloned().unwrap_or_default()
    );
    CaseOutcome {
        refused: true,
        ..CaseOutcome::new(
            messages.len() == count,
            format!("{count} of {count} refused"),
            measured,
        )
    }
}

fn observations(trials: Trials) -> CaseOutcome {
    let spoil: [fn(&mut Capture, f64); 5] = [
        |capture, value| capture.light[0][(7, 5)] = value,
        |capture, value| capture.patterns[(7, 5)] = value,
        |capture, value| capture.ambient[7] = value,
        |capture, value| capture.noise = value,
        |capture, value| capture.blur = value,
    ];
    let mut results = Vec::new();
    for spoil in spoil {
        for value in NOT_FINITE {
            let mut capture = capture();
            spoil(&mut capture, value);
            results.push(
                capture
                    .solve(trials.method)
                    .map(|_| ())
                    .map_err(|error| error.to_string()),
            );
        }
    }
    all_refused(results)
}

fn options(trials: Trials) -> CaseOutcome {
    let capture = capture();
    let solve = |options: SolveOptions| {
        let solved = solve_observed(&capture.observed(), &options, &Silent);
        solved.map(|_| ()).map_err(|error| error.to_string())
    };
    let mut results = Vec::new();
    for value in NOT_FINITE {
        results.push(solve(SolveOptions {
            lambda: Some(value),
            ..trials.options()
        }));
        results.push(solve(SolveOptions {
            tolerance: value,
            ..trials.options()
        }));
    }
    let Ok((inverse, _)) = capture.solve(trials.method) else {
        return CaseOutcome::new(false, "an inverse", "none");
    };
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -1.0, 1e300] {
        results.push(compiled(
            &inverse,
            &CompileOptions {
                reference_white: Some(value),
                ..CompileOptions::default()
            },
        ));
    }
    for value in NOT_FINITE {
        results.push(compiled(
            &inverse,
            &CompileOptions {
                inverse_error: value,
                ..CompileOptions::default()
            },
        ));
        results.push(compiled(
            &inverse,
            &CompileOptions {
                targets: Some(vec![value]),
                ..CompileOptions::default()
            },
        ));
    }
    all_refused(results)
}

fn compiled(inverse: &InverseTransport, options: &CompileOptions) -> Result<(), String> {
    compile(inverse, None, options)
        .map(|_| ())
        .map_err(|error| error.to_string())
}

/// The operator with one element of this value.
fn with_element(operator: &Interreflection, value: f64) -> Interreflection {
    let mut elements = operator.dense();
    elements[(3, 4)] = value;
    elements.into()
}

fn inverses(trials: Trials) -> CaseOutcome {
    let Ok((inverse, _)) = capture().solve(trials.method) else {
        return CaseOutcome::new(false, "an inverse", "none");
    };
    let spoil: [fn(&mut InverseTransport, f64); 5] = [
        |inverse, value| inverse.shared = with_element(&inverse.shared, value),
        |inverse, value| inverse.channels[0].gain[3] = value,
        |inverse, value| inverse.channels[0].scale = value,
        |inverse, value| inverse.channels[0].ambient[3] = value,
        |inverse, value| {
            inverse.channels[0].deviation = Some(with_element(&inverse.shared, value));
        },
    ];
    let mut results = Vec::new();
    for spoil in spoil {
        // Too large for any table is as bad.
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
            let mut spoilt = inverse.clone();
            spoil(&mut spoilt, value);
            results.push(compiled(&spoilt, &CompileOptions::default()));
        }
    }
    all_refused(results)
}

fn settings(_: Trials) -> CaseOutcome {
    let mut results = Vec::new();
    for value in ["nan", "inf", "-inf", "-1", "1e300", "true"] {
        for text in [
            format!("[camera]\nresponse = {value}\n"),
            format!("[projector]\nresponse = {value}\n"),
            format!("[projector]\nblur = {value}\n"),
        ] {
            let parsed = Settings::parse(text.as_bytes(), Path::new("capture.toml"));
            results.push(
                parsed
                    .map(|_| ())
                    .map_err(|error| error.to_string().replace('\n', " ")),
            );
        }
    }
    all_refused(results)
}

/// An inverse must be the one of light near 1, or be refused.
fn scaled(trials: Trials, factor: f64) -> CaseOutcome {
    let bound = "the same table as for light near 1, or a refusal";
    let Ok((plain, _)) = capture().solve(trials.method) else {
        return CaseOutcome::new(false, bound, "no inverse");
    };
    let small = capture().map(|light| light * factor);
    match small.solve(trials.method) {
        Ok((found, _)) => {
            let same = found.channels[0].gain.iter().zip(&plain.channels[0].gain);
            let change = same
                .map(|(a, b)| (a * factor / b - 1.0).abs())
                .fold(0.0, f64::max);
            let table = compiled(&found, &CompileOptions::default());
            let holds = change < 1e-6 || table.is_err();
            let refused = table.is_err();
            let measured = table.err();
            let measured = measured.unwrap_or_else(|| format!("gains differ by {change:.1e}"));
            CaseOutcome {
                refused,
                ..CaseOutcome::new(holds, bound, measured)
            }
        }
        Err(error) => CaseOutcome {
            refused: true,
            ..CaseOutcome::new(true, bound, error.to_string())
        },
    }
}
