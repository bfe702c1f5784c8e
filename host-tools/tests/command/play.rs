//! `iltm play` on a desktop without a screen: mpv shows what the runtime makes of a film, keys do
//! what they say, and what goes wrong in a show does not end it.

use super::desktop::Desktop;
use super::schema;
use super::user::{Ended, User, contains, interrupt};
use fastrand::Rng;
use iltm::compile::shader::integer_shader;
use iltm_runtime::image::Table;
use iltm_runtime::placement::ProjectorPixels;
use iltm_runtime::{FrameSize, Grid};
use iltm_tests::made_up::MadeUp;
use image::{DynamicImage, Rgb, RgbImage, imageops};
use serde_json::{Value, json};
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::UdpSocket;
use std::os::unix::net::UnixStream;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};
use x11rb::connection::Connection;
use x11rb::protocol::randr::ConnectionExt as _;
use x11rb::protocol::xproto::{self, ConnectionExt as _, InputFocus};
use x11rb::protocol::xtest::ConnectionExt as _;
use x11rb::rust_connection::RustConnection;

/// The projector of [`user`]: 336 x 208 pixels in a border of 8.
const SIZE: &str = "352x224";

/// No sound device is needed.
const MPV: &str = "--ao=null --input-ipc-server=socket";

/// Light of the codes by which a picture and what is made of it are rounded.
const ROUNDED: f64 = 3.0 / 255.0;

/// With the table `t.iltm` of a projector of [`SIZE`].
fn user() -> User {
    let user = User::with_capture();
    let settings = user.text("capture/capture.toml");
    let projector = "[projector]\nsize = [352, 224]\nborder = 8\n";
    user.write("capture/capture.toml", format!("{settings}\n{projector}"));
    user.says("solve capture -o t.iltm");
    user
}

/// Makes a film of a second and a half, with sound, in which colours move.
fn film(user: &User, name: &str, rate: u32, format: &str) {
    user.ffmpeg(&format!(
        "-f lavfi -i testsrc2=size={SIZE}:rate={rate} -f lavfi -i sine=frequency=440 -t 1.5 \
         -pix_fmt {format} -c:v ffv1 -c:a flac {name}"
    ));
}

/// A show under way, and its player's socket.
struct Playing<'u> {
    user: &'u User,
    child: Child,
    replies: BufReader<UnixStream>,
}

impl<'u> Playing<'u> {
    fn start(desktop: &Desktop, user: &'u User, line: &str) -> Self {
        Self::with(desktop, user, line, "")
    }

    /// With an option for mpv.
    fn with(desktop: &Desktop, user: &'u User, line: &str, option: &str) -> Self {
        let child = desktop.spawn(user, &format!("play t.iltm {line} -- {MPV} {option}"));
        Self::of(user, child)
    }

    /// Once a film is on the screen.
    fn of(user: &'u User, child: Child) -> Self {
        let socket = user.path("socket");
        let stream = within(60, || UnixStream::connect(&socket).ok());
        let mut show = Self {
            user,
            child,
            replies: BufReader::new(stream),
        };
        within(60, || show.get("time-pos").as_f64());
        show
    }

    fn tell(&mut self, command: &[&str]) -> Value {
        let line = format!("{}\n", json!({ "command": command }));
        self.replies
            .get_mut()
            .write_all(line.as_bytes())
            .expect("mpv listens");
        loop {
            let mut reply = String::new();
            self.replies.read_line(&mut reply).expect("mpv answers");
            let reply: Value = serde_json::from_str(&reply).expect("an object");
            // Others are events.
            if reply.get("error").is_some() {
                return reply;
            }
        }
    }

    fn get(&mut self, property: &str) -> Value {
        self.tell(&["get_property", property])["data"].clone()
    }

    fn key(&mut self, key: &str) {
        assert_eq!(self.tell(&["keypress", key])["error"], "success");
    }

    /// Stands still at a time.
    fn hold(&mut self, seconds: &str) {
        self.tell(&["set", "pause", "yes"]);
        self.tell(&["seek", seconds, "absolute+exact"]);
        within(60, || (self.get("seeking") == false).then_some(()));
    }

