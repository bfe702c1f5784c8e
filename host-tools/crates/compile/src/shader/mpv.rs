//! mpv user shader: the passes of a table in one file, which libplacebo takes too.
//!
//! The format is that of mpv's manual, `--glsl-shaders`: each texture and each pass begins with
//! lines of `//!`.

use super::{Piece, Shader, ShaderTexture, Texels};
use iltm_runtime::image::Table;
use std::fmt::Write;

/// How mpv names what passes name.
pub(super) const NAMES: &str = "#define PLACE HOOKED_pos\n\
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
            write_image(&image_of(texture), &mut text);
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

/// The bytes of a texture's numbers.
fn image_of(texture: &ShaderTexture) -> Image {
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
    Image {
        name: texture.name.to_owned(),
        size: texture.size,
        format,
        bytes,
    }
}

/// A texture as mpv takes it.
pub(super) struct Image {
    pub(super) name: String,
    /// Width and height.
    pub(super) size: (usize, usize),
    /// As mpv calls it.
    pub(super) format: &'static str,
    pub(super) bytes: Vec<u8>,
}

/// Writes a texture, its bytes in hexadecimal digits.
pub(super) fn write_image(image: &Image, text: &mut String) {
    const DIGITS: [u8; 16] = *b"0123456789abcdef";
    let Image {
        name,
        size: (width, height),
        format,
        bytes,
    } = image;
    let _ = write!(
        text,
        "//!TEXTURE {name}\n//!SIZE {width} {height}\n//!FORMAT {format}\n\
         //!FILTER NEAREST\n//!BORDER CLAMP\n"
    );
    text.reserve(2 * bytes.len());
    for byte in bytes {
        for digit in [byte >> 4, byte & 0xf] {
            text.push(char::from(DIGITS[usize::from(digit)]));
        }
    }
    text.push_str("\n\n");
}
