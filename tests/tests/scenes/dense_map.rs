//! Projector map of fine stripes against geometry: lines of sight to the M-shaped panels and the
//! stage's floor, and from there to the projector, worked out here from the numbers of the scenes'
//! descriptions.

use iltm::capture::{MapSource, Measurements, NO_CELL, ProjectorMap};
use iltm::scene::description::Scene;
use iltm::session::Layout;
use iltm_runtime::FrameSize;
use iltm_tests::simulated::{self, scene};
use iltm_tests::verdicts::as_jpeg;
use nalgebra::Vector3;

/// Pixels of the projector, and those that stay black on each side.
const PROJECTOR: (u16, u16) = (174, 110);
const BORDER: u16 = 3;

/// Pixels from a crease or an edge that are beside it.
const BESIDE: isize = 2;

/// The folds of the M, x and z.
const FOLDS: [(f64, f64); 5] = [
    (-2.0, 0.0),
    (-1.0, -1.0),
    (0.0, 0.0),
    (1.0, -1.0),
    (2.0, 0.0),
];

/// A pinhole: where it is, and its axes to the right, downwards and forwards, the first two as
/// long as half its picture at distance 1.
struct View {
    position: Vector3<f64>,
    right: Vector3<f64>,
    down: Vector3<f64>,
    forward: Vector3<f64>,
}

impl View {
    fn new([from, to]: [[f64; 3]; 2], field_of_view: f64, aspect: f64) -> Self {
        let position = Vector3::from(from);
        let forward = (Vector3::from(to) - position).normalize();
        let half = (0.5 * field_of_view.to_radians()).tan();
        let right = forward.cross(&Vector3::y()).normalize();
        Self {
            down: forward.cross(&right) * (half / aspect),
            right: right * half,
            position,
            forward,
        }
    }

    /// Where it sees a point, 0 to 1 from the left and from the top.
    fn sees(&self, point: &Vector3<f64>) -> [f64; 2] {
        let way = point - self.position;
        let depth = way.dot(&self.forward);
        [self.right, self.down]
            .map(|axis| 0.5 + 0.5 * way.dot(&axis) / (depth * axis.norm_squared()))
    }

    /// The direction to a place of its picture.
    fn way(&self, [across, down]: [f64; 2]) -> Vector3<f64> {
        self.forward + (2.0 * across - 1.0) * self.right + (2.0 * down - 1.0) * self.down
    }

    /// The panel that it sees at a place of its picture, and the point of it.
    fn panel(&self, at: [f64; 2]) -> Option<(usize, Vector3<f64>)> {
        let way = self.way(at);
        let hit = |panel: usize| {
            let ((x, z), (end, _)) = (FOLDS[panel], FOLDS[panel + 1]);
            let slope = FOLDS[panel + 1].1 - z;
            // z = z0 + slope (x - x0)
            let level = |at: &Vector3<f64>| at.z - slope * at.x;
            let along = (z - slope * x - level(&self.position)) / level(&way);
            let point = self.position + along * way;
            let inside = (x..end).contains(&point.x) && point.y.abs() <= 1.25;
            inside.then_some((panel, point, along))
        };
        let nearest = (0..4).filter_map(hit).min_by(|a, b| a.2.total_cmp(&b.2));
        nearest.map(|(panel, point, _)| (panel, point))
    }
}

/// Where a pixel of a picture is in it, 0 to 1.
fn place(pixel: usize, (width, height): (usize, usize)) -> [f64; 2] {
    [
        ((pixel % width) as f64 + 0.5) / width as f64,
        ((pixel / width) as f64 + 0.5) / height as f64,
    ]
}

/// How far a map is off: the root mean square of each direction on flat parts, and what 95 % of
/// the pixels beside creases and edges keep; and the shares of the pixels that are lit and known.
struct Off {
    flat: [f64; 2],
    beside: f64,
    known: f64,
    /// Of flat parts, both directions together.
    stated: f64,
}