    /// What is in the window, once it stands still.
    fn shown(&mut self, name: &str) -> RgbImage {
        let path = self.user.path(name);
        // Without the words that a key brings.
        thread::sleep(Duration::from_millis(500));
        self.tell(&["show-text", "", "1"]);
        let mut before = None;
        within(60, || {
            thread::sleep(Duration::from_millis(500));
            let told = self.tell(&["screenshot-to-file", path.to_str().expect("text"), "window"]);
            assert_eq!(told["error"], "success");
            let now = self.user.picture(name).to_rgb8();
            let still = before.replace(now.clone()) == Some(now.clone());
            still.then_some(now)
        })
    }

    fn end(mut self) -> Ended {
        self.key("q");
        Ended::of(self.child)
    }
}

fn within<T>(seconds: u64, mut of: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = of() {
            return found;
        }
        assert!(
            start.elapsed() < Duration::from_secs(seconds),
            "it took too long"
        );
        thread::sleep(Duration::from_millis(50));
    }
}

/// Largest difference of two pictures in light, and mean difference in codes: near black a code
/// is next to no light, and codes of 8 bits that were compensated are several apart there.
fn apart(a: &RgbImage, b: &RgbImage) -> (f64, f64) {
    assert_eq!(a.dimensions(), b.dimensions());
    let light = |code: u8| (f64::from(code) / 255.0).powf(2.2);
    let (mut most, mut sum) = (0.0_f64, 0.0);
    for (a, b) in a.iter().zip(b.iter()) {
        most = most.max((light(*a) - light(*b)).abs());
        sum += f64::from(a.abs_diff(*b));
    }
    (most, sum / a.len() as f64)
}

/// What the runtime makes of a picture in 16 bits, to the nearest of 8.
fn compensated(user: &User, picture: &RgbImage, tier: &str) -> RgbImage {
    DynamicImage::from(picture.clone())
        .to_rgb16()
        .save(user.path("wanted.png"))
        .unwrap();
    user.says(&format!(
        "compensate t.iltm wanted.png {tier} -o expected.png"
    ));
    DynamicImage::to_rgb8(&user.picture("expected.png"))
}

/// Pixels inside the border.
fn inside(picture: &RgbImage) -> RgbImage {
    imageops::crop_imm(picture, 8, 8, 336, 208).to_image()
}

#[test]
fn a_film_plays_with_what_the_runtime_makes_of_it_and_keys_change_it() {
    let desktop = Desktop::start(&format!("{SIZE}x24"));
    let user = user();
    for (rate, format) in [(24, "yuv420p"), (60, "yuv422p10le"), (30, "bgr0")] {
        let name = format!("{format}.mkv");
        film(&user, &name, rate, format);
        let mut show = Playing::start(&desktop, &user, &name);
        assert_ne!(show.get("current-tracks/audio"), Value::Null);
        show.hold("1.0");
        let found = show.shown("found.png");
        show.key("c");
        let wanted = show.shown("raw.png");
        assert!(apart(&wanted, &found).0 > 0.1, "{format}: nothing was done");
        let expected = compensated(&user, &wanted, "");
        let (most, mean) = apart(&expected, &found);
        // mpv makes RGB of other films in floating point, and what it shows of that is rounded.
        let exact = format == "bgr0";
        assert!(
            exact || most < 0.05 && mean < 0.3,
            "{format}: {most}, mean {mean}"
        );
        assert!(!exact || found == expected, "{most}, mean {mean}");
        // The border is black in both.
        assert!(found.enumerate_pixels().all(|(x, y, pixel)| {
            (8..344).contains(&x) && (8..216).contains(&y) || pixel.0 == [0; 3]
        }));
        if format == "bgr0" {
            show.key("c");
            show.key("-");
            let coarser = show.shown("coarser.png");
            let top = user.json("inspect t.iltm --json")["tiers"]
                .as_array()
                .unwrap()
                .len()
                - 1;
            let expected = compensated(&user, &wanted, &format!("--tier {}", top - 1));
            assert!(expected == coarser);
            show.key("w");
            show.key("c");
            let white = inside(&show.shown("white.png"));
            assert!(white.iter().all(|code| *code == 255));
            show.key("t");
            let card = show.shown("card.png");
            assert!(apart(&inside(&card), &white).0 > 0.5, "no card");
        }
        let ended = show.end();
        assert_eq!(ended.code, 0, "{}", ended.said);
        contains(
            &ended.said,
            &["films       1 begun, 0 that could not be played", "dropped"],
        );
    }
}

