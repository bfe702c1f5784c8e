//! Placement: which pixels of a frame the cells of a table cover.
//!
//! A table remembers the pixels of the projector that it was made with
//! ([`ProjectorPixels`]): its size, and the border that slides left black. A frame fills
//! the projector's picture, at whatever scale, so its cells lie inside the same border,
//! scaled with it ([`PixelArea`]). Host and device place cells by this rule and no other.

use crate::FrameSize;

/// The pixels of a projector and the border of them that no cell covers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ProjectorPixels {
    size: FrameSize,
    border: u16,
}

impl ProjectorPixels {
    /// A projector of `size` with `border` pixels on every side that are no cell's;
    /// `None` if that leaves no pixel.
    #[must_use]
    pub const fn new(size: FrameSize, border: u16) -> Option<Self> {
        let both = 2 * border as usize;
        if both >= size.width() || both >= size.height() {
            return None;
        }
        Some(Self { size, border })
    }

    /// A projector of `size` without a border.
    #[must_use]
    pub const fn whole(size: FrameSize) -> Self {
        Self { size, border: 0 }
    }

    /// The projector's own width and height.
    #[must_use]
    pub const fn size(self) -> FrameSize {
        self.size
    }

    /// Pixels on every side that no cell covers.
    #[must_use]
    pub const fn border(self) -> u16 {
        self.border
    }

    /// The pixels inside the border.
    #[must_use]
    pub const fn inner(self) -> FrameSize {
        let both = 2 * self.border as usize;
        let width = self.size.width() - both;
        let height = self.size.height() - both;
        // Both are above zero, or there is no such projector.
        match FrameSize::new(width as u16, height as u16) {
            Some(inner) => inner,
            None => self.size,
        }
    }

    /// Whether a frame has the projector's aspect, within one pixel of a side.
    #[must_use]
    pub const fn has_aspect_of(self, frame: FrameSize) -> bool {
        // Products of sides fit 32 bits.
        let (width, height) = (self.size.width() as u32, self.size.height() as u32);
        let across = frame.width() as u32 * height;
        let down = frame.height() as u32 * width;
        let longer = if width > height { width } else { height };
        across.abs_diff(down) < longer
    }

    /// The smallest frame of the projector's aspect that holds `frame`; `None` if a side
    /// is too long.
    #[must_use]
    pub fn around(self, frame: FrameSize) -> Option<FrameSize> {
        let [wide, high] = self.sharing_a_side(frame);
        let (width, height) = if wide.0 >= frame.width() { wide } else { high };
        FrameSize::new(width.try_into().ok()?, height.try_into().ok()?)
    }

    /// The largest frame of the projector's aspect that `frame` holds; `None` if a side
    /// is too short.
    #[must_use]
    pub fn within(self, frame: FrameSize) -> Option<FrameSize> {
        let [wide, high] = self.sharing_a_side(frame);
        let (width, height) = if wide.0 <= frame.width() { wide } else { high };
        FrameSize::new(width.try_into().ok()?, height.try_into().ok()?)
    }

    /// Width and height of the frames of the projector's aspect that have the height of
    /// `frame`, and its width.
    const fn sharing_a_side(self, frame: FrameSize) -> [(usize, usize); 2] {
        let (width, height) = (self.size.width(), self.size.height());
        [
            (nearest(frame.height(), width, height), frame.height()),
            (frame.width(), nearest(frame.width(), height, width)),
        ]
    }

    /// The pixels that cells cover of a frame that fills the projector's picture,
    /// whatever its aspect: each edge of the cells is within half a pixel of where the
    /// border's edge falls. `None` if no pixel is left.
    #[must_use]
    pub const fn area(self, frame: FrameSize) -> Option<PixelArea> {
        let border = self.border as usize;
        let left = nearest(border, frame.width(), self.size.width());
        let top = nearest(border, frame.height(), self.size.height());
        let (Some(width), Some(height)) = (
            frame.width().checked_sub(2 * left),
            frame.height().checked_sub(2 * top),
        ) else {
            return None;
        };
        // No wider and no higher than the frame.
        match FrameSize::new(width as u16, height as u16) {
            Some(size) => Some(PixelArea { left, top, size }),
            None => None,
        }
    }
}

