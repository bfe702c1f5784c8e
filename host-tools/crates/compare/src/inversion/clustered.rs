//! Clustered inverses: cells that light each other most are inverted together.

use super::live::LiveTransport;
use super::{Inversion, Inverted, KnownTransport};
use crate::{Citation, Description, Unfit};
use nalgebra::DMatrix;

/// Blocks of limited size, inverted one by one.
#[derive(Clone, Copy, Debug)]
pub struct Clustered {
    /// Most cells of one cluster, at least 1.
    pub limit: usize,
    /// Whether light from other clusters counts as the cell's own (as if they showed
    /// what the cell shows) instead of being ignored, which the original does not do.
    pub lumped: bool,
}

impl Inversion for Clustered {
    fn description(&self) -> Description {
        let lumped = if self.lumped {
            ", other clusters' light as a cell's own"
        } else {
            ""
        };
        Description {
            name: format!("clustered inverse, {} cells{lumped}", self.limit),
            source: Citation {
                authors: "Wetzstein, Bimber",
                title: "Radiometric Compensation through Inverse Light Transport",
                venue: "Pacific Graphics",
                year: 2007,
            },
            how: "Cells that light each other most are joined into clusters of limited size, and \
                each cluster's transport is inverted for itself. Light between clusters is \
                ignored, or taken for the cell's own, which is right for what white shows.",
        }
    }

    fn invert(&self, known: KnownTransport<'_>) -> Result<Inverted, Unfit> {
        let live = LiveTransport::new(&known)?;
        let clusters = clusters(&live.transport, self.limit);
        let mut matrix = DMatrix::zeros(live.len(), live.len());
        let mut inside = 0.0;
        let mut multiplications = 0.0;
        for cluster in &clusters {
            let rows = live.transport.select_rows(cluster);
            let mut block = rows.select_columns(cluster);
            inside += block.sum();
            if self.lumped {
                let outside = rows.column_sum() - block.column_sum();
                block += DMatrix::from_diagonal(&outside);
            }
            multiplications += (cluster.len() * cluster.len()) as f64;
            let inverse = block.try_inverse().ok_or(Unfit::Singular)?;
            for (col, j) in cluster.iter().enumerate() {
                for (row, i) in cluster.iter().enumerate() {
                    matrix[(*i, *j)] = inverse[(row, col)];
                }
            }
        }
        let outside = 1.0 - inside / live.transport.sum();
        Ok(Inverted::matrix(
            live.whole(&super::live::finite(matrix)?),
            multiplications,
            format!(
                "{} clusters; {:.1} % of white's light passes between them",
                clusters.len(),
                100.0 * outside
            ),
        ))
    }
}

/// Joins, again and again, the two clusters with the most light between a cell of the
/// one and a cell of the other on average (average linkage), as long as both together
/// have at most `limit` cells.
fn clusters(transport: &DMatrix<f64>, limit: usize) -> Vec<Vec<usize>> {
    let n = transport.nrows();
    let mut members: Vec<Vec<usize>> = (0..n).map(|cell| vec![cell]).collect();
    // Total light between two clusters.
    let mut light = transport + transport.transpose();
    while let Some((a, b)) = strongest(&members, &light, limit) {
        let joined = members.swap_remove(b);
        members[a].extend(joined);
        let last = members.len();
        let of_b = light.column(b).into_owned();
        for k in 0..=last {
            light[(k, a)] += of_b[k];
            light[(a, k)] += of_b[k];
        }
        // The last cluster took the place of `b`.
        for k in 0..=last {
            light[(k, b)] = light[(k, last)];
            light[(b, k)] = light[(last, k)];
        }
    }
    members
}

/// The pair to join next, the later one second.
fn strongest(members: &[Vec<usize>], light: &DMatrix<f64>, limit: usize) -> Option<(usize, usize)> {
    let mut best = None;
    let mut most = 0.0;
    for b in 0..members.len() {
        for a in 0..b {
            let (x, y) = (members[a].len(), members[b].len());
            let mean = light[(a, b)] / (x * y) as f64;
            if x + y <= limit && mean > most {
                most = mean;
                best = Some((a, b));
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::KnownScene;

    #[test]
    fn every_cell_is_in_one_cluster_and_none_is_too_large() {
        let before = KnownScene::textured(6, 9);
        for limit in [1, 7, 54] {
            let clusters = clusters(&before.transport, limit);
            assert!(clusters.iter().all(|cluster| cluster.len() <= limit));
            let mut cells: Vec<usize> = clusters.into_iter().flatten().collect();
            cells.sort_unstable();
            assert_eq!(cells, (0..54).collect::<Vec<_>>());
        }
    }

    /// The valleys of an M do not see each other: half of the cells is enough.
    #[test]
    fn valleys_that_do_not_see_each_other_are_two_exact_clusters() {
        let before = KnownScene::panels(5, 8);
        for lumped in [false, true] {
            assert!(before.error(&Clustered { limit: 20, lumped }) < 1e-12);
            assert!(before.error(&Clustered { limit: 10, lumped }) > 1e-3);
        }
    }

    /// `T 1` is what white shows.
    #[test]
    fn with_other_light_as_a_cells_own_what_white_shows_needs_white() {
        let before = KnownScene::textured(5, 8);
        let white = before.transport.column_sum();
        let off = |lumped| {
            let drive = before.drive(&Clustered { limit: 6, lumped }, &white);
            drive.add_scalar(-1.0).amax()
        };
        assert!(off(true) < 1e-12 && off(false) > 0.01);
    }
}