#[test]
fn codes_on_the_screen_are_the_runtimes_own_bit_for_bit_at_every_tier() {
    let desktop = Desktop::start(&format!("{SIZE}x24"));
    let user = User::new();
    let size = FrameSize::new(352, 224).unwrap();
    // The border, and the picture inside of it.
    for (case, (rows, cols, channels, border)) in [
        (13, 21, 1, 8),
        (23, 40, 3, 5),
        (1, 33, 3, 0),
        (224, 16, 1, 0),
    ]
    .into_iter()
    .enumerate()
    {
        let grid = Grid::new(rows, cols).unwrap();
        let mut table = MadeUp::of_all_kinds(grid, channels, 5, case as u64);
        table.of_channels = true;
        table.projector = ProjectorPixels::new(size, border);
        if case == 1 {
            table.fine_gains = None;
        }
        user.write("t.iltm", table.image());
        let mut random = Rng::with_seed(case as u64);
        let frame = RgbImage::from_fn(352, 224, |x, y| {
            let inside =
                |at: u32, side: u32| (u32::from(border)..side - u32::from(border)).contains(&at);
            let wanted = [x as u8, random.u8(..), (x * y / 300) as u8];
            Rgb(if inside(x, 352) && inside(y, 224) {
                wanted
            } else {
                [0; 3]
            })
        });
        let [left, top] = [u32::from(border); 2];
        let picture = imageops::crop_imm(&frame, left, top, 352 - 2 * left, 224 - 2 * top);
        picture.to_image().save(user.path("picture.png")).unwrap();
        let line = format!("play t.iltm picture.png -- {MPV} --image-display-duration=inf");
        let mut command = desktop.command(&user, &line);
        if case % 2 == 1 {
            // As on graphics processors of 2010, whose GLSL has no products of 64 bits.
            command.env("MESA_GL_VERSION_OVERRIDE", "3.3");
            command.env("MESA_GLSL_VERSION_OVERRIDE", "330");
        }
        let mut show = Playing::of(&user, command.spawn().expect("a binary"));
        for tier in (0..=table.tiers.len()).rev() {
            let found = show.shown("found.png");
            let expected = compensated(&user, &frame, &format!("--tier {tier}"));
            let (most, mean) = apart(&expected, &found);
            assert!(
                found == expected,
                "case {case}, tier {tier}: {most}, mean {mean}"
            );
            show.key("-");
        }
        let ended = show.end();
        assert_eq!(ended.code, 0, "{}", ended.said);
        assert!(!ended.said.contains("problem"), "{}", ended.said);
    }
}

#[test]
fn a_table_with_more_columns_than_textures_have_is_left_to_the_exported_shader() {
    let size = FrameSize::new(6_000, 4).unwrap();
    for (cols, fits) in [(5_461, true), (5_462, false)] {
        let image = MadeUp::nearly_plain(Grid::new(1, cols).unwrap(), 1, true).image();
        let table = Table::check(&image).unwrap();
        let shader = integer_shader(&table, 0, ProjectorPixels::whole(size));
        assert_eq!(shader.is_some(), fits, "{cols}");
    }
    let image = MadeUp::new(Grid::new(5, 5).unwrap(), 1).image();
    let table = Table::check(&image).unwrap();
    assert!(integer_shader(&table, 0, ProjectorPixels::whole(size)).is_none());
}

