//! GLSL for `TouchDesigner`: a pixel shader for each pass of a table, and a text that says how to
//! connect them.
//!
//! `TouchDesigner` calls an image operator TOP. Each file is for a GLSL TOP, whose images are
//! `sTD2DInputs`, its place `vUV`; both begin at the bottom left.

use super::pictures::{PngTexture, readable};
use super::{Piece, Shader};
use iltm_runtime::image::Table;
use std::fmt::Write;

/// The shaders of a tier of a table, their pictures and `README.md`, by file name; `None` if a
/// picture would be larger than graphics processors take.
///
/// Frames are sRGB, full screen on the projector that the table was made with.
#[must_use]
pub fn glsl_files(table: &Table<'_>, tier: u8) -> Option<Vec<(String, Vec<u8>)>> {
    let shader = Shader::new(table, tier);
    let (width, height) = shader.target_size();
    let (mut files, mut rows, mut made) = (Vec::new(), String::new(), Vec::new());
    // Writing into a string cannot fail.
    for (index, pass) in shader.passes.iter().enumerate() {
        let name = format!(
            "{}-{}",
            index + 1,
            pass.about.to_lowercase().replace(' ', "-")
        );
        let needed = shader.needed(&pass.body);
        let mut inputs = Vec::new();
        if pass.body.contains("FILM(") {
            inputs.push(("FILM_IMAGE", "the film".to_owned()));
        }
        let mut functions = shader.constants();
        for piece in needed {
            let readable = readable(piece, (width, height))?;
            let text = readable.functions;
            functions.push_str(&text.replace("IMG_NORM_PIXEL(", "texture("));
            if let Some(PngTexture { name, file, bytes }) = readable.picture {
                inputs.push((name, file.clone()));
                if files.iter().all(|(before, _)| *before != file) {
                    files.push((file, bytes));
                }
            } else if let Piece::Target(name) = piece {
                let by = made.iter().find(|(target, _)| target == name);
                inputs.push((name, by.map(|(_, file): &(&str, String)| file.clone())?));
            }
        }
        let mut text = format!(
            "// iltm: {}. Connect the images in this order.\n",
            pass.about
        );
        for (place, (image, from)) in inputs.iter().enumerate() {
            let _ = writeln!(text, "#define {image} sTD2DInputs[{place}] // {from}");
        }
        text.push_str(
            "#define PLACE vec2(vUV.s, 1.0 - vUV.t)\n#define FRAME uTD2DInfos[0].res.zw\n",
        );
        if pass.body.contains("FILM(") {
            text.push_str(
                "vec4 FILM(vec2 place) {\n    \
                     return texture(FILM_IMAGE, vec2(place.x, 1.0 - place.y));\n}\n",
            );
        }
        let body = pass.body.replace("PASS()", "iltm_pass()");
        let _ = write!(
            text,
            "{functions}\n{body}\nout vec4 fragColor;\n\n\
             void main() {{\n    fragColor = TDOutputSwizzle(iltm_pass());\n}}\n"
        );
        let file = format!("{name}.frag");
        let size = if let Some(target) = pass.target {
            made.push((target, file.clone()));
            format!("{width} x {height}, 32-bit float (RGBA)")
        } else {
            "that of the projector, as the film".to_owned()
        };
        let images: Vec<String> = inputs.into_iter().map(|(_, from)| from).collect();
        let _ = writeln!(rows, "| `{file}` | {size} | {} |", images.join(", "));
        files.push((file, text.into_bytes()));
    }
    let readme = include_str!("glsl.md").replace("ROWS\n", &rows);
    files.insert(0, ("README.md".to_owned(), readme.into_bytes()));
    Some(files)
}
