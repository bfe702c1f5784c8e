//! `iltm compensate` on a pipe whose table is replaced while frames flow.

use super::user::{Ended, SAMPLE, User, contains};
use std::fs;
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Stdio};
use std::sync::OnceLock;
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

const HEADER: &[u8] = b"YUV4MPEG2 W48 H26 F60:1 C444 XCOLORRANGE=FULL\n";

/// Bytes of a frame with its header.
const FRAME: usize = 6 + 3 * 48 * 26;

/// Two tables of the sample, which differ in brightness.
fn tables() -> &'static [Vec<u8>; 2] {
    static TABLES: OnceLock<[Vec<u8>; 2]> = OnceLock::new();
    TABLES.get_or_init(|| {
        let user = User::new();
        ["0.3", "0.15"].map(|white| {
            let solve = "solve SAMPLE -o made.iltm --photos 20 --white";
            user.says(&format!("{solve} {white}"));
            user.read("made.iltm")
        })
    })
}

fn frame() -> Vec<u8> {
    let grey = [&[140_u8; 48 * 26][..], &[128; 2 * 48 * 26]].concat();
    [b"FRAME\n", grey.as_slice()].concat()
}

/// The frames of the process, one by one as they come.
fn read_frames(mut out: ChildStdout) -> Receiver<Vec<u8>> {
    let (send, frames) = channel();
    thread::spawn(move || {
        let mut header = vec![0; HEADER.len()];
        out.read_exact(&mut header).expect("a header");
        let mut frame = vec![0; FRAME];
        while out.read_exact(&mut frame).is_ok() && send.send(frame.clone()).is_ok() {}
    });
    frames
}

struct Stream {
    child: Child,
    input: ChildStdin,
    frames: Receiver<Vec<u8>>,
}

impl Stream {
    /// Sends a frame and waits for what becomes of it.
    fn next(&mut self) -> Vec<u8> {
        self.input.write_all(&frame()).expect("a pipe");
        self.input.flush().expect("a pipe");
        let waited = self.frames.recv_timeout(Duration::from_mins(1));
        waited.expect("a frame for each frame")
    }

    /// Sends frames until one is other than `old`; it.
    fn until_other_than(&mut self, old: &[u8]) -> Vec<u8> {
        for _ in 0..3_000 {
            let frame = self.next();
            if frame != old {
                return frame;
            }
            thread::sleep(Duration::from_millis(10));
        }
        panic!("the new table is never used");
    }

    /// Closes the input; what people read.
    fn end(self) -> String {
        drop(self.input);
        let ended = Ended::of(self.child);
        assert_eq!(ended.code, 0, "{}", ended.said);
        ended.said
    }
}

#[test]
fn a_table_replaced_while_frames_flow_is_used_and_a_broken_one_is_not() {
    let user = User::new();
    let [first, second] = tables();
    user.write("t.iltm", first);
    let mut command = user.iltm("compensate t.iltm - -o - --watch");
    let mut child = command.stdin(Stdio::piped()).spawn().expect("a binary");
    let mut input = child.stdin.take().expect("a pipe");
    input.write_all(HEADER).expect("a pipe");
    let frames = read_frames(child.stdout.take().expect("a pipe"));
    let mut stream = Stream {
        child,
        input,
        frames,
    };
    let old = stream.next();
    assert_eq!(stream.next(), old);
    // Beside its place, then renamed, as `iltm solve` does.
    user.write("beside", second);
    user.rename("beside", "t.iltm");
    let new = stream.until_other_than(&old);
    assert_eq!(stream.next(), new);
    // Half a table: for a second and more nothing happens.
    user.write("t.iltm", &first[..first.len() / 2]);
    for _ in 0..100 {
        assert_eq!(stream.next(), new);
        thread::sleep(Duration::from_millis(15));
    }
    user.write("t.iltm", first);
    assert_eq!(stream.until_other_than(&new), old);
    let stays = "the table before stays in use";
    contains(&stream.end(), &[stays, "new tables: 2 taken, 1 refused"]);
}

#[test]
fn a_budget_tells_which_tiers_there_was_time_for() {
    let user = User::new();
    user.write("t.iltm", &tables()[0]);
    user.write("v.y4m", [HEADER, &frame().repeat(40)].concat());
    for (budget, top) in [("0.001", 0), ("10000", 2)] {
        let line = format!("compensate t.iltm v.y4m -o o.y4m --budget {budget}");
        let events = user.events(&line);
        let (end, changes) = events.split_last().expect("at least the end");
        assert_eq!((&end["event"], &end["frames"]), (&"end".into(), &40.into()));
        assert_eq!(end["overruns"], if top == 0 { 40 } else { 0 });
        let tiers = end["tiers"].as_array().expect("a list").len();
        assert!(tiers > top, "{events:?}");
        assert_eq!(changes.len() + 1, tiers, "{events:?}");
    }
}