#[test]
fn pixels_that_are_not_square_are_shown_as_they_are_meant_and_ctrl_c_ends_a_show() {
    let desktop = Desktop::start(&format!("{SIZE}x24"));
    let user = user();
    let white = "color=white:size=336x208:rate=25,setsar=1/2";
    user.ffmpeg(&format!("-f lavfi -i {white} -t 1 -c:v ffv1 narrow.mkv"));
    let mut show = Playing::start(&desktop, &user, "narrow.mkv");
    show.key("c");
    let shown = show.shown("narrow.png");
    let line = (0..352).map(|x| shown.get_pixel(x, 112)[0]);
    let lit: Vec<usize> = line
        .enumerate()
        .filter(|(_, code)| *code > 128)
        .map(|(x, _)| x)
        .collect();
    assert_eq!((lit.len(), lit.first()), (168, Some(&92)));
    interrupt(&show.child);
    let ended = Ended::of(show.child);
    assert_eq!(ended.code, 0, "{}", ended.said);
    contains(&ended.said, &["films       1 begun"]);
    // A player that outlives `iltm` would still have it.
    assert!(UnixStream::connect(user.path("socket")).is_err());
}

#[test]
fn a_show_goes_on_whatever_happens_and_says_it() {
    let desktop = Desktop::start(&format!("{SIZE}x24"));
    let user = user();
    film(&user, "good.mkv", 25, "yuv420p");
    user.write("damaged.mkv", &user.read("good.mkv")[..600]);
    user.ffmpeg("-i good.mkv -vn sound.mkv");
    let mut show = Playing::start(
        &desktop,
        &user,
        "good.mkv damaged.mkv missing.mkv sound.mkv",
    );
    // The second time around.
    within(30, || {
        show.get("playlist-pos").as_i64().filter(|at| *at != 0)
    });
    within(30, || (show.get("playlist-pos") == 0).then_some(()));
    // Another table, one that is none, and one of another projector.
    user.says("solve capture --keep-ambient -o other.iltm");
    fs::rename(user.path("other.iltm"), user.path("t.iltm")).unwrap();
    within(20, || {
        let shaders = show.get("glsl-shaders").to_string();
        shaders.contains("/1-").then_some(())
    });
    user.write("t.iltm", "no table");
    thread::sleep(Duration::from_secs(2));
    user.write("t.iltm", super::user::table());
    thread::sleep(Duration::from_secs(2));
    assert!(show.get("glsl-shaders").to_string().contains("/1-"));
    let ended = show.end();
    assert_eq!(ended.code, 0, "{}", ended.said);
    contains(
        &ended.said,
        &[
            "missing.mkv: ",
            "damaged.mkv: ",
            "sound.mkv: has no picture",
            "t.iltm has changed and is used from now on",
            "t.iltm: ",
            "another projector or border; the table before goes on",
        ],
    );
}

#[test]
fn a_playlist_is_all_of_its_films_and_one_film_begins_again() {
    let desktop = Desktop::start(&format!("{SIZE}x24"));
    let user = user();
    film(&user, "good.mkv", 25, "yuv420p");
    user.write("list.m3u", "good.mkv\ngood.mkv\n");
    let mut show = Playing::start(&desktop, &user, "list.m3u");
    within(60, || (show.get("playlist-pos") == 1).then_some(()));
    within(60, || (show.get("playlist-pos") == 0).then_some(()));
    assert_eq!(show.end().code, 0);
    let mut show = Playing::start(&desktop, &user, "good.mkv");
    within(60, || (show.get("loop-file") == "inf").then_some(()));
    let ended = show.end();
    contains(&ended.said, &["films       1 begun"]);
}

/// A programme that sends its picture, as OBS does.
#[test]
fn a_stream_is_waited_for_and_what_was_received_is_not_played_again() {
    let desktop = Desktop::start(&format!("{SIZE}x24"));
    let user = user();
    let port = UdpSocket::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    let address = format!("udp://127.0.0.1:{port}");
    let send = || {
        let source = format!("-re -f lavfi -i testsrc2=size={SIZE}:rate=25");
        let coded = "-c:v mpeg2video -b:v 4M -g 5 -f mpegts";
        Command::new("ffmpeg")
            .args(["-v", "quiet"])
            .args(source.split(' '))
            .args(coded.split(' '))
            .arg(format!("{address}?pkt_size=1316"))
            .stdin(Stdio::null())
            .spawn()
            .expect("ffmpeg is there")
    };
    let child = desktop.spawn(&user, &format!("play t.iltm {address} -- {MPV}"));
    thread::sleep(Duration::from_secs(1));
    let mut sender = send();
    let mut show = Playing::of(&user, child);
    assert_eq!(show.get("loop-file"), false);
    assert_eq!(show.get("prefetch-playlist"), false);
    // However long it pauses.
    assert_eq!(show.get("network-timeout"), 0.0);
    sender.kill().expect("it runs");
    sender.wait().expect("it ends");
    let before = within(30, || {
        let time = show.get("time-pos").as_f64();
        thread::sleep(Duration::from_secs(1));
        time.filter(|time| Some(*time) == show.get("time-pos").as_f64())
    });
    let mut sender = send();
    within(30, || {
        show.get("time-pos")
            .as_f64()
            .filter(|now| now.total_cmp(&before).is_ne())
    });
    sender.kill().expect("it runs");
    sender.wait().expect("it ends");
    let ended = show.end();
    assert_eq!(ended.code, 0, "{}", ended.said);
    contains(&ended.said, &["0 that could not be played"]);
}

