//! How much memory a photograph takes while it is read. Alone in its process, since the memory
//! of all threads is counted.

use iltm_capture::{PhotoStats, grey_view};
use image::{DynamicImage, ImageBuffer, ImageFormat};
use peak_alloc::PeakAlloc;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Most bytes that were in use at a time.
fn peak(work: impl FnOnce()) -> f64 {
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    work();
    (MEMORY.peak_usage() - before) as f64
}

#[test]
fn a_photograph_takes_its_pixels_memory_once_or_twice_and_little_more() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("photograph");
    let (width, height) = (1500, 1000);
    let opaque = ImageBuffer::from_pixel(width, height, image::Rgba([9_u16, 9, 9, u16::MAX]));
    for (picture, format, copies) in [
        (DynamicImage::new_rgb8(width, height), ImageFormat::Png, 1.0),
        (
            DynamicImage::new_rgb16(width, height),
            ImageFormat::Png,
            1.0,
        ),
        (DynamicImage::ImageRgba16(opaque), ImageFormat::Png, 1.0),
        (
            DynamicImage::new_rgb8(width, height),
            ImageFormat::Jpeg,
            1.0,
        ),
        (
            DynamicImage::new_rgb16(width, height),
            ImageFormat::Pnm,
            1.0,
        ),
        (
            DynamicImage::new_rgb16(width, height),
            ImageFormat::Tiff,
            2.0,
        ),
        (
            DynamicImage::new_rgb32f(width, height),
            ImageFormat::OpenExr,
            2.0,
        ),
    ] {
        picture.save_with_format(&path, format).unwrap();
        let pixels = picture.as_bytes().len() as f64;
        let stats = peak(|| {
            PhotoStats::read(&path).unwrap();
        });
        let grey = peak(|| drop(grey_view(&path, 500).unwrap()));
        let most = 2.0e6 + copies * pixels;
        let what = picture.color();
        assert!(
            stats < most && grey < most,
            "{format:?} {what:?}: {stats} {grey} {most}"
        );
    }
}