fn off(map: &ProjectorMap) -> Off {
    let (width, height) = map.camera;
    let middle = [0.0, 0.0, -0.5];
    let aspect = width as f64 / height as f64;
    let camera = View::new([[0.6, 0.3, 9.0], middle], 27.0, aspect);
    let projector = View::new([[-0.4, 0.0, 9.0], middle], 23.0, 21.0 / 13.0);
    let seen: Vec<Option<(usize, Vector3<f64>)>> = (0..width * height)
        .map(|pixel| camera.panel(place(pixel, (width, height))))
        .collect();
    let panel = |x: isize, y: isize| {
        let at = usize::try_from(x).ok()?;
        let row = usize::try_from(y)
            .ok()
            .filter(|row| at < width && *row < height)?;
        seen[row * width + at].map(|seen| seen.0)
    };
    let inner = [PROJECTOR.0, PROJECTOR.1].map(|side| f64::from(side - 2 * BORDER));
    let (mut squares, mut flat, mut stated) = ([0.0; 2], 0.0, 0.0);
    let (mut beside, mut lit, mut known) = (Vec::new(), 0.0, 0.0);
    for (pixel, seen) in seen.iter().enumerate() {
        let Some((own, point)) = seen else { continue };
        let at = projector.sees(point);
        let truth = [0, 1].map(|axis| at[axis] * inner[axis] + f64::from(BORDER) - 0.5);
        let border = (0..2).any(|axis| !(0.01..0.99).contains(&at[axis]));
        lit += f64::from(u8::from(!border));
        let found = map.position[pixel];
        if border || found[0].is_nan() {
            continue;
        }
        known += 1.0;
        let apart = [0, 1].map(|axis| f64::from(found[axis]) - truth[axis]);
        let (x, y) = ((pixel % width) as isize, (pixel / width) as isize);
        let all = -BESIDE..=BESIDE;
        let same = |dx: isize, dy: isize| panel(x + dx, y + dy) == Some(*own);
        if all.clone().all(|dy| all.clone().all(|dx| same(dx, dy))) {
            flat += 1.0;
            for (square, apart) in squares.iter_mut().zip(apart) {
                *square += apart * apart;
            }
            stated += f64::from(map.uncertainty[pixel]).powi(2);
        } else {
            beside.push(apart[0].hypot(apart[1]));
        }
    }
    beside.sort_by(f64::total_cmp);
    Off {
        flat: squares.map(|square| (square / flat).sqrt()),
        beside: beside[beside.len() * 95 / 100],
        known: known / lit,
        stated: (stated / flat).sqrt(),
    }
}

/// A session with 10 random patterns, as it is photographed and measured.
fn measured(scene: &Scene, projector: (u16, u16), border: u16, jpeg: bool) -> Measurements {
    let size = FrameSize::new(projector.0, projector.1).unwrap();
    let layout = Layout::new(scene.grid(), size, border).unwrap();
    simulated::measured(scene, &layout, 10, |photographs| {
        if jpeg {
            as_jpeg(photographs, 90);
        }
    })
}

#[test]
fn every_pixel_finds_its_place_across_creases_with_twelve_bits_and_with_jpeg() {
    for (camera, jpeg) in [(1, false), (1, true), (2, false), (2, true)] {
        let (width, height) = (192 * camera, 132 * camera);
        let curve = if jpeg { "srgb" } else { "linear" };
        let scene = scene(
            "m-panels",
            &[
                ("width = 192", &format!("width = {width}")),
                ("height = 132", &format!("height = {height}")),
                ("bits = 12", &format!("bits = 12\nresponse = \"{curve}\"")),
            ],
        );
        let measured = measured(&scene, PROJECTOR, BORDER, jpeg);
        let map = measured.map.unwrap().unwrap();
        assert_eq!(map.source, MapSource::Waves);
        let off = off(&map);
        let words = format!(
            "camera of {width}, jpeg {jpeg}: flat {:.3} {:.3}, beside {:.3}, stated {:.3}, known {:.4}",
            off.flat[0], off.flat[1], off.beside, off.stated, off.known
        );
        println!("{words}");
        assert!(off.flat[0] < 0.15 && off.flat[1] < 0.15, "{words}");
        assert!(off.beside < 0.5 && off.known > 0.99, "{words}");
        // What a map says of itself is neither less nor many times what it is.
        let true_one = off.flat[0].hypot(off.flat[1]);
        assert!((1.0..3.0).contains(&(off.stated / true_one)), "{words}");
    }
}

