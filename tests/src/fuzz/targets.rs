//! Table of the fuzz targets: all of them by name, with good inputs to start from.

use super::{files, session};
use crate::made_up::MadeUp;
use crate::simulated::host_tools;
use crate::{wedge_table, wedge_table_for};
use iltm::picture::Response;
use iltm_runtime::placement::ProjectorPixels;
use iltm_runtime::{FrameSize, Grid};

/// What is fuzzed.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Its name.
    pub name: &'static str,
    /// What must return, whatever the bytes.
    pub run: fn(&[u8]),
    /// Good inputs.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Bytes before the first group, and bytes of a group, which change together.
    pub groups: (usize, usize),
}

/// All of them.
pub const TARGETS: [Target; 14] = [
    target("session", session::session, stories, (1, session::OP)),
    target("link", super::link, lines, (0, 1)),
    target("messages", super::messages, messages, (0, 1)),
    target("gate", super::gate, gate, (1, 1)),
    target("contents", super::contents, tables, (0, 4)),
    target("flash", super::flash, flashes, (1, 8)),
    target("image", super::image, tables, (0, 4)),
    target(
        "manifest",
        super::manifest,
        || sample("capture.csv"),
        (0, 1),
    ),
    target(
        "settings",
        super::settings,
        || sample("capture.toml"),
        (0, 1),
    ),
    target(
        "scene",
        super::scene,
        || file("scenes/painted-corner.toml"),
        (0, 1),
    ),
    target("mesh", super::mesh, || file("scenes/dome.obj"), (0, 1)),
    target("reference", super::reference, arrays, (0, 1)),
    target("frames", super::frames, streams, (0, 1)),
    target("photograph", super::photograph, super::pictures, (0, 1)),
];

const fn target(
    name: &'static str,
    run: fn(&[u8]),
    seeds: fn() -> Vec<Vec<u8>>,
    groups: (usize, usize),
) -> Target {
    Target {
        name,
        run,
        seeds,
        groups,
    }
}

/// Lives of devices, in the numbers of [`session::Op`].
fn stories() -> Vec<Vec<u8>> {
    let hello = [0, 0, 0, 0];
    let slots = [2, 0, 0, 0];
    let confirm = [19, 2, 0, 0];
    let rollback = [23, 2, 0, 0];
    let restart = [34, 0, 0, 0];
    let again = [27, 0, 0, 0];
    let over = [33, 0, 0, 250];
    let send = |file: u8, sparing: u8| [11, 1, file, 1 - sparing];
    let provision = [26, 0, 1, 0];
    let begin = |file: u8| [5, 1, file, 200];
    let write = |file: u8, chunk: u8| [7, 1, file, 0xF0 | chunk];
    let activate = |file: u8| [17, 1, file, 9];
    let cut = |steps: u8| [35, 0, 0, steps];
    let put = |slot: u8, file: u8| [39, 1, file, slot];
    let rot = |slot: u8, at: u8| [37, 0x40 | slot, at, 0];
    let stories: [&[[u8; 4]]; 9] = [
        &[
            hello,
            send(0, 0),
            confirm,
            send(8, 0),
            confirm,
            rollback,
            restart,
        ],
        &[
            hello,
            send(0, 0),
            confirm,
            send(6, 1),
            over,
            hello,
            send(8, 1),
            rollback,
        ],
        &[
            hello,
            begin(2),
            write(2, 0),
            write(2, 1),
            write(2, 2),
            write(2, 3),
            activate(2),
        ],
        &[
            hello,
            provision,
            send(1, 0),
            confirm,
            send(2, 0),
            confirm,
            rollback,
            restart,
        ],
        &[
            hello,
            provision,
            send(2, 0),
            confirm,
            send(3, 1),
            confirm,
            rollback,
        ],
        &[
            hello,
            send(8, 0),
            cut(60),
            confirm,
            hello,
            slots,
            send(8, 1),
            confirm,
        ],
        &[
            hello,
            send(0, 0),
            confirm,
            again,
            send(4, 0),
            confirm,
            rollback,
            again,
        ],
        &[put(0, 0), put(1, 2), hello, begin(8), slots, restart],
        &[
            hello,
            send(0, 0),
            confirm,
            send(8, 0),
            confirm,
            rot(1, 30),
            hello,
            rollback,
        ],
    ];
    let stories = stories.iter().map(|story| story.as_flattened());
    (0..8)
        .flat_map(|flash| stories.clone().map(move |story| [&[flash], story].concat()))
        .collect()
}

