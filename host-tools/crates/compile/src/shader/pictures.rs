//! Pictures of 8 bits that hold a table's numbers, for programs that load no others, and GLSL that
//! reads them as ISF does: `IMG_NORM_PIXEL(image, place)`, from the bottom left.
//!
//! A number has as many bytes as it needs, in the colours of one texel or of several.

use super::{Piece, ShaderTexture, Texels};
use iltm_picture::{Picture, Samples, png};
use iltm_runtime::FrameSize;

/// Largest side of a texture that graphics processors are made for.
pub(super) const MAX_SIDE: usize = 16_384;

/// A piece for such programs.
pub(super) struct Readable {
    /// Its functions.
    pub(super) functions: String,
    /// The picture of a texture.
    pub(super) picture: Option<PngTexture>,
}

/// A texture as a file.
pub(super) struct PngTexture {
    /// Name in the shader.
    pub(super) name: &'static str,
    /// The file's name.
    pub(super) file: String,
    /// The file.
    pub(super) bytes: Vec<u8>,
}

/// `None` if a picture would be larger than graphics processors take.
pub(super) fn readable(piece: &Piece, target_size: (usize, usize)) -> Option<Readable> {
    let (functions, picture) = match piece {
        Piece::Texture(texture) => {
            let (picture, functions) = Encoded::of(texture).finish()?;
            let picture = PngTexture {
                name: texture.name,
                file: format!("{}.png", texture.name.to_lowercase().replace('_', "-")),
                bytes: png::encode(&picture),
            };
            (functions, Some(picture))
        }
        Piece::Target(name) => {
            let texel = reader(name, target_size);
            let kept = include_str!("kept.glsl").replace("NAME", name);
            (texel + &kept, None)
        }
        Piece::Text(functions) => (functions.clone(), None),
    };
    Some(Readable { functions, picture })
}

/// Function `NAME_texel(ivec2)`, a texel of an image of this size, counted from the top left.
fn reader(name: &str, (width, height): (usize, usize)) -> String {
    format!(
        "vec4 {name}_texel(ivec2 at) {{\n    \
             vec2 place = (vec2(at) + 0.5) / vec2({width}.0, {height}.0);\n    \
             return IMG_NORM_PIXEL({name}, vec2(place.x, 1.0 - place.y));\n}}\n"
    )
}

/// A texture as a picture of 8 bits, and what reads it.
struct Encoded<'x> {
    texture: &'x ShaderTexture,
    /// Pictures of the texture's size, one below the other.
    bytes: Vec<u8>,
    /// GLSL that makes a number of the texture from `NAME_bytes(ivec2, int)`, a texel of one of them.
    value: String,
}

impl<'x> Encoded<'x> {
    fn of(texture: &'x ShaderTexture) -> Self {
        let mut encoded = Self {
            texture,
            bytes: Vec::new(),
            value: String::new(),
        };
        match &texture.texels {
            Texels::Sixteen(texels) => encoded.sixteen(texels),
            Texels::Float(texels) => encoded.float(texels),
        }
        encoded
    }

    /// High bytes, and then low ones.
    fn sixteen(&mut self, texels: &[[u16; 3]]) {
        for byte in [1, 0] {
            let bytes = texels.iter().flatten();
            self.bytes.extend(bytes.map(|v| v.to_le_bytes()[byte]));
        }
        let name = self.texture.name;
        self.value =
            format!("vec4((256.0 * {name}_bytes(at, 0) + {name}_bytes(at, 1)) / 65535.0, 1.0)");
    }

    /// Each component that is not the same everywhere in 24 bits between its least and its largest
    /// value; whole numbers as they are.
    fn float(&mut self, texels: &[[f32; 4]]) {
        const STEPS: f32 = 16_777_215.0;
        let mut pictures = 0;
        let components = [0, 1, 2, 3].map(|component: usize| {
            let values = || texels.iter().map(|texel| texel[component]);
            let (least, most) = (
                values().fold(f32::INFINITY, f32::min),
                values().fold(f32::NEG_INFINITY, f32::max),
            );
            if least >= most {
                return format!("{least:.9e}");
            }
            let whole = values().all(|value| value.fract() == 0.0) && most - least <= STEPS;
            let step = if whole { 1.0 } else { (most - least) / STEPS };
            let (from, by) = (f64::from(least), f64::from(step));
            let steps = values().map(|value| ((f64::from(value) - from) / by).round() as u32);
            let bytes =
                steps.flat_map(|steps| steps.min(STEPS as u32).to_be_bytes().into_iter().skip(1));
            self.bytes.extend(bytes);
            pictures += 1;
            let name = self.texture.name;
            let bytes = format!("{name}_bytes(at, {})", pictures - 1);
            format!("{least:.9e} + {step:.9e} * dot({bytes}, vec3(65536.0, 256.0, 1.0))")
        });
        if pictures == 0 {
            self.bytes = vec![0; 3 * texels.len()];
        }
        self.value = format!("vec4({})", components.join(", "));
    }

    /// The picture, and the function `NAME_at(ivec2)`.
    fn finish(self) -> Option<(Picture, String)> {
        let (name, (width, height)) = (self.texture.name, self.texture.size);
        let rows = self.bytes.len() / (3 * width);
        let side = |side: usize| u16::try_from(side).ok().filter(|_| side <= MAX_SIDE);
        let size = FrameSize::new(side(width)?, side(rows)?)?;
        let picture = Picture::new(size, Samples::Eight(self.bytes))?;
        let functions = format!(
            "{}vec3 {name}_bytes(ivec2 at, int picture) {{\n    \
                 ivec2 texel = ivec2(at.x, at.y + {height} * picture);\n    \
                 return floor(255.0 * {name}_texel(texel).rgb + 0.5);\n}}\n\
             vec4 {name}_at(ivec2 at) {{\n    return {};\n}}\n",
            reader(name, (width, rows)),
            self.value,
        );
        Some((picture, functions))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_larger_than_graphics_processors_take_is_refused() {
        for (lines, fits) in [(MAX_SIDE, true), (MAX_SIDE + 1, false)] {
            let texels = (0..lines).map(|line| [line as f32, 0.0, 0.0, 0.0]);
            let texture = ShaderTexture {
                name: "LIST",
                size: (1, lines),
                texels: Texels::Float(texels.collect()),
            };
            assert_eq!(readable(&Piece::Texture(texture), (2, 1)).is_some(), fits);
        }
    }
}
