//! QR code cards: pictures of a number, each shown before the slide of that number, so that
//! a photograph taken after one is known for what it shows.
//!
//! A card repeats its code, as one of them has to lie on a surface that is flat.

use crate::Layout;
use iltm_picture::{LightPicture, Picture};
use qrcode::{Color, EcLevel, QrCode};
use rxing::BarcodeFormat;

/// What a card says.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Card {
    /// Id of the table that the slides are for.
    pub(super) table: u32,
    /// Index of the slide that follows.
    pub(super) slide: u32,
}

/// What every card's text begins with.
const PREFIX: &str = "ILTM:";

/// Codes across and down.
const CODES: [usize; 2] = [4, 2];

/// White modules on each side of a code: between two of them as many as the standard asks for.
const QUIET: usize = 2;

impl Card {
    /// In digits and capitals, which a QR code holds most of.
    fn text(self) -> String {
        format!("{PREFIX}{:08X}:{}", self.table, self.slide)
    }

    fn from_text(text: &str) -> Option<Self> {
        let (table, slide) = text.strip_prefix(PREFIX)?.split_once(':')?;
        let card = Self {
            table: u32::from_str_radix(table, 16).ok()?,
            slide: slide.parse().ok()?,
        };
        (card.text() == text).then_some(card)
    }

    /// The card as a slide, grey; `None` if the projection has too few pixels for a code.
    pub(super) fn picture(self, layout: &Layout) -> Option<Picture> {
        let code = QrCode::with_error_correction_level(self.text(), EcLevel::M).ok()?;
        let modules = code.width() + 2 * QUIET;
        let size = layout.inner();
        let place = [size.width() / CODES[0], size.height() / CODES[1]];
        let scale = (place[0] / modules).min(place[1] / modules);
        if scale == 0 {
            return None;
        }
        let dark = |at: usize, axis: usize| -> Option<usize> {
            let within = at % place[axis];
            let first = (place[axis] - scale * modules) / 2 + scale * QUIET;
            let module = within.checked_sub(first)? / scale;
            (at / place[axis] < CODES[axis] && module < code.width()).then_some(module)
        };
        let card = Picture::of_codes(size, 1, |pixel, _| {
            let (x, y) = (pixel % size.width(), pixel / size.width());
            let module = dark(x, 0).zip(dark(y, 1));
            let is_dark = module.is_some_and(|at| code[at] == Color::Dark);
            255 * u8::from(!is_dark)
        });
        layout.framed(&card)
    }

    /// The card that a photograph shows, by the first of its codes that can be read.
    pub(super) fn read(photograph: &LightPicture) -> Option<Self> {
        let [plane] = photograph.planes() else {
            return None;
        };
        let (size, most) = (photograph.size(), photograph.quantile(0.999) as f32);
        let code = |light: &f32| (255.0 * (light / most).clamp(0.0, 1.0)) as u8;
        let codes: Vec<u8> = plane.iter().map(code).collect();
        let (width, height) = (size.width() as u32, size.height() as u32);
        let format = Some(BarcodeFormat::QR_CODE);
        let found = rxing::helpers::detect_in_luma(codes, width, height, format);
        Self::from_text(found.ok()?.getText())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use iltm_picture::Samples;
    use iltm_runtime::{FrameSize, Grid};
    use proptest::prelude::*;

    fn layout(width: u16, height: u16, border: u16) -> Layout {
        let grid = Grid::new(6, 8).unwrap();
        Layout::new(grid, FrameSize::new(width, height).unwrap(), border).unwrap()
    }

    /// Seen by a camera: `from` says where in the card, both from 0 to 1.
    fn seen(
        card: &Picture,
        size: FrameSize,
        from: impl Fn(f64, f64) -> (f64, f64),
    ) -> LightPicture {
        let Samples::Eight(codes) = card.samples() else {
            panic!("cards have 8 bits");
        };
        let card = card.size();
        LightPicture::from_fn(size, 1, |_, at| {
            let (x, y) = (at % size.width(), at / size.width());
            let place = |x: usize, side: usize| (x as f64 + 0.5) / side as f64;
            let (u, v) = from(place(x, size.width()), place(y, size.height()));
            if !(0.0..1.0).contains(&u) || !(0.0..1.0).contains(&v) {
                return 0.02;
            }
            let (x, y) = (u * card.width() as f64, v * card.height() as f64);
            let code = codes[y as usize * card.width() + x as usize];
            0.02 + 0.4 * f32::from(code) / 255.0
        })
    }

    #[test]
    fn a_card_is_read_at_an_angle_across_a_crease_small_and_mirrored() {
        let card = Card {
            table: 0x00C0_FFEE,
            slide: 17,
        };
        let picture = card.picture(&layout(640, 400, 10)).unwrap();
        let camera = FrameSize::new(900, 700).unwrap();
        let angle = |x: f64, y: f64| {
            let depth = 0.8 + 0.4 * x + 0.1 * y;
            ((x * 1.3 - 0.1) / depth, (y * 1.4 - 0.2) / depth)
        };
        assert_eq!(Card::read(&seen(&picture, camera, angle)), Some(card));
        // A corner of two walls in the middle of the picture.
        let crease = |x: f64, y: f64| (x, y + 0.4 * (x - 0.5).abs() - 0.1);
        assert_eq!(Card::read(&seen(&picture, camera, crease)), Some(card));
        let mirrored = |x: f64, y: f64| (1.0 - x, y);
        assert_eq!(Card::read(&seen(&picture, camera, mirrored)), Some(card));
        let small = FrameSize::new(480, 320).unwrap();
        assert_eq!(
            Card::read(&seen(&picture, small, |x, y| (x, y))),
            Some(card)
        );
    }

    #[test]
    fn a_projection_too_small_for_a_code_has_no_card() {
        let card = Card { table: 1, slide: 2 };
        assert_eq!(card.picture(&layout(64, 48, 0)), None);
    }

    #[test]
    fn other_peoples_codes_are_no_cards() {
        for text in [
            "ILTM:1:2",
            "ILTM:00C0FFEE",
            "ILTM:00C0FFEE:+7",
            "iltm:00C0FFEE:7",
            "",
        ] {
            assert_eq!(Card::from_text(text), None, "{text}");
        }
        let card = Card {
            table: 0xC0_FFEE,
            slide: 7,
        };
        assert_eq!(Card::from_text("ILTM:00C0FFEE:7"), Some(card));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(500))]

        /// Whatever a photograph shows, it is read or not, and nothing else happens.
        #[test]
        fn any_photograph_can_be_looked_at(
            slide: u32,
            at in (0_usize..360, 0_usize..230),
            noise in 0.0_f32..1.0,
            seed: u64,
        ) {
            let picture = Card { table: 7, slide }.picture(&layout(360, 230, 0)).unwrap();
            let random = std::cell::RefCell::new(fastrand::Rng::with_seed(seed));
            let view = seen(&picture, picture.size(), |x, y| (x, y));
            let view = view.with_planes(|_, plane| {
                let mut plane = plane.to_vec();
                for light in &mut plane {
                    *light += noise * (random.borrow_mut().f32() - 0.5);
                }
                // A stripe of it is torn out and put elsewhere.
                plane.rotate_left(at.1 * 360 + at.0);
                plane
            });
            let read = Card::read(&view);
            prop_assert!(read.is_none_or(|read| read == Card { table: 7, slide }), "{read:?}");
        }
    }
}
