//! Pseudo-inverse, for unequal numbers of lights and camera cells.

use super::live::{LiveTransport, finite};
use super::{Inversion, Inverted, KnownTransport};
use crate::{Citation, Description, Unfit};
use nalgebra::{DMatrix, DVector};

/// Regularisation that only keeps rounding from deciding, of the mean eigenvalue.
const ROUNDING: f64 = 1e-13;

/// Which side has fewer cells: half as many, by joining neighbours along each row.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Fewer {
    /// Two cells share one projector light: no input is exact, the nearest is looked for.
    Lights,
    /// Two cells share one camera cell: many inputs are exact, the one nearest to
    /// `d / flood` is looked for.
    CameraCells,
}

/// The pseudo-inverse of a transport that is not square, with Tikhonov's regularisation
/// where it is noisy.
#[derive(Clone, Copy, Debug)]
pub struct PseudoInverse {
    /// Which side has fewer cells.
    pub fewer: Fewer,
}

impl Inversion for PseudoInverse {
    fn description(&self) -> Description {
        Description {
            name: match self.fewer {
                Fewer::Lights => "pseudo-inverse, half as many lights",
                Fewer::CameraCells => "pseudo-inverse, half as many camera cells",
            }
            .to_owned(),
            source: Citation {
                authors: "Golub, Van Loan",
                title: "Matrix Computations, sections 5.5 and 6.1",
                venue: "Johns Hopkins University Press",
                year: 2013,
            },
            how: match self.fewer {
                Fewer::Lights => {
                    "The camera sees more cells than the projector lights: least squares, T^+ = \
                     (T^T T + mu^2 I)^-1 T^T. Detail finer than a light cannot be shown."
                }
                Fewer::CameraCells => {
                    "The projector lights more cells than the camera tells apart: of all inputs \
                     that the camera sees as wanted, the one nearest to d / flood."
                }
            },
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let live = LiveTransport::new(&known)?;
        let groups = groups(&live.chosen, known.grid.cols());
        let members = membership(&groups, live.len());
        let (matrix, mu) = match self.fewer {
            Fewer::Lights => fewer_lights(&live, &members)?,
            Fewer::CameraCells => fewer_camera_cells(&live, &members)?,
        };
        let stored = (live.len() * groups.len()) as f64;
        let extra = match self.fewer {
            Fewer::Lights => 0.0,
            // d / flood, and what the camera would see of it, first.
            Fewer::CameraCells => stored + live.len() as f64 + groups.len() as f64,
        };
        Ok(Inverted::matrix(
            live.whole(&finite(matrix)?),
            stored + extra,
            format!("{} of {} cells; mu {mu:.1e}", groups.len(), live.len()),
        ))
    }
}

/// Live cells (places among them) that are joined: neighbours of a row, the first of each
/// pair in an even column.
fn groups(chosen: &[usize], cols: usize) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut last = None;
    for (place, cell) in chosen.iter().enumerate() {
        let pair = (cell / cols, cell % cols / 2);
        match groups.last_mut() {
            Some(group) if last == Some(pair) => group.push(place),
            _ => groups.push(vec![place]),
        }
        last = Some(pair);
    }
    groups
}

/// `n x groups`: 1 where a cell belongs to a group.
fn membership(groups: &[Vec<usize>], n: usize) -> DMatrix<f64> {
    let mut members = DMatrix::zeros(n, groups.len());
    for (group, cells) in groups.iter().enumerate() {
        for cell in cells {
            members[(*cell, group)] = 1.0;
        }
    }
    members
}

fn fewer_lights(
    live: &LiveTransport,
    members: &DMatrix<f64>,
) -> Result<(DMatrix<f64>, f64), Unfit> {
    let transport = &live.transport * members;
    let mu = noise_weight(live, transport.nrows());
    let gram = regularised(&transport.tr_mul(&transport), mu);
    let inverse = gram
        .cholesky()
        .ok_or(Unfit::Singular)?
        .solve(&transport.transpose());
    Ok((members * inverse, mu))
}

