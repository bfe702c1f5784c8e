//! Shader: a table as a user shader for mpv and libplacebo, with its numbers as textures.
//!
//! The frame passes as in the runtime's pipeline: light of the pixels is averaged over the cells,
//! Haar coefficients are taken, the operator makes coefficients of the correction, and those
//! become corrections of the cells. All of these are passes over the grid. The last pass, over the
//! pixels, is `gain * light - correction` and the projector's response.
//!
//! Between passes numbers lie between 0 and 1 and have two texels each, since players keep 16 bits.

use crate::haar_entries::haar_entries;
use iltm_runtime::FrameSize;
use iltm_runtime::haar::Function;
use iltm_runtime::image::Table;
use iltm_runtime::operator::Segment;
use iltm_runtime::response::{RESPONSE_KNOTS, knot_drive};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Texels in a line of a list.
const LINE: usize = 2048;

/// Functions that all passes share.
const COMMON: &str = include_str!("common.glsl");

/// The user shader of a tier of a table.
///
/// Frames are sRGB, full screen on the projector that the table was made with.
#[must_use]
pub fn user_shader(table: &Table<'_>, tier: u8) -> String {
    let mut shader = ShaderText::new(table);
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
    shader.text
}

struct ShaderText<'t, 'a> {
    table: &'t Table<'a>,
    /// What every pass begins with.
    constants: String,
    text: String,
    textures: Vec<&'static str>,
}

impl<'t, 'a> ShaderText<'t, 'a> {
    fn new(table: &'t Table<'a>) -> Self {
        let grid = table.grid();
        let (projector, border) = table.projector().map_or_else(
            || (FrameSize::of_grid(grid), 0),
            |projector| (projector.size(), projector.border()),
        );
        let constants = format!(
            "const ivec2 CELLS = ivec2({}, {});\n\
             const vec2 PROJECTOR = vec2({}, {});\n\
             const float BORDER = float({border});\n\
             const int LINE = {LINE};\n{COMMON}\n",
            grid.cols(),
            grid.rows(),
            projector.width(),
            projector.height(),
        );
        Self {
            table,
            constants,
            text: String::new(),
            textures: Vec::new(),
        }
    }

    /// Value of each channel of a texel; a grey table does the same to all.
    fn colours(&self, of: impl Fn(usize) -> f32) -> [f32; 3] {
        let channels = usize::from(self.table.channels());
        [0, 1, 2].map(|channel| of(channel.min(channels - 1)))
    }

    fn texture(&mut self, name: &'static str, size: (usize, usize), format: &str, bytes: &[u8]) {
        let (width, height) = size;
        let _ = write!(
            self.text,
            "//!TEXTURE {name}\n//!SIZE {width} {height}\n//!FORMAT {format}\n\
             //!FILTER NEAREST\n//!BORDER CLAMP\n"
        );
        for byte in bytes {
            let _ = write!(self.text, "{byte:02x}");
        }
        self.text.push_str("\n\n");
        self.textures.push(name);
    }

    /// A list of texels in lines of [`LINE`].
    fn list(&mut self, name: &'static str, texels: &[[f32; 4]]) {
        let lines = texels.len().div_ceil(LINE).max(1);
        let mut bytes: Vec<u8> = texels
            .iter()
            .flatten()
            .flat_map(|value| value.to_le_bytes())
            .collect();
        bytes.resize(lines * LINE * 16, 0);
        self.texture(name, (LINE, lines), "rgba32f", &bytes);
    }

    fn sixteen(&mut self, name: &'static str, size: (usize, usize), texels: &[[u16; 3]]) {
        let bytes: Vec<u8> = texels
            .iter()
            .flat_map(|[red, green, blue]| [*red, *green, *blue, u16::MAX])
            .flat_map(u16::to_le_bytes)
            .collect();
        self.texture(name, size, "rgba16", &bytes);
    }

    fn pass(
        &mut self,
        name: &str,
        inputs: &[&str],
        saved: Option<(&str, (usize, usize))>,
        body: &str,
    ) {
        self.text.push_str("//!HOOK MAIN\n//!BIND HOOKED\n");
        for input in self.textures.iter().chain(inputs) {
            if body.contains(input) || self.constants.contains(input) {
                let _ = writeln!(self.text, "//!BIND {input}");
            }
        }
        if let Some((save, (width, height))) = saved {
            let _ = write!(
                self.text,
                "//!SAVE {save}\n//!WIDTH {width}\n//!HEIGHT {height}\n//!COMPONENTS 4\n"
            );
        }
        let _ = write!(
            self.text,
            "//!DESC iltm: {name}\n{}{body}\n\n",
            self.constants
        );
    }

