//! Effect decisions: which effects a scene calls for, and why.

use super::description::{Albedo, Camera, Projector, Scene};
use super::effects::{Decisions, Effect};
use super::estimate::{self, Estimate};
use super::facets::Facets;
use super::patches::PatchExtent;
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
    let pixels = f64::from(width) * f64::from(height) / (2.0 * scene.grid().cells() as f64);
    (OF_NOISE * noise / pixels.max(1.0).sqrt()).max(THRESHOLD)
}

/// Pixels by which a lens may displace something unnoticed.
const UNNOTICED_PIXELS: f64 = 0.02;

/// Effects that need nothing but the scene's own words.
pub(super) fn named(facets: &Facets<'_>, threshold: f64, decisions: &mut Decisions) {
    let scene = facets.scene();
    colour(scene, threshold, decisions);
    gloss(scene, threshold, decisions);
    projector(facets.projector(), threshold, decisions);
    let ambient = facets.ambient().into_iter().fold(0.0, f64::max) / estimate::level(facets);
    let what = "of white comes from all around";
    let found = share(ambient, threshold, what);
    decisions.weigh(Effect::Ambient, found, "no light comes from all around");
    camera(&scene.camera, decisions);
}

/// A share of the light: whether it shows, and in words; `None` if there is nothing.
fn share(value: f64, threshold: f64, what: &str) -> Option<(bool, String)> {
    (value > 0.0).then(|| (value >= threshold, format!("{} {what}", percent(value))))
}

fn projector(projector: &Projector, threshold: f64, decisions: &mut Decisions) {
    let blurred = projector.blur / (2.0 * std::f64::consts::PI).sqrt();
    let cells = number(projector.blur);
    let what = "of a cell's light on each side of a border";
    let found = share(blurred, threshold, what);
    let found = found.map(|(on, words)| (on, format!("{cells} cells: {words}")));
    decisions.weigh(Effect::Blur, found, "the projector is in focus");
    let what = "of the light is lost in the frame's corners";
    let found = share(projector.vignetting, threshold, what);
    decisions.weigh(Effect::Vignetting, found, "the projector's frame is even");
    let found = share(projector.black, threshold, "of white is left in black");
    decisions.weigh(Effect::Black, found, "the projector's black is dark");
    let what = "of the lamp's light is lost from the first photograph to the last";
    let found = share(projector.drift, threshold, what);
    decisions.weigh(Effect::Drift, found, "the lamp is steady");
    let mixed = projector.foreign_light();
    let found = (projector.mixing != Projector::UNMIXED).then(|| {
        let reason = format!(
            "a channel of the camera has up to {} of its light from another of the projector's",
            percent(mixed)
        );
        (mixed >= threshold, reason)
    });
    let nothing = "each channel of the camera sees one of the projector's";
    decisions.weigh(Effect::Mixing, found, nothing);
}

/// What the camera makes of light: on wherever the scene names it, but for a lens whose
/// distortion nobody would see.
fn camera(camera: &Camera, decisions: &mut Decisions) {
    let found = camera.distorts().then(|| {
        let pixels = camera.most_displaced();
        let reason = format!("the lens displaces by up to {} pixels", number(pixels));
        (pixels >= UNNOTICED_PIXELS, reason)
    });
    let nothing = "the lens leaves straight lines straight";
    decisions.weigh(Effect::Distortion, found, nothing);
    let found = camera.full_well.map(|full_well| {
        let noise = percent(Sensor::noise_at_white(camera));
        let reason = format!("a full well of {full_well} electrons: {noise} of white in a pixel");
        (true, reason)
    });
    decisions.weigh(Effect::Noise, found, "the camera has no `full_well`");
    let found = camera.bits.map(|bits| {
        let step = percent(1.0 / f64::from((1_u32 << bits) - 1));
        (true, format!("{bits} bits: steps of {step} of full scale"))
    });
    let nothing = "the camera has no `bits`; files have 16";
    decisions.weigh(Effect::Quantisation, found, nothing);
    let found = (camera.response != Response::Linear).then(|| {
        (
            true,
            format!("the camera's values follow {}", camera.response),
        )
    });
    decisions.weigh(Effect::Response, found, "the camera is linear");
}

