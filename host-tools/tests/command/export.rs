//! `iltm export`: another program's shader makes of a frame what the runtime makes of it. ffmpeg's
//! `libplacebo` filter runs the shader on Mesa's software Vulkan, and those for other programs too, with
//! the names that these give.

use super::user::{User, contains};
use image::{ImageBuffer, Rgb};
use std::fmt::Write;

/// A frame of 16 bits with what natural ones have: ramps, edges, fine stripes, darks, colours.
fn frame(width: u32, height: u32) -> ImageBuffer<Rgb<u16>, Vec<u16>> {
    ImageBuffer::from_fn(width, height, |x, y| {
        let (u, v) = (
            f64::from(x) / f64::from(width),
            f64::from(y) / f64::from(height),
        );
        let blob = (-20.0 * ((u - 0.7).powi(2) + (v - 0.4).powi(2))).exp();
        let stripes = if u < 0.4 && v > 0.6 {
            f64::from(x % 3) / 2.0
        } else {
            0.0
        };
        let edge = if u + v > 1.3 { 0.5 } else { 0.0 };
        let level = |share: f64| (65_535.0 * share.clamp(0.0, 1.0)).round() as u16;
        Rgb([
            level(0.8 * u * v + 0.3 * stripes + blob),
            level(0.6 * u * u + edge),
            level(0.2 * v + 0.7 * blob + 0.1 * stripes),
        ])
    })
}

/// What ffmpeg makes of `in.png` by a shader.
fn by_ffmpeg(user: &User, shader: &str) -> ImageBuffer<Rgb<u16>, Vec<u16>> {
    let filter = format!(
        "format=rgba64le,hwupload,libplacebo=custom_shader_path={shader}:dithering=-1,\
         hwdownload,format=rgba64le"
    );
    user.ffmpeg(&format!(
        "-init_hw_device vulkan=gpu -filter_hw_device gpu -i in.png -vf '{filter}' out.png"
    ));
    user.picture("out.png").to_rgb16()
}

/// Largest difference, in steps of 8 bits.
fn apart(a: &ImageBuffer<Rgb<u16>, Vec<u16>>, b: &ImageBuffer<Rgb<u16>, Vec<u16>>) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let apart = a.iter().zip(b.iter()).map(|(a, b)| a.abs_diff(*b));
    f64::from(apart.max().unwrap_or(0)) / 257.0
}

/// A pass of a shader that another program than mpv is to run. It reads an image `NAME` by
/// `NAME_norm(place)`, the film among them, which is `film`; images begin at the bottom left.
struct HostedPass {
    /// Name and size of its result.
    target: Option<(String, String, String)>,
    code: String,
}

/// libplacebo as that program, with these pictures.
fn hosted(user: &User, pictures: &[(String, String)], passes: &[HostedPass]) -> String {
    let mut text = String::new();
    let mut names = String::from(
        "#define upright(p) vec2((p).x, 1.0 - (p).y)\n\
         #define place_norm upright(HOOKED_pos)\n\
         #define film_norm(p) HOOKED_tex(upright(p))\n\
         #define film_size HOOKED_size\n",
    );
    let mut bound = Vec::new();
    for (name, path) in pictures {
        let picture = user.picture(path);
        assert_eq!(picture.color(), image::ColorType::Rgb8, "{path}");
        let picture = picture.to_rgba8();
        let (width, height) = picture.dimensions();
        write!(
            text,
            "//!TEXTURE {name}\n//!SIZE {width} {height}\n//!FORMAT rgba8\n//!FILTER LINEAR\n"
        )
        .unwrap();
        for byte in picture.iter() {
            write!(text, "{byte:02x}").unwrap();
        }
        text.push_str("\n\n");
        writeln!(names, "#define {name}_norm(p) texture({name}, upright(p))").unwrap();
        bound.push(name);
    }
    for pass in passes {
        text += "//!HOOK MAIN\n//!BIND HOOKED\n";
        for name in &bound {
            writeln!(text, "//!BIND {name}").unwrap();
        }
        let mut own = names.clone();
        for (target, ..) in passes.iter().filter_map(|pass| pass.target.as_ref()) {
            // What later passes make is not there yet.
            let read = if bound.contains(&target) {
                format!("{target}_tex(upright(p))")
            } else {
                "vec4(0.0)".to_owned()
            };
            writeln!(own, "#define {target}_norm(p) {read}").unwrap();
        }
        if let Some((target, width, height)) = &pass.target {
            write!(
                text,
                "//!SAVE {target}\n//!WIDTH {width}\n//!HEIGHT {height}\n//!COMPONENTS 4\n"
            )
            .unwrap();
            bound.push(target);
        }
        let code = pass.code.replace("void main()", "void hosted()");
        write!(
            text,
            "{own}vec4 shown;\n{code}\n\
             vec4 hook() {{\n    hosted();\n    return shown;\n}}\n\n"
        )
        .unwrap();
    }
    text
}