#[test]
fn what_has_no_frames_to_change_between_is_refused() {
    let user = User::new();
    user.write("t.iltm", &tables()[0]);
    let picture = Path::new(SAMPLE).join("patterns/000.png");
    fs::copy(picture, user.path("p.png")).expect("a copy");
    let said = user.fails(2, "compensate t.iltm p.png -o o.png --budget 16");
    contains(&said, &["still picture"]);
    assert!(!user.path("o.png").exists());
}

/// Mean and largest difference of the samples of two pictures of 16 bits, of the full scale.
fn differences(user: &User, names: [&str; 2]) -> [f64; 2] {
    let [a, b] = names.map(|name| user.picture(name).into_rgb16());
    assert_eq!(a.dimensions(), b.dimensions());
    let each = a.iter().zip(b.iter());
    let each: Vec<f64> = each
        .map(|(a, b)| f64::from(a.abs_diff(*b)) / 65_535.0)
        .collect();
    let mean = each.iter().sum::<f64>() / each.len() as f64;
    [mean, each.iter().copied().fold(0.0, f64::max)]
}

#[test]
fn films_of_ten_bits_are_compensated_as_ffmpegs_pictures_of_them_are() {
    let user = User::with_table();
    for format in [
        "yuv444p10",
        "yuv422p10",
        "yuv420p10",
        "yuv444p12",
        "yuv422p",
    ] {
        // Soft colours: chroma is shared by neighbours, and is not cut.
        user.ffmpeg(&format!(
            "-f lavfi -i gradients=size=320x180:c0=0x604030:c1=0x90a0b0:x0=0:y0=0:x1=319:y1=179:\
             duration=1:rate=1:speed=0.00001 -vf scale=out_color_matrix=bt601:out_range=tv,format={format} \
             -strict -1 film.y4m"
        ));
        user.says("compensate t.iltm film.y4m -o shown.y4m");
        let picture = |film: &str, picture: &str| {
            user.ffmpeg(&format!(
                "-i {film} -vf scale=in_color_matrix=bt601:in_range=tv:\
                 flags=accurate_rnd+full_chroma_int+full_chroma_inp,format=rgb48 -frames:v 1 {picture}"
            ));
        };
        picture("film.y4m", "film.png");
        picture("shown.y4m", "shown.png");
        user.says("compensate t.iltm film.png -o wanted.png");
        let [mean, worst] = differences(&user, ["shown.png", "wanted.png"]);
        println!("{format}: mean {mean:.6}, worst {worst:.6}");
        let [changed, _] = differences(&user, ["film.png", "wanted.png"]);
        assert!(changed > 0.01, "{format}: the table does little: {changed}");
        let code = match format {
            _ if format.ends_with("p10") => 1023.0,
            _ if format.ends_with("p12") => 4095.0,
            _ => 255.0,
        };
        assert!(
            mean * code < 1.0 && worst * code < 4.0,
            "{format}: {mean} {worst}"
        );
    }
}

#[cfg(feature = "gpu")]
#[test]
fn a_graphics_processor_makes_the_same_film_and_where_there_is_none_nothing_is_written() {
    let user = User::with_table();
    user.ffmpeg("-f lavfi -i testsrc2=size=320x180:rate=5:duration=1 -pix_fmt yuv420p film.y4m");
    let plain = user.json("compensate t.iltm film.y4m -o plain.y4m");
    assert!(plain["gpu"].is_null());
    let with_gpu = user.json("compensate t.iltm film.y4m -o gpu.y4m --gpu");
    let name = with_gpu["gpu"].as_str().expect("a name");
    assert!(!name.is_empty());
    assert!(user.read("gpu.y4m") == user.read("plain.y4m"));
    assert_eq!(with_gpu["clipped"], plain["clipped"]);
    let said = user.says("compensate t.iltm film.y4m -o again.y4m --gpu");
    contains(&said, &[name]);
    // One pixel a cell is the processor's work, and is not called another's.
    let picture = Path::new(SAMPLE).join("patterns/000.png");
    fs::copy(picture, user.path("cells.png")).expect("a copy");
    let cells = user.json("compensate t.iltm cells.png -o small.png --gpu");
    assert!(cells["gpu"].is_null());

    let mut command = user.iltm("compensate t.iltm film.y4m -o none.y4m --gpu");
    command.env("VK_DRIVER_FILES", user.path("no-driver.json"));
    command.env("VK_ICD_FILENAMES", user.path("no-driver.json"));
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    let ended = Ended::of(command.spawn().expect("built"));
    assert_eq!(ended.code, 39, "{}", ended.said);
    contains(&ended.said, &["Leave --gpu away"]);
    assert!(!user.path("none.y4m").exists());
}
