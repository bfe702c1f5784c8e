//! Frames a second of `iltm compensate` on Y4M, without decoder and disk.
//!
//! `cargo bench -p iltm --bench compensate` prints the median of several runs for
//! every frame size, grid, tier and number of threads. Frames come through an
//! operating system pipe that a thread of this program feeds, and leave through
//! another that a thread empties, as between programs; both threads' work is in
//! the figures. `-- WORD` runs only the cases whose line contains the word.
//!
//! Beside it stands the processor time of a frame, all threads and the kernel's
//! pipes together (Linux only): it tells what a machine could do that had nothing
//! else to do, while frames a second are those of this machine at this moment.
//!
//! What frames move through memory, and how long `memcpy` takes to move as much, says whether
//! memory limits them.

use iltm::progress::Silent;
use iltm::video::live::Live;
use iltm::video::pipe;
use iltm::video::watch::FileWatch;
use iltm::video::y4m::Header;
use iltm::video::{CompensateOptions, Compensator, Input};
use iltm_runtime::Grid;
use iltm_runtime::image::Table;
use iltm_tests::made_up::MadeUp;
use std::io::{Read, Write};
use std::time::{Duration, Instant};

/// Runs of each case.
const RUNS: usize = 5;

/// Entries that an operator row has at most, twice its mean. For an error of one 8-bit code
/// a 64 x 64 grid needs 2 to 10 a row.
const ENTRIES: usize = 20;

/// One line of the result.
struct Case {
    width: u16,
    height: u16,
    grid: (u16, u16),
    channels: usize,
    tier: u8,
    threads: usize,
    colour: &'static str,
    /// As with `--watch --budget`: a table's file is watched, and the tier follows a
    /// budget of 16 ms.
    live: bool,
}

fn main() {
    let filter = std::env::args().skip(1).find(|word| !word.starts_with('-'));
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    println!("{cores} cores; median and range of {RUNS} runs");
    for case in cases(cores) {
        let name = format!(
            "{} x {} C{}, grid {} x {}, {} channels, tier {}, {} threads{}",
            case.width,
            case.height,
            case.colour,
            case.grid.0,
            case.grid.1,
            case.channels,
            case.tier,
            case.threads,
            if case.live { ", live" } else { "" }
        );
        if filter.as_ref().is_some_and(|word| !name.contains(word)) {
            continue;
        }
        let runs: Vec<(f64, f64)> = (0..RUNS).map(|_| run(&case)).collect();
        let sorted = |of: fn(&(f64, f64)) -> f64| {
            let mut values: Vec<f64> = runs.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let (rates, costs) = (sorted(|run| run.0), sorted(|run| run.1));
        println!(
            "{name:72} {:7.1} frames/s ({:.1} to {:.1}), {:6.2} ms of processor time a frame; {:.0} MB, copied in {:.1} ms",
            rates[RUNS / 2],
            rates[0],
            rates[RUNS - 1],
            costs[RUNS / 2],
            moved(&case) as f64 / 1e6,
            copied(moved(&case)),
        );
    }
}

fn cases(cores: usize) -> Vec<Case> {
    let case = |(width, height), grid, channels, tier, threads, colour| Case {
        width,
        height,
        grid,
        channels,
        tier,
        threads,
        colour,
        live: false,
    };
    let full_hd = (1920, 1080);
    let mut cases = Vec::new();
    for grid in [(13, 21), (16, 24), (48, 64)] {
        cases.push(case(full_hd, grid, 3, 2, cores, "420jpeg"));
    }
    cases.push(Case {
        live: true,
        ..case(full_hd, (16, 24), 3, 2, cores, "420jpeg")
    });
    for tier in [0, 1] {
        cases.push(case(full_hd, (48, 64), 3, tier, cores, "420jpeg"));
    }
    cases.push(case(full_hd, (48, 64), 3, 2, 1, "420jpeg"));
    for colour in ["444", "422", "420p10", "422p10"] {
        cases.push(case(full_hd, (16, 24), 3, 2, cores, colour));
    }
    cases.push(case(full_hd, (16, 24), 1, 2, cores, "420jpeg"));
    cases.push(case(full_hd, (16, 24), 1, 2, cores, "mono"));
    cases.push(case((1280, 720), (16, 24), 3, 2, cores, "420jpeg"));
    cases.push(case((3840, 2160), (16, 24), 3, 2, cores, "420jpeg"));
    cases.push(case((24, 16), (16, 24), 3, 2, cores, "444"));
    cases
}

/// Processor time that this process has used, in milliseconds; not a number where
/// the system does not say.
fn processor_time() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The fields after the name in brackets; a tick is a hundredth of a second.
    let fields = stat
        .rsplit(')')
        .next()
        .unwrap_or_default()
        .split_whitespace();
    let ticks: Vec<f64> = fields
        .skip(11)
        .take(2)
        .filter_map(|f| f.parse().ok())
        .collect();
    if ticks.len() == 2 {
        10.0 * (ticks[0] + ticks[1])
    } else {
        f64::NAN
    }
}

