//! The exchange of whole scenes against closed forms, and blocks against one matrix.

use super::*;
use iltm_picture::progress::Silent;
use nalgebra::Vector3;
use std::f64::consts::PI;

type Corner = Vector3<f64>;

/// Facets of a scene, each cut into patches.
#[derive(Default)]
struct Scene {
    facets: Vec<Polygon>,
    patches: Vec<Element>,
}

impl Scene {
    /// A quadrangle of rows x columns patches, faces as its corners turn. `bend` moves the
    /// cuts, so that cells are no rectangles.
    fn quadrangle(&mut self, c: [Corner; 4], rows: usize, columns: usize, bend: f64) {
        let at = |u: f64, v: f64| {
            let (u, v) = (u + bend * u * (1.0 - u) * v, v + bend * v * (1.0 - v) * u);
            c[0] * (1.0 - u) * (1.0 - v)
                + c[1] * u * (1.0 - v)
                + c[2] * u * v
                + c[3] * (1.0 - u) * v
        };
        for i in 0..rows {
            for j in 0..columns {
                let corners = [(j, i), (j + 1, i), (j + 1, i + 1), (j, i + 1)];
                let corners =
                    corners.map(|(j, i)| at(j as f64 / columns as f64, i as f64 / rows as f64));
                let polygon = Polygon::new(corners.to_vec()).unwrap();
                self.patches.push(Element {
                    polygon,
                    facet: self.facets.len(),
                });
            }
        }
        self.facets.push(Polygon::new(c.to_vec()).unwrap());
    }

    fn exchange(&self, options: &FormFactorOptions) -> FormFactorMatrix {
        let obstacles = Obstacles::new(self.facets.clone());
        FormFactorMatrix::new(&self.patches, &obstacles, options, &Silent).unwrap()
    }

    /// The inside of a box of these sides.
    fn room(sides: [f64; 3], cells: usize) -> Self {
        let mut scene = Self::default();
        for axis in 0..3 {
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let at = |[a, b, c]: [f64; 3]| {
                let mut corner = Vector3::zeros();
                (corner[axis], corner[u], corner[v]) =
                    (a * sides[axis], b * sides[u], c * sides[v]);
                corner
            };
            let low = [[0., 0., 0.], [0., 1., 0.], [0., 1., 1.], [0., 0., 1.]];
            let high = [[1., 0., 0.], [1., 0., 1.], [1., 1., 1.], [1., 1., 0.]];
            scene.quadrangle(low.map(at), cells, cells, 0.0);
            scene.quadrangle(high.map(at), cells, cells, 0.0);
        }
        scene
    }

    /// M-shaped panels x = -2..2 by 1, z = 0,-1,0,-1,0, 2.5 high.
    fn panels(rows: usize, columns: usize, bend: f64) -> Self {
        let mut scene = Self::default();
        for k in 0..4_u8 {
            let (x, z) = (f64::from(k) - 2.0, -f64::from(k & 1));
            let (x1, z1) = (x + 1.0, -f64::from((k + 1) & 1));
            let at = |x, y, z| Vector3::new(x, y, z);
            let corners = [at(x, 0., z), at(x1, 0., z1), at(x1, 2.5, z1), at(x, 2.5, z)];
            scene.quadrangle(corners, rows, columns, bend);
        }
        scene
    }