fn colour(scene: &Scene, threshold: f64, decisions: &mut Decisions) {
    let spread = |channels: [f64; 3]| {
        let largest = channels.into_iter().fold(f64::NEG_INFINITY, f64::max);
        largest - channels.into_iter().fold(f64::INFINITY, f64::min)
    };
    let mut widest = (spread(scene.ambient), "the ambient light".to_owned());
    let mut widen = |of: f64, whose: &dyn Fn() -> String| {
        if of > widest.0 {
            widest = (of, whose());
        }
    };
    for panel in &scene.panels {
        let of_panel = match &panel.albedo {
            Albedo::Uniform(channels) => spread(*channels),
            Albedo::Texture(texture) => texture.widest_spread(),
        };
        widen(of_panel, &|| format!("`{}`", panel.name));
    }
    for projector in &scene.projectors {
        if projector.mixing != Projector::UNMIXED {
            let whose = || "what the camera sees of the projector's light".to_owned();
            widen(projector.foreign_light(), &whose);
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
    let found = glossy.map(|(panel, gloss)| {
        let reason = format!(
            "`{}` sends {} into a lobe of {:.0} degrees",
            panel.name,
            percent(gloss.reflectance),
            (2.0 / (gloss.exponent + 1.0)).sqrt().to_degrees()
        );
        (gloss.reflectance >= threshold, reason)
    });
    decisions.weigh(Effect::Gloss, found, "no panel is glossy");
    let mirrors = scene.panels.iter().filter(|panel| panel.mirror > 0.0);
    let mirror = mirrors.max_by(|a, b| a.mirror.total_cmp(&b.mirror));
    let found = mirror.map(|panel| {
        let reason = format!("`{}` mirrors {}", panel.name, percent(panel.mirror));
        (panel.mirror >= threshold, reason)
    });
    decisions.weigh(Effect::Mirrors, found, "no panel is a mirror");
}

/// Whether surfaces throw shadows in the projector's light.
pub(super) fn shadows(facets: &Facets<'_>, decisions: &mut Decisions) -> bool {
    let shaded = (0..facets.count()).filter_map(|facet| {
        let by = facets.shaded_by(facet);
        Some((facet, *by.first()?))
    });
    let shaded: Vec<_> = shaded.collect();
    let found = shaded.first().map(|(facet, by)| {
        let reason = format!(
            "{} of {} surfaces may be shaded, `{}` by `{}` first",
            shaded.len(),
            facets.count(),
            facets.name(*facet),
            facets.name(*by)
        );
        (true, reason)
    });
    let nothing = "from the projector, no panel is in front of another";
    decisions.weigh(Effect::Shadows, found, nothing)
}

/// Decides about light between surfaces: whether there is any, and which surfaces take part
/// beside those in the frame.
pub(super) fn between_surfaces(
    facets: &Facets<'_>,
    threshold: f64,
    decisions: &mut Decisions,
) -> (bool, PatchExtent) {
    let ambient = if decisions.on(Effect::Ambient) {
        facets.ambient().into_iter().fold(0.0, f64::max)
    } else {
        0.0
    };
    let estimate = Estimate::new(facets, ambient);
    let found = estimate.bounce.map(|pair| {
        let (facing, pairs) = estimate.facing;
        let reason = format!(
            "{facing} of {pairs} pairs of surfaces face each other; `{}` sends on up to {} of white, most of it from `{}`",
            facets.name(pair.to),
            percent(pair.light),
            facets.name(pair.from)
        );
        (pair.light >= threshold, reason)
    });
    let nothing = "no two surfaces face each other";
    let interreflection = decisions.weigh(Effect::Interreflection, found, nothing);
    let mut side = |effect, light: Option<f64>, what: &str, nothing: &str| {
        let words = |light| format!("{what} send back up to {} of white", percent(light));
        let found = light.map(|light| (light >= threshold, words(light)));
        decisions.weigh(effect, found, nothing)
    };
    let extent = PatchExtent {
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
    };
    (interreflection, extent)
}