/// The header of a case's stream.
fn header(case: &Case) -> Header {
    let line = format!(
        "YUV4MPEG2 W{} H{} F60:1 Ip C{}",
        case.width, case.height, case.colour
    );
    Header::parse(line.as_bytes()).expect("a header")
}

/// Bytes of a frame that are read or written, without the pipes: its planes both ways, the light
/// of every colour of every pixel both ways, its gain and its ambient light.
fn moved(case: &Case) -> usize {
    let header = header(case);
    2 * header.frame_bytes() + 8 * header.size().pixels() * header.colours()
}

/// Milliseconds in which one thread reads and writes so many bytes together; the least of several.
fn copied(bytes: usize) -> f64 {
    let from = vec![1_u8; bytes / 2];
    let mut to = vec![0_u8; bytes / 2];
    let times = (0..RUNS).map(|_| {
        let start = Instant::now();
        to.copy_from_slice(std::hint::black_box(&from));
        std::hint::black_box(&to);
        1e3 * start.elapsed().as_secs_f64()
    });
    times.fold(f64::INFINITY, f64::min)
}

/// Frames a second and milliseconds of processor time a frame of one run.
fn run(case: &Case) -> (f64, f64) {
    let grid = Grid::new(case.grid.0, case.grid.1).expect("a small grid");
    let image = MadeUp::of_all_kinds(grid, case.channels, ENTRIES, 1).image();
    let table = Table::check(&image).expect("a sample table is whole");
    let settings = CompensateOptions {
        tier: Some(case.tier),
        threads: case.threads,
        ..CompensateOptions::default()
    };
    let compensator = Compensator::new(&table, settings).expect("threads start");
    let stream = header(case);
    let bytes = stream.frame_bytes();
    // About a second, whatever the size.
    let frames = (400_000_000 / bytes).clamp(20, 20_000);
    let (input, mut feed) = std::io::pipe().expect("a pipe");
    let (mut drain, output) = std::io::pipe().expect("a pipe");
    // As the program does.
    pipe::widen(&input);
    pipe::widen(&output);
    let mut random = fastrand::Rng::with_seed(2);
    let deep = stream.sample_bytes() == 2;
    let sample = |at: usize| match at % 2 {
        1 if deep => random.u8(0..4),
        _ => random.u8(40..200),
    };
    let samples: Vec<u8> = (0..bytes).map(sample).collect();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            feed.write_all(stream.line())?;
            feed.write_all(b"\n")?;
            for _ in 0..frames {
                feed.write_all(b"FRAME\n")?;
                feed.write_all(&samples)?;
            }
            Ok::<_, std::io::Error>(())
        });
        scope.spawn(move || {
            let mut buffer = vec![0; 1 << 20];
            while drain.read(&mut buffer)? > 0 {}
            Ok::<_, std::io::Error>(())
        });
        let (start, before) = (Instant::now(), processor_time());
        let done = if case.live {
            let file = tempfile::NamedTempFile::new().expect("a file");
            std::fs::write(file.path(), &image).expect("a table's file");
            let (bytes, watch) =
                FileWatch::read(file.path(), image.len() as u64).expect("the same");
            let live = Live {
                budget: Some(Duration::from_millis(16)),
                newer: &mut || watch.newer(),
                said: &mut |_| {},
            };
            let table = Table::check(&bytes).expect("the same table");
            let compensator = Compensator::new(&table, settings).expect("threads");
            let summary =
                compensator.live(live, Input::of(input).expect("a stream"), output, &Silent);
            summary.expect("a whole stream").frames.frames
        } else {
            let summary = compensator.y4m(input, output, &Silent);
            summary.expect("a whole stream").frames
        };
        assert_eq!(done, frames as u64);
        let rate = frames as f64 / start.elapsed().as_secs_f64();
        (rate, (processor_time() - before) / frames as f64)
    })
}