    /// A sphere of radius 1 seen from inside, as triangles of an octahedron cut finer.
    fn sphere(cuts: usize) -> Self {
        let mut scene = Self::default();
        for octant in 0..8_u8 {
            let sign = |bit: u8| if octant >> bit & 1 == 0 { 1.0 } else { -1.0 };
            let at = |i: usize, j: usize| {
                let (x, y) = (i as f64 / cuts as f64, j as f64 / cuts as f64);
                Vector3::new(sign(0) * x, sign(1) * y, sign(2) * (1.0 - x - y)).normalize()
            };
            let mut triangle = |corners: [Corner; 3]| {
                let polygon = Polygon::new(corners.to_vec()).unwrap();
                let inwards = polygon.normal().dot(&corners[0]) < 0.0;
                let polygon = if inwards { polygon } else { polygon.flipped() };
                scene.patches.push(Element {
                    polygon: polygon.clone(),
                    facet: scene.facets.len(),
                });
                scene.facets.push(polygon);
            };
            for i in 0..cuts {
                for j in 0..cuts - i {
                    triangle([at(i, j), at(i + 1, j), at(i, j + 1)]);
                    if i + j + 1 < cuts {
                        triangle([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                    }
                }
            }
        }
        scene
    }
}

fn in_blocks() -> FormFactorOptions {
    FormFactorOptions {
        dense_limit: 0,
        ..FormFactorOptions::default()
    }
}

fn ramp(patches: usize, columns: usize) -> DMatrix<f64> {
    DMatrix::from_fn(patches, columns, |p, c| {
        1.0 + ((p * (c + 3)) as f64 * 0.37).sin()
    })
}

#[test]
fn all_light_in_a_closed_box_arrives_somewhere_and_none_twice() {
    let room = Scene::room([1.0, 2.0, 0.7], 7);
    for (options, error) in [(FormFactorOptions::default(), 2e-6), (in_blocks(), 2e-5)] {
        let exchange = room.exchange(&options);
        let sums = exchange.row_sums();
        assert!(sums.max() <= 1.0);
        assert!(sums.min() > 1.0 - error, "{}", 1.0 - sums.min());
        assert!(exchange.report().excess < error);
    }
}

#[test]
fn blocks_give_the_irradiance_of_the_dense_matrix_to_a_ten_thousandth() {
    for bend in [0.0, 0.15] {
        let scene = Scene::panels(24, 16, bend);
        let dense = scene.exchange(&FormFactorOptions {
            dense_limit: 10_000,
            ..in_blocks()
        });
        let blocks = scene.exchange(&in_blocks());
        assert!(blocks.report().low_rank_blocks > 0);
        let light = ramp(scene.patches.len(), 70);
        let (exact, found) = (dense.irradiance(&light), blocks.irradiance(&light));
        let off = (&exact - &found).amax() / exact.amax();
        let total = (&exact - &found).norm() / exact.norm();
        assert!(off < 1e-4 && total < 2e-5, "{bend}: {off} {total}");
    }
}

#[test]
fn reciprocity_holds_to_rounding_in_blocks_and_in_one_matrix() {
    let scene = Scene::panels(8, 5, 0.1);
    for options in [FormFactorOptions::default(), in_blocks()] {
        let exchange = scene.exchange(&options);
        let areas = exchange.areas();
        for p in (0..exchange.patches()).step_by(7) {
            for q in (0..exchange.patches()).step_by(3) {
                let (there, back) = (
                    areas[p] * exchange.entry(p, q),
                    areas[q] * exchange.entry(q, p),
                );
                assert!((there - back).abs() <= 1e-14 * there);
            }
        }
    }
}

#[test]
fn irradiance_is_what_the_entries_say_and_has_the_same_bits_on_any_number_of_cores() {
    let scene = Scene::panels(10, 8, 0.1);
    for options in [FormFactorOptions::default(), in_blocks()] {
        let exchange = scene.exchange(&options);
        let light = ramp(scene.patches.len(), 5);
        let found = exchange.irradiance(&light);
        for p in [0, 100, 319] {
            let sum: f64 = (0..320).map(|q| exchange.entry(p, q) * light[(q, 2)]).sum();
            assert!(
                (found[(p, 2)] - sum).abs() < 1e-6 * sum,
                "{} {sum}",
                found[(p, 2)]
            );
        }
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(5)
            .build()
            .unwrap();
        let other = pool.install(|| scene.exchange(&options).irradiance(&light));
        assert_eq!(other, found);
    }
}

#[test]
fn the_report_names_what_stands_between_panels() {
    let exchange = Scene::panels(4, 3, 0.0).exchange(&FormFactorOptions::default());
    let report = exchange.report();
    // 0-1 and 2-3 face each other across a valley, 0-3 are hidden behind both ridges.
    assert_eq!((report.facing, report.not_facing), (3, 3));
    assert_eq!(
        (report.surveyed, report.occludable, report.blocked),
        (3, 1, 1)
    );
    let hidden = report.pairs.iter().find(|p| p.blocked).unwrap();
    assert_eq!(hidden.facets, (0, 3));
    assert!(matches!(hidden.between, Some(1 | 2)));
    assert_eq!(report.visibility_tested, 0);
    assert!(exchange.entry(0, 40).abs() < f64::MIN_POSITIVE);
}

#[test]
fn deciding_where_to_test_visibility_agrees_with_testing_it_everywhere() {
    let mut scene = Scene::panels(4, 3, 0.0);
    // A vane in a valley, and one outside of everything.
    for x in [-1.0, 5.0] {
        let vane = [[x, 0.3, -0.9], [x, 1.2, -0.9], [x, 1.2, 0.2], [x, 0.3, 0.2]];
        let vane = vane.map(Vector3::from);
        scene.facets.push(Polygon::new(vane.to_vec()).unwrap());
    }
    let by = |occlusion| {
        scene.exchange(&FormFactorOptions {
            occlusion,
            ..FormFactorOptions::default()
        })
    };
    let light = ramp(scene.patches.len(), 3);
    let decided = by(Occlusion::Decide);
    let found = decided.irradiance(&light);
    let everywhere = by(Occlusion::Everywhere);
    let known = everywhere.irradiance(&light);
    let ignored = by(Occlusion::Ignore).irradiance(&light);
    assert!((&found - &known).amax() < 1e-12 * known.amax());
    assert!((&ignored - &known).amax() > 0.05 * known.amax());
    assert!(decided.report().visibility_tested < everywhere.report().visibility_tested);
}

#[test]
fn a_patch_on_no_surface_and_too_much_memory_are_refused() {
    let mut scene = Scene::panels(8, 8, 0.0);
    let obstacles = Obstacles::new(scene.facets.clone());
    let options = FormFactorOptions {
        most_bytes: 1000,
        ..in_blocks()
    };
    let refused = FormFactorMatrix::new(&scene.patches, &obstacles, &options, &Silent);
    let too_large = FormFactorError::TooLarge {
        patches: 256,
        limit: 1000,
    };
    assert_eq!(refused.unwrap_err(), too_large);
    scene.patches[3].facet = 9;
    let refused = FormFactorMatrix::new(&scene.patches, &obstacles, &options, &Silent);
    let no_such = FormFactorError::NoSuchFacet {
        patch: 3,
        facet: 9,
        facets: 4,
    };
    assert_eq!(refused.unwrap_err(), no_such);
}

/// Jacquez, Kuppenheim, *Theory of the Integrating Sphere* (1955): a wall of albedo r whose
/// part a receives flux P reflects r P from there, and everywhere an even irradiance
/// r P / ((1 - r) area) arrives. Here the sphere is a polyhedron: its total is exact, and
/// the mean deviation falls with the size of its facets squared (facets side by side
/// never exchange like parts of a sphere, but they become few).
#[test]
fn one_lit_patch_of_an_integrating_sphere_lights_it_evenly() {
    let (albedo, lit) = (0.8, 17);
    let mut last = f64::INFINITY;
    for cuts in [4_u32, 8] {
        let scene = Scene::sphere(cuts as usize);
        let exchange = scene.exchange(&FormFactorOptions {
            dense_limit: 300,
            ..in_blocks()
        });
        let patches = exchange.patches();
        let mut incident = DMatrix::zeros(patches, 1);
        incident[lit] = 1.0;
        let light = radiosity(
            &exchange,
            &vec![albedo; patches],
            &incident,
            StopRule::Share(1e-8),
        )
        .unwrap()
        .light;
        let flux = exchange.areas()[lit];
        let total: f64 = light.iter().zip(exchange.areas()).map(|(b, a)| b * a).sum();
        let known = albedo * flux / (1.0 - albedo);
        assert!(
            (total / known - 1.0).abs() < 1e-4,
            "{cuts}: {total} {known}"
        );
        let even = albedo * albedo * flux / ((1.0 - albedo) * 4.0 * PI);
        let others = (0..patches).filter(|p| *p != lit);
        let off = others.map(|p| (light[p] / even - 1.0).abs()).sum::<f64>() / patches as f64;
        assert!(
            off < 1.0 / f64::from(cuts * cuts) && off < last / 3.0,
            "{cuts}: {off}"
        );
        last = off;
    }
}

/// Two infinite parallel plates: F = 1 both ways, so B1 = r1 E / (1 - r1 r2).
#[test]
fn wide_plates_near_each_other_approach_infinite_ones() {
    let mut last = f64::INFINITY;
    for width in [10.0, 100.0, 1000.0] {
        let mut scene = Scene::default();
        let at = |[x, y, z]: [f64; 3]| Vector3::new(x * width, y * width, z);
        let below = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]];
        let above = [[0., 0., 1.], [0., 1., 1.], [1., 1., 1.], [1., 0., 1.]];
        scene.quadrangle(below.map(at), 1, 1, 0.0);
        scene.quadrangle(above.map(at), 1, 1, 0.0);
        let exchange = scene.exchange(&FormFactorOptions::default());
        let incident = DMatrix::from_column_slice(2, 1, &[1.0, 0.0]);
        let light = radiosity(&exchange, &[0.9, 0.6], &incident, StopRule::Share(1e-10))
            .unwrap()
            .light;
        let known = 0.9 / (1.0 - 0.54);
        let off = (light[0] / known - 1.0).abs();
        assert!(off < 5.0 / width && off < last, "{width}: {off}");
        last = off;
    }
}