    /// Gains of the cells and, for frames that have as many pixels, the finer ones.
    fn gains(&mut self) {
        let table = self.table;
        let size = FrameSize::of_grid(table.grid());
        let cells = self.rows(size, |row, channel| table.gain_row(row, channel).collect());
        self.sixteen("ILTM_GAINS", (size.width(), size.height()), &cells);
        let unit = 65_535.0 * (-f64::from(table.gain_fraction())).exp2();
        let mut gain = format!("{unit:.9} * between(ILTM_GAINS, CELLS, part)");
        if let Some(fine) = table.fine_gain() {
            let size = fine.size();
            let (width, height) = (size.width(), size.height());
            let texels = self.rows(size, |row, channel| fine.row(row, channel).collect());
            self.sixteen("ILTM_FINE_GAINS", (width, height), &texels);
            gain = format!(
                "all(greaterThanEqual(area_of(HOOKED_size).zw, vec2({width}, {height}))) \\\n    \
                 ? {unit:.9} * between(ILTM_FINE_GAINS, ivec2({width}, {height}), part) : {gain}"
            );
        }
        let _ = writeln!(self.constants, "#define GAIN(part) ({gain})");
    }

    /// Texels of a picture of three channels; a grey table does the same to all.
    fn rows(&self, size: FrameSize, line: impl Fn(usize, usize) -> Vec<u16>) -> Vec<[u16; 3]> {
        let channels = usize::from(self.table.channels());
        let of_row = |row: usize| {
            let lines: Vec<Vec<u16>> = (0..channels).map(|channel| line(row, channel)).collect();
            (0..size.width()).map(move |x| [0, 1, 2].map(|c: usize| lines[c.min(channels - 1)][x]))
        };
        (0..size.height()).flat_map(of_row).collect()
    }

    /// Ambient light times gain, by cell.
    fn ambient(&mut self) {
        let (grid, table) = (self.table.grid(), self.table);
        if table.ambient_row(0, 0).is_none() {
            self.constants
                .push_str("#define ABOVE_AMBIENT(light, part) (light)\n");
            return;
        }
        let unit = (-f64::from(table.gain_fraction())).exp2();
        let mut texels = Vec::new();
        for row in 0..grid.rows() {
            let lines: Vec<Vec<f32>> = (0..usize::from(table.channels()))
                .map(|channel| {
                    let ambient = table.ambient_row(row, channel).into_iter().flatten();
                    let cells = table.gain_row(row, channel).zip(ambient);
                    let driven = cells.map(|(gain, ambient)| {
                        let light = ambient.to_num::<f64>();
                        let gain = f64::from(gain) * unit;
                        (if gain > 0.0 { gain * light } else { light }) as f32
                    });
                    driven.collect()
                })
                .collect();
            texels.extend((0..grid.cols()).map(|col| {
                let [red, green, blue] = self.colours(|channel| lines[channel][col]);
                [red, green, blue, 1.0]
            }));
        }
        let bytes: Vec<u8> = texels
            .iter()
            .flatten()
            .flat_map(|v: &f32| v.to_le_bytes())
            .collect();
        self.texture(
            "ILTM_AMBIENT",
            (grid.cols(), grid.rows()),
            "rgba32f",
            &bytes,
        );
        self.constants.push_str(
            "#define ABOVE_AMBIENT(light, part) max((light) - between(ILTM_AMBIENT, CELLS, part) \
             / max(GAIN(part), vec3(1e-6)), vec3(0.0))\n",
        );
    }