/// The desktop has no rate of its own.
#[test]
fn late_frames_are_counted_where_the_rate_of_the_display_is_known() {
    let desktop = Desktop::start(&format!("{SIZE}x24"));
    let user = user();
    film(&user, "good.mkv", 25, "yuv420p");
    let show = Playing::start(&desktop, &user, "good.mkv");
    contains(
        &show.end().said,
        &["late ones cannot be told: the display's rate is not known"],
    );
    let mut show = Playing::with(&desktop, &user, "good.mkv", "--override-display-fps=50");
    let late = |show: &mut Playing<'_>| show.get("vo-delayed-frame-count").as_i64();
    within(60, || late(&mut show));
    let player = show.get("pid").to_string();
    let signal = |signal: &str| {
        let sent = Command::new("kill").args([signal, &player]).status();
        assert!(sent.expect("kill is there").success());
    };
    signal("-STOP");
    thread::sleep(Duration::from_millis(700));
    signal("-CONT");
    thread::sleep(Duration::from_secs(2));
    let counted = late(&mut show);
    let said = show.end().said;
    let line = said.lines().find(|line| line.starts_with("frames"));
    let words: Vec<&str> = line.expect("counts").split_whitespace().collect();
    assert_eq!((words[2], words[4]), ("dropped,", "late"), "{said}");
    let told: i64 = words[3].parse().expect("a count");
    assert!(told > 0 && Some(told) >= counted, "{said}: {counted:?}");
}

/// A user of the desktop beside `iltm`.
struct Beside {
    connection: RustConnection,
    root: xproto::Window,
}

impl Beside {
    fn of(desktop: &Desktop) -> Self {
        let (connection, screen) = x11rb::connect(Some(&desktop.display)).expect("it runs");
        let root = connection.setup().roots[screen].root;
        Self { connection, root }
    }

    /// What all displays show together.
    fn sees(&self) -> RgbImage {
        let whole = self.connection.get_geometry(self.root).unwrap();
        let whole = whole.reply().unwrap();
        let format = xproto::ImageFormat::Z_PIXMAP;
        let (width, height) = (whole.width, whole.height);
        let image = self
            .connection
            .get_image(format, self.root, 0, 0, width, height, !0);
        let data = image.unwrap().reply().unwrap().data;
        RgbImage::from_fn(width.into(), height.into(), |x, y| {
            let at = 4 * (x + u32::from(width) * y) as usize;
            image::Rgb([data[at + 2], data[at + 1], data[at]])
        })
    }

    /// Width and height of the window that has the keys.
    fn keys(&self) -> (u16, u16) {
        let focus = self.connection.get_input_focus().unwrap();
        let window = focus.reply().unwrap().focus;
        // None, and whatever the pointer is on, are no windows.
        if window <= 1 {
            return (0, 0);
        }
        let geometry = self.connection.get_geometry(window).unwrap();
        geometry.reply().map_or((0, 0), |of| (of.width, of.height))
    }

    fn takes_the_keys(&self) {
        let focus = self
            .connection
            .set_input_focus(InputFocus::NONE, self.root, 0_u32);
        focus.unwrap().check().unwrap();
    }