/// An infinite wedge cut into strips, whose form factors are Hottel's crossed strings, solved
/// by elimination; ours are strips 2000 times as long as the wedge is wide.
#[test]
fn a_long_wedge_has_the_light_of_an_infinite_one_by_crossed_strings() {
    let (strips, length) = (12, 2000.0);
    for degrees in [40.0_f64, 90.0] {
        let angle = degrees.to_radians();
        let wall = |u: f64| [u * angle.cos(), u * angle.sin()];
        let edge = |k: usize| k as f64 / strips as f64;
        let apart = |p: [f64; 2], q: [f64; 2]| (p[0] - q[0]).hypot(p[1] - q[1]);
        let form = |i: usize, j: usize| {
            let (a, b) = ([edge(i), 0.0], [edge(i + 1), 0.0]);
            let (c, d) = (wall(edge(j)), wall(edge(j + 1)));
            (apart(a, d) + apart(b, c) - apart(a, c) - apart(b, d)).abs() / 2.0 * strips as f64
        };
        let mut scene = Scene::default();
        let (x, z) = (angle.cos(), angle.sin());
        let at = |[x, y, z]: [f64; 3]| Vector3::new(x, y * length, z);
        let floor = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 1., 0.]];
        let slope = [[0., 0., 0.], [0., 1., 0.], [x, 1., z], [x, 0., z]];
        scene.quadrangle(floor.map(at), 1, strips, 0.0);
        scene.quadrangle(slope.map(at), strips, 1, 0.0);
        let albedo = 0.9;
        let whole = DMatrix::from_fn(2 * strips, 2 * strips, |p, q| {
            match (p < strips, q < strips) {
                (true, false) => form(p, q - strips),
                (false, true) => form(q, p - strips),
                _ => 0.0,
            }
        });
        let incident = DMatrix::from_fn(2 * strips, 1, |p, _| if p < strips { 1.0 } else { 0.2 });
        let known = (DMatrix::identity(24, 24) - whole * albedo)
            .lu()
            .solve(&(&incident * albedo))
            .unwrap();
        let found = radiosity(
            &scene.exchange(&FormFactorOptions::default()),
            &[albedo; 24],
            &incident,
            StopRule::Share(1e-9),
        )
        .unwrap();
        let off = (&found.light - &known).component_div(&known).amax();
        assert!(off < 2e-3, "{degrees}: {off}");
    }
}

