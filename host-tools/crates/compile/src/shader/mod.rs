//! Shader: a table as passes over a frame, with its numbers as textures, for players.
//!
//! The frame passes as in the runtime's pipeline: light of the pixels is averaged over the cells,
//! Haar coefficients are taken, the operator makes coefficients of the correction, and those
//! become corrections of the cells. All of these are passes over the grid. The last pass, over the
//! pixels, is `gain * light - correction` and the projector's response.
//!
//! Between passes numbers lie between 0 and 1 and have two texels each, since players keep 16 bits.
//!
//! The passes are the same for all players. How a player names the frame, reads a texel and is
//! told of passes, `mpv.rs`, `isf.rs` and `glsl.rs` say. They take frames of any size and are within
//! a code of the runtime; for one size, `integers.rs` has mpv make the runtime's own codes.

mod glsl;
mod integers;
mod isf;
mod mpv;
mod pictures;

use crate::haar_entries::haar_entries;
pub use glsl::glsl_files;
use iltm_runtime::FrameSize;
use iltm_runtime::haar::Function;
use iltm_runtime::image::Table;
use iltm_runtime::operator::Segment;
use iltm_runtime::response::{RESPONSE_KNOTS, knot_drive};
pub use integers::integer_shader;
pub use isf::isf_files;
pub use mpv::user_shader;
use std::collections::BTreeMap;

/// Texels in a line of a list.
const LINE: usize = 2048;

/// Functions that need no texture, which all passes have.
const COMMON: &str = include_str!("common.glsl");

/// What a pass may need. It needs those before it too that its text names.
enum Piece {
    /// Numbers of the table, `NAME_at(ivec2)`.
    Texture(ShaderTexture),
    /// What an earlier pass made of each cell, `NAME_at(ivec2)`, from texels `NAME_texel(ivec2)`.
    Target(&'static str),
    /// Functions.
    Text(String),
}

/// Numbers of a table.
struct ShaderTexture {
    name: &'static str,
    /// Width and height.
    size: (usize, usize),
    texels: Texels,
}

enum Texels {
    /// 65,535 is 1.
    Sixteen(Vec<[u16; 3]>),
    Float(Vec<[f32; 4]>),
}

/// One pass over the cells, or the last one over the pixels.
struct Pass {
    about: &'static str,
    /// What its result is called, which has two texels for each cell; the last one has none.
    target: Option<&'static str>,
    /// Function `PASS`.
    body: String,
}

/// The passes of a tier of a table.
///
/// Frames are sRGB, full screen on the projector that the table was made with.
struct Shader<'t, 'a> {
    table: &'t Table<'a>,
    pieces: Vec<Piece>,
    passes: Vec<Pass>,
}

impl Piece {
    /// Whether `text` needs it.
    fn is_needed(&self, text: &str) -> bool {
        let functions = match self {
            Self::Texture(ShaderTexture { name, .. }) | Self::Target(name) => {
                return text.contains(&format!("{name}_at("));
            }
            Self::Text(functions) => functions,
        };
        let names = functions
            .lines()
            .filter(|line| !line.starts_with([' ', '}', '#']));
        let mut names = names.filter_map(|line| line.split(['(', ' ']).nth(1));
        names.any(|name| text.contains(&format!("{name}(")))
    }
}

impl<'t, 'a> Shader<'t, 'a> {
    fn new(table: &'t Table<'a>, tier: u8) -> Self {
        let mut shader = Self {
            table,
            pieces: Vec::new(),
            passes: Vec::new(),
        };
        shader.gains();
        shader.ambient();
        shader.response();
        let operator = table.operator().filter(|_| tier > 0);
        if let Some(operator) = operator {
            let own = operator.segments().iter();
            let own: Vec<_> = own.filter(|s| s.tier == tier).copied().collect();
            shader.operator(&own);
        }
        shader.pixels(operator.is_some());
        shader
    }

