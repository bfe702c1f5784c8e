//! Planar frames of Y4M as rows of colours, and as pictures.

#![allow(
    clippy::inline_always,
    reason = "compiled into `engine::rows`, which chooses the processor's instructions"
)]

use super::bands::{Band, Bands, Interleaved, STRIP};
use super::y4m::{ChromaSampling, Header, YuvFrame};
use super::yuv::{Conversion, Standard, repeat_pairs, sum_squares};
use iltm_picture::{Picture, Samples};

/// How the planes of every frame of a stream are laid out and converted.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaneLayout {
    width: usize,
    pixels: usize,
    chroma_width: usize,
    chroma_samples: usize,
    sampling: ChromaSampling,
    conversion: Conversion,
}

impl PlaneLayout {
    pub(super) fn new(header: &Header) -> Self {
        let (chroma_width, chroma_height) = header.chroma();
        Self {
            width: header.size().width(),
            pixels: header.size().pixels(),
            chroma_width,
            chroma_samples: chroma_width * chroma_height,
            sampling: header.sampling(),
            conversion: Conversion::new(Standard::of(header.size()), header.range()),
        }
    }

    /// Colours of a pixel.
    pub(super) const fn colours(&self) -> usize {
        match self.sampling {
            ChromaSampling::Mono => 1,
            ChromaSampling::Chroma420 | ChromaSampling::Chroma444 => 3,
        }
    }
}

/// One frame of a stream.
#[derive(Debug)]
pub(super) struct Planar {
    pub(super) layout: PlaneLayout,
    pub(super) frame: YuvFrame,
}

impl YuvFrame {
    /// A picture as a frame of a stream: 8 bits, of the stream's size, with as many
    /// channels as the stream has; `None` for any other.
    #[must_use]
    pub fn from_picture(header: &Header, picture: &Picture) -> Option<Self> {
        let layout = PlaneLayout::new(header);
        let Samples::Eight(samples) = picture.samples() else {
            return None;
        };
        if (picture.size(), picture.channels()) != (header.size(), layout.colours()) {
            return None;
        }
        let mut planar = Planar {
            layout,
            frame: Self {
                parameters: Vec::new(),
                samples: vec![0; header.frame_bytes()],
            },
        };
        let rows = header.size().height().next_multiple_of(STRIP);
        let mut samples = samples.clone();
        let mut picture = Interleaved {
            width: layout.width,
            channels: layout.colours(),
            samples: &mut samples,
        };
        convert(
            &mut picture,
            &mut planar,
            rows,
            layout.width * layout.colours(),
        );
        Some(planar.frame)
    }

    /// A frame of a stream as a picture; `None` if it has another number of samples
    /// than the stream's frames.
    #[must_use]
    pub fn to_picture(&self, header: &Header) -> Option<Picture> {
        let layout = PlaneLayout::new(header);
        if self.samples.len() != header.frame_bytes() {
            return None;
        }
        let mut planar = Planar {
            layout,
            frame: self.clone(),
        };
        let rows = header.size().height().next_multiple_of(STRIP);
        let mut samples = vec![0; layout.pixels * layout.colours()];
        let mut picture = Interleaved {
            width: layout.width,
            channels: layout.colours(),
            samples: &mut samples,
        };
        convert(
            &mut planar,
            &mut picture,
            rows,
            layout.width * layout.colours(),
        );
        Picture::new(header.size(), Samples::Eight(samples))
    }
}

/// Copies the colours of all rows of one frame into another.
fn convert<A, B>(from: &mut A, to: &mut B, rows: usize, row_len: usize)
where
    A: Bands<Code = u8>,
    B: Bands<Code = u8>,
{
    let (mut of_from, mut of_to) = (A::Memory::default(), B::Memory::default());
    let mut colours = vec![0; STRIP * row_len];
    for (from, mut to) in from.bands(rows).into_iter().zip(to.bands(rows)) {
        for strip in 0..from.rows().div_ceil(STRIP) {
            let colours = &mut colours[..(from.rows() - STRIP * strip).min(STRIP) * row_len];
            from.unpack(strip, &mut of_from, colours);
            to.pack(strip, &mut of_to, colours);
        }
    }
}

/// Adjacent rows of the planes.
#[derive(Debug)]
pub(super) struct PlanarBand<'b> {
    layout: PlaneLayout,
    luma: &'b mut [u8],
    u: &'b mut [u8],
    v: &'b mut [u8],
}

/// Rows on their way between planes and colours.
#[derive(Debug, Default)]
pub(super) struct ChromaRows {
    /// What each chroma sample adds to each colour.
    terms: [Vec<i16>; 3],
    /// The same for each pixel.
    spread: [Vec<i16>; 3],
    /// Sums of the codes that make each chroma sample.
    sums: [Vec<u16>; 3],
}

impl ChromaRows {
    fn fit(&mut self, layout: &PlaneLayout) {
        for terms in &mut self.terms {
            terms.resize(layout.chroma_width, 0);
        }
        for spread in &mut self.spread {
            spread.resize(layout.width, 0);
        }
        for sums in &mut self.sums {
            sums.resize(layout.chroma_width, 0);
        }
    }
}

impl Bands for Planar {
    type Code = u8;
    type Band<'b>
        = PlanarBand<'b>
    where
        Self: 'b;
    type Memory = ChromaRows;