#[test]
fn every_way_to_the_light_gives_the_same_light_and_says_why_it_was_taken() {
    let scene = Scene::room([1.0, 1.0, 1.0], 5);
    let exchange = scene.exchange(&FormFactorOptions::default());
    let blocks = scene.exchange(&in_blocks());
    let incident = ramp(150, 4);
    let dark = radiosity(&exchange, &[0.1; 150], &incident, StopRule::Share(1e-6)).unwrap();
    assert_eq!(dark.how, RadiosityMethod::Bounces);
    // Even albedo in a closed box: the radius is the albedo.
    assert!(
        (dark.plan.radius - 0.1).abs() < 1e-4,
        "{}",
        dark.plan.radius
    );
    let many = radiosity(&exchange, &[0.99; 150], &incident, StopRule::Bounces(3000)).unwrap();
    assert!(many.share_left < 1e-10);
    let bright = radiosity(&exchange, &[0.99; 150], &incident, StopRule::Share(1e-6)).unwrap();
    assert_ne!(bright.how, RadiosityMethod::Bounces);
    assert!(bright.plan.bounces > 1000.0, "{}", bright.plan.bounces);
    assert!((&bright.light - &many.light).norm() < 1e-6 * many.light.norm());
    let solved = radiosity(&blocks, &[0.99; 150], &incident, StopRule::Share(1e-5)).unwrap();
    assert_eq!(solved.how, RadiosityMethod::ConjugateGradients);
    assert!(solved.bounces < 60);
    // The loss is 1 percent: errors of the blocks count a hundred times.
    assert!((&solved.light - &many.light).norm() < 2e-3 * many.light.norm());
}

