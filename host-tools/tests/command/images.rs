//! Sessions with pictures of any content: `iltm patterns --images` and what follows.

use super::simulate::CORNER;
use super::user::{User, contains};
use std::fs;

/// The small scene with more cells and a larger camera, its walls of this colour.
fn scene(albedo: &str) -> String {
    let mut scene = CORNER.to_owned();
    for (from, to) in [
        (
            "rows = 4\ncols = 6",
            "rows = 8\ncols = 12\nresponse = \"srgb\"",
        ),
        ("width = 60\nheight = 44", "width = 160\nheight = 116"),
        ("albedo = 0.8", albedo),
    ] {
        assert!(scene.contains(from), "{from}");
        scene = scene.replace(from, to);
    }
    scene
}

const COLOURED: &str = "albedo = [0.85, 0.7, 0.5]";

/// A picture of a few lights of different colours, half of them soft and half with an edge, other ones
/// for each number.
fn picture(number: u64) -> Vec<u8> {
    let (width, height) = (120, 67);
    let mut dice = fastrand::Rng::with_seed(number);
    let mut one = |most: f64| most * dice.f64();
    let lights: Vec<[f64; 6]> = (0..6)
        .map(|_| {
            [
                one(120.0),
                one(67.0),
                6.0 + one(30.0),
                one(255.0),
                one(255.0),
                one(255.0),
            ]
        })
        .collect();
    let mut bytes = format!("P6\n{width} {height}\n255\n").into_bytes();
    for at in 0..width * height {
        let (x, y) = (f64::from(at % width), f64::from(at / width));
        for channel in 0..3 {
            let light = lights.iter().enumerate().map(|(at, light)| {
                let far = (x - light[0]).hypot(y - light[1]) / light[2];
                let sharp = if far < 1.0 { 0.5 } else { 0.0 };
                let shape = if at % 2 == 0 {
                    sharp
                } else {
                    (-far * far).exp()
                };
                light[3 + channel] * shape
            });
            bytes.push(light.sum::<f64>().min(255.0) as u8);
        }
    }
    bytes
}

/// With a folder of pictures and the photographs of a session that shows some.
fn photographed(scene: &str, images: u64, session: &str) -> User {
    let user = User::new();
    user.write("scene.toml", scene);
    fs::create_dir(user.path("stills")).expect("a folder");
    for number in 0..images {
        user.write(&format!("stills/{number}.ppm"), picture(number));
    }
    let line = "patterns -o c --rows 8 --cols 12 --projector 192x128";
    user.says(&format!("{line} {session}"));
    user.says("simulate scene.toml --photograph c");
    user
}

/// Tables of stills in colour and of random patterns are equally good, and say the same of a
/// picture that neither has seen.
fn stills_teach(scene: &str, session: &str) {
    let user = photographed(scene, 40, &format!("--photos 0 --images stills {session}"));
    let said = user.says("solve c -o stills.iltm --verbose");
    contains(&said, &["14 Gray code, 40 images"]);
    fs::remove_dir_all(user.path("c")).expect("a folder");
    let line = "patterns -o c --rows 8 --cols 12 --projector 192x128 --photos 40";
    user.says(&format!("{line} {session}"));
    user.says("simulate scene.toml --photograph c");
    user.says("solve c -o random.iltm");
    let [stills, random] = ["stills", "random"].map(|table| {
        let inspected = user.json(&format!("inspect {table}.iltm"));
        let error = &inspected["provenance"]["predicted_error"]["compensated"];
        error.as_f64().unwrap_or_else(|| panic!("{inspected}"))
    });
    assert!(stills < 1.5 * random, "{stills} {random}");
    let wanted = image::load_from_memory(&picture(1000)).expect("a picture");
    wanted.save(user.path("wanted.png")).expect("written");
    let made = ["stills", "random"].map(|table| {
        let out = format!("{table}.png");
        user.says(&format!(
            "compensate {table}.iltm wanted.png -o {out} --fit stretch"
        ));
        user.picture(&out).into_rgb8().into_raw()
    });
    let pairs = made[0].iter().zip(&made[1]);
    let square = pairs.map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
    let off = (square.sum::<f64>() / made[0].len() as f64).sqrt();
    assert!(off < 3.0, "{off}");
}

