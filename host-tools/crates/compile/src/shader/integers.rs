//! Integer shader for mpv: the runtime's frame pipeline, bit for bit, for frames of 16 bits.
//!
//! The passes are those of the shader in floating point, in the arithmetic of
//! [`iltm_runtime::pipeline`]. Whatever depends on the table and on the size of frames alone is a
//! texture: the light of every code, the code of every drive, and where pixels lie between cells
//! ([`Axis`]). What passes leave behind are words of 32 bits, each the four bytes of a texel, which
//! all formats of a player's targets keep.

use super::mpv::{Image, NAMES, write_image};
use super::pictures::MAX_SIDE;
use super::{LINE, StepFunction};
use fixed::types::I2F30;
use iltm_runtime::FrameSize;
use iltm_runtime::image::{FineGain, Table};
use iltm_runtime::operator::{Channels, Segment};
use iltm_runtime::pipeline::stages::{CORRECTION_HALF, driven};
use iltm_runtime::pipeline::{Encoding, FullPipeline, Sample};
use iltm_runtime::placement::{PixelArea, ProjectorPixels};
use iltm_runtime::resample::interpolation::Axis;
use iltm_runtime::response::narrow;
use iltm_runtime::units::{CORRECTION_GUARD_BITS, Drive, GAIN_GUARD_BITS};
use std::fmt::Write;

/// The user shader of a tier of a table, for frames of the projector's size and no others.
///
/// Frames are sRGB. Their codes are rounded to 16 bits, and what is shown in 8 bits are the codes
/// nearest to those of [`FullPipeline`] for such frames. The player's targets must keep 16 bits:
/// mpv's are told to by `--fbo-format=rgba16`.
///
/// `None` if the projector has fewer pixels than the table has cells, or a texture would be larger
/// than graphics processors take.
#[must_use]
pub fn integer_shader(table: &Table<'_>, tier: u8, projector: ProjectorPixels) -> Option<String> {
    let size = projector.size();
    let area = projector.area(size)?;
    match table.channels() {
        1 => IntegerShader::text(&FullPipeline::<1>::within(table, size, area).ok()?, tier),
        _ => IntegerShader::text(&FullPipeline::<3>::within(table, size, area).ok()?, tier),
    }
}

/// How far a code may be from the nearest one of 8 bits; the middle is 128.
const MOST: i32 = 120;

/// How mpv reads a pixel of the film.
const FILM: &str = "#define FILM_at(at) (HOOKED_mul * texelFetch(HOOKED_raw, at, 0))\n";

/// Colours of a frame; a grey table does the same to all.
const COLOURS: usize = 3;

/// Where pixels lie between values along rows and columns, and how many values there are.
#[derive(Clone, Copy)]
struct Places {
    /// Of function `NAME_place`.
    name: &'static str,
    axes: [Axis; 2],
    values: FrameSize,
}

struct IntegerShader<'t, 'a> {
    table: &'t Table<'a>,
    area: PixelArea,
    cells: Places,
    images: Vec<Image>,
    /// What passes have left behind.
    targets: Vec<&'static str>,
    /// Text of the passes.
    passes: String,
}

impl<'t, 'a> IntegerShader<'t, 'a> {
    fn text<const C: usize>(pipeline: &FullPipeline<'t, 'a, C>, tier: u8) -> Option<String> {
        let table = pipeline.table();
        let mut shader = Self {
            table,
            area: pipeline.area(),
            cells: Places {
                name: "ILTM_CELL",
                axes: pipeline.cell_axes(),
                values: FrameSize::of_grid(table.grid()),
            },
            images: Vec::new(),
            targets: Vec::new(),
            passes: String::new(),
        };
        let mut light = shader.gains(pipeline.fine_gain(), pipeline.gain_axes());
        light.push_str(&shader.ambient());
        light.push_str(&shader.curves());
        let correction = shader.correction(tier, &light);
        let pixels = include_str!("integers/pixels.glsl");
        shader.pass("pixels", None, &(light + &correction + pixels));
        let mut text = String::new();
        for image in &shader.images {
            let (width, height) = image.size;
            if width.max(height) > MAX_SIDE {
                return None;
            }
            write_image(image, &mut text);
        }
        let columns = COLOURS * table.grid().cols();
        let rows = shader.area.size.height();
        (columns.max(rows) <= MAX_SIDE).then(|| text + &shader.passes)
    }

    fn channels(&self) -> usize {
        self.table.channels().into()
    }