/// An ISF shader as a host runs it by the format's reference: the JSON says what there is.
fn isf(user: &User, folder: &str, compensate: bool) -> String {
    let shader = std::fs::read_to_string(user.path(&format!("{folder}/iltm.fs"))).unwrap();
    let (json, code) = shader.strip_prefix("/*").unwrap().split_once("*/").unwrap();
    let json: serde_json::Value = serde_json::from_str(json).unwrap();
    assert_eq!(json["ISFVSN"], "2");
    assert_eq!(json["INPUTS"][0]["NAME"], "inputImage");
    assert_eq!(json["INPUTS"][1]["DEFAULT"], true);
    let said = |value: &serde_json::Value| value.as_str().unwrap().to_owned();
    let pictures = json["IMPORTED"].as_object().unwrap().iter();
    let pictures: Vec<_> = pictures
        .map(|(name, picture)| (name.clone(), format!("{folder}/{}", said(&picture["PATH"]))))
        .collect();
    let targets: Vec<Option<(String, String, String)>> = json["PASSES"]
        .as_array()
        .unwrap()
        .iter()
        .map(|pass| {
            pass.get("TARGET").map(|target| {
                assert_eq!(pass["FLOAT"], true);
                (said(target), said(&pass["WIDTH"]), said(&pass["HEIGHT"]))
            })
        })
        .collect();
    let mut code = code
        .replace("IMG_SIZE(inputImage)", "film_size")
        .replace("IMG_NORM_PIXEL(inputImage, ", "film_norm(")
        .replace("isf_FragNormCoord", "place_norm")
        .replace("gl_FragColor", "shown");
    let names = targets.iter().flatten().map(|target| &target.0);
    for name in names.chain(pictures.iter().map(|picture| &picture.0)) {
        code = code.replace(
            &format!("IMG_NORM_PIXEL({name}, "),
            &format!("{name}_norm("),
        );
    }
    assert!(!code.contains("IMG_"), "{code}");
    let pass = |(index, target): (usize, &Option<_>)| HostedPass {
        target: target.clone(),
        code: format!("#define compensate {compensate}\n#define PASSINDEX {index}\n{code}"),
    };
    let passes: Vec<HostedPass> = targets.iter().enumerate().map(pass).collect();
    hosted(user, &pictures, &passes)
}