    fn clicks(&self, x: i16, y: i16) {
        for (kind, button) in [
            (xproto::MOTION_NOTIFY_EVENT, 0),
            (xproto::BUTTON_PRESS_EVENT, 1),
            (xproto::BUTTON_RELEASE_EVENT, 1),
        ] {
            let faked = self
                .connection
                .xtest_fake_input(kind, button, 0, self.root, x, y, 0);
            faked.unwrap().check().unwrap();
        }
    }

    /// Makes the display at this place the primary one, which the server lists first.
    fn prefers(&self, place: usize) {
        let resources = self
            .connection
            .randr_get_screen_resources_current(self.root);
        let output = resources.unwrap().reply().unwrap().outputs[place];
        let set = self.connection.randr_set_output_primary(self.root, output);
        set.unwrap().check().unwrap();
    }
}

/// The table's projector as two, of 176 columns each, the second lower, and a display of 40 columns for the technician.
#[test]
fn a_wide_frame_lies_over_the_displays_that_are_named() {
    let desktop = Desktop::with_displays(&[(40, 224), (176, 224), (176, 200)]);
    let user = user();
    let beside = Beside::of(&desktop);
    film(&user, "wide.mkv", 25, "bgr0");
    for (name, left) in [("left", 0), ("right", 176)] {
        user.ffmpeg(&format!(
            "-i wide.mkv -vf crop=176:224:{left}:0 -c:v ffv1 {name}.mkv"
        ));
    }
    let two = "--external-file=right.mkv --lavfi-complex=[vid1][vid2]hstack[vo]";
    for (film, option) in [("wide.mkv", ""), ("left.mkv", two)] {
        let line = format!("{film} --display 1,2");
        let mut show = Playing::with(&desktop, &user, &line, option);
        show.hold("1.0");
        let found = show.shown("found.png");
        let sees = beside.sees();
        let operator = imageops::crop_imm(&sees, 0, 0, 40, 224).to_image();
        assert!(operator.iter().all(|code| *code == 0), "{film}");
        let walls = imageops::crop_imm(&sees, 40, 0, 352, 224).to_image();
        assert!(
            apart(&walls, &found).1 < 0.01,
            "{film}: not pixel for pixel"
        );
        show.key("c");
        let wanted = show.shown("raw.png");
        let (most, mean) = apart(&compensated(&user, &wanted, ""), &walls);
        assert!(most < ROUNDED && mean < 0.3, "{film}: {most}, mean {mean}");
        assert!(apart(&wanted, &walls).0 > 0.1, "{film}: nothing was done");
        assert_eq!(beside.keys(), (352, 224));
        // Another window takes the keys, until somebody clicks on the show.
        beside.takes_the_keys();
        beside.clicks(20, 100);
        thread::sleep(Duration::from_millis(500));
        assert_ne!(beside.keys(), (352, 224));
        beside.clicks(300, 100);
        within(10, || (beside.keys() == (352, 224)).then_some(()));
        let ended = show.end();
        assert_eq!(ended.code, 0, "{}", ended.said);
        assert!(!ended.said.contains("problem"), "{}", ended.said);
    }
}

#[test]
fn a_display_that_goes_in_mid_show_is_said_and_ends_a_strict_one() {
    let user = user();
    user.ffmpeg(&format!(
        "-f lavfi -i testsrc2=size={SIZE} -frames:v 1 wide.png"
    ));
    for (strict, code) in [("", 0), ("--strict", 38)] {
        let desktop = Desktop::with_displays(&[(176, 224), (176, 224), (40, 224)]);
        let line = format!("wide.png --display 0,1 {strict}");
        let mut show = Playing::start(&desktop, &user, &line);
        // One that shows none of it.
        desktop.divide(&[(176, 224), (176, 224), (80, 224)]);
        thread::sleep(Duration::from_secs(1));
        assert!(show.get("time-pos").as_f64().is_some());
        desktop.divide(&[(176, 224), (144, 224), (80, 224)]);
        let ended = if code == 0 {
            thread::sleep(Duration::from_secs(1));
            show.end()
        } else {
            Ended::of(show.child)
        };
        assert_eq!(ended.code, code, "{}", ended.said);
        contains(
            &ended.said,
            &["display 1 is gone, or its mode or place changed"],
        );
    }
}

