//! Local planes: positions of single pixels, averaged over their neighbours without averaging
//! across a crease.
//!
//! A pixel of the projector is evenly lit: a camera that sees it with several pixels cannot tell
//! where within it each of them lies. Their neighbours can. Around a pixel the positions are a
//! plane, unless the surface bends there; so each pixel takes its place on that plane, of all
//! windows that the pixel is in, that leaves the least (Kuwahara's filter, with planes for means).

use nalgebra::{Matrix3, Matrix3x2};
use rayon::prelude::*;

/// Pixels on each side of a window's middle.
const REACH: isize = 2;

/// Known positions that a window needs, of 25.
const LEAST: f64 = 20.0;

/// The plane of a window, from its middle: constant, slopes across and down, for x and for y; and
/// the mean square that it leaves, of both directions together.
pub(super) type Plane = (Matrix3x2<f64>, f64);

/// Puts each known position on its plane; returns the root mean square that the plane leaves,
/// of both directions together, `None` where there is no window with enough positions.
pub(crate) fn settle(
    position: &mut [Option<[f32; 2]>],
    (width, height): (usize, usize),
) -> Vec<Option<f32>> {
    let pixels = 0..width * height;
    let neighbour = |pixel: usize, across: isize, down: isize| {
        let x = (pixel % width).checked_add_signed(across)?;
        let y = (pixel / width).checked_add_signed(down)?;
        (x < width && y < height).then_some(y * width + x)
    };
    let known: &[Option<[f32; 2]>] = position;
    let planes: Vec<Option<Plane>> = pixels
        .clone()
        .into_par_iter()
        .map(|pixel| {
            known[pixel]?;
            let known = |across, down| known[neighbour(pixel, across, down)?];
            plane(REACH, LEAST, known)
        })
        .collect();
    let best = |pixel: usize| {
        known[pixel]?;
        let windows = window(REACH).filter_map(|(across, down)| {
            let plane = planes[neighbour(pixel, across, down)?].as_ref()?;
            Some((plane, across, down))
        });
        let (plane, across, down) = windows.min_by(|a, b| a.0.1.total_cmp(&b.0.1))?;
        let at = [0, 1].map(|axis: usize| {
            let [constant, slope_across, slope_down] = [0, 1, 2].map(|row| plane.0[(row, axis)]);
            (constant - across as f64 * slope_across - down as f64 * slope_down) as f32
        });
        Some((at, plane.1.max(0.0).sqrt() as f32))
    };
    let best: Vec<_> = pixels.into_par_iter().map(best).collect();
    for (position, best) in position.iter_mut().zip(&best) {
        *position = best.map(|(at, _)| at).or(*position);
    }
    best.into_iter().map(|best| Some(best?.1)).collect()
}

/// All places of a window, seen from its middle.
fn window(reach: isize) -> impl Iterator<Item = (isize, isize)> {
    (-reach..=reach).flat_map(move |down| (-reach..=reach).map(move |across| (across, down)))
}

/// The plane of a window, so many pixels on each side, whose positions are given by their place in
/// it; `None` if fewer than `least` are known.
pub(super) fn plane(
    reach: isize,
    least: f64,
    position: impl Fn(isize, isize) -> Option<[f32; 2]>,
) -> Option<Plane> {
    let (mut normal, mut right) = (Matrix3::zeros(), Matrix3x2::zeros());
    let mut squares = 0.0;
    // Differences to one of them, so that squares lose no digits.
    let mut known = window(reach)
        .filter_map(|at| Some((at, position(at.0, at.1)?)))
        .peekable();
    let origin = known.peek()?.1.map(f64::from);
    for ((across, down), at) in known {
        let place = nalgebra::Vector3::new(1.0, across as f64, down as f64);
        let at =
            nalgebra::RowVector2::new(f64::from(at[0]) - origin[0], f64::from(at[1]) - origin[1]);
        normal += place * place.transpose();
        right += place * at;
        squares += at.norm_squared();
    }
    let count: f64 = normal[(0, 0)];
    if count < least {
        return None;
    }
    let mut plane = normal.try_inverse()? * right;
    let left = squares - plane.component_mul(&right).sum();
    plane[(0, 0)] += origin[0];
    plane[(0, 1)] += origin[1];
    Some((plane, left / (count - 3.0)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (20, 12);

    /// Two planes that meet at column 9, as a crease does, each place rounded to a half.
    fn folded(x: usize, y: usize) -> [f64; 2] {
        let across = x as f64 - 9.0;
        let slope = if across < 0.0 { 0.45 } else { 0.81 };
        [60.0 + slope * across, 30.0 + 0.62 * y as f64 + 0.1 * across]
    }

    fn rounded(at: f64) -> f32 {
        ((2.0 * at).round() / 2.0) as f32
    }

    #[test]
    fn places_within_a_pixel_come_back_and_a_crease_stays_sharp() {
        let at = |pixel: usize| folded(pixel % SIZE.0, pixel / SIZE.0);
        let mut position: Vec<_> = (0..SIZE.0 * SIZE.1)
            .map(|pixel| Some(at(pixel).map(rounded)))
            .collect();
        let off = |position: &[Option<[f32; 2]>]| {
            let square = position.iter().enumerate().map(|(pixel, place)| {
                let (wanted, place) = (at(pixel), place.unwrap());
                (0..2)
                    .map(|axis| (f64::from(place[axis]) - wanted[axis]).powi(2))
                    .sum::<f64>()
            });
            (square.sum::<f64>() / (SIZE.0 * SIZE.1) as f64).sqrt()
        };
        let before = off(&position);
        let left = settle(&mut position, SIZE);
        assert!(
            off(&position) < 0.65 * before,
            "{} {before}",
            off(&position)
        );
        let left = left.iter().flatten();
        assert!(left.clone().count() == SIZE.0 * SIZE.1);
        assert!(left.copied().fold(0.0, f32::max) < 0.3);
    }

    #[test]
    fn what_is_unknown_stays_so_and_a_lonely_pixel_keeps_its_place() {
        let mut position = vec![None; SIZE.0 * SIZE.1];
        position[45] = Some([3.0, 4.0]);
        let left = settle(&mut position, SIZE);
        assert_eq!(position[45], Some([3.0, 4.0]));
        assert_eq!(position.iter().flatten().count(), 1);
        assert!(left.iter().all(Option::is_none));
        assert!(settle(&mut [], (0, 0)).is_empty());
    }
}
