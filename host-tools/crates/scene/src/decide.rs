//! Looks at a scene and decides which effects it calls for.

use super::description::{Albedo, Camera, Projector, Scene};
use super::effects::{Decisions, Effect};
use super::estimate::{self, Estimate};
use super::facets::Facets;
use super::sensor::Sensor;
use iltm_picture::{
    Response,
    numbers::{number, percent},
};

/// Effects that change a photograph by less than this share of white are left out,
/// where the camera has no noise that would hide more.
const THRESHOLD: f64 = 1e-4;
/// Part of the camera's noise in one cell of one photograph that an effect may
/// change unnoticed.
const OF_NOISE: f64 = 0.25;

/// Share of white below which nobody would notice: a part of the camera's noise,
/// averaged over a cell's pixels.
pub(super) fn threshold(scene: &Scene) -> f64 {
    let noise = Sensor::noise_at_white(&scene.camera);
    let (width, height) = scene.camera.size;
    // About half of the pixels see a cell of their own.
    let pixels = f64::from(width) * f64::from(height) / (2.0 * scene.projector.grid.cells() as f64);
    (OF_NOISE * noise / pixels.max(1.0).sqrt()).max(THRESHOLD)
}

/// Effects that need nothing but the scene's own words.
pub(super) fn named(facets: &Facets<'_>, threshold: f64, decisions: &mut Decisions) {
    let scene = facets.scene();
    colour(scene, threshold, decisions);
    gloss(scene, threshold, decisions);
    let projector = &scene.projector;
    let blurred = scene.projector.blur / (2.0 * std::f64::consts::PI).sqrt();
    if projector.blur > 0.0 {
        let reason = format!(
            "{} cells: {} of a cell's light on each side of a border",
            number(projector.blur),
            percent(blurred)
        );
        decisions.decide(Effect::Blur, blurred >= threshold, reason);
    } else {
        decisions.rule_out(Effect::Blur, "the projector is in focus");
    }
    let share = |effect, value: f64, what: &str, nothing: &str, decisions: &mut Decisions| {
        if value > 0.0 {
            let reason = format!("{} {what}", percent(value));
            decisions.decide(effect, value >= threshold, reason);
        } else {
            decisions.rule_out(effect, nothing);
        }
    };
    share(
        Effect::Vignetting,
        projector.vignetting,
        "of the light is lost in the frame's corners",
        "the projector's frame is even",
        decisions,
    );
    share(
        Effect::Black,
        projector.black,
        "of white is left in black",
        "the projector's black is dark",
        decisions,
    );
    share(
        Effect::Drift,
        projector.drift,
        "of the lamp's light is lost from the first photograph to the last",
        "the lamp is steady",
        decisions,
    );
    mixing(projector, threshold, decisions);
    distortion(&scene.camera, decisions);
    let ambient = scene.ambient.into_iter().fold(0.0, f64::max) / estimate::level(facets);
    share(
        Effect::Ambient,
        ambient,
        "of white comes from all around",
        "no light comes from all around",
        decisions,
    );
    sensor(scene, decisions);
}

/// Pixels by which a lens may displace something unnoticed.
const UNNOTICED_PIXELS: f64 = 0.02;

fn mixing(projector: &Projector, threshold: f64, decisions: &mut Decisions) {
    let mixed = projector.foreign_light();
    if projector.mixing == Projector::UNMIXED {
        decisions.rule_out(
            Effect::Mixing,
            "each channel of the camera sees one of the projector's",
        );
    } else {
        let reason = format!(
            "a channel of the camera has up to {} of its light from another of the projector's",
            percent(mixed)
        );
        decisions.decide(Effect::Mixing, mixed >= threshold, reason);
    }
}

fn distortion(camera: &Camera, decisions: &mut Decisions) {
    if camera.distorts() {
        let pixels = camera.most_displaced();
        let reason = format!("the lens displaces by up to {} pixels", number(pixels));
        decisions.decide(Effect::Distortion, pixels >= UNNOTICED_PIXELS, reason);
    } else {
        decisions.rule_out(
            Effect::Distortion,
            "the lens leaves straight lines straight",
        );
    }
}

/// What the camera makes of light: on wherever the scene names it.
fn sensor(scene: &Scene, decisions: &mut Decisions) {
    let camera = &scene.camera;
    match camera.full_well {
        Some(full_well) => {
            let noise = Sensor::noise_at_white(camera);
            let reason = format!(
                "a full well of {full_well} electrons: {} of white in a pixel",
                percent(noise)
            );
            decisions.decide(Effect::Noise, true, reason);
        }
        None => decisions.rule_out(Effect::Noise, "the camera has no `full_well`"),
    }
    match camera.bits {
        Some(bits) => {
            let step = 1.0 / f64::from((1_u32 << bits) - 1);
            let reason = format!("{bits} bits: steps of {} of full scale", percent(step));
            decisions.decide(Effect::Quantisation, true, reason);
        }
        None => decisions.rule_out(
            Effect::Quantisation,
            "the camera has no `bits`; files have 16",
        ),
    }
    if camera.response == Response::Linear {
        decisions.rule_out(Effect::Response, "the camera is linear");
    } else {
        let reason = format!("the camera's values follow {}", camera.response);
        decisions.decide(Effect::Response, true, reason);
    }
}