fn lines() -> Vec<Vec<u8>> {
    let mut bytes = super::HELLO.to_vec();
    bytes.extend(super::SUBSCRIBE);
    bytes.extend([0; 60]);
    vec![bytes]
}

fn messages() -> Vec<Vec<u8>> {
    let mut all: Vec<Vec<u8>> = (0..11).map(|kind| vec![kind; 40]).collect();
    all.push([&[1, 0, 1, 0, 7][..], b"made-up", &[1; 60]].concat());
    all.push([&[5, 0x80, 4][..], &[7; 16]].concat());
    all.push([&[6, 1, 2, 3, 0, 32][..], &[7; 32]].concat());
    all
}

fn gate() -> Vec<Vec<u8>> {
    let files = files::files().iter();
    files
        .flat_map(|file| (0..5).map(|demands| [&[demands * 5], &file.bytes[..]].concat()))
        .collect()
}

fn tables() -> Vec<Vec<u8>> {
    let mut placed = MadeUp::of_all_kinds(Grid::new(2, 3).expect("small"), 1, 3, 1);
    let size = FrameSize::new(64, 40).expect("not empty");
    placed.projector = ProjectorPixels::new(size, 5);
    let others = Grid::new(1, 4).expect("small");
    let one_of_three = placed.clone().with_neighbours(others, [1, 1], 2);
    let mut all = vec![
        wedge_table(3, 4, 3),
        wedge_table(4, 4, 1),
        placed.image(),
        one_of_three.image(),
    ];
    all.extend(
        [(1, 1), (2, 3)].map(|(rows, cols)| wedge_table_for(Response::Linear, rows, cols, 1)),
    );
    all
}

fn flashes() -> Vec<Vec<u8>> {
    let file = |slot: u8, file: u8| [1, slot, file, 0, 0, 0, 0, 0];
    let commit =
        |place: u8, sequence: u8, slot: u8, file: u8| [5, place, sequence, slot, file, 0, 0x80, 0];
    let identity = [4, 0, 0, 0, 0, 0, 0, 0];
    let all: [&[[u8; 8]]; 5] = [
        &[file(0, 0), commit(0, 1, 0, 0), commit(1, 2, 2, 0)],
        &[file(0, 2), file(1, 3), commit(0, 7, 1, 3), identity],
        &[identity, file(0, 2), commit(0, 3, 0, 2), commit(1, 4, 1, 3)],
        &[file(1, 0), commit(4, 9, 1, 0), [0, 200, 1, 2, 3, 4, 5, 6]],
        &[],
    ];
    let all = all.iter().map(|puts| puts.as_flattened());
    (0..3)
        .flat_map(|kind| all.clone().map(move |puts| [&[kind], puts].concat()))
        .collect()
}

/// Two frames of video, 6 x 4 pixels, and a picture.
fn streams() -> Vec<Vec<u8>> {
    let mut stream = b"YUV4MPEG2 W6 H4 F25:1 Ip A1:1 C420jpeg\n".to_vec();
    for luma in [40, 200] {
        stream.extend(b"FRAME\n");
        stream.extend([luma; 24]);
        stream.extend([128; 12]);
    }
    let mut all = sample("patterns/020.png");
    all.push(stream);
    all
}

/// A file of the tools; nothing where the repository is not there.
fn file(name: &str) -> Vec<Vec<u8>> {
    std::fs::read(host_tools().join(name)).into_iter().collect()
}

/// A file of the sample capture.
fn sample(name: &str) -> Vec<Vec<u8>> {
    file(&format!("samples/m-panels/{name}"))
}

/// `NumPy` arrays of a transport between four cells, 32 and 64 bits, in both orders, and
/// of three channels.
fn arrays() -> Vec<Vec<u8>> {
    let array = |kind: &str, fortran: &str, shape: &str, bytes: usize| {
        let mut header =
            format!("{{'descr': '{kind}', 'fortran_order': {fortran}, 'shape': ({shape}), }}");
        // The data begin at a multiple of 64 bytes, after a line break.
        while (10 + header.len() + 1) % 64 > 0 {
            header.push(' ');
        }
        header.push('\n');
        let mut file = b"\x93NUMPY\x01\x00".to_vec();
        file.extend((header.len() as u16).to_le_bytes());
        file.extend(header.bytes());
        file.resize(file.len() + bytes, 0);
        file
    };
    vec![
        array("<f4", "False", "4, 4", 64),
        array("<f8", "True", "4, 4", 128),
        array(">f4", "False", "3, 4, 4", 192),
    ]
}
