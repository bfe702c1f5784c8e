//! Pinhole model: where a projector or a camera stands and what it looks at.

use super::geometry::Plane;
use nalgebra::Vector3;

/// A pinhole with a rectangular frame.
///
/// Places in the frame are `(across, down)`, both 0 to 1, from the top left corner as
/// its owner sees it. Depth is measured along the axis, in metres.
#[derive(Clone, Debug)]
pub struct Pinhole {
    position: Vector3<f64>,
    forward: Vector3<f64>,
    right: Vector3<f64>,
    down: Vector3<f64>,
    /// Half the frame's width and height at depth 1.
    half: [f64; 2],
    /// Depth of the point looked at.
    focus: f64,
}

/// A place in a frame.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct FramePlace {
    /// From the left, 0 to 1 within the frame.
    pub across: f64,
    /// From the top, 0 to 1 within the frame.
    pub down: f64,
    /// Along the axis, metres.
    pub depth: f64,
}

impl Pinhole {
    /// Looks from `position` to `target`, with `up` upwards in the frame.
    /// `field_of_view` is the angle of the frame's width in degrees, `aspect` its
    /// width over its height. `None` if a direction cannot be told.
    #[must_use]
    pub fn new(
        position: Vector3<f64>,
        target: Vector3<f64>,
        up: Vector3<f64>,
        field_of_view: f64,
        aspect: f64,
    ) -> Option<Self> {
        const LEAST: f64 = 1e-9;
        let focus = (target - position).norm();
        let forward = (target - position).try_normalize(LEAST)?;
        let right = forward.cross(&up).try_normalize(LEAST * up.norm())?;
        let width = (field_of_view.to_radians() / 2.0).tan();
        Some(Self {
            position,
            forward,
            right,
            down: forward.cross(&right),
            half: [width, width / aspect],
            focus,
        })
    }

    /// The pinhole.
    #[must_use]
    pub fn position(&self) -> Vector3<f64> {
        self.position
    }

    /// Unit vector of the axis.
    #[must_use]
    pub fn forward(&self) -> Vector3<f64> {
        self.forward
    }

    /// Depth of the point that it looks at, metres.
    #[must_use]
    pub fn focus(&self) -> f64 {
        self.focus
    }

    /// Area of the frame at depth 1, square metres.
    #[must_use]
    pub fn frame_area(&self) -> f64 {
        4.0 * self.half[0] * self.half[1]
    }

    /// Where a place in the world is in the frame, or outside of it; `None` behind.
    #[must_use]
    pub fn place(&self, world: &Vector3<f64>) -> Option<FramePlace> {
        let way = world - self.position;
        let depth = way.dot(&self.forward);
        (depth > 0.0).then(|| FramePlace {
            across: 0.5 + way.dot(&self.right) / (2.0 * depth * self.half[0]),
            down: 0.5 + way.dot(&self.down) / (2.0 * depth * self.half[1]),
            depth,
        })
    }

    /// The way to a place in the frame, of depth 1.
    #[must_use]
    pub fn ray(&self, across: f64, down: f64) -> Vector3<f64> {
        self.forward
            + (2.0 * across - 1.0) * self.half[0] * self.right
            + (2.0 * down - 1.0) * self.half[1] * self.down
    }

    /// The plane of everything that is `across` from the left; what is further to
    /// the right is in front of it.
    #[must_use]
    pub fn column_plane(&self, across: f64) -> Plane {
        self.side_plane(self.right, (2.0 * across - 1.0) * self.half[0])
    }

    /// The plane of everything that is `down` from the top; what is lower is in
    /// front of it.
    #[must_use]
    pub fn row_plane(&self, down: f64) -> Plane {
        self.side_plane(self.down, (2.0 * down - 1.0) * self.half[1])
    }

    fn side_plane(&self, side: Vector3<f64>, slope: f64) -> Plane {
        Plane::through(self.position, (side - slope * self.forward).normalize())
    }

    /// The plane of everything at a depth; what is further is in front of it.
    #[must_use]
    pub fn depth_plane(&self, depth: f64) -> Plane {
        Plane::through(self.position + depth * self.forward, self.forward)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn view() -> Pinhole {
        let at = Vector3::new(-0.4, 0.0, 9.0);
        Pinhole::new(
            at,
            Vector3::new(0.0, 0.0, -0.5),
            Vector3::y(),
            23.0,
            21.0 / 13.0,
        )
        .unwrap()
    }

    #[test]
    fn who_looks_along_minus_z_with_y_up_has_x_to_the_right() {
        let view = Pinhole::new(Vector3::zeros(), -Vector3::z(), Vector3::y(), 90.0, 2.0).unwrap();
        let place = view.place(&Vector3::new(1.0, 0.5, -2.0)).unwrap();
        assert!((place.across - 0.75).abs() < 1e-12, "{place:?}");
        assert!((place.down - 0.25).abs() < 1e-12, "{place:?}");
        assert!((place.depth - 2.0).abs() < 1e-12, "{place:?}");
        assert_eq!(view.place(&Vector3::z()), None);
    }

    #[test]
    fn a_view_along_its_own_up_is_none() {
        assert!(Pinhole::new(Vector3::zeros(), Vector3::y(), Vector3::y(), 40.0, 1.0).is_none());
        assert!(
            Pinhole::new(Vector3::zeros(), Vector3::zeros(), Vector3::y(), 40.0, 1.0).is_none()
        );
    }

    proptest! {
        #[test]
        fn a_ray_leads_to_the_place_it_was_made_for(
            across in -0.5..1.5_f64, down in -0.5..1.5_f64, depth in 0.1..20.0_f64,
        ) {
            let view = view();
            let world = view.position() + depth * view.ray(across, down);
            let place = view.place(&world).unwrap();
            prop_assert!((place.across - across).abs() < 1e-9);
            prop_assert!((place.down - down).abs() < 1e-9);
            prop_assert!((place.depth - depth).abs() < 1e-9);
            let (column, row) = (view.column_plane(0.3), view.row_plane(0.6));
            prop_assert_eq!(column.distance(&world) > 0.0, across > 0.3);
            prop_assert_eq!(row.distance(&world) > 0.0, down > 0.6);
        }
    }
}