    /// What every pass begins with.
    fn constants(&self) -> String {
        let (grid, table) = (self.table.grid(), self.table);
        let PixelArea { left, top, size } = self.area;
        let scales = table.operator().map_or([0; 3], |operator| {
            let scales = operator.channel_scales();
            scales.map(|scale| I2F30::from(scale).to_bits())
        });
        let [red, green, blue] = scales;
        format!(
            "const ivec2 CELLS = ivec2({}, {});\n\
             const int CHANNELS = {};\n\
             const ivec4 AREA = ivec4({left}, {top}, {}, {});\n\
             const int LINE = {LINE};\n\
             const uint GAIN_FRACTION = {}u;\n\
             const int GAIN_GUARD_BITS = {GAIN_GUARD_BITS};\n\
             const int CORRECTION_GUARD_BITS = {CORRECTION_GUARD_BITS};\n\
             const int CORRECTION_HALF = {CORRECTION_HALF};\n\
             const int DRIVE_ONE = {};\n\
             const uvec3 SCALES = uvec3({red}u, {green}u, {blue}u);\n{}",
            grid.cols(),
            grid.rows(),
            self.channels(),
            size.width(),
            size.height(),
            table.gain_fraction(),
            Drive::ONE.to_bits(),
            include_str!("integers/common.glsl"),
        )
    }