/// Shaders for `TouchDesigner`, connected as their `README.md` says.
fn touch_designer(user: &User, folder: &str) -> String {
    let read =
        |name: &str| std::fs::read_to_string(user.path(&format!("{folder}/{name}"))).unwrap();
    let readme = read("README.md");
    let rows: Vec<Vec<&str>> = readme
        .lines()
        .filter(|line| line.starts_with("| `"))
        .map(|line| line.split('|').map(str::trim).collect())
        .collect();
    let mut pictures: Vec<(String, String)> = Vec::new();
    let mut passes = Vec::new();
    for row in &rows {
        let [_, file, size, images, _] = row[..] else {
            panic!("{row:?}");
        };
        let file = file.trim_matches('`');
        let mut code = read(file)
            .replace("uTD2DInfos[0].res.zw", "film_size")
            .replace("vUV.s", "place_norm.x")
            .replace("vUV.t", "place_norm.y")
            .replace("out vec4 fragColor;", "")
            .replace("fragColor = TDOutputSwizzle(", "shown = (");
        for (place, image) in images.split(", ").enumerate() {
            // The name that the file gives to the image of this place.
            let end = format!(" sTD2DInputs[{place}] // {image}");
            let line = code
                .lines()
                .find(|line| line.ends_with(&end))
                .unwrap()
                .to_owned();
            let name = line
                .strip_prefix("#define ")
                .unwrap()
                .split(' ')
                .next()
                .unwrap();
            code = code.replace(&line, "");
            let by = if image == "the film" {
                assert_eq!(place, 0);
                "film".to_owned()
            } else if let Some(by) = image.strip_suffix(".frag") {
                format!("MADE_{}", by.split('-').next().unwrap())
            } else {
                let picture = (name.to_owned(), format!("{folder}/{image}"));
                if !pictures.contains(&picture) {
                    pictures.push(picture);
                }
                name.to_owned()
            };
            code = code.replace(&format!("texture({name}, "), &format!("{by}_norm("));
        }
        assert!(
            !code.contains("sTD2DInputs") && !code.contains("texture("),
            "{code}"
        );
        let target = size.strip_suffix(", 32-bit float (RGBA)").map(|size| {
            let (width, height) = size.split_once(" x ").unwrap();
            let name = format!("MADE_{}", file.split('-').next().unwrap());
            (name, width.to_owned(), height.to_owned())
        });
        passes.push(HostedPass { target, code });
    }
    hosted(user, &pictures, &passes)
}

#[test]
fn shaders_make_what_the_runtime_makes_at_every_tier() {
    for (sample, width, height) in [
        ("m-panels", 336, 208),
        ("m-panels-colour", 384, 256),
        ("m-panels --match-black", 336, 208),
    ] {
        let user = User::new();
        let sample = format!("{}/samples/{sample}", env!("CARGO_MANIFEST_DIR"));
        user.says(&format!("solve {sample} -o t.iltm"));
        let frame = frame(width, height);
        frame.save(user.path("in.png")).unwrap();
        let shown_by = |shader: String| {
            user.write("shader.glsl", shader);
            by_ffmpeg(&user, "shader.glsl")
        };
        let tiers = user.json("inspect t.iltm --json")["tiers"]
            .as_array()
            .unwrap()
            .len();
        assert!(tiers > 3);
        let raises = user.json("inspect t.iltm --json")["black"]
            .as_f64()
            .unwrap()
            > 0.0;
        assert_eq!(raises, sample.ends_with("--match-black"));
        for tier in 0..tiers {
            user.says(&format!(
                "compensate t.iltm in.png --tier {tier} -o expected.png"
            ));
            let expected = user.picture("expected.png").to_rgb16();
            let exported = |player: &str, said: &[&str]| {
                let folder = format!("{player}{tier}");
                let line = format!("export t.iltm --as {player} --tier {tier} -o {folder}");
                contains(&user.says(&line), said);
                folder
            };
            let mpv = exported("mpv", &["--glsl-shader=", "iltm.glsl"]);
            let isf_folder = exported("isf", &["iltm.fs", "iltm-gains.png", "load iltm.fs"]);
            let glsl = exported("glsl", &["README.md", "iltm-gains.png", "-pixels.frag"]);
            let shaders = [
                String::from_utf8(user.read(&format!("{mpv}/iltm.glsl"))).unwrap(),
                isf(&user, &isf_folder, true),
                touch_designer(&user, &glsl),
            ];
            for (shader, player) in shaders.into_iter().zip(["mpv", "isf", "glsl"]) {
                let found = shown_by(shader);
                let apart = apart(&expected, &found);
                assert!(apart < 1.0, "{sample}, tier {tier}, {player}: {apart}");
                // A frame that nothing was done to would be found out.
                assert!(self::apart(&frame, &found) > 10.0);
            }
        }
        // Switched off, the film is as it was, but for the filter's half floats.
        let apart = apart(&frame, &shown_by(isf(&user, "isf1", false)));
        assert!(apart < 0.3, "{apart}");
    }
}

