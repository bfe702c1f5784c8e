//! `mpirun iltm solve`: the same table from any number of ranks, and what a rank does that fails.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};
use tempfile::tempdir;

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("samples")
        .join(name)
}

/// `iltm` on so many ranks; with 0 it is not MPI that starts it.
fn iltm(ranks: usize) -> Command {
    let program = env!("CARGO_BIN_EXE_iltm");
    if ranks == 0 {
        return Command::new(program);
    }
    let mut command = Command::new("mpirun");
    command
        // In a container everything is root's, and cores are few.
        .env("OMPI_ALLOW_RUN_AS_ROOT", "1")
        .env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1")
        .args(["--oversubscribe", "-n", &ranks.to_string(), program]);
    command
}

fn solve(ranks: usize, capture: &Path, table: &Path) -> Command {
    solve_several(ranks, &[capture], table)
}

fn solve_several(ranks: usize, captures: &[&Path], table: &Path) -> Command {
    let mut command = iltm(ranks);
    command
        .env("SOURCE_DATE_EPOCH", "1000000000")
        .arg("solve")
        .args(captures)
        .args(["--method", "links", "-o"])
        .arg(table);
    command
}

fn words(output: &Output) -> String {
    [&output.stdout, &output.stderr]
        .map(|words| String::from_utf8_lossy(words))
        .concat()
}

#[test]
fn any_number_of_ranks_makes_the_same_bytes_and_says_it_once() {
    let folder = tempdir().unwrap();
    for name in ["m-panels", "m-panels-colour"] {
        // Of the coarsest level there are fewer blocks than seven.
        let tables = [0, 1, 2, 7].map(|ranks| {
            let table = folder.path().join(format!("{name}-{ranks}.iltm"));
            let output = solve(ranks, &sample(name), &table).output().unwrap();
            let words = words(&output);
            assert!(output.status.success(), "{words}");
            assert_eq!(words.matches("predicted to be").count(), 1, "{words}");
            fs::read(table).unwrap()
        });
        assert!(tables.iter().all(|table| *table == tables[0]), "{name}");
    }
}

#[test]
fn a_method_that_is_not_shared_says_so() {
    let folder = tempdir().unwrap();
    let solve = |ranks| {
        let mut command = iltm(ranks);
        command.arg("solve").arg(sample("m-panels")).arg("-o");
        words(&command.arg(folder.path().join("t.iltm")).output().unwrap())
    };
    let note = "`joint` works on one of 2";
    assert!(solve(2).contains(note));
    assert!(!solve(1).contains("ranks:"));
}

#[test]
fn an_error_is_said_once_and_has_its_exit_code() {
    let folder = tempdir().unwrap();
    let nowhere = folder.path().join("nowhere");
    let output = solve(2, &nowhere, &folder.path().join("t.iltm"))
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(3));
    assert_eq!(words(&output).matches("is not a capture").count(), 1);
    let output = iltm(2)
        .args(["solve", "--no-such-option"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(words(&output).matches("--no-such-option").count(), 1);
}

#[test]
fn any_number_of_ranks_makes_the_same_table_of_projectors_that_overlap() {
    let folder = tempdir().unwrap();
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/folded-screen.toml");
    let captures = ["left", "right"].map(|projector| {
        let capture = folder.path().join(projector);
        let order = "--rows 15 --cols 24 --photos 12 --projector 240x150";
        let patterns = iltm(0)
            .args(["patterns", "-o"])
            .arg(&capture)
            .args(order.split(' '))
            .output()
            .unwrap();
        assert!(patterns.status.success(), "{}", words(&patterns));
        let photographs = iltm(0)
            .args(["simulate", "--projector", projector, "--photograph"])
            .args([&capture, &scene])
            .output()
            .unwrap();
        assert!(photographs.status.success(), "{}", words(&photographs));
        capture
    });
    let captures = captures.each_ref().map(PathBuf::as_path);
    let tables = [0, 1, 2, 4].map(|ranks| {
        let table = folder.path().join(format!("{ranks}.iltm"));
        let output = solve_several(ranks, &captures, &table).output().unwrap();
        let words = words(&output);
        assert!(output.status.success(), "{words}");
        assert_eq!(words.matches("predicted to be").count(), 1, "{words}");
        fs::read(table).unwrap()
    });
    assert!(tables.windows(2).all(|pair| pair[0] == pair[1]));
}

/// The process of a rank, once it is there.
fn rank(mpirun: &Child, rank: usize) -> u32 {
    let is_it = |id: &u32| {
        let environment = fs::read(format!("/proc/{id}/environ")).unwrap_or_default();
        let stat = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
        let parent = stat
            .rsplit(')')
            .next()
            .and_then(|rest| rest.split_whitespace().nth(1));
        let wanted = format!("OMPI_COMM_WORLD_RANK={rank}");
        parent == Some(&mpirun.id().to_string())
            && environment
                .split(|byte| *byte == 0)
                .any(|variable| variable == wanted.as_bytes())
    };
    let start = Instant::now();
    loop {
        let all = fs::read_dir("/proc").unwrap();
        let mut all = all.filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok());
        if let Some(found) = all.find(is_it) {
            return found;
        }
        assert!(
            start.elapsed() < Duration::from_mins(1),
            "rank {rank} never came"
        );
        thread::sleep(Duration::from_millis(5));
    }
}

/// Waits until a rank has joined the others: its process has loaded Open MPI's messaging layer.
///
/// A process that dies before it has joined is a failed program to `mpirun`, which then gives no
/// rank's number.
fn wait_until_joined(id: u32) {
    let start = Instant::now();
    while !fs::read_to_string(format!("/proc/{id}/maps"))
        .unwrap_or_default()
        .contains("mca_pml")
    {
        assert!(
            start.elapsed() < Duration::from_mins(1),
            "process {id} never joined"
        );
        thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_rank_that_dies_ends_the_run_with_an_error_and_no_table() {
    for (dies, has_joined) in [(0, false), (0, true), (1, false), (1, true)] {
        let folder = tempdir().unwrap();
        let table = folder.path().join("t.iltm");
        let mut command = solve(2, &sample("m-panels-colour"), &table);
        let run = command
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let id = rank(&run, dies);
        if has_joined {
            wait_until_joined(id);
        }
        let kill = format!("kill -9 {id}");
        let killed = Command::new("sh").args(["-c", &kill]).status().unwrap();
        assert!(killed.success());
        let output = run.wait_with_output().unwrap();
        let words = words(&output);
        assert!(!output.status.success(), "{words}");
        if has_joined {
            assert!(words.contains(&format!("rank {dies}")), "{words}");
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "{words}");
    }
}