fn colour(scene: &Scene, threshold: f64, decisions: &mut Decisions) {
    let spread = |channels: [f64; 3]| {
        let largest = channels.into_iter().fold(f64::NEG_INFINITY, f64::max);
        largest - channels.into_iter().fold(f64::INFINITY, f64::min)
    };
    let mut widest = (spread(scene.ambient), "the ambient light".to_owned());
    for panel in &scene.panels {
        let of_panel = match &panel.albedo {
            Albedo::Uniform(channels) => spread(*channels),
            Albedo::Texture(texture) => texture.widest_spread(),
        };
        if of_panel > widest.0 {
            widest = (of_panel, format!("`{}`", panel.name));
        }
    }
    if scene.projector.mixing != Projector::UNMIXED {
        let mixed = scene.projector.foreign_light();
        if mixed > widest.0 {
            widest = (
                mixed,
                "what the camera sees of the projector's light".to_owned(),
            );
        }
    }
    let (spread, whose) = widest;
    let reason = if spread > 0.0 {
        format!("the channels of {whose} differ by {}", percent(spread))
    } else {
        "all surfaces and lights are grey: one channel".to_owned()
    };
    decisions.decide(Effect::Colour, spread >= threshold && spread > 0.0, reason);
}

fn gloss(scene: &Scene, threshold: f64, decisions: &mut Decisions) {
    let glossy = scene
        .panels
        .iter()
        .filter_map(|panel| Some((panel, panel.gloss?)))
        .max_by(|a, b| a.1.reflectance.total_cmp(&b.1.reflectance));
    match glossy {
        Some((panel, gloss)) => {
            let reason = format!(
                "`{}` sends {} into a lobe of {:.0} degrees",
                panel.name,
                percent(gloss.reflectance),
                (2.0 / (gloss.exponent + 1.0)).sqrt().to_degrees()
            );
            decisions.decide(Effect::Gloss, gloss.reflectance >= threshold, reason);
        }
        None => decisions.rule_out(Effect::Gloss, "no panel is glossy"),
    }
    let mirror = scene
        .panels
        .iter()
        .filter(|panel| panel.mirror > 0.0)
        .max_by(|a, b| a.mirror.total_cmp(&b.mirror));
    match mirror {
        Some(panel) => {
            let reason = format!("`{}` mirrors {}", panel.name, percent(panel.mirror));
            decisions.decide(Effect::Mirrors, panel.mirror >= threshold, reason);
        }
        None => decisions.rule_out(Effect::Mirrors, "no panel is a mirror"),
    }
}

/// Whether surfaces throw shadows in the projector's light.
pub(super) fn shadows(facets: &Facets<'_>, decisions: &mut Decisions) -> bool {
    let shaded = (0..facets.count()).filter_map(|facet| {
        let by = facets.shaded_by(facet);
        Some((facet, *by.first()?))
    });
    let shaded: Vec<_> = shaded.collect();
    let Some((facet, by)) = shaded.first() else {
        let reason = "from the projector, no panel is in front of another";
        decisions.rule_out(Effect::Shadows, reason);
        return false;
    };
    let reason = format!(
        "{} of {} surfaces may be shaded, `{}` by `{}` first",
        shaded.len(),
        facets.count(),
        facets.name(*facet),
        facets.name(*by)
    );
    decisions.decide(Effect::Shadows, true, reason)
}

/// Which surfaces take part in interreflection: what is in the frame, beside it,
/// behind.
#[derive(Clone, Copy, Debug)]
pub(super) struct Taking {
    pub(super) interreflection: bool,
    pub(super) surroundings: bool,
    pub(super) backs: bool,
}

/// Decides about light between surfaces.
pub(super) fn between_surfaces(
    facets: &Facets<'_>,
    threshold: f64,
    decisions: &mut Decisions,
) -> Taking {
    let scene = facets.scene();
    let ambient = if decisions.on(Effect::Ambient) {
        scene.ambient.into_iter().fold(0.0, f64::max)
    } else {
        0.0
    };
    let estimate = Estimate::new(facets, ambient);
    let interreflection = if let Some(pair) = estimate.bounce {
        let (facing, pairs) = estimate.facing;
        let reason = format!(
            "{facing} of {pairs} pairs of surfaces face each other; `{}` sends on up to {} of white, most of it from `{}`",
            facets.name(pair.to),
            percent(pair.light),
            facets.name(pair.from)
        );
        decisions.decide(Effect::Interreflection, pair.light >= threshold, reason)
    } else {
        let reason = "no two surfaces face each other";
        decisions.rule_out(Effect::Interreflection, reason);
        false
    };
    let mut side = |effect, light: Option<f64>, what: &str, nothing: &str| {
        let Some(light) = light else {
            decisions.rule_out(effect, nothing);
            return false;
        };
        let reason = format!("{what} send back up to {} of white", percent(light));
        decisions.decide(effect, light >= threshold, reason)
    };
    Taking {
        interreflection,
        surroundings: side(
            Effect::Surroundings,
            estimate.surroundings,
            "surfaces beside the frame",
            "nothing beside the frame gets any light",
        ),
        backs: side(
            Effect::Backs,
            estimate.backs,
            "back sides",
            "no back side gets light and is seen",
        ),
    }
}