/// What a server makes of `in.png` by an alpha and a beta map, `alpha (1 - beta) in + beta`: ffmpeg
/// works it out.
fn mapped(user: &User) -> ImageBuffer<Rgb<u16>, Vec<u16>> {
    let filter = "[0]format=gbrp16[p];[1]format=gbrp16[a];[2]format=gbrp16,split[b][b2];\
                  [b2]negate[nb];[p][a]blend=all_mode=multiply[pa];[pa][nb]blend=all_mode=multiply[pab];\
                  [pab][b]blend=all_mode=addition,format=rgb48";
    let files = "-i in.png -i maps/alpha.png -i maps/beta.png";
    user.ffmpeg(&format!("{files} -filter_complex '{filter}' mapped.png"));
    user.picture("mapped.png").to_rgb16()
}

/// Mean difference, in steps of 8 bits.
fn mean_apart(a: &ImageBuffer<Rgb<u16>, Vec<u16>>, b: &ImageBuffer<Rgb<u16>, Vec<u16>>) -> f64 {
    let sum: f64 = a
        .iter()
        .zip(b.iter())
        .map(|(a, b)| f64::from(a.abs_diff(*b)))
        .sum();
    sum / a.len() as f64 / 257.0
}

#[test]
fn maps_make_even_pictures_what_the_runtime_makes_of_them() {
    for sample in ["m-panels", "m-panels-colour", "m-panels --match-black"] {
        let user = User::new();
        let sample = format!("{}/samples/{sample}", env!("CARGO_MANIFEST_DIR"));
        user.says(&format!("solve {sample} -o t.iltm"));
        let said = user.says("export t.iltm --as maps -o maps");
        contains(&said, &["alpha.png as the alpha map"]);
        assert_eq!(user.names("maps").len(), 6);
        let (width, height) = user.picture("maps/alpha.png").to_rgb16().dimensions();
        // White is exact. Below it the room's light counts for more, and maps cannot know.
        for (code, times) in [(u16::MAX, 1000.0), (48_000, 5.0), (32_000, 3.0)] {
            let even = ImageBuffer::from_pixel(width, height, Rgb([code; 3]));
            even.save(user.path("in.png")).unwrap();
            user.says("compensate t.iltm in.png -o expected.png");
            let expected = user.picture("expected.png").to_rgb16();
            let (found, without) = (mapped(&user), mean_apart(&expected, &even));
            let found = mean_apart(&expected, &found);
            assert!(without > times * found, "{code}: {found}, {without}");
        }
        // Gains are not cut off, and the brightest is as bright as can be.
        let gain = user.picture("maps/gain.exr").to_rgb32f();
        let full = gain.iter().filter(|gain| **gain > 0.99).count();
        assert!(full > 0 && full < gain.len() / 20, "{full}");
    }
}

#[test]
fn what_cannot_be_exported_is_refused_and_nothing_is_written() {
    let user = User::with_table();
    let mut text = String::new();
    for line in [
        "t.iltm --as mpv --tier 99 -o s",
        "missing.iltm --as mpv -o s",
        "t.iltm --as vlc -o s",
    ] {
        text += &user.run(&format!("export {line}")).with_code();
    }
    insta::assert_snapshot!(text);
    assert!(!user.path("s").exists());
}