/// It gets a quarter of the light of the backdrop that it shares cells with.
#[test]
fn a_floor_that_the_projector_grazes_keeps_its_pixels() {
    for camera in [1, 2] {
        let (width, height) = (220 * camera, 160 * camera);
        let size = format!("width = {width}\nheight = {height}");
        let scene = scene("stage", &[("width = 220\nheight = 160", &size)]);
        let registration = measured(&scene, (400, 280), 0, false).registration;
        let middle = [0.0, 0.9, 0.0];
        let aspect = width as f64 / height as f64;
        let camera = View::new([[0.7, 1.6, 5.2], middle], 38.0, aspect);
        let projector = View::new([[0.0, 1.4, 5.0], middle], 32.0, 20.0 / 14.0);
        let (mut lit, mut seen) = (0.0, 0.0);
        for (pixel, cell) in registration.seen_cell.iter().enumerate() {
            let way = camera.way(place(pixel, (width, height)));
            let point = camera.position - way * (camera.position.y / way.y);
            // To the left of the column and its shadow, not at an edge.
            let floor = (-1.35..-0.6).contains(&point.x) && (0.05..1.55).contains(&point.z);
            let inside = |at: &f64| (0.02..0.97).contains(at);
            if floor && projector.sees(&point).iter().all(inside) {
                lit += 1.0;
                seen += f64::from(u8::from(*cell != NO_CELL));
            }
        }
        let words = format!("camera of {width}: {seen} of {lit} pixels");
        println!("{words}");
        assert!(lit > 100.0 && seen > 0.95 * lit, "{words}");
    }
}

/// Beside the corner of a room the next wall gets more than half as much light from the lit wall as
/// that from its projector.
#[test]
fn a_wall_beside_the_lit_one_has_no_place_in_the_picture() {
    let other = |name: &str, place: &str| {
        format!(
            "[[projector]]\nname = \"{name}\"\n{place}\nfield_of_view = 52.0\nrows = 12\ncols = 16\n"
        )
    };
    let others = [
        other(
            "back",
            "position = [1.2, 1.2, 2.2]\nlook_at = [1.2, 1.2, 0.0]",
        ),
        other(
            "right",
            "position = [0.2, 1.2, 1.2]\nlook_at = [2.4, 1.2, 1.2]",
        ),
    ];
    let middle = [1.2, 1.2, 0.0];
    let camera = View::new([[1.2, 1.3, 4.0], middle], 76.0, 1.6);
    let projector = View::new([[2.2, 1.2, 1.2], [0.0, 1.2, 1.2]], 52.0, 4.0 / 3.0);
    // To the second, 18 pixels of the projector are one of its own.
    for (width, height) in [(640, 400), (200, 125)] {
        let size = format!("width = {width}\nheight = {height}");
        let [back, right] = others.each_ref().map(|other| (&**other, ""));
        let left = scene(
            "cube-room",
            &[back, right, ("width = 640\nheight = 400", &size)],
        );
        let map = measured(&left, (320, 240), 0, false).map.unwrap().unwrap();
        assert_eq!(map.camera, (width, height));
        // How much of the picture a camera pixel sees.
        let beside = 6.0 / width as f64;
        let (mut lit, mut known) = (0_usize, 0_usize);
        for (pixel, found) in map.position.iter().enumerate() {
            let way = camera.way(place(pixel, (width, height)));
            let wall = camera.position - way * (camera.position.x / way.x);
            let at = projector.sees(&wall);
            let left = way.x < 0.0 && wall.z > 0.0;
            let within = |by: f64| left && at.iter().all(|at| (-by..1.0 + by).contains(at));
            lit += usize::from(within(-beside));
            if !found[0].is_nan() {
                known += usize::from(within(-beside));
                assert!(within(beside), "camera of {width}: {pixel} is at {found:?}");
            }
        }
        println!("camera of {width}: {known} of {lit} pixels");
        assert!(10 * lit > width * height && 100 * known > 99 * lit);
    }
}