#[test]
fn stills_teach_a_table_as_random_patterns_do() {
    stills_teach(&scene(COLOURED), "");
}

#[test]
fn stills_in_colour_teach_a_camera_that_sees_none() {
    stills_teach(&scene("albedo = 0.8"), "--no-calibration");
}

#[test]
fn stills_that_are_much_alike_end_in_a_table_that_says_how_good_it_is() {
    let user = User::new();
    user.write("scene.toml", scene("albedo = 0.8"));
    fs::create_dir(user.path("stills")).expect("a folder");
    let still = image::load_from_memory(&picture(1)).expect("a picture");
    for number in 1..=24 {
        // A fade, and even pictures, of which a camera without colours sees a share of each.
        let mut still = still.to_rgb8();
        for pixel in still.pixels_mut() {
            for (channel, code) in pixel.0.iter_mut().enumerate() {
                *code = match number % 2 {
                    0 => (u32::from(*code) * number / 24) as u8,
                    _ => (40 + 37 * (number as usize * (channel + 2) % 6)) as u8,
                };
            }
        }
        let path = user.path(&format!("stills/{number}.png"));
        still.save(path).expect("written");
    }
    let line = "--photos 0 --images stills --no-calibration --no-dense";
    user.says(&format!(
        "patterns -o c --rows 8 --cols 12 --projector 192x128 {line}"
    ));
    user.says("simulate scene.toml --photograph c");
    user.says("check c");
    let table = user.json("solve c -o t.iltm");
    let error = table["predicted_error"]["compensated"].as_f64();
    let before = table["predicted_error"]["uncompensated"].as_f64();
    assert!(error > Some(0.0) && error < before, "{table}");
}

#[test]
fn photographs_of_stills_in_the_wrong_places_are_named() {
    let user = photographed(
        &scene(COLOURED),
        12,
        "--photos 20 --images stills --no-calibration --no-dense",
    );
    user.says("check c");
    let list = user.text("c/capture.csv");
    let photos: Vec<String> = (list.lines().filter(|line| line.contains(",image,")))
        .map(|line| line.rsplit(',').next().expect("four columns").to_owned())
        .collect();
    assert_eq!(photos.len(), 12);
    let place = |photo: &String| user.path(&format!("c/{photo}"));
    fs::rename(place(&photos[3]), user.path("a.png")).expect("renamed");
    fs::rename(place(&photos[9]), place(&photos[3])).expect("renamed");
    fs::rename(user.path("a.png"), place(&photos[9])).expect("renamed");
    let refused = user.run("check c");
    assert_eq!(refused.code, 5, "{}", refused.out);
    let exchanged = format!("{} and {} are exchanged", photos[3], photos[9]);
    contains(&refused.out, &[&exchanged]);
}

#[test]
fn folders_without_stills_and_pictures_of_other_sizes_are_refused() {
    let user = User::new();
    let line = "patterns -o c --rows 8 --cols 12 --projector 192x128 --photos 0 --images stills";
    let gone = user.run(line);
    fs::create_dir(user.path("stills")).expect("a folder");
    user.write("stills/notes.txt", "no picture");
    let none = user.run(line);
    user.write("stills/1.ppm", picture(1));
    let few = user.run(line);
    user.write("stills/2.ppm", "P6 no more than this");
    let broken = user.run(line);
    insta::assert_snapshot!(
        [gone, none, few, broken]
            .map(|refused| refused.with_code())
            .concat()
    );
    assert_eq!(user.names(""), ["stills"]);
    // A picture that was scaled after it was shown.
    let user = photographed(
        &scene(COLOURED),
        12,
        "--photos 0 --images stills --no-calibration --no-dense",
    );
    let list = user.text("c/capture.csv");
    let line = (list.lines().find(|line| line.contains(",image,"))).expect("an image");
    let slide = line.split(',').nth(2).expect("four columns");
    user.write(&format!("c/{slide}"), picture(1));
    let refused = user.run("check c");
    contains(
        &refused.said,
        &[slide, "it has 120 x 67 pixels; an image has 192 x 128"],
    );
}