/// `side * to / from` to the nearest, of sides, which are `u16`s: 32 bits are enough.
const fn nearest(side: usize, to: usize, from: usize) -> usize {
    let from = from as u32;
    ((side as u32 * to as u32 + from / 2) / from) as usize
}

/// A rectangle of a frame's pixels.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PixelArea {
    /// Pixels to the left of it.
    pub left: usize,
    /// Rows above it.
    pub top: usize,
    /// Its width and height.
    pub size: FrameSize,
}

impl PixelArea {
    /// All pixels of a frame.
    #[must_use]
    pub const fn all(frame: FrameSize) -> Self {
        Self {
            left: 0,
            top: 0,
            size: frame,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn size(width: u16, height: u16) -> FrameSize {
        FrameSize::new(width, height).unwrap()
    }

    fn bordered() -> ProjectorPixels {
        ProjectorPixels::new(size(1280, 800), 100).unwrap()
    }

    #[test]
    fn a_frame_of_the_projectors_size_has_its_cells_inside_the_border() {
        let area = bordered().area(size(1280, 800)).unwrap();
        assert_eq!((area.left, area.top), (100, 100));
        assert_eq!(area.size, size(1080, 600));
    }

    #[test]
    fn the_border_scales_with_the_frame_and_is_within_half_a_pixel() {
        for (width, height) in [(640, 400), (1920, 1200), (333, 208), (64, 40), (2560, 1600)] {
            let area = bordered().area(size(width, height)).unwrap();
            let exact = |side: u16, of: f64| 100.0 * f64::from(side) / of;
            assert!((area.left as f64 - exact(width, 1280.0)).abs() <= 0.5);
            assert!((area.top as f64 - exact(height, 800.0)).abs() <= 0.5);
            assert_eq!(area.size.width() + 2 * area.left, usize::from(width));
            assert_eq!(area.size.height() + 2 * area.top, usize::from(height));
        }
    }

    #[test]
    fn the_largest_sides_do_not_overflow() {
        let largest = size(u16::MAX, u16::MAX);
        let projector = ProjectorPixels::new(largest, 32_767).unwrap();
        assert!(projector.has_aspect_of(largest));
        let area = projector.area(largest).unwrap();
        assert_eq!(
            (area.left, area.top, area.size),
            (32_767, 32_767, size(1, 1))
        );
        assert!(!projector.has_aspect_of(size(u16::MAX, 1)));
        assert_eq!(projector.around(size(u16::MAX, 1)), Some(largest));
    }

    #[test]
    fn a_border_that_leaves_no_pixel_is_none() {
        assert_eq!(ProjectorPixels::new(size(1280, 800), 400), None);
        assert_eq!(ProjectorPixels::new(size(9, 3), u16::MAX), None);
        assert_eq!(
            ProjectorPixels::new(size(100, 100), 49)
                .unwrap()
                .area(size(2, 2)),
            None
        );
    }

    #[test]
    fn an_aspect_is_the_same_within_a_pixel_and_no_more() {
        let wide = ProjectorPixels::new(size(1920, 1080), 0).unwrap();
        // What is sold as 16:9 is not always quite.
        for (width, height) in [
            (1920, 1080),
            (1366, 768),
            (854, 480),
            (426, 240),
            (3840, 2160),
        ] {
            assert!(wide.has_aspect_of(size(width, height)), "{width}x{height}");
        }
        for (width, height) in [
            (1280, 800),
            (720, 576),
            (1440, 1080),
            (17, 13),
            (1080, 1920),
        ] {
            assert!(!wide.has_aspect_of(size(width, height)), "{width}x{height}");
        }
    }
}