#[test]
fn a_share_left_is_an_upper_bound_of_what_further_bounces_add() {
    let scene = Scene::panels(6, 4, 0.0);
    let exchange = scene.exchange(&FormFactorOptions::default());
    let albedo = [0.7; 96];
    let incident = ramp(96, 3);
    let all = radiosity(&exchange, &albedo, &incident, StopRule::Bounces(200))
        .unwrap()
        .light;
    for bounces in 0..5 {
        let found = radiosity(&exchange, &albedo, &incident, StopRule::Bounces(bounces)).unwrap();
        assert_eq!(found.bounces, bounces);
        let missing = 1.0 - found.light.column(1).sum() / all.column(1).sum();
        assert!(missing <= found.share_left + 1e-15 && found.share_left < 10.0 * missing + 1e-12);
    }
}

#[test]
fn no_end_of_bounces_and_what_is_no_albedo_are_refused() {
    let exchange = Scene::room([1.0, 1.0, 1.0], 3).exchange(&FormFactorOptions::default());
    let incident = ramp(54, 1);
    let by = |albedo: &[f64]| radiosity(&exchange, albedo, &incident, StopRule::Share(1e-4));
    assert!(matches!(by(&[1.0; 54]), Err(RadiosityError::NoLoss { .. })));
    assert!(matches!(
        by(&[f64::NAN; 54]),
        Err(RadiosityError::Albedo { patch: 0, .. })
    ));
    assert!(matches!(
        by(&[0.5; 3]),
        Err(RadiosityError::Shape { found: 3, .. })
    ));
    assert!(by(&[0.0; 54]).unwrap().light.amax() < f64::MIN_POSITIVE);
}