fn fewer_camera_cells(
    live: &LiveTransport,
    members: &DMatrix<f64>,
) -> Result<(DMatrix<f64>, f64), Unfit> {
    // The camera sees the mean of a group.
    let mut average = members.transpose();
    for mut row in average.row_iter_mut() {
        row /= row.sum();
    }
    let transport = &average * &live.transport;
    let seen_flood = transport.column_sum();
    let flood = members * &seen_flood;
    if flood.iter().any(|light| *light <= 0.0) {
        return Err(Unfit::Condition(
            "a camera cell sees no light under white".to_owned(),
        ));
    }
    let start = DMatrix::from_diagonal(&flood.map(f64::recip));
    let mu = noise_weight(live, transport.nrows());
    let gram = regularised(&(&transport * transport.transpose()), mu);
    let missing = average - &transport * &start;
    let correction = gram.cholesky().ok_or(Unfit::Singular)?.solve(&missing);
    Ok((start + transport.tr_mul(&correction), mu))
}

/// `mu = sigma sqrt(m)` for `m` rows whose elements have a noise of `sigma`: with
/// `T = T0 + noise`, the expectation of `|T0 p - d|^2` is `|T p - d|^2 + m sigma^2 |p|^2`
/// when nothing else is known of `T0`.
fn noise_weight(live: &LiveTransport, rows: usize) -> f64 {
    live.noise() * (rows as f64).sqrt()
}

/// `G + mu^2 I`, and enough against rounding.
pub(super) fn regularised(gram: &DMatrix<f64>, mu: f64) -> DMatrix<f64> {
    let least = ROUNDING * gram.trace() / gram.nrows() as f64;
    gram + DMatrix::from_diagonal(&DVector::from_element(gram.nrows(), mu * mu + least))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::KnownScene;

    #[test]
    fn odd_rows_and_dead_cells_leave_cells_of_their_own() {
        // 2 rows of 3 columns, cell 1 not live.
        let groups = groups(&[0, 2, 3, 4, 5], 3);
        assert_eq!(groups, [vec![0], vec![1], vec![2, 3], vec![4]]);
    }

    /// The normal equations of least squares: what is left over is orthogonal to every
    /// light.
    #[test]
    fn with_fewer_lights_what_is_left_over_is_orthogonal_to_every_light() {
        let before = KnownScene::textured(4, 7);
        let method = PseudoInverse {
            fewer: Fewer::Lights,
        };
        let wanted = DVector::from_fn(28, |cell, _| 0.2 + 0.1 * ((cell * 7) % 5) as f64);
        let drive = before.drive(&method, &wanted);
        let left = &before.transport * &drive - &wanted;
        for pair in groups(&(0..28).collect::<Vec<_>>(), 7) {
            let light = pair.iter().map(|cell| before.transport.column(*cell));
            let along: f64 = light.map(|light| light.dot(&left)).sum();
            assert!(along.abs() < 1e-9, "{pair:?}: {along}");
            assert!((drive[pair[0]] - drive[pair[pair.len() - 1]]).abs() < 1e-12);
        }
        assert!(left.norm() > 1e-3);
    }

    #[test]
    fn with_fewer_camera_cells_the_camera_sees_what_is_wanted() {
        let before = KnownScene::textured(4, 7);
        let method = PseudoInverse {
            fewer: Fewer::CameraCells,
        };
        let wanted = DVector::from_fn(28, |cell, _| 0.2 + 0.1 * ((cell * 7) % 5) as f64);
        let light = &before.transport * before.drive(&method, &wanted);
        for pair in groups(&(0..28).collect::<Vec<_>>(), 7) {
            let off: f64 = pair.iter().map(|cell| light[*cell] - wanted[*cell]).sum();
            assert!(off.abs() < 1e-9, "{pair:?}: {off}");
        }
    }
}