    /// What every pass begins with.
    fn constants(&self) -> String {
        let grid = self.table.grid();
        let black = self.table.black();
        let (projector, border) = self.table.projector().map_or_else(
            || (FrameSize::of_grid(grid), 0),
            |projector| (projector.size(), projector.border()),
        );
        format!(
            "const ivec2 CELLS = ivec2({}, {});\n\
             const vec2 PROJECTOR = vec2({}, {});\n\
             const float BORDER = float({border});\n\
             const float BLACK = float({black});\n\
             const int LINE = {LINE};\n{COMMON}\n",
            grid.cols(),
            grid.rows(),
            projector.width(),
            projector.height(),
        )
    }

    /// What a pass needs, in its order.
    fn needed(&self, body: &str) -> Vec<&Piece> {
        let mut text = body.to_owned();
        let mut needed = Vec::new();
        for piece in self.pieces.iter().rev() {
            if piece.is_needed(&text) {
                if let Piece::Text(functions) = piece {
                    text.push_str(functions);
                }
                needed.push(piece);
            }
        }
        needed.reverse();
        needed
    }

    /// Texels of a target, two for each cell.
    const fn target_size(&self) -> (usize, usize) {
        let grid = self.table.grid();
        (2 * grid.cols(), grid.rows())
    }

    fn texture(&mut self, name: &'static str, size: (usize, usize), texels: Texels) {
        let texture = ShaderTexture { name, size, texels };
        self.pieces.push(Piece::Texture(texture));
    }

    /// A list of texels in lines of [`LINE`].
    fn list(&mut self, name: &'static str, mut texels: Vec<[f32; 4]>) {
        let lines = texels.len().div_ceil(LINE).max(1);
        texels.resize(lines * LINE, [0.0; 4]);
        self.texture(name, (LINE, lines), Texels::Float(texels));
    }

    /// Values between the texels of a texture or of a target.
    fn between(&mut self, name: &str, (width, height): (usize, usize)) {
        let text = include_str!("between.glsl")
            .replace("NAME", name)
            .replace("WIDTH", &width.to_string())
            .replace("HEIGHT", &height.to_string());
        self.pieces.push(Piece::Text(text));
    }

    /// Gains of the cells and, for frames that have as many pixels, the finer ones.
    fn gains(&mut self) {
        let table = self.table;
        let size = FrameSize::of_grid(table.grid());
        let cells = self.rows(size, |row, channel| table.gain_row(row, channel).collect());
        let size = (size.width(), size.height());
        self.texture("ILTM_GAINS", size, Texels::Sixteen(cells));
        self.between("ILTM_GAINS", size);
        let unit = 65_535.0 * (-f64::from(table.gain_fraction())).exp2();
        let mut finer = String::new();
        if let Some(fine) = table.fine_gain() {
            let size = fine.size();
            let texels = self.rows(size, |row, channel| fine.row(row, channel).collect());
            let (width, height) = (size.width(), size.height());
            self.texture("ILTM_FINE_GAINS", (width, height), Texels::Sixteen(texels));
            self.between("ILTM_FINE_GAINS", (width, height));
            finer = format!(
                "    if (all(greaterThanEqual(area_of(FRAME).zw, vec2({width}, {height})))) {{\n\
                 \x20       return {unit:.9} * ILTM_FINE_GAINS_between(part);\n    }}\n"
            );
        }
        self.pieces.push(Piece::Text(format!(
            "vec3 gain_of(vec2 part) {{\n{finer}    return {unit:.9} * ILTM_GAINS_between(part);\n}}\n"
        )));
    }

    /// Texels of a picture of three channels; a grey table does the same to all.
    fn rows<T: Copy>(&self, size: FrameSize, line: impl Fn(usize, usize) -> Vec<T>) -> Vec<[T; 3]> {
        let channels = usize::from(self.table.channels());
        let of_row = |row: usize| {
            let lines: Vec<Vec<T>> = (0..channels).map(|channel| line(row, channel)).collect();
            (0..size.width()).map(move |x| [0, 1, 2].map(|c: usize| lines[c.min(channels - 1)][x]))
        };
        (0..size.height()).flat_map(of_row).collect()
    }

