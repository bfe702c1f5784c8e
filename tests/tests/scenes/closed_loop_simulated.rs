//! Closed loop: from simulated photographs to a projection that is photographed again: the
//! error on the wall, cells that the surface covers only in part among them.

use iltm::scene::description::Scene;
use iltm_tests::simulated::{error_on_the_wall, inputs, learned, photograph, scene, showable};

/// Live cells, and errors on the wall with gains alone and compensated.
fn errors(scene: &Scene) -> (usize, f64, f64) {
    let place = tempfile::tempdir().unwrap();
    let capture = place.path().join("capture");
    photograph(scene, 150, 3, &capture);
    let learned = learned(&capture);
    let wanted = showable(&learned.inverse);
    let [compensated, alone] = inputs(&learned, &wanted)
        .map(|inputs| error_on_the_wall(scene, &learned, &wanted, &inputs));
    let live = learned.inverse.live.iter();
    (live.filter(|live| **live).count(), alone, compensated)
}

#[test]
fn cells_that_the_surface_covers_in_part_are_compensated_like_the_others() {
    // Within the panels; and larger than them on all sides.
    for field_of_view in ["23.0", "27.5"] {
        let (live, alone, compensated) = errors(&scene(
            "m-panels",
            &[
                (
                    "field_of_view = 23.0",
                    &format!("field_of_view = {field_of_view}"),
                ),
                ("field_of_view = 27.0", "field_of_view = 31.0"),
            ],
        ));
        println!(
            "{field_of_view} degrees: {live} live cells, gains alone {alone:.4}, compensated {compensated:.4}"
        );
        // A cell has a noise of about a thousandth of white, and the solver alone reaches
        // .0015 at three times that.
        assert!(compensated < 0.003, "{field_of_view}: {compensated}");
        assert!(
            compensated < 0.1 * alone,
            "{field_of_view}: {compensated}, {alone}"
        );
    }
}