/// Takes the lines of these roles out of a session's list.
fn without(user: &User, roles: &[&str]) {
    let list = user.text("c/capture.csv");
    let kept = list.lines().filter(|line| {
        let role = line.split(',').nth(1).unwrap_or_default();
        !roles.iter().any(|wanted| role.starts_with(wanted))
    });
    let kept: Vec<&str> = kept.collect();
    user.write("c/capture.csv", kept.join("\n") + "\n");
}

/// Photographs of stills, white and black: nothing else says where the cells are.
fn photographed_without_code(images: u64, random: u64) -> User {
    let session = format!("--photos {random} --images stills --no-calibration --no-dense");
    let user = photographed(&scene(COLOURED), images, &session);
    without(&user, &["column", "row"]);
    user
}

/// Where each camera pixel looks, by the capture's map.
fn map(user: &User) -> Vec<[f32; 2]> {
    user.says("check c --map map.exr");
    let map = image::open(user.path("map.exr"))
        .expect("a map")
        .into_rgb32f();
    map.pixels().map(|pixel| [pixel[0], pixel[1]]).collect()
}

#[test]
fn stills_alone_say_where_each_pixel_looks() {
    let user = photographed(&scene(COLOURED), 40, "--photos 0 --images stills");
    let error = |user: &User| {
        let table = user.json("solve c -o t.iltm");
        table["predicted_error"]["compensated"]
            .as_f64()
            .expect("a prediction")
    };
    let (by_stripes, all) = (map(&user), error(&user));
    without(&user, &["column", "row"]);
    fs::remove_file(user.path("c/stripes.csv")).expect("removed");
    let said = user.says("check c --map map.npy");
    contains(
        &said,
        &[
            "from the photographs of images",
            "photographs show their patterns",
        ],
    );
    let by_stills = map(&user);
    let known = |at: &[f32; 2]| !at[0].is_nan();
    let pairs = by_stripes.iter().zip(&by_stills);
    let both = pairs.filter(|(a, b)| known(a) && known(b));
    let mut off: Vec<f32> = both
        .map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]))
        .collect();
    let wanted = by_stripes.iter().filter(|at| known(at)).count();
    off.sort_by(f32::total_cmp);
    let (middle, most) = (off[off.len() / 2], off[off.len() * 95 / 100]);
    // Half of the lights have no edges, and a camera pixel sees more than one of the projector's.
    assert!(off.len() * 100 > 80 * wanted, "{} of {wanted}", off.len());
    assert!(middle < 0.5 && most < 3.0, "{middle} {most}");
    assert!(error(&user) < 1.5 * all);
}

#[test]
fn few_pictures_without_a_gray_code_are_refused() {
    let user = photographed_without_code(19, 40);
    let said = user.fails(4, "check c");
    contains(
        &said,
        &[
            "there is no Gray code of the columns",
            "20 images are needed",
        ],
    );
}

#[test]
fn stills_without_a_gray_code_in_the_wrong_places_are_named() {
    let user = photographed_without_code(24, 0);
    user.says("check c");
    let list = user.text("c/capture.csv");
    let lines: Vec<&str> = list
        .lines()
        .filter(|line| line.contains(",image,"))
        .collect();
    let photo = |at: usize| {
        user.path("c")
            .join(lines[at].rsplit(',').next().expect("a photograph"))
    };
    fs::rename(photo(3), user.path("a.png")).expect("renamed");
    fs::rename(photo(9), photo(3)).expect("renamed");
    fs::rename(user.path("a.png"), photo(9)).expect("renamed");
    contains(&user.run("check c").out, &["are exchanged"]);
}

