//! mpv user shader: the passes of a table in one file, which libplacebo takes too.
//!
//! The format is that of mpv's manual, `--glsl-shaders`: each texture and each pass begins with
//! lines of `//!`.

use super::{Piece, Shader, ShaderTexture, Texels};
use iltm_runtime::image::Table;
use std::fmt::Write;

/// How mpv names what passes name.
const NAMES: &str = "#define PLACE HOOKED_pos\n\
                     #define FRAME HOOKED_size\n\
                     #define FILM(place) HOOKED_tex(place)\n";

/// The user shader of a tier of a table.
///
/// Frames are sRGB, full screen on the projector that the table was made with.
#[must_use]
pub fn user_shader(table: &Table<'_>, tier: u8) -> String {
    let shader = Shader::new(table, tier);
    let mut text = String::new();
    for piece in &shader.pieces {
        if let Piece::Texture(texture) = piece {
            define(texture, &mut text);
        }
    }
    let (width, height) = shader.target_size();
    // Writing into a string cannot fail.
    for pass in &shader.passes {
        text.push_str("//!HOOK MAIN\n//!BIND HOOKED\n");
        let needed = shader.needed(&pass.body);
        let mut functions = String::new();
        for piece in needed {
            match piece {
                Piece::Texture(ShaderTexture { name, .. }) => {
                    let _ = writeln!(text, "//!BIND {name}");
                    let _ = writeln!(functions, "#define {name}_at(at) texelFetch({name}, at, 0)");
                }
                Piece::Target(name) => {
                    let _ = writeln!(text, "//!BIND {name}");
                    let _ = writeln!(
                        functions,
                        "#define {name}_texel(at) texelFetch({name}_raw, at, 0)"
                    );
                    functions.push_str(&include_str!("kept.glsl").replace("NAME", name));
                }
                Piece::Text(own) => functions.push_str(own),
            }
        }
        if let Some(target) = pass.target {
            let _ = write!(
                text,
                "//!SAVE {target}\n//!WIDTH {width}\n//!HEIGHT {height}\n//!COMPONENTS 4\n"
            );
        }
        let (about, constants) = (pass.about, shader.constants());
        let body = pass.body.replace("PASS()", "hook()");
        let _ = write!(
            text,
            "//!DESC iltm: {about}\n{NAMES}{constants}{functions}{body}\n\n"
        );
    }
    text
}

/// A texture's bytes, in hexadecimal digits.
fn define(texture: &ShaderTexture, text: &mut String) {
    let (format, bytes): (_, Vec<u8>) = match &texture.texels {
        Texels::Sixteen(texels) => {
            let texels = texels.iter();
            let texels = texels.flat_map(|[red, green, blue]| [*red, *green, *blue, u16::MAX]);
            ("rgba16", texels.flat_map(u16::to_le_bytes).collect())
        }
        Texels::Float(texels) => {
            let values = texels.iter().flatten();
            ("rgba32f", values.flat_map(|v| v.to_le_bytes()).collect())
        }
    };
    let (name, (width, height)) = (texture.name, texture.size);
    let _ = write!(
        text,
        "//!TEXTURE {name}\n//!SIZE {width} {height}\n//!FORMAT {format}\n\
         //!FILTER NEAREST\n//!BORDER CLAMP\n"
    );
    for byte in bytes {
        let _ = write!(text, "{byte:02x}");
    }
    text.push_str("\n\n");
}