    /// Adds a pass over columns of cells, colour beside colour, or the last one over the pixels.
    fn pass(&mut self, about: &str, target: Option<(&'static str, usize)>, text: &str) {
        let used = |name: &str| text.contains(&format!("{name}_at("));
        let images = self.images.iter().map(|image| &*image.name);
        let images = images.map(|name| (name, name.to_owned()));
        let targets = self.targets.iter();
        let targets = targets.map(|name| (*name, format!("{name}_raw")));
        let bound = images.chain(targets).filter(|(name, _)| used(name));
        let passes = &mut self.passes;
        passes.push_str("//!HOOK MAIN\n//!BIND HOOKED\n");
        let mut functions = String::new();
        for (name, sampler) in bound {
            // Writing into a string cannot fail.
            let _ = writeln!(passes, "//!BIND {name}");
            let _ = writeln!(
                functions,
                "#define {name}_at(at) texelFetch({sampler}, at, 0)"
            );
        }
        if let Some((target, height)) = target {
            let width = COLOURS * self.table.grid().cols();
            self.targets.push(target);
            let _ = write!(
                passes,
                "//!SAVE {target}\n//!WIDTH {width}\n//!HEIGHT {height}\n//!COMPONENTS 4\n"
            );
        }
        let _ = writeln!(passes, "//!DESC iltm: {about}");
        for part in [NAMES, FILM, &functions, &self.constants(), text, "\n"] {
            self.passes.push_str(part);
        }
    }

    fn image(&mut self, name: &str, size: (usize, usize), format: &'static str, bytes: Vec<u8>) {
        let image = Image {
            name: name.to_owned(),
            size,
            format,
            bytes,
        };
        self.images.push(image);
    }

    /// A list in lines of [`LINE`] texels.
    fn words(&mut self, name: &str, mut words: Vec<u32>) {
        let lines = words.len().div_ceil(LINE).max(1);
        words.resize(lines * LINE, 0);
        let bytes = words.into_iter().flat_map(u32::to_le_bytes).collect();
        self.image(name, (LINE, lines), "rgba8", bytes);
    }

    /// A list in lines of [`LINE`] texels.
    fn halfwords(&mut self, name: &str, mut values: Vec<u16>) {
        let lines = values.len().div_ceil(LINE).max(1);
        values.resize(lines * LINE, 0);
        self.plane(name, (LINE, lines), values);
    }

    fn plane(&mut self, name: &str, size: (usize, usize), values: Vec<u16>) {
        let bytes = values.into_iter().flat_map(u16::to_le_bytes).collect();
        self.image(name, size, "r16", bytes);
    }

    /// Lists: of every row of pixels the values before and after it, and the share of the one
    /// after; of every column its piece and the first pixel of that, and how far it is after a
    /// centre. Function `NAME_place`.
    fn places(&mut self, places: Places) -> String {
        let [rows, columns] = places.axes;
        let PixelArea { size, .. } = self.area;
        let both = |low: usize, high: usize| (high << 16 | low) as u32;
        let of_row = |y| {
            let place = rows.place(y);
            [both(place.before, place.after), place.fraction << 1]
        };
        let pieces: Vec<_> = columns.pieces().collect();
        let of_column = |x| {
            let piece = pieces.partition_point(|piece| piece.first <= x);
            let before = piece.checked_sub(1).map(|before| pieces[before]);
            let (first, past) = before.map_or((0, 0), |before| (before.first, before.past));
            [both(piece, first), past]
        };
        let of_rows = (0..size.height()).flat_map(of_row).collect();
        let of_columns = (0..size.width()).flat_map(of_column).collect();
        self.words(&format!("{}_ROWS", places.name), of_rows);
        self.words(&format!("{}_COLUMNS", places.name), of_columns);
        include_str!("integers/place.glsl").replace("NAME", places.name)
    }

    /// Values of [`GAIN_GUARD_BITS`] more, channel below channel: function `NAME_between`.
    fn widened(
        &mut self,
        name: &str,
        places: Places,
        row: impl Fn(usize, usize) -> Vec<u16>,
    ) -> String {
        let size = places.values;
        let mut values = Vec::new();
        for channel in 0..self.channels() {
            for at in 0..size.height() {
                values.extend(row(at, channel));
            }
        }
        self.plane(
            name,
            (size.width(), size.height() * self.channels()),
            values,
        );
        let value = include_str!("integers/widened.glsl").replace("NAME", name);
        value.replace("HEIGHT", &size.height().to_string()) + &between(name, places)
    }

    /// Functions `pixel_of` and `gain_at`.
    fn gains(&mut self, fine: Option<FineGain<'_>>, axes: [Axis; 2]) -> String {
        let table = self.table;
        let mut text = self.places(self.cells);
        let mut places = self.cells;
        if let Some(fine) = fine {
            places = Places {
                name: "ILTM_GAIN",
                axes,
                values: fine.size(),
            };
            text.push_str(&self.places(places));
            let row = |at, channel| fine.row(at, channel).collect();
            text.push_str(&self.widened("ILTM_GAINS", places, row));
        } else {
            let row = |at, channel| table.gain_row(at, channel).collect();
            text.push_str(&self.widened("ILTM_GAINS", places, row));
        }
        let gain = include_str!("integers/gain.glsl");
        text + &gain
            .replace("CELLS_place", &format!("{}_place", self.cells.name))
            .replace("GAINS_place", &format!("{}_place", places.name))
    }

    /// Function `ambient_at`.
    fn ambient(&mut self) -> String {
        let table = self.table;
        if table.ambient_row(0, 0).is_none() {
            return "uint ambient_at(Pixel pixel, int channel) {\n    return 0u;\n}\n".to_owned();
        }
        let row = |at, channel| {
            let ambient = table.ambient_row(at, channel).into_iter().flatten();
            let cells = table.gain_row(at, channel).zip(ambient);
            let fraction = table.gain_fraction().into();
            let driven = cells.map(|(gain, ambient)| driven(ambient, gain, fraction));
            driven.collect()
        };
        self.widened("ILTM_AMBIENT", self.cells, row) + include_str!("integers/ambient.glsl")
    }

    /// Light by code and code by drive; function `light_at`.
    fn curves(&mut self) -> String {
        let table = self.table;
        let curves = |channel| <u16 as Sample>::curves(table, Encoding::Display, channel);
        let light = (0..=u16::MAX).map(|code| code.light(curves(0)).to_bits());
        self.halfwords("ILTM_LIGHT", light.collect());
        let drives = 0..=i32::from(Drive::ONE.to_bits());
        let codes = (0..self.channels()).flat_map(|channel| {
            let of_drive = move |drive| certain(<u16 as Sample>::code(drive, curves(channel)));
            drives.clone().map(of_drive)
        });
        let codes = codes.collect();
        self.halfwords("ILTM_CODES", codes);
        include_str!("integers/light.glsl").to_owned()
    }

    /// The passes of the operator; function `correction_at`.
    fn correction(&mut self, tier: u8, light: &str) -> String {
        let table = self.table;
        let Some(operator) = table.operator().filter(|_| tier > 0) else {
            return "int correction_at(Pixel pixel, int colour) {\n    return 0;\n}\n".to_owned();
        };
        let segments = operator.segments().iter();
        let segments: Vec<_> = segments.filter(|one| one.tier == tier).copied().collect();
        self.functions();
        self.entries(&segments);
        let most = self.covering();
        let rows = self.table.grid().rows();
        let along = light.to_owned() + include_str!("integers/rows.glsl");
        let synthesis = include_str!("integers/synthesis.glsl").replace("MOST", &most.to_string());
        for (about, target, height, text) in [
            (
                "light along rows",
                "ILTM_ALONG",
                self.area.size.height(),
                &*along,
            ),
            (
                "light of the cells",
                "ILTM_CELLS",
                rows,
                include_str!("integers/cells.glsl"),
            ),
            (
                "Haar coefficients",
                "ILTM_INPUTS",
                rows,
                include_str!("integers/analysis.glsl"),
            ),
            (
                "operator",
                "ILTM_OUTPUTS",
                rows,
                include_str!("integers/operator.glsl"),
            ),
            ("corrections", "ILTM_CORRECTIONS", rows, &*synthesis),
        ] {
            self.pass(about, Some((target, height)), text);
        }
        let value = "int ILTM_CORRECTIONS_value(ivec2 at, int colour) {\n    \
                     return int(word_of(ILTM_CORRECTIONS_at(ivec2(CELLS.x * colour + at.x, at.y))));\n}\n";
        value.to_owned()
            + &between("ILTM_CORRECTIONS", self.cells)
            + "int correction_at(Pixel pixel, int colour) {\n    \
               return ILTM_CORRECTIONS_between(pixel.cells, pixel.at.x, colour);\n}\n"
    }

    /// List: of every function its halves of rows and of columns, its shift, and its values in
    /// the four quarters.
    fn functions(&mut self) {
        let functions = self.table.basis().functions();
        let words = functions.flat_map(|function| {
            let shape = StepFunction::new(&function);
            let both = |(row, col): (usize, usize)| (row << 16 | col) as u32;
            // A function is 0 where it ends, and no cell is there.
            let (row, col) = shape.first;
            let values = [(0, 0), (0, col), (row, 0), (row, col)];
            let at = |(row, col)| function.at(shape.start.0 + row, shape.start.1 + col) as u32;
            let [a, b, c, d] = values.map(at);
            [
                both(shape.start),
                both(shape.extent),
                both(shape.first),
                function.input_shift(),
                a,
                b,
                c,
                d,
            ]
        });
        let words = words.collect();
        self.words("ILTM_FUNCTIONS", words);
    }

    /// Lists: of every row of every channel, in the segment of all and in its own, its first pair,
    /// and how many there are beside its shift; of every pair, its index and both values.
    fn entries(&mut self, segments: &[Segment<'_>]) {
        let cells = self.table.grid().cells();
        let mut rows = vec![0; 4 * cells * self.channels()];
        let mut pairs = Vec::new();
        for segment in segments {
            for row in segment.rows() {
                let first = (pairs.len() / 2) as u32;
                row.fold((), |(), pair| {
                    let [low, high] = pair.values.map(|value| u32::from(value.cast_unsigned()));
                    pairs.extend([u32::from(pair.index), high << 16 | low]);
                });
                // Two bits of the shift are in the scale of a channel.
                let shift = u32::from(row.shift - Segment::MIN_SHIFT);
                let about = [first, shift << 16 | u32::from(row.pairs())];
                let (channels, part) = match segment.channels {
                    Channels::All => (0..self.channels(), 0),
                    Channels::One(own) => (own.into()..usize::from(own) + 1, 1),
                };
                for channel in channels {
                    let at = 2 * (2 * (channel * cells + usize::from(row.index)) + part);
                    rows[at..at + 2].copy_from_slice(&about);
                }
            }
        }
        self.words("ILTM_ROWS", rows);
        self.words("ILTM_PAIRS", pairs);
    }

    /// List: of every cell, the functions that cover it and their values; how many there are.
    fn covering(&mut self) -> usize {
        let mut covering: Vec<Vec<u32>> = super::covering(self.table)
            .into_iter()
            .map(|list| {
                list.into_iter()
                    .flat_map(|(index, value)| [index as u32, value as u32])
                    .collect()
            })
            .collect();
        let most = covering.iter().map(Vec::len).max().unwrap_or(0);
        for list in &mut covering {
            list.resize(most, 0);
        }
        self.words("ILTM_COVERING", covering.concat());
        most / 2
    }
}

/// The code as a player is given it: never so near to the middle between two codes of 8 bits that
/// a graphics processor could round it to the other one.
fn certain(code: u16) -> u16 {
    const STEP: i32 = 257;
    let nearest = STEP * i32::from(narrow(code));
    let rest = (i32::from(code) - nearest).clamp(-MOST, MOST);
    (nearest + rest) as u16
}

/// Function `NAME_between` of function `NAME_value`.
fn between(name: &str, places: Places) -> String {
    let [_, columns] = places.axes;
    include_str!("integers/between.glsl")
        .replace("NAME", name)
        .replace("COUNT", &places.values.width().to_string())
        // 2^32 stands as 0.
        .replace("STEP", &format!("{}u", columns.step() as u32))
}
