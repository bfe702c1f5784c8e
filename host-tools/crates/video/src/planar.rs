//! Planar frames of Y4M as rows of colours, and as pictures.

#![allow(
    clippy::inline_always,
    reason = "compiled into `engine::rows`, which chooses the processor's instructions"
)]

use super::bands::{Band, Bands, Interleaved, STRIP};
use super::y4m::{ChromaSampling, Header, YuvFrame};
use super::yuv::{Convert, PlaneCode, Standard, repeat_pairs, sum_pairs, sum_squares};
use iltm_picture::{Picture, Samples};
use iltm_runtime::FrameSize;

/// How the planes of every frame of a stream are laid out and converted.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaneLayout<S: PlaneCode> {
    width: usize,
    pixels: usize,
    chroma_width: usize,
    chroma_samples: usize,
    sampling: ChromaSampling,
    conversion: S::Conversion,
}

impl<S: PlaneCode> PlaneLayout<S> {
    /// Of a stream whose samples have as many bits as `S` is for.
    pub(super) fn new(header: &Header) -> Self {
        let (chroma_width, chroma_height) = header.chroma();
        Self {
            width: header.size().width(),
            pixels: header.size().pixels(),
            chroma_width,
            chroma_samples: chroma_width * chroma_height,
            sampling: header.sampling(),
            conversion: S::Conversion::of(
                Standard::of(header.size()),
                header.range(),
                header.bits(),
            ),
        }
    }

    /// Whether rows of pixels share a row of chroma.
    const fn shares_rows(&self) -> bool {
        matches!(self.sampling, ChromaSampling::Chroma420)
    }

    /// Whether the pixels of a row share chroma.
    const fn shares_columns(&self) -> bool {
        matches!(
            self.sampling,
            ChromaSampling::Chroma420 | ChromaSampling::Chroma422
        )
    }
}

/// One frame of a stream.
#[derive(Debug)]
pub(super) struct Planar<S: PlaneCode> {
    layout: PlaneLayout<S>,
    /// What the header of the frame says.
    parameters: Vec<u8>,
    /// Luma, then chroma.
    samples: Vec<S>,
}

impl<S: PlaneCode> Planar<S> {
    /// A frame that has been read.
    pub(super) fn new(layout: PlaneLayout<S>, frame: YuvFrame) -> Self {
        Self {
            layout,
            parameters: frame.parameters,
            samples: S::of_bytes(frame.samples),
        }
    }

    /// The frame to be written.
    pub(super) fn frame(self) -> YuvFrame {
        YuvFrame {
            parameters: self.parameters,
            samples: S::to_bytes(self.samples),
        }
    }

    fn of_picture(header: &Header, size: (FrameSize, usize), samples: &[S]) -> Option<YuvFrame> {
        let layout = PlaneLayout::new(header);
        if size != (header.size(), header.colours()) {
            return None;
        }
        let mut planar = Self {
            layout,
            parameters: Vec::new(),
            samples: vec![S::default(); header.frame_bytes() / header.sample_bytes()],
        };
        let mut samples = samples.to_vec();
        convert(
            &mut layout.picture(header.colours(), &mut samples),
            &mut planar,
            header,
        );
        Some(planar.frame())
    }

    fn into_samples(mut self, header: &Header) -> Vec<S> {
        let layout = self.layout;
        let mut samples = vec![S::default(); layout.pixels * header.colours()];
        convert(
            &mut self,
            &mut layout.picture(header.colours(), &mut samples),
            header,
        );
        samples
    }
}

impl<S: PlaneCode> PlaneLayout<S> {
    /// The samples of a picture of such frames.
    fn picture<'p>(&self, channels: usize, samples: &'p mut [S]) -> Interleaved<'p, S> {
        Interleaved {
            width: self.width,
            channels,
            samples,
        }
    }
}

