//! Which surface a ray meets first, and whether two places see each other.

use super::polygon::Polygon;
use nalgebra::Vector3;

/// Part of a segment at either end that no surface blocks: the surfaces that it
/// starts and ends on.
const ENDS: f64 = 1e-6;

/// All surfaces of a scene as obstacles to light, whichever way they face.
#[derive(Clone, Debug)]
pub struct Obstacles {
    facets: Vec<Polygon>,
}

/// Where a ray meets a surface.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Hit {
    /// Index of the surface in [`Obstacles::facets`].
    pub facet: usize,
    /// How far along the ray, in lengths of its direction.
    pub along: f64,
}

impl Obstacles {
    /// Obstacles in the order that [`Hit::facet`] counts them.
    #[must_use]
    pub fn new(facets: Vec<Polygon>) -> Self {
        Self { facets }
    }

    /// The surfaces.
    #[must_use]
    pub fn facets(&self) -> &[Polygon] {
        &self.facets
    }

    /// The first surface beyond `least` along a ray; back sides count.
    #[must_use]
    pub fn first_hit(
        &self,
        origin: &Vector3<f64>,
        direction: &Vector3<f64>,
        least: f64,
    ) -> Option<Hit> {
        let hits = self
            .facets
            .iter()
            .enumerate()
            .filter_map(|(facet, polygon)| {
                let along = meets(polygon, origin, direction)?;
                (along > least).then_some(Hit { facet, along })
            });
        hits.min_by(|a, b| a.along.total_cmp(&b.along))
    }

    /// Whether a surface stands between two places that are on surfaces
    /// themselves.
    #[must_use]
    pub fn blocked(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
        let direction = to - from;
        self.facets.iter().any(|polygon| {
            meets(polygon, from, &direction).is_some_and(|along| along > ENDS && along < 1.0 - ENDS)
        })
    }
}

/// How far along the ray it meets the polygon.
fn meets(polygon: &Polygon, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<f64> {
    let slope = polygon.normal().dot(direction);
    if slope == 0.0 {
        return None;
    }
    let along = -polygon.plane().distance(origin) / slope;
    let inside = along.is_finite() && polygon.contains(&(origin + direction * along));
    inside.then_some(along)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(z: f64) -> Polygon {
        let corner = |x, y| Vector3::new(x, y, z);
        Polygon::new(vec![
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ])
        .unwrap()
    }

    #[test]
    fn the_nearest_of_two_squares_is_met_and_blocks_the_other() {
        let obstacles = Obstacles::new(vec![square(0.0), square(1.0), square(2.0)]);
        let origin = Vector3::new(0.2, 0.1, 5.0);
        let hit = obstacles.first_hit(&origin, &-Vector3::z(), 0.0).unwrap();
        assert_eq!(hit.facet, 2);
        assert!((hit.along - 3.0).abs() < 1e-12);
        let (bottom, top) = (Vector3::zeros(), Vector3::new(0.0, 0.0, 2.0));
        assert!(obstacles.blocked(&bottom, &top));
        assert!(!obstacles.blocked(&bottom, &Vector3::new(0.0, 0.0, 1.0)));
        let past = Vector3::new(3.0, 0.0, 1.0);
        assert!(!obstacles.blocked(&bottom, &past));
    }
}