    /// Codes by drive, at the runtime's knots.
    fn response(&mut self) {
        if !self.table.has_response() {
            self.constants.push_str("#define CODE(drive) (drive)\n");
            return;
        }
        let channels = usize::from(self.table.channels());
        let curves = [0, 1, 2].map(|c: usize| self.table.response(c.min(channels - 1)));
        let mut texels: Vec<[u16; 3]> = (0..RESPONSE_KNOTS)
            .map(|knot| curves.map(|curve| curve.fine_code(knot_drive(knot))))
            .collect();
        let lines = texels.len().div_ceil(LINE);
        texels.resize(lines * LINE, [u16::MAX; 3]);
        self.sixteen("ILTM_CODES", (LINE, lines), &texels);
        let dense =
            (1..RESPONSE_KNOTS).take_while(|knot| knot_drive(*knot).to_bits() == *knot as u16);
        let dense = dense.count() as u32;
        let _ = write!(
            self.constants,
            "float code_of(float drive, int channel) {{\n\
             \x20   float bits = drive * 32768.0;\n\
             \x20   float at = bits < {dense}.0 ? bits : {dense}.0 + (bits - {dense}.0) / 16.0;\n\
             \x20   int knot = min(int(floor(at)), {last});\n\
             \x20   int next = min(knot + 1, {last});\n\
             \x20   float below = texelFetch(ILTM_CODES, ivec2(knot % LINE, knot / LINE), 0)[channel];\n\
             \x20   float above = texelFetch(ILTM_CODES, ivec2(next % LINE, next / LINE), 0)[channel];\n\
             \x20   return mix(below, above, clamp(at - float(knot), 0.0, 1.0));\n\
             }}\n\
             #define CODE(drive) vec3(code_of(drive.r, 0), code_of(drive.g, 1), code_of(drive.b, 2))\n",
            last = RESPONSE_KNOTS - 1
        );
    }

    fn operator(&mut self, segments: &[Segment<'_>]) {
        let grid = self.table.grid();
        let cells = (2 * grid.cols(), grid.rows());
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
        self.list(
            "ILTM_FUNCTIONS",
            &shapes
                .iter()
                .flat_map(StepFunction::texels)
                .collect::<Vec<_>>(),
        );
        self.list("ILTM_ROWS", &starts);
        self.list("ILTM_ENTRIES", &list);
        // What covers each cell.
        let mut covering: Vec<Vec<[f32; 4]>> = vec![Vec::new(); grid.cells()];
        for (index, function) in functions.iter().enumerate() {
            let norm = (function.squared_norm() as f64).sqrt();
            let (high, wide) = function.extent();
            let (top, left) = (usize::from(function.row), usize::from(function.col));
            for row in top..top + high {
                for col in left..left + wide {
                    let value = function.at(row, col) as f64 / norm * bounds[index];
                    covering[row * grid.cols() + col].push([index as f32, value as f32, 0.0, 0.0]);
                }
            }
        }
        let most = covering.iter().map(Vec::len).max().unwrap_or(0);
        for list in &mut covering {
            list.resize(most, [0.0; 4]);
        }
        self.list("ILTM_COVERING", &covering.concat());
        self.pass(
            "light of the cells",
            &[],
            Some(("ILTM_CELLS", cells)),
            include_str!("cells.glsl"),
        );
        self.pass(
            "Haar coefficients",
            &["ILTM_CELLS"],
            Some(("ILTM_INPUTS", cells)),
            include_str!("analysis.glsl"),
        );
        self.pass(
            "operator",
            &["ILTM_INPUTS"],
            Some(("ILTM_OUTPUTS", cells)),
            include_str!("operator.glsl"),
        );
        let body = include_str!("synthesis.glsl").replace("MOST", &most.to_string());
        self.pass(
            "corrections",
            &["ILTM_OUTPUTS"],
            Some(("ILTM_CORRECTIONS", cells)),
            &body,
        );
    }

    fn pixels(&mut self, operates: bool) {
        let correction = if operates {
            "(2.0 * kept_between(ILTM_CORRECTIONS_raw, part) - 1.0)"
        } else {
            "vec3(0.0)"
        };
        let body = include_str!("pixels.glsl").replace("CORRECTION", correction);
        self.pass("pixels", &["ILTM_CORRECTIONS"], None, &body);
    }
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

    fn texels(&self) -> [[f32; 4]; 3] {
        [
            [
                self.start.0 as f32,
                self.start.1 as f32,
                self.extent.0 as f32,
                self.extent.1 as f32,
            ],
            [
                self.first.0 as f32,
                self.first.1 as f32,
                self.second.0 as f32,
                self.second.1 as f32,
            ],
            [self.value as f32, 0.0, 0.0, 0.0],
        ]
    }
}