impl YuvFrame {
    /// A picture as a frame of a stream: of the stream's size, with as many channels as the stream
    /// has, and 16 bits where the stream has more than 8; `None` for any other.
    #[must_use]
    pub fn from_picture(header: &Header, picture: &Picture) -> Option<Self> {
        let size = (picture.size(), picture.channels());
        match picture.samples() {
            Samples::Eight(samples) if header.bits() == 8 => {
                Planar::of_picture(header, size, samples)
            }
            Samples::Sixteen(samples) if header.bits() > 8 => {
                Planar::of_picture(header, size, samples)
            }
            _ => None,
        }
    }

    /// A frame of a stream as a picture, of 16 bits where the stream has more than 8; `None` if it
    /// has another number of samples than the stream's frames.
    #[must_use]
    pub fn to_picture(&self, header: &Header) -> Option<Picture> {
        if self.samples.len() != header.frame_bytes() {
            return None;
        }
        let samples = if header.bits() == 8 {
            let planar = Planar::new(PlaneLayout::new(header), self.clone());
            Samples::Eight(planar.into_samples(header))
        } else {
            let planar = Planar::new(PlaneLayout::new(header), self.clone());
            Samples::Sixteen(planar.into_samples(header))
        };
        Picture::new(header.size(), samples)
    }
}

/// Copies the colours of all rows of one frame of a stream into another.
fn convert<S, A, B>(from: &mut A, to: &mut B, header: &Header)
where
    S: PlaneCode,
    A: Bands<Code = S>,
    B: Bands<Code = S>,
{
    let rows = header.size().height().next_multiple_of(STRIP);
    let row_len = header.size().width() * header.colours();
    let (mut of_from, mut of_to) = (A::Memory::default(), B::Memory::default());
    let mut colours = vec![S::default(); STRIP * row_len];
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
pub(super) struct PlanarBand<'b, S: PlaneCode> {
    layout: PlaneLayout<S>,
    luma: &'b mut [S],
    u: &'b mut [S],
    v: &'b mut [S],
}

/// Rows on their way between planes and colours.
#[derive(Debug, Default)]
pub(super) struct ChromaRows<S: PlaneCode> {
    /// What each chroma sample adds to each colour.
    terms: [Vec<S::Term>; 3],
    /// The same for each pixel.
    spread: [Vec<S::Term>; 3],
    /// Sums of the codes that make each chroma sample.
    sums: [Vec<S::Sum>; 3],
}

impl<S: PlaneCode> ChromaRows<S> {
    fn fit(&mut self, layout: &PlaneLayout<S>) {
        for terms in &mut self.terms {
            terms.resize(layout.chroma_width, S::Term::default());
        }
        for spread in &mut self.spread {
            spread.resize(layout.width, S::Term::default());
        }
        for sums in &mut self.sums {
            sums.resize(layout.chroma_width, S::Sum::default());
        }
    }
}

impl<S: PlaneCode> Bands for Planar<S> {
    type Code = S;
    type Band<'b>
        = PlanarBand<'b, S>
    where
        Self: 'b;
    type Memory = ChromaRows<S>;

    fn bands(&mut self, rows: usize) -> Vec<PlanarBand<'_, S>> {
        let layout = self.layout;
        let (luma, chroma) = self.samples.split_at_mut(layout.pixels);
        let (u, v) = chroma.split_at_mut(layout.chroma_samples);
        let chroma_rows = if layout.shares_rows() {
            rows / STRIP
        } else {
            rows
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

impl<S: PlaneCode> PlanarBand<'_, S> {
    /// Where the samples of a strip begin in the luma and in each chroma plane.
    fn starts(&self, strip: usize) -> (usize, usize) {
        let chroma_rows = if self.layout.shares_rows() {
            strip
        } else {
            STRIP * strip
        };
        (
            STRIP * strip * self.layout.width,
            chroma_rows * self.layout.chroma_width,
        )
    }
}

impl<S: PlaneCode> Band for PlanarBand<'_, S> {
    type Code = S;
    type Memory = ChromaRows<S>;

    fn rows(&self) -> usize {
        self.luma.len() / self.layout.width
    }