#[test]
fn stills_tell_the_projectors_response_where_nothing_states_it() {
    // Powers are tried in steps of .05; large ones are found a step off.
    for (response, found) in [
        ("1.8", &["gamma 1.80"][..]),
        ("2.6", &["gamma 2.55", "gamma 2.60", "gamma 2.65"]),
        ("\"srgb\"", &["srgb"]),
    ] {
        let scene =
            scene(COLOURED).replace("response = \"srgb\"", &format!("response = {response}"));
        let user = photographed(&scene, 30, "--photos 0 --images stills --no-calibration");
        let table = user.json("solve c -o t.iltm");
        let says = table["devices"]["projector_response"][0].as_str();
        assert!(says.is_some_and(|says| found.contains(&says)), "{says:?}");
    }
}

#[test]
fn photographs_of_other_pictures_teach_nothing() {
    let user = photographed_without_code(24, 0);
    // Each still is given the photograph of another one.
    let list = user.text("c/capture.csv");
    let (images, others): (Vec<&str>, Vec<&str>) =
        list.lines().partition(|line| line.contains(",image,"));
    let others_of = images.iter().cycle().skip(7);
    let shifted = images.iter().zip(others_of).map(|(line, other)| {
        let (shown, _) = line.rsplit_once(',').expect("four columns");
        let (_, photo) = other.rsplit_once(',').expect("four columns");
        format!("{shown},{photo}\n")
    });
    let shifted: String = shifted.collect();
    user.write("c/capture.csv", others.join("\n") + "\n" + &shifted);
    let refused = user.run("check c");
    assert_eq!(refused.code, 5, "{}", refused.out);
    contains(
        &refused.out,
        &["photographs show another pattern than their line says"],
    );
}

#[test]
fn a_still_of_one_pixel_a_cell_is_even_within_each_cell() {
    let user = User::new();
    user.write("scene.toml", scene(COLOURED));
    fs::create_dir(user.path("stills")).expect("a folder");
    fs::create_dir(user.path("cells")).expect("a folder");
    for number in 0..24 {
        let still = image::load_from_memory(&picture(number)).expect("a picture");
        let cells = still.resize_exact(12, 8, image::imageops::FilterType::Triangle);
        let whole = cells.resize_exact(192, 128, image::imageops::FilterType::Nearest);
        let name = format!("{number:02}.png");
        cells.save(user.path("cells").join(&name)).expect("written");
        whole
            .save(user.path("stills").join(&name))
            .expect("written");
    }
    let line = "patterns -o c --rows 8 --cols 12 --projector 192x128 --photos 0 --images stills";
    user.says(line);
    user.says("simulate scene.toml --photograph c");
    let error = |user: &User| {
        let table = user.json("solve c -o t.iltm");
        table["predicted_error"]["compensated"]
            .as_f64()
            .expect("a prediction")
    };
    let whole = error(&user);
    // The same pictures, named by their cells.
    let list = user.text("c/capture.csv");
    let images: Vec<&str> = list.lines().filter(|l| l.contains(",image,")).collect();
    assert_eq!(images.len(), 24);
    for (at, line) in images.into_iter().enumerate() {
        let slide = line.split(',').nth(2).expect("four columns");
        let small = user.path(&format!("cells/{at:02}.png"));
        fs::copy(small, user.path("c").join(slide)).expect("copied");
    }
    let by_cells = error(&user);
    assert!((by_cells / whole - 1.0).abs() < 0.2, "{by_cells} {whole}");
    // Nothing says where within a cell a pixel looks.
    fs::remove_file(user.path("c/stripes.csv")).expect("removed");
    contains(
        &user.says("check c --map map.npy"),
        &["from the cells alone"],
    );
}

#[test]
fn a_single_cell_needs_no_gray_code() {
    let user = User::new();
    let cells = "rows = 8\ncols = 12";
    user.write(
        "scene.toml",
        scene(COLOURED).replace(cells, "rows = 1\ncols = 1"),
    );
    let line = "patterns -o c --rows 1 --cols 1 --projector 192x128 --photos 12";
    user.says(&format!("{line} --no-calibration --no-dense"));
    user.says("simulate scene.toml --photograph c");
    contains(&user.says("check c"), &["1 of 1 cells were found"]);
}