    /// Ambient light times gain, by cell.
    fn ambient(&mut self) {
        let (grid, table) = (self.table.grid(), self.table);
        let mut above = "light".to_owned();
        if table.ambient_row(0, 0).is_some() {
            let unit = (-f64::from(table.gain_fraction())).exp2();
            let texels = self.rows(FrameSize::of_grid(grid), |row, channel| {
                let ambient = table.ambient_row(row, channel).into_iter().flatten();
                let cells = table.gain_row(row, channel).zip(ambient);
                let driven = cells.map(|(gain, ambient)| {
                    let light = ambient.to_num::<f64>();
                    let gain = f64::from(gain) * unit;
                    (if gain > 0.0 { gain * light } else { light }) as f32
                });
                driven.collect()
            });
            let texels = texels
                .into_iter()
                .map(|[red, green, blue]| [red, green, blue, 1.0]);
            let size = (grid.cols(), grid.rows());
            self.texture("ILTM_AMBIENT", size, Texels::Float(texels.collect()));
            self.between("ILTM_AMBIENT", size);
            "max(light - ILTM_AMBIENT_between(part) / max(gain_of(part), vec3(1e-6)), vec3(0.0))"
                .clone_into(&mut above);
        }
        self.pieces.push(Piece::Text(format!(
            "vec3 above_ambient(vec3 light, vec2 part) {{\n    return {above};\n}}\n"
        )));
    }

    /// Codes by drive, at the runtime's knots.
    fn response(&mut self) {
        if !self.table.has_response() {
            let same = "vec3 code_of(vec3 drive) {\n    return drive;\n}\n";
            self.pieces.push(Piece::Text(same.to_owned()));
            return;
        }
        let channels = usize::from(self.table.channels());
        let curves = [0, 1, 2].map(|c: usize| self.table.response(c.min(channels - 1)));
        let mut texels: Vec<[u16; 3]> = (0..RESPONSE_KNOTS)
            .map(|knot| curves.map(|curve| curve.fine_code(knot_drive(knot))))
            .collect();
        let lines = texels.len().div_ceil(LINE);
        texels.resize(lines * LINE, [u16::MAX; 3]);
        self.texture("ILTM_CODES", (LINE, lines), Texels::Sixteen(texels));
        let dense =
            (1..RESPONSE_KNOTS).take_while(|knot| knot_drive(*knot).to_bits() == *knot as u16);
        let text = include_str!("code.glsl")
            .replace("DENSE", &format!("{}.0", dense.count()))
            .replace("LAST", &format!("{}.0", RESPONSE_KNOTS - 1));
        self.pieces.push(Piece::Text(text));
    }

