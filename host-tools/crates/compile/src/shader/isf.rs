//! ISF (Interactive Shader Format): the passes of a table for `MadMapper`, VDMX, ossia score and
//! others.
//!
//! A file of GLSL that begins with JSON, as the format's reference says
//! (<https://docs.isf.video/ref_json.html>), beside pictures that it imports.
//!
//! Programs that read ISF differ in the version of GLSL: there is nothing in it that 1.20 has not.

use super::Shader;
use super::pictures::{PngTexture, readable};
use iltm_runtime::image::Table;
use std::fmt::Write;

/// How ISF names what passes name.
const NAMES: &str = "#define PLACE vec2(isf_FragNormCoord.x, 1.0 - isf_FragNormCoord.y)\n\
                     #define FRAME frame_size()\n\
                     vec2 frame_size() {\n    return IMG_SIZE(inputImage);\n}\n\
                     vec4 FILM(vec2 place) {\n    \
                         return IMG_NORM_PIXEL(inputImage, vec2(place.x, 1.0 - place.y));\n}\n";

/// The shader of a tier of a table, `iltm.fs`, and its pictures, by file name; `None` if a picture
/// would be larger than graphics processors take.
///
/// Frames are sRGB, full screen on the projector that the table was made with.
#[must_use]
pub fn isf_files(table: &Table<'_>, tier: u8) -> Option<Vec<(String, Vec<u8>)>> {
    let shader = Shader::new(table, tier);
    let (mut files, mut imported, mut targets) = (Vec::new(), Vec::new(), Vec::new());
    let bodies: String = shader.passes.iter().map(|pass| &*pass.body).collect();
    let mut text = format!("{NAMES}{}", shader.constants());
    for piece in shader.needed(&bodies) {
        let readable = readable(piece, shader.target_size())?;
        text.push_str(&readable.functions);
        if let Some(PngTexture { name, file, bytes }) = readable.picture {
            imported.push(format!("    \"{name}\": {{\"PATH\": \"{file}\"}}"));
            files.push((file, bytes));
        }
    }
    let (width, height) = shader.target_size();
    let mut main = String::from("void main() {\n");
    for (index, pass) in shader.passes.iter().enumerate() {
        let name = format!("pass_{index}()");
        // Writing into a string cannot fail.
        let _ = write!(
            text,
            "\n// {}.\n{}",
            pass.about,
            pass.body.replace("PASS()", &name)
        );
        let shown = if let Some(target) = pass.target {
            targets.push(format!(
                "    {{\"TARGET\": \"{target}\", \"WIDTH\": \"{width}\", \"HEIGHT\": \"{height}\", \
                 \"FLOAT\": true}}"
            ));
            name
        } else {
            targets.push("    {}".to_owned());
            format!("compensate ? {name} : FILM(PLACE)")
        };
        let _ = write!(
            main,
            "    if (PASSINDEX == {index}) {{\n        gl_FragColor = {shown};\n    }}\n"
        );
    }
    let head = format!(
        "/*{{\n\
         \x20 \"ISFVSN\": \"2\",\n\
         \x20 \"DESCRIPTION\": \"Cancels the light that bounces between the surfaces of a projection\",\n\
         \x20 \"CREDIT\": \"iltm\",\n\
         \x20 \"CATEGORIES\": [\"Projection\", \"Color Adjustment\"],\n\
         \x20 \"INPUTS\": [\n\
         \x20   {{\"NAME\": \"inputImage\", \"TYPE\": \"image\"}},\n\
         \x20   {{\"NAME\": \"compensate\", \"TYPE\": \"bool\", \"DEFAULT\": true}}\n\
         \x20 ],\n\
         \x20 \"IMPORTED\": {{\n{}\n  }},\n\
         \x20 \"PASSES\": [\n{}\n  ]\n\
         }}*/\n\n",
        imported.join(",\n"),
        targets.join(",\n"),
    );
    files.insert(
        0,
        (
            "iltm.fs".to_owned(),
            format!("{head}{text}\n{main}}}\n").into_bytes(),
        ),
    );
    Some(files)
}
