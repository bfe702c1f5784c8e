//! `iltm export`: another program's shader makes of a frame what the runtime makes of it. ffmpeg's
//! `libplacebo` filter runs the shader on Mesa's software Vulkan.

use super::user::{User, contains};
use image::{ImageBuffer, Rgb};

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

#[test]
fn a_shader_makes_what_the_runtime_makes_at_every_tier() {
    for (sample, width, height) in [("m-panels", 336, 208), ("m-panels-colour", 384, 256)] {
        let user = User::new();
        let sample = format!("{}/samples/{sample}", env!("CARGO_MANIFEST_DIR"));
        user.says(&format!("solve {sample} -o t.iltm"));
        let frame = frame(width, height);
        frame.save(user.path("in.png")).unwrap();
        let tiers = user.json("inspect t.iltm --json")["tiers"]
            .as_array()
            .unwrap()
            .len();
        assert!(tiers > 3);
        for tier in 0..tiers {
            user.says(&format!(
                "compensate t.iltm in.png --tier {tier} -o expected.png"
            ));
            let said = user.says(&format!(
                "export t.iltm --as mpv --tier {tier} -o shader{tier}"
            ));
            contains(&said, &["--glsl-shader=", "iltm.glsl"]);
            let expected = user.picture("expected.png").to_rgb16();
            let found = by_ffmpeg(&user, &format!("shader{tier}/iltm.glsl"));
            let apart = apart(&expected, &found);
            assert!(apart < 1.0, "{sample}, tier {tier}: {apart}");
            // A frame that nothing was done to would be found out.
            assert!(self::apart(&frame, &found) > 10.0);
        }
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
    for sample in ["m-panels", "m-panels-colour"] {
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
