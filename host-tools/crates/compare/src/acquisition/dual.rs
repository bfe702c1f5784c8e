//! Dual photography, adaptive and multi-resolution: blocks of lights, divided where they are seen.

use super::Acquisition;
use crate::{Acquired, Citation, Description, Rig, Unfit};
use nalgebra::DMatrix;

/// Starts with the whole frame and divides blocks in four.
///
/// A camera cell follows a block on to its parts only where it answers to it by more
/// than a threshold; what is below stays, evenly spread, with the block that it was last
/// seen in. Parts of two blocks are lit in one photograph if no camera cell follows both.
/// The paper's light in one photograph is all the followed block's; here the little that
/// is known to come from blocks not followed is taken off first.
///
/// Where every surface lights every other, every cell follows every block: then all
/// blocks of every level are lit one after the other, a third more photographs than one
/// light at a time. Surfaces that do not see each other share photographs, and noise ends
/// the division early: large blocks are brighter than it.
#[derive(Clone, Copy, Debug)]
pub struct DualPhotography {
    /// In deviations of a photograph's noise.
    threshold: f64,
}

impl DualPhotography {
    /// Follows light above `threshold` deviations of the noise; 0 follows all.
    #[must_use]
    pub const fn new(threshold: f64) -> Self {
        Self { threshold }
    }
}

impl Default for DualPhotography {
    /// Four deviations: of a hundred thousand responses without any light three pass.
    fn default() -> Self {
        Self::new(4.0)
    }
}

impl Acquisition for DualPhotography {
    fn description(&self) -> Description {
        Description {
            name: "adaptive dual photography".to_owned(),
            source: Citation {
                authors: "Sen, Chen, Garg, Marschner, Horowitz, Levoy, Lensch",
                title: "Dual Photography",
                venue: "ACM Transactions on Graphics (SIGGRAPH)",
                year: 2005,
            },
            how: "Blocks of cells, divided in four as long as somebody sees them; blocks that no \
                camera cell sees both of are lit together. Needs the photographs so far to choose \
                the next, and light that stays local: where every surface lights every other, all \
                blocks conflict.",
        }
    }

    fn acquire(&self, rig: &mut Rig) -> Result<Acquired, Unfit> {
        let cells = rig.grid().cells();
        let mut transport = DMatrix::zeros(cells, cells);
        let grid = rig.grid();
        let whole = CellRectangle::new(rig, (0, grid.rows()), (0, grid.cols()));
        let followers = rig.live().to_vec();
        let mut blocks: Vec<LightBlock> = whole
            .map(|area| LightBlock { area, followers })
            .into_iter()
            .collect();
        while !blocks.is_empty() {
            let mut next = Vec::new();
            for together in compatible(&blocks) {
                let lit: Vec<&LightBlock> = together.iter().map(|block| &blocks[*block]).collect();
                for (block, followers) in self.light(rig, &lit, &mut transport) {
                    for area in block.area.quarters(rig) {
                        next.push(LightBlock {
                            area,
                            followers: followers.clone(),
                        });
                    }
                }
            }
            blocks = next;
        }
        Ok(Acquired::Forward(transport))
    }
}

/// Lights to be lit, and who looks.
struct LightBlock {
    area: CellRectangle,
    /// Camera cells that answered to the block this one is part of, length `N`.
    followers: Vec<bool>,
}

impl DualPhotography {
    /// Photographs blocks together and writes what each follower got into `transport`.
    /// Returns every block with those who go on to its parts.
    fn light<'b>(
        self,
        rig: &mut Rig,
        blocks: &[&'b LightBlock],
        transport: &mut DMatrix<f64>,
    ) -> Vec<(&'b LightBlock, Vec<bool>)> {
        let cells = rig.grid().cells();
        let mut pattern = DMatrix::zeros(cells, 1);
        for cell in blocks.iter().flat_map(|block| &block.area.live) {
            pattern[(*cell, 0)] = 1.0;
        }
        let light = rig.photograph(&pattern);
        // What followers of one block are known to get from the others.
        let known = &*transport * &pattern;
        let follow = |block: &&'b LightBlock| {
            let mut followers = vec![false; cells];
            let size = block.area.live.len() as f64;
            for seen in (0..cells).filter(|seen| block.followers[*seen]) {
                let so_far: f64 = block
                    .area
                    .live
                    .iter()
                    .map(|lit| transport[(seen, *lit)])
                    .sum();
                let own = light[seen] - (known[seen] - so_far);
                for lit in &block.area.live {
                    transport[(seen, *lit)] = own / size;
                }
                let noise = rig.noise().variance(light[seen]).sqrt();
                followers[seen] = own > self.threshold * noise;
            }
            (*block, followers)
        };
        blocks.iter().map(follow).collect()
    }
}

/// A rectangle of cells.
#[derive(Clone)]
struct CellRectangle {
    /// First and one past the last.
    rows: (usize, usize),
    cols: (usize, usize),
    /// Its live cells, at least one.
    live: Vec<usize>,
}