    fn bands(&mut self, rows: usize) -> Vec<PlanarBand<'_>> {
        let layout = self.layout;
        let (luma, chroma) = self.frame.samples.split_at_mut(layout.pixels);
        let (u, v) = chroma.split_at_mut(layout.chroma_samples);
        let chroma_rows = match layout.sampling {
            ChromaSampling::Chroma420 => rows / STRIP,
            ChromaSampling::Mono | ChromaSampling::Chroma444 => rows,
        };
        let chroma_band = (chroma_rows * layout.chroma_width).max(1);
        let mut u = u.chunks_mut(chroma_band);
        let mut v = v.chunks_mut(chroma_band);
        let luma = luma.chunks_mut(rows * layout.width);
        let band = |luma| PlanarBand {
            layout,
            luma,
            u: u.next().unwrap_or_default(),
            v: v.next().unwrap_or_default(),
        };
        luma.map(band).collect()
    }
}

impl PlanarBand<'_> {
    /// Where the samples of a strip begin in the luma and in each chroma plane.
    fn starts(&self, strip: usize) -> (usize, usize) {
        let chroma_rows = match self.layout.sampling {
            ChromaSampling::Chroma420 => strip,
            ChromaSampling::Mono | ChromaSampling::Chroma444 => STRIP * strip,
        };
        (
            STRIP * strip * self.layout.width,
            chroma_rows * self.layout.chroma_width,
        )
    }
}

impl Band for PlanarBand<'_> {
    type Code = u8;
    type Memory = ChromaRows;

    fn rows(&self) -> usize {
        self.luma.len() / self.layout.width
    }

    #[inline(always)]
    fn unpack(&self, strip: usize, rows: &mut ChromaRows, colours: &mut [u8]) {
        let layout = self.layout;
        let (width, sampling, conversion) = (layout.width, layout.sampling, layout.conversion);
        let (luma, chroma) = self.starts(strip);
        let lumas = self.luma[luma..].chunks_exact(width);
        if sampling == ChromaSampling::Mono {
            for (luma, grey) in lumas.zip(colours.chunks_exact_mut(width)) {
                conversion.grey_row(luma, grey);
            }
            return;
        }
        rows.fit(&layout);
        let mut us = self.u[chroma..].chunks_exact(layout.chroma_width);
        let mut vs = self.v[chroma..].chunks_exact(layout.chroma_width);
        for (row, (luma, colours)) in lumas.zip(colours.chunks_exact_mut(3 * width)).enumerate() {
            if sampling == ChromaSampling::Chroma444 || row == 0 {
                let (u, v) = (us.next().unwrap_or_default(), vs.next().unwrap_or_default());
                let [red, green, blue] = &mut rows.terms;
                conversion.chroma_terms(u, v, [red, green, blue]);
                if sampling == ChromaSampling::Chroma420 {
                    for (terms, pixels) in rows.terms.iter().zip(&mut rows.spread) {
                        repeat_pairs(terms, pixels);
                    }
                }
            }
            let terms = match sampling {
                ChromaSampling::Chroma420 => &rows.spread,
                ChromaSampling::Mono | ChromaSampling::Chroma444 => &rows.terms,
            };
            for (terms, colour) in terms.iter().zip(colours.chunks_exact_mut(width)) {
                conversion.colour_row(luma, terms, colour);
            }
        }
    }

    #[inline(always)]
    fn pack(&mut self, strip: usize, rows: &mut ChromaRows, colours: &[u8]) {
        let layout = self.layout;
        let (width, sampling, conversion) = (layout.width, layout.sampling, layout.conversion);
        let (luma, chroma) = self.starts(strip);
        let lumas = self.luma[luma..].chunks_exact_mut(width);
        if sampling == ChromaSampling::Mono {
            for (luma, grey) in lumas.zip(colours.chunks_exact(width)) {
                conversion.grey_luma_row(grey, luma);
            }
            return;
        }
        rows.fit(&layout);
        let mut us = self.u[chroma..].chunks_exact_mut(layout.chroma_width);
        let mut vs = self.v[chroma..].chunks_exact_mut(layout.chroma_width);
        for (luma, colours) in lumas.zip(colours.chunks_exact(3 * width)) {
            conversion.luma_row(separate(colours, width), luma);
            if sampling == ChromaSampling::Chroma444 {
                for (sums, colour) in rows.sums.iter_mut().zip(colours.chunks_exact(width)) {
                    for (sum, code) in sums.iter_mut().zip(colour) {
                        *sum = u16::from(*code);
                    }
                }
                let (u, v) = (us.next().unwrap_or_default(), vs.next().unwrap_or_default());
                conversion.chroma_row(rows.sums.each_ref().map(Vec::as_slice), 0, u, v);
            }
        }
        if sampling == ChromaSampling::Chroma420 {
            let tops = &colours[..3 * width];
            let bottoms = &colours[colours.len() - 3 * width..];
            let pairs = tops.chunks_exact(width).zip(bottoms.chunks_exact(width));
            for ((top, bottom), sums) in pairs.zip(&mut rows.sums) {
                sum_squares(top, bottom, sums);
            }
            let (u, v) = (us.next().unwrap_or_default(), vs.next().unwrap_or_default());
            conversion.chroma_row(rows.sums.each_ref().map(Vec::as_slice), 2, u, v);
        }
    }
}

/// Three rows that lie one after the other.
#[inline(always)]
fn separate(colours: &[u8], width: usize) -> [&[u8]; 3] {
    let (red, rest) = colours.split_at(width);
    let (green, blue) = rest.split_at(width);
    [red, green, blue]
}