    fn operator(&mut self, segments: &[Segment<'_>]) {
        let grid = self.table.grid();
        let functions: Vec<Function> = self.table.basis().functions().collect();
        let shapes: Vec<StepFunction> = functions.iter().map(StepFunction::new).collect();
        let mut rows: Vec<BTreeMap<usize, [f64; 3]>> = vec![BTreeMap::new(); functions.len()];
        let entries = haar_entries(self.table, segments);
        for channel in 0..3 {
            for entry in &entries[channel.min(entries.len() - 1)] {
                // The coefficient that is kept is a part of the function's positive mass.
                let norm = (functions[entry.col].squared_norm() as f64).sqrt();
                let mass = functions[entry.col].positive_mass() as f64 / norm;
                rows[entry.row].entry(entry.col).or_default()[channel] += entry.value * mass;
            }
        }
        let ends = |row: &BTreeMap<usize, [f64; 3]>| {
            let of = |channel: usize| {
                row.values()
                    .map(|values| values[channel].abs())
                    .sum::<f64>()
            };
            of(0).max(of(1)).max(of(2)).max(1e-12)
        };
        let bounds: Vec<f64> = rows.iter().map(ends).collect();
        // Rows: where entries start and end, and what the result is a part of.
        let (mut starts, mut list) = (Vec::new(), Vec::new());
        for (row, bound) in rows.iter().zip(&bounds) {
            let start = list.len();
            for (col, values) in row {
                let [red, green, blue] = values.map(|value| (value / bound) as f32);
                list.push([*col as f32, red, green, blue]);
            }
            starts.push([start as f32, list.len() as f32, 0.0, 0.0]);
        }
        let places = shapes.iter().flat_map(StepFunction::places).collect();
        self.list("ILTM_FUNCTIONS", places);
        self.list(
            "ILTM_STEPS",
            shapes.iter().map(StepFunction::values).collect(),
        );
        self.list("ILTM_ROWS", starts);
        self.list("ILTM_ENTRIES", list);
        // What covers each cell.
        let texel = |(index, value): (usize, i64)| {
            let norm = (functions[index].squared_norm() as f64).sqrt();
            [
                index as f32,
                (value as f64 / norm * bounds[index]) as f32,
                0.0,
                0.0,
            ]
        };
        let covering = covering(self.table).into_iter();
        let mut covering: Vec<Vec<[f32; 4]>> = covering
            .map(|list| list.into_iter().map(texel).collect())
            .collect();
        let most = covering.iter().map(Vec::len).max().unwrap_or(0);
        for list in &mut covering {
            list.resize(most, [0.0; 4]);
        }
        self.list("ILTM_COVERING", covering.concat());
        let synthesis = include_str!("synthesis.glsl").replace("MOST", &most.to_string());
        for (about, target, body) in [
            (
                "light of the cells",
                "ILTM_CELLS",
                include_str!("cells.glsl"),
            ),
            (
                "Haar coefficients",
                "ILTM_INPUTS",
                include_str!("analysis.glsl"),
            ),
            ("operator", "ILTM_OUTPUTS", include_str!("operator.glsl")),
            ("corrections", "ILTM_CORRECTIONS", &*synthesis),
        ] {
            self.pieces.push(Piece::Target(target));
            self.passes.push(Pass {
                about,
                target: Some(target),
                body: body.to_owned(),
            });
        }
        self.between("ILTM_CORRECTIONS", (grid.cols(), grid.rows()));
    }

    fn pixels(&mut self, operates: bool) {
        let correction = if operates {
            "(2.0 * ILTM_CORRECTIONS_between(part) - 1.0)"
        } else {
            "vec3(0.0)"
        };
        self.passes.push(Pass {
            about: "pixels",
            target: None,
            body: include_str!("pixels.glsl").replace("CORRECTION", correction),
        });
    }
}

/// Of every cell, the Haar functions that cover it and their values there.
fn covering(table: &Table<'_>) -> Vec<Vec<(usize, i64)>> {
    let grid = table.grid();
    let mut covering = vec![Vec::new(); grid.cells()];
    for (index, function) in table.basis().functions().enumerate() {
        let (high, wide) = function.extent();
        let (top, left) = (usize::from(function.row), usize::from(function.col));
        for row in top..top + high {
            for col in left..left + wide {
                covering[row * grid.cols() + col].push((index, function.at(row, col)));
            }
        }
    }
    covering
}

/// A Haar function as a product of two steps.
struct StepFunction {
    start: (usize, usize),
    extent: (usize, usize),
    first: (usize, usize),
    /// Values in the second half of rows and columns, against 1 in the first.
    second: (f64, f64),
    value: f64,
}

impl StepFunction {
    fn new(function: &Function) -> Self {
        let start = (usize::from(function.row), usize::from(function.col));
        let extent = function.extent();
        let at = |row: usize, col: usize| function.at(start.0 + row, start.1 + col);
        let corner = at(0, 0);
        let first_row = (1..extent.0).find(|row| at(*row, 0) != corner);
        let first_col = (1..extent.1).find(|col| at(0, *col) != corner);
        Self {
            start,
            extent,
            first: (first_row.unwrap_or(extent.0), first_col.unwrap_or(extent.1)),
            second: (
                first_row.map_or(1.0, |row| at(row, 0) as f64 / corner as f64),
                first_col.map_or(1.0, |col| at(0, col) as f64 / corner as f64),
            ),
            value: corner as f64 / function.positive_mass() as f64,
        }
    }

    /// Whole numbers, which pictures of 8 bits keep as they are where there are no others beside
    /// them: where it is, and where its second halves begin.
    fn places(&self) -> [[f32; 4]; 2] {
        let [top, left, high, wide] =
            [self.start.0, self.start.1, self.extent.0, self.extent.1].map(|n| n as f32);
        let (row, col) = (self.first.0 as f32, self.first.1 as f32);
        [[top, left, high, wide], [row, col, 0.0, 0.0]]
    }

    fn values(&self) -> [f32; 4] {
        let (row, col) = self.second;
        [row as f32, col as f32, self.value as f32, 0.0]
    }
}