    #[inline(always)]
    fn unpack(&self, strip: usize, rows: &mut ChromaRows<S>, colours: &mut [S]) {
        let layout = self.layout;
        let (width, conversion) = (layout.width, layout.conversion);
        let (luma, chroma) = self.starts(strip);
        let lumas = self.luma[luma..].chunks_exact(width);
        if layout.sampling == ChromaSampling::Mono {
            for (luma, grey) in lumas.zip(colours.chunks_exact_mut(width)) {
                conversion.grey_row(luma, grey);
            }
            return;
        }
        rows.fit(&layout);
        let mut us = self.u[chroma..].chunks_exact(layout.chroma_width);
        let mut vs = self.v[chroma..].chunks_exact(layout.chroma_width);
        for (row, (luma, colours)) in lumas.zip(colours.chunks_exact_mut(3 * width)).enumerate() {
            if row == 0 || !layout.shares_rows() {
                let (u, v) = (us.next().unwrap_or_default(), vs.next().unwrap_or_default());
                let [red, green, blue] = &mut rows.terms;
                conversion.chroma_terms(u, v, [red, green, blue]);
                if layout.shares_columns() {
                    for (terms, pixels) in rows.terms.iter().zip(&mut rows.spread) {
                        repeat_pairs(terms, pixels);
                    }
                }
            }
            let terms = if layout.shares_columns() {
                &rows.spread
            } else {
                &rows.terms
            };
            for (terms, colour) in terms.iter().zip(colours.chunks_exact_mut(width)) {
                conversion.colour_row(luma, terms, colour);
            }
        }
    }

    #[inline(always)]
    fn pack(&mut self, strip: usize, rows: &mut ChromaRows<S>, colours: &[S]) {
        let layout = self.layout;
        let (width, conversion) = (layout.width, layout.conversion);
        let (luma, chroma) = self.starts(strip);
        let lumas = self.luma[luma..].chunks_exact_mut(width);
        if layout.sampling == ChromaSampling::Mono {
            for (luma, grey) in lumas.zip(colours.chunks_exact(width)) {
                conversion.grey_luma_row(grey, luma);
            }
            return;
        }
        rows.fit(&layout);
        let mut us = self.u[chroma..].chunks_exact_mut(layout.chroma_width);
        let mut vs = self.v[chroma..].chunks_exact_mut(layout.chroma_width);
        let mut chroma_row = |sums: &[Vec<S::Sum>; 3], bits| {
            let (u, v) = (us.next().unwrap_or_default(), vs.next().unwrap_or_default());
            conversion.chroma_row(sums.each_ref().map(Vec::as_slice), bits, u, v);
        };
        for (luma, colours) in lumas.zip(colours.chunks_exact(3 * width)) {
            conversion.luma_row(separate(colours, width), luma);
            if layout.shares_rows() {
                continue;
            }
            let pairs = layout.shares_columns();
            for (sums, colour) in rows.sums.iter_mut().zip(colours.chunks_exact(width)) {
                if pairs {
                    sum_pairs(colour, sums);
                } else {
                    for (sum, code) in sums.iter_mut().zip(colour) {
                        *sum = S::Sum::from(*code);
                    }
                }
            }
            chroma_row(&rows.sums, u32::from(pairs));
        }
        if layout.shares_rows() {
            let tops = &colours[..3 * width];
            let bottoms = &colours[colours.len() - 3 * width..];
            let pairs = tops.chunks_exact(width).zip(bottoms.chunks_exact(width));
            for ((top, bottom), sums) in pairs.zip(&mut rows.sums) {
                sum_squares(top, bottom, sums);
            }
            chroma_row(&rows.sums, 2);
        }
    }
}

/// Three rows that lie one after the other.
#[inline(always)]
fn separate<S>(colours: &[S], width: usize) -> [&[S]; 3] {
    let (red, rest) = colours.split_at(width);
    let (green, blue) = rest.split_at(width);
    [red, green, blue]
}