#[test]
fn displays_that_cannot_show_a_wide_frame_are_refused_with_what_there_is() {
    let desktop = Desktop::with_displays(&[(176, 224), (176, 224), (352, 224)]);
    let user = user();
    user.ffmpeg(&format!(
        "-f lavfi -i testsrc2=size={SIZE} -frames:v 1 wide.png"
    ));
    let mut text = String::new();
    for display in ["7", "1,0", "0,0", "0", "0,1,2"] {
        let line = format!("play t.iltm wide.png --display {display} -- {MPV}");
        let refused = Ended::of(desktop.spawn(&user, &line));
        text += &refused.with_code();
    }
    // Numbers are those of `iltm capture`, whatever display is the primary one.
    Beside::of(&desktop).prefers(1);
    user.says("patterns -o c --rows 3 --cols 4 --photos 10 --no-calibration --no-dense");
    for line in [
        "play t.iltm wide.png",
        "capture c --camera 'cp now {photo}'",
    ] {
        let listed = Ended::of(desktop.spawn(&user, &format!("{line} --display 7")));
        contains(&listed.said, &["0 is VNC-1, 176 x 224 pixels at 176, 0"]);
    }
    Beside::of(&desktop).prefers(0);
    let mut other = user.iltm("play t.iltm wide.png --display 0,1");
    let other = Ended::of(
        other
            .env("WAYLAND_DISPLAY", "wayland-0")
            .spawn()
            .expect("a binary"),
    );
    text += &other.with_code();
    insta::assert_snapshot!(text);
    // One display of a desktop of three.
    let mut show = Playing::start(&desktop, &user, "wide.png --display 2");
    show.shown("found.png");
    let found = user.picture("found.png").to_rgb8();
    let sees = Beside::of(&desktop).sees();
    let third = imageops::crop_imm(&sees, 352, 0, 352, 224).to_image();
    assert!(apart(&third, &found).1 < 0.01, "not pixel for pixel");
    assert_eq!(show.end().code, 0);
}

#[test]
fn what_cannot_be_shown_is_refused_with_a_code_of_its_own() {
    let desktop = Desktop::start("320x200x24");
    let user = user();
    film(&user, "good.mkv", 25, "yuv420p");
    let play = |line: &str| {
        let child = desktop.spawn(&user, &format!("play t.iltm {line} -- {MPV}"));
        Ended::of(child)
    };
    let refused = play("good.mkv");
    assert_eq!(refused.code, 33, "{}", refused.said);
    contains(&refused.said, &["320 x 200 pixels", "projector 352 x 224"]);
    let missing = play("missing.mkv");
    assert_eq!(missing.code, 8, "{}", missing.said);
    contains(&missing.said, &["missing.mkv"]);
    let tier = play("good.mkv --tier 99");
    assert_eq!(tier.code, 2, "{}", tier.said);
    let large = Desktop::start(&format!("{SIZE}x24"));
    let line = format!("play t.iltm good.mkv missing.mkv --strict -- {MPV}");
    let strict = Ended::of(large.spawn(&user, &line));
    assert_eq!(strict.code, 38, "{}", strict.said);
    contains(&strict.said, &["missing.mkv"]);
    let line = format!("play t.iltm missing.mkv --strict -- {MPV}");
    let strict = Ended::of(large.spawn(&user, &line));
    assert_eq!(strict.code, 38, "{}", strict.said);
    let line = format!("play t.iltm good.mkv --strict -- {MPV} --fbo-format=none");
    let plain = Ended::of(large.spawn(&user, &line));
    assert_eq!(plain.code, 38, "{}", plain.said);
    contains(
        &plain.said,
        &["nothing is compensated", "--fbo-format=auto"],
    );
    let line = format!("play t.iltm good.mkv --once --json -- {MPV}");
    let once = Ended::of(large.spawn(&user, &line));
    assert_eq!(once.code, 0, "{}", once.said);
    schema::check("play", &once.out);
    assert_eq!(once.json()["films"], 1);
    let mut bare = user.iltm("play t.iltm good.mkv");
    let bare = Ended::of(bare.env("PATH", "").spawn().expect("a binary"));
    assert_eq!(bare.code, 38, "{}", bare.said);
    contains(&bare.said, &["mpv is not installed"]);
}