impl CellRectangle {
    fn new(rig: &Rig, rows: (usize, usize), cols: (usize, usize)) -> Option<Self> {
        let cells = (rows.0..rows.1)
            .flat_map(|row| (cols.0..cols.1).map(move |col| row * rig.grid().cols() + col));
        let live: Vec<usize> = cells.filter(|cell| rig.live()[*cell]).collect();
        (!live.is_empty()).then_some(Self { rows, cols, live })
    }

    /// Its parts; none of a block of one live cell.
    fn quarters(&self, rig: &Rig) -> Vec<Self> {
        if self.live.len() == 1 {
            return Vec::new();
        }
        let halves = |(first, end): (usize, usize)| {
            let middle = usize::midpoint(first, end + 1);
            [(first, middle), (middle, end)]
        };
        let rows = halves(self.rows);
        rows.iter()
            .flat_map(|rows| halves(self.cols).map(|cols| Self::new(rig, *rows, cols)))
            .flatten()
            .collect()
    }
}

/// Blocks in groups that may be lit together, by index. Blocks that nobody follows are in
/// none.
///
/// Greedy colouring of the graph of conflicts, blocks in order; followers of a group are
/// followers of exactly one of its blocks.
fn compatible(blocks: &[LightBlock]) -> Vec<Vec<usize>> {
    let mut groups: Vec<(Vec<usize>, Vec<bool>)> = Vec::new();
    for (index, block) in blocks.iter().enumerate() {
        if !block.followers.contains(&true) {
            continue;
        }
        let fits = |taken: &[bool]| {
            let both = taken.iter().zip(&block.followers);
            both.into_iter()
                .all(|(taken, follows)| !(*taken && *follows))
        };
        match groups.iter_mut().find(|(_, taken)| fits(taken)) {
            Some((group, taken)) => {
                group.push(index);
                for (taken, follows) in taken.iter_mut().zip(&block.followers) {
                    *taken |= *follows;
                }
            }
            None => groups.push((vec![index], block.followers.clone())),
        }
    }
    groups.into_iter().map(|(group, _)| group).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::known_scene::{forward, m_scene, rig};
    use iltm_capture::NoiseModel;
    use iltm_runtime::Grid;
    use nalgebra::DVector;

    #[test]
    fn without_noise_it_ends_where_one_light_at_a_time_does() {
        for (rows, cols) in [(1, 1), (3, 5), (7, 9)] {
            let grid = Grid::new(rows, cols).unwrap();
            let (transport, live) = m_scene(grid);
            let mut rig = rig(grid, &transport, &live, NoiseModel::default());
            let found = forward(&DualPhotography::default(), &mut rig);
            assert!((found - &transport).amax() < 1e-14);
        }
    }

    /// Every cell sees its own light only: after the whole frame, four parts a level,
    /// of all blocks at once.
    #[test]
    fn a_flat_wall_takes_four_photographs_for_each_halving() {
        let grid = Grid::new(8, 8).unwrap();
        let own = DVector::from_fn(64, |i, _| 0.3 + i as f64 / 100.0);
        let transport = DMatrix::from_diagonal(&own);
        let mut rig = rig(grid, &transport, &[true; 64], NoiseModel::default());
        let found = forward(&DualPhotography::default(), &mut rig);
        assert!((found - &transport).amax() < 1e-14);
        assert_eq!(rig.photographs(), 1 + 4 + 4 + 4);
    }

    /// Every cell sees every other: all blocks of all levels one by one.
    #[test]
    fn the_inside_of_a_sphere_takes_more_photographs_than_lights() {
        let grid = Grid::new(4, 4).unwrap();
        let transport = DMatrix::from_fn(16, 16, |i, j| if i == j { 0.9 } else { 0.05 });
        let mut rig = rig(grid, &transport, &[true; 16], NoiseModel::default());
        let found = forward(&DualPhotography::default(), &mut rig);
        assert!((found - &transport).amax() < 1e-14);
        assert_eq!(rig.photographs(), 1 + 4 + 16);
    }

    #[test]
    fn light_below_the_threshold_stays_spread_over_the_block_it_was_seen_in() {
        let grid = Grid::new(4, 4).unwrap();
        let transport = DMatrix::from_fn(16, 16, |i, j| match () {
            () if i == j => 1.0,
            // A little more from the left than from the right.
            () if j % 4 < 2 => 0.0055,
            () => 0.0045,
        });
        let noise = NoiseModel {
            shot: 0.0,
            floor: 1e-4,
        };
        // A threshold of 6 deviations: 0.06, above the 0.02 of a block of four, below
        // everybody's own light.
        let mut rig = rig(grid, &transport, &[true; 16], noise);
        let found = forward(&DualPhotography::new(6.0), &mut rig);
        assert_eq!(rig.photographs(), 1 + 4 + 4);
        for seen in 0..16 {
            for block in [0, 2, 8, 10] {
                let of = [block, block + 1, block + 4, block + 5].map(|lit| found[(seen, lit)]);
                if ![block, block + 1, block + 4, block + 5].contains(&seen) {
                    assert!(of.iter().all(|value| (value - of[0]).abs() < 1e-15));
                    assert!((of[0] - 0.005).abs() < 5.0 * 0.01 / 4.0);
                }
            }
        }
    }
}
