//! Growth of time and memory with the number of cells, from simulated photographs to a table
//! with all of its tiers: `cargo run --release -p iltm-tests --bin growth -- docs/results`
//! writes `growth.csv` and `growth.svg`.

use iltm::build_table::{TableOptions, build_table};
use iltm::capture::CaptureOptions;
use iltm::picture::chart::{self, Chart};
use iltm::progress::Silent;
use iltm::solve::{Method, SolveOptions};
use iltm_tests::simulated::{photograph, scene};
use std::path::Path;
use std::process::Command;
use std::time::Instant;

/// Rows, columns, width and height of the photographs, Bernoulli patterns.
const SIZES: [(usize, usize, usize, usize, usize); 4] = [
    (24, 32, 160, 120, 250),
    (48, 64, 320, 240, 250),
    (96, 128, 640, 480, 250),
    (135, 240, 1280, 960, 300),
];

/// Cells up to which `joint` is tried: its memory would be 18 GB for 96 x 128.
const JOINT_CELLS: usize = 48 * 64;

/// Word that makes this program measure one solve and end.
const ONE: &str = "--one";

const HEADING: &str = "method,rows,cols,Bernoulli photographs,seconds,peak megabytes,table bytes,predicted error,error of the best gains alone";

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    match words.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [ONE, capture, method] => one(Path::new(capture), method.parse().expect("a method")),
        [folder] => all(Path::new(folder)),
        _ => panic!("name the folder to write into"),
    }
}

/// Prints seconds, memory, bytes and errors of a solve. The peak of memory is the
/// process's, so every solve has one.
fn one(capture: &Path, method: Method) {
    let options = SolveOptions {
        method: Some(method),
        ..SolveOptions::default()
    };
    let start = Instant::now();
    let photographs = CaptureOptions::default();
    let built = build_table(
        capture,
        &photographs,
        &options,
        &TableOptions::default(),
        &Silent,
    )
    .expect("a good capture");
    let seconds = start.elapsed().as_secs_f64();
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let peak = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))
        .and_then(|text| text.trim().strip_suffix(" kB")?.parse::<f64>().ok())
        .expect("the peak of memory");
    println!(
        "{seconds:.2},{:.0},{},{:.5},{:.5}",
        peak / 1e3,
        built.compiled.image.len(),
        built.predicted_error(),
        built.predicted.gain_only,
    );
}

fn all(folder: &Path) {
    let mut csv = HEADING.to_owned() + "\n";
    let mut curves = vec![
        (Method::Joint, Vec::<(f64, f64)>::new()),
        (Method::Links, Vec::new()),
    ];
    for (rows, cols, width, height, bernoulli) in SIZES {
        let place = tempfile::tempdir().expect("a folder");
        let capture = place.path().join("capture");
        let sizes = [
            ("rows = 96", format!("rows = {rows}")),
            ("cols = 128", format!("cols = {cols}")),
            ("width = 640", format!("width = {width}")),
            ("height = 480", format!("height = {height}")),
        ];
        let sizes = sizes.each_ref().map(|(from, to)| (*from, to.as_str()));
        photograph(&scene("m-panels-fine", &sizes), bernoulli, 1, &capture);
        for (method, points) in &mut curves {
            if *method == Method::Joint && rows * cols > JOINT_CELLS {
                continue;
            }
            let program = std::env::current_exe().expect("this program");
            let ended = Command::new(program)
                .args([ONE, capture.to_str().expect("letters"), &method.to_string()])
                .output()
                .expect("runs");
            assert!(
                ended.status.success(),
                "{}",
                String::from_utf8_lossy(&ended.stderr)
            );
            let said = String::from_utf8(ended.stdout).expect("letters");
            let line = format!("{method},{rows},{cols},{bernoulli},{said}");
            eprint!("{line}");
            csv += &line;
            let seconds = said.split(',').next().and_then(|word| word.parse().ok());
            points.push(((rows * cols) as f64, seconds.expect("seconds")));
        }
    }
    std::fs::write(folder.join("growth.csv"), csv).expect("written");
    std::fs::write(folder.join("growth.svg"), drawn(&curves).file()).expect("written");
}

/// Seconds against cells, and the power by which links grow from 48 x 64 cells on.
fn drawn(curves: &[(Method, Vec<(f64, f64)>)]) -> Chart<'static> {
    let links = curves.last().map_or(&[][..], |(_, points)| points);
    let power = match links {
        [_, first, .., last] => (last.1 / first.1).ln() / (last.0 / first.0).ln(),
        _ => f64::NAN,
    };
    let named = curves.iter();
    let named = named.map(|(method, points)| (method.to_string(), points.clone()));
    let title = "From photographs to a table: time against cells";
    Chart {
        notes: vec![format!(
            "M-shaped panels in grey, 12 bits; links grow as N to the power of {power:.2} from 48 x 64 cells on"
        )],
        size: (640.0, 400.0),
        ..chart::curves(title, ("cells N", "seconds"), named.collect())
    }
}
